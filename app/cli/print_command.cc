// print: sheets with tags, boards and scale bars as PDF.
#include <fmt/format.h>

#include <optional>

#include "app/cli/field_commands.h"
#include "app/pipeline/command_line.h"
#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "eval/print/printed.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {
namespace {

struct Arguments {
  PrintRequest request;
  std::string dir, out, ids, paper = "A4";
  std::vector<double> measured;
  double nominal_mm = 0;
};

CLI::Validator Millimetres(double least, double most) {
  return CLI::Validator(
      [=](const std::string& text) {
        const std::optional<double> value = ParseDouble(text);
        const bool good = value && *value >= least && *value <= most;
        return good ? std::string() : fmt::format("expected {:g} to {:g} mm, found '{}'", least, most, text);
      },
      fmt::format("{:g} to {:g} mm", least, most));
}

int EnterMeasured(const Session& session, const Arguments& a) {
  const std::vector<int> ids = a.ids.empty() ? std::vector<int>() : ParseIds(a.ids);
  const MeasuredPrint entered = EnterMeasuredPrint(a.dir, ids, a.measured, a.nominal_mm);
  Ending ending(fmt::format("Entered the measured size of {}: {:.2f} % of the size asked for",
                            Counted(entered.ids.size(), "tag"), 100 * entered.factor));
  for (const std::string& warning : entered.warnings) ending.Problem("Warning", warning);
  ending.Look("Sizes", std::filesystem::path(a.dir) / "tags.yaml");
  if (!entered.old.empty()) ending.Look("Old file", entered.old);
  ending.Fact("Reading", fmt::format("half a millimetre on the ruler is {:.2g} % of {:g} mm",
                                     ReadingPercent(a.nominal_mm), a.nominal_mm));
  session.End(ending.Next("trigpoint plan " + ShellWord(ShownPath(a.dir)) + ", or put the tags up and survey"));
  session.PrintJson({{"command", "print"},
                     {"ok", true},
                     {"tags", entered.ids},
                     {"factor", entered.factor},
                     {"old", entered.old.string()},
                     {"warnings", entered.warnings}});
  return 0;
}

// What to measure on the paper, and what to do with it.
void AddMeasuring(const Arguments& a, const PrintOutcome& outcome, Ending* ending) {
  const PrintedSheets& sheets = outcome.sheets;
  const bool edges = sheets.measure_mm > sheets.bar_mm;
  ending->Fact("Print", "at 100 %, not fitted to the page");
  ending->Fact("Measure", fmt::format("{} across and up; half a millimetre on the ruler is {:.2g} %",
                                      edges ? fmt::format("the tag's edges, {:g} mm (longer than the bars, {:g} mm),",
                                                          sheets.measure_mm, sheets.bar_mm)
                                            : fmt::format("the bars, {:g} mm,", sheets.bar_mm),
                                      ReadingPercent(sheets.measure_mm)));
  for (const std::string& check : outcome.checks) ending->Fact("Measure", check);
  if (a.request.what == "board") {
    ending->Fact("Scale", fmt::format("sizes in --target: multiply by measured / {:g}", sheets.measure_mm));
    ending->Next("trigpoint calibrate " + ShellWord(ShownPath(a.dir)) + " --images 'board/*.jpg' --target " +
                 ShellWord(a.request.target) + " --name NAME   (with 20 pictures of it)");
    return;
  }
  if (a.request.what == "scale-bar") {
    ending->Fact("Distance", fmt::format("centre to centre, into distances.csv: {},{},DISTANCE_M,SIGMA_M,control",
                                         a.request.ids[0], a.request.ids[1]));
  }
  ending->Next(fmt::format("trigpoint print {} --measured ACROSS UP --nominal {:g}   (ACROSS, UP: as measured, mm)",
                           ShellWord(ShownPath(a.dir)), sheets.measure_mm));
}

int Print(const Session& session, Arguments a) {
  if (!a.measured.empty()) return EnterMeasured(session, a);
  if (a.nominal_mm > 0) {
    throw OptionError(
        fmt::format("--nominal {:g}: expected --measured with it, the length on the paper in mm", a.nominal_mm));
  }
  a.request.dir = a.dir;
  a.request.out = a.out;
  if (!a.ids.empty()) a.request.ids = ParseIds(a.ids);
  a.request.sheets.paper = PaperNamed(a.paper);
  const PrintOutcome outcome = PrintSheetsFor(a.request);
  const PrintedSheets& sheets = outcome.sheets;
  std::string text = Counted(sheets.pages, "page") + " of " + a.request.sheets.paper.name;
  if (sheets.per_sheet > 0) text += fmt::format(", at most {} on a sheet", sheets.per_sheet);
  if (sheets.tiles > 0) {
    text += fmt::format(", {} for each piece larger than the paper", Counted(sheets.tiles, "sheet"));
    if (!sheets.one_sheet.empty()) text += fmt::format(" (one of {}: --paper {})", sheets.one_sheet, sheets.one_sheet);
  }
  Ending ending("Wrote " + text);
  AddMeasuring(a, outcome, &ending);
  for (const std::string& warning : outcome.warnings) ending.Problem("Warning", warning);
  ending.Look("PDF", outcome.pdf);
  if (a.request.what != "board") {
    ending.Fact("Added", Counted(outcome.entries_added, "entry", "entries") + " to " +
                             ShownPath(std::filesystem::path(a.dir) / "tags.yaml"));
    if (!outcome.old.empty()) ending.Look("Old file", outcome.old);
  }
  session.End(ending);
  session.PrintJson({{"command", "print"},
                     {"ok", true},
                     {"file", outcome.pdf.string()},
                     {"points", outcome.points.string()},
                     {"pages", sheets.pages},
                     {"per_sheet", sheets.per_sheet},
                     {"tiles", sheets.tiles},
                     {"bar_mm", sheets.bar_mm},
                     {"measure_mm", sheets.measure_mm},
                     {"one_sheet", sheets.one_sheet},
                     {"tags", a.request.ids},
                     {"entries_added", outcome.entries_added},
                     {"old", outcome.old.string()},
                     {"warnings", outcome.warnings}});
  return 0;
}

}  // namespace

void AddPrintCommand(CLI::App& app, Session& session) {
  std::string families;
  for (const std::string& name : TagFamilyNames()) families += (families.empty() ? "" : ", ") + name;
  CLI::App& command = AddCommand(
      app, session, "print", "sheets with tags, calibration boards or scale bars as PDF, noted in tags.yaml",
      "A tag's size is what tags.yaml calls it: the edge of the black square, corner 0 to corner 1. Tags that fit\n"
      "share a sheet, larger ones are cut into sheets with crop marks, whose distance is stated. All other sheets\n"
      "have a measuring bar both ways; the last page is a form for where each tag was put. Entries are added to\n"
      "DIR/tags.yaml, never replaced, and the old file is kept. With --measured nothing is printed: the sizes of the\n"
      "last print (or of --ids) are corrected in tags.yaml by what a ruler shows. A tag that is printed again keeps\n"
      "its entry until the new sheet is measured.\n"
      "Families: " +
          families +
          "\n\n"
          "Examples:\n"
          "  trigpoint print my_site --ids 0-11 --size 160\n"
          "  trigpoint print my_site --ids 20-43 --size 40 --paper Letter\n"
          "  trigpoint print my_site --ids 50 --size 500 --paper A3\n"
          "  trigpoint print my_site --measured 159.5 159.6 --nominal 160\n"
          "  trigpoint print my_site --what board --target charuco:8x6:0.03:0.022:DICT_4X4_50\n"
          "  trigpoint print my_site --what scale-bar --ids 100,101 --size 80 --length 1000 --paper A3\n");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the site's folder; it may be empty")->required();
  command.add_option("--what", a->request.what, "tags, board or scale-bar")
      ->check(CLI::IsMember({"tags", "board", "scale-bar"}))
      ->capture_default_str();
  command.add_option("--ids", a->ids, "ids of the tags, as 0-9,12");
  command.add_option("--size", a->request.size_mm, "size of a tag as tags.yaml declares it, mm")
      ->check(Millimetres(5, 5000));
  command.add_option("--family", a->request.family, "tag family; default: that of tags.yaml, else tag36h11");
  command.add_option("--paper", a->paper, "A0 to A6, Letter, Legal, Tabloid, or WIDTHxHEIGHT in mm")
      ->capture_default_str();
  command.add_option("--margin", a->request.sheets.margin_mm, "edge of the paper that the printer leaves white, mm")
      ->check(Millimetres(0, 100))
      ->capture_default_str();
  command.add_option("--per-sheet", a->request.sheets.per_sheet, "most tags on a sheet; 0: as many as fit")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command.add_option("--target", a->request.target, "board: a file or one line, as `calibrate --target` takes it");
  command.add_option("--length", a->request.length_mm, "scale bar: distance of the two tags' centres, mm")
      ->check(Millimetres(10, 20000));
  command.add_option("--measured", a->measured, "length of a printed bar or tag's edge, mm; or of both: across and up")
      ->expected(1, 2)
      ->check(Millimetres(1, 20000));
  command.add_option("--nominal", a->nominal_mm, "length that it should have, mm; stated at the foot of the sheet")
      ->check(Millimetres(1, 20000));
  command.add_option("--out", a->out, "the PDF; default: DIR/print/<what it holds>.pdf");
  command.add_flag("--force", a->request.force, "replace a PDF that was changed since it was written");
  command.callback([&session, a] { session.action = [a](Session& s) { return Print(s, *a); }; });
}

}  // namespace trigpoint
