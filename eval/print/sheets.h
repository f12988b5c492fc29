// Sheets of paper to scale: tags, boards and scale bars as vector PDF.
//
// All lengths are millimetres on the paper, x to the right, y down, from the upper left corner.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/target/board_ink.h"

namespace trigpoint {

struct PaperSize {
  std::string name = "A4";
  double width_mm = 210, height_mm = 297;
};
// A0 to A6, Letter, Legal, Tabloid.
const std::vector<PaperSize>& KnownPapers();
// One of these (any case), or WIDTHxHEIGHT in mm. Throws OptionError.
PaperSize PaperNamed(const std::string& text);

// "twelve", "three hundred and five": an id as it is read aloud. 0 to 999999.
std::string NumberInWords(int number);

// A point whose place on the paper matters: a tag's corner, a board's point.
struct ArtworkPoint {
  std::string object;  // "tag 12", "board"; among printed points also "bar across", "bar up" with its two ends
  int index = 0;       // of the corner (0 to 3: bottom-left, bottom-right, top-right, top-left), or of the point
  double x_mm = 0, y_mm = 0;
};

struct ArtworkText {
  double x_mm = 0, y_mm = 0;  // on the baseline
  double size_mm = 3;
  int anchor = 0;  // -1 begins at x, 0: centred, 1: ends at x
  bool bold = false;
  std::string colour = "#333333";
  std::string text;
};

struct ArtworkLine {
  double x0_mm = 0, y0_mm = 0, x1_mm = 0, y1_mm = 0;
};

// What is printed in one piece.
struct Artwork {
  std::string title;  // "tag 12 (twelve)"
  double width_mm = 0, height_mm = 0;
  double white_mm = 0;  // at its left and right edge, that may lie where a printer cannot print
  double edge_mm = 0;   // of a tag: its size, that a ruler can measure across and up; 0: none
  std::vector<InkBox> boxes;
  std::vector<InkCircle> circles;
  std::vector<ArtworkLine> lines;
  std::vector<std::vector<std::pair<double, double>>> areas;  // black polygons
  std::vector<ArtworkText> texts;
  std::vector<ArtworkPoint> points;
  std::vector<std::string> checks;  // what to measure on the print
};

// A tag whose declared size (the edge that detection measures: the black square, or the white one of families with a
// reversed border) is `size_mm`, with its quiet zone, id in digits and words, corner numbers, an arrow upwards, family
// and size. Throws OptionError (family), InputError (id).
Artwork TagArtwork(const std::string& family, int id, double size_mm);
// Two tags whose centres are `length_mm` apart. Throws as TagArtwork, OptionError where they would overlap.
Artwork ScaleBarArtwork(const std::string& family, int first_id, int second_id, double size_mm, double length_mm);
// Throws InputError.
Artwork BoardArtwork(const Target& target);

struct SheetOptions {
  PaperSize paper;
  double margin_mm = 8;  // where the printer cannot print
  int per_sheet = 0;     // pieces on a sheet at most; 0: as many as fit
  std::string title;     // at the foot of every sheet
};

// Where a point of an artwork was drawn.
struct PrintedPoint {
  int page = 0;  // from 1
  std::string object;
  int index = 0;
  double x_mm = 0, y_mm = 0;
};

struct PrintedSheets {
  int pages = 0;
  int per_sheet = 0;  // pieces on a full sheet
  int tiles = 0;      // sheets of one piece, if one is larger than the paper
  double bar_mm = 0;  // length of the measuring bars
  // What is measured across and up most exactly: the bars, or a tag's edges where these are longer.
  double measure_mm = 0;
  std::string one_sheet;  // where pieces are cut: the smallest paper with a name on which none is; empty: there is none
  std::vector<PrintedPoint> points;
};

// A row of the page on which is noted where each tag was put.
struct PlaceRow {
  std::string tag, family, size_mm;
};

// What a reading of a ruler to half a millimetre is of a length, in percent.
double ReadingPercent(double length_mm);

// Pieces that fit on the paper are laid out in a grid with lines to cut along, larger ones are cut into sheets with
// crop marks after a sheet that shows how they go together. Every sheet has a measuring bar both ways, of the longest
// multiple of 10 mm that fits both ways, at most 500 mm (of which half a millimetre is 0.1 %); of a cut sheet the
// distances of its crop marks are stated. The last pages are a form for `places`, if there are any. Throws OptionError
// (paper too small for its margins or for a piece in at most 200 sheets; the message names paper that is not), IoError.
PrintedSheets WriteSheets(const std::vector<Artwork>& artworks, const std::vector<PlaceRow>& places,
                          const SheetOptions& options, const std::filesystem::path& file);

}  // namespace trigpoint
