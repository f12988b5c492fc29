// What is drawn on the plan desk: the sketch of a site, in site ENU (metres), with undo. No widgets here.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "datasets/io/site_sketch.h"

namespace trigpoint {

class Project;

// A step that can be taken back.
struct SketchStep {
  enum class Kind { kAdd, kEdit, kMove, kRemove };
  Kind kind = Kind::kEdit;
  std::string item;  // "tag 5"
};

class Sketch {
 public:
  Sketch() = default;  // empty, of no project
  // Of the project's plan.csv, else its plan.geojson; else empty. Throws InputError.
  explicit Sketch(const Project& project);

  const std::vector<SketchItem>& items() const { return items_; }
  // Of control and check points that state none: their tag's. Nothing: the tag is not there.
  std::optional<Eigen::Vector3d> PlaceOf(size_t index) const;
  bool changed() const { return changed_; }  // since it was read or saved
  // What Undo takes back, and Redo makes again; null: nothing.
  const SketchStep* undone_next() const { return before_.empty() ? nullptr : &before_.back().step; }
  const SketchStep* redone_next() const { return after_.empty() ? nullptr : &after_.back().step; }

  // Each can be undone.
  void Add(const SketchItem& item);
  void Replace(size_t index, const SketchItem& item);
  void MoveTo(size_t index, const Eigen::Vector2d& east_north_m);
  void Remove(size_t index);  // a tag with what is known of it
  void Undo();
  void Redo();

  // The smallest id of a printed tag (tags.yaml) that is not placed yet, else of any.
  int FreeTag() const;
  // "STEM1", "STEM2", ...: the first that no item of the kind has.
  std::string FreeName(const std::string& kind, const std::string& stem) const;

  // Writes plan.csv; the file as it was is kept. Returns that one, or nothing. Throws IoError.
  std::filesystem::path Save();

 private:
  struct Earlier {
    SketchStep step;
    std::vector<SketchItem> items;
  };
  void Remember(SketchStep::Kind kind, const SketchItem& item);
  void Exchange(std::vector<Earlier>* from, std::vector<Earlier>* to);

  std::filesystem::path dir_;
  std::vector<int> printed_;
  std::optional<Geodetic> origin_;  // the file's positions are geodetic, ENU is about this; nothing: they are ENU
  std::vector<SketchItem> items_;
  std::vector<Earlier> before_, after_;
  bool changed_ = false;
};

}  // namespace trigpoint
