#include "datasets/project/marking.h"

#include <algorithm>

#include "datasets/io/csv.h"
#include "datasets/io/csv_dialect.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/lock.h"
#include "datasets/project/replaced.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

fs::path FileOf(const Project& project) { return project.dir() / "control_observations.csv"; }

struct NamedImage {
  const Run* run;
  const ImageEntry* entry;
  std::string image;
};

std::vector<NamedImage> ImagesOf(const Project& project) {
  std::vector<NamedImage> images;
  for (const Run& run : project.site().runs) {
    for (const ImageEntry& entry : run.images) {
      images.push_back({&run, &entry, RelativeTo(project.dir(), entry.path)});
    }
  }
  return images;
}

NamedImage FindImage(const Project& project, const std::string& text) {
  std::vector<std::string> names;
  for (const NamedImage& image : ImagesOf(project)) {
    if (image.image == text || image.run->name + "/" + image.entry->file == text) return image;
    names.push_back(image.run->name + "/" + image.entry->file);
  }
  throw InputError("there is no image '" + text + "'" + NearestHint(text, names));
}

// Below the project; `named` itself where it is no image of a run.
std::string FullName(const std::vector<NamedImage>& images, const std::string& named) {
  for (const NamedImage& image : images) {
    if (image.entry->file == named || NamesPath(named, image.image)) return image.image;
  }
  return named;
}

const std::vector<std::string> kMarkColumns = {"point", "image", "u", "v"};

std::string MarkLine(const std::vector<std::string>& columns, const PointMark& mark) {
  CsvWriter csv(columns);
  const size_t header = csv.text().size();
  for (const std::string& column : columns) {
    if (column == "point") {
      csv.Text(mark.point);
    } else if (column == "image") {
      csv.Text(mark.image);
    } else if (column == "u" || column == "v") {
      csv.Number(column == "u" ? mark.pixel.x() : mark.pixel.y(), 3);
    } else if (column == "sigma_px" && mark.sigma_px != PointMark().sigma_px) {
      csv.Number(mark.sigma_px, 3);
    } else {
      csv.Empty();
    }
  }
  csv.EndRow();
  return csv.text().substr(header);
}

// Marks are added as lines with commas and decimal points.
void RequireCommas(const fs::path& file, const std::string& text) {
  const std::vector<DataLine> lines = DataLines(text);
  if (lines.empty() || DelimiterOf(lines.front().text) == ',') return;
  throw InputError(file.string() + ": its cells are separated by '" + DelimiterOf(lines.front().text) +
                   "'; marks are added to a table with commas and decimal points alone: save it so first");
}

// Takes the marks of a point in an image out of control_observations.csv and adds one. The file as it was is kept in
// results/replaced/; returns that copy in `kept`, and whether one was taken out.
bool EditMarks(const Project& project, const std::string& point, const std::string& image, const PointMark* added,
               fs::path* kept) {
  const fs::path file = FileOf(project);
  const InputLock lock(project.results());
  const CsvWriter none(kMarkColumns, {"trigpoint control_observations 1; pixels from the centre of the first"});
  if (!fs::exists(file)) {
    if (added == nullptr) return false;
    WriteFileAtomically(file, none.text() + MarkLine(kMarkColumns, *added));
    return false;
  }
  const CsvTable table = CsvTable::Read(file, kMarkColumns);
  const auto is_mark = [&, images = ImagesOf(project)](const CsvRow& row) {
    return row.Text("point") == point && FullName(images, row.Text("image")) == image;
  };
  const bool there = std::any_of(table.rows().begin(), table.rows().end(), is_mark);
  RequireCommas(file, ReadTextFile(file));
  std::string text = table.TextWithout(is_mark);
  if (added != nullptr) {
    if (!text.empty() && text.back() != '\n') text += '\n';
    text += MarkLine(table.columns(), *added);
  }
  const fs::path old = ReplaceInputFile(project.dir(), file.filename().string(), text);
  if (kept != nullptr) *kept = old;
  if (text == none.text()) fs::remove(file);  // as it was before the first mark: results are up to date again
  return there;
}

}  // namespace

std::vector<PointMark> ReadPointMarks(const Project& project) {
  std::vector<PointMark> marks;
  if (!fs::exists(FileOf(project))) return marks;
  const CsvTable table = CsvTable::Read(FileOf(project), kMarkColumns, {"sigma_px"});
  const std::vector<NamedImage> images = ImagesOf(project);
  for (const CsvRow& row : table.rows()) {
    PointMark mark{row.Text("point"), FullName(images, row.Text("image")), {row.Number("u"), row.Number("v")}};
    mark.sigma_px = row.Number("sigma_px", mark.sigma_px);
    marks.push_back(std::move(mark));
  }
  return marks;
}

PointMark SavePointMark(const Project& project, const std::string& point, const std::string& image,
                        const Eigen::Vector2d& pixel, fs::path* kept, double sigma_px) {
  if (Trim(point).empty()) throw InputError("a mark needs the name of its point");
  const NamedImage named = FindImage(project, image);
  const auto camera = static_cast<size_t>(named.entry->camera);
  if (!pixel.allFinite() ||
      (camera < named.run->cameras.size() && !named.run->cameras[camera].camera.Contains(pixel))) {
    throw InputError(named.image + ": the mark lies outside the image");
  }
  PointMark mark{std::string(Trim(point)), named.image, pixel};
  mark.sigma_px = sigma_px;
  EditMarks(project, mark.point, mark.image, &mark, kept);
  return mark;
}

void RemovePointMark(const Project& project, const std::string& point, const std::string& image, fs::path* kept) {
  const NamedImage named = FindImage(project, image);
  if (!EditMarks(project, point, named.image, nullptr, kept)) {
    throw InputError(FileOf(project).string() + ": point '" + point + "' is not marked in " + named.image);
  }
}

}  // namespace trigpoint
