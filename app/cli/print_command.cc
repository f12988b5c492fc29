// print: sheets with tags, boards and scale bars as PDF.
#include <fmt/format.h>

#include "app/cli/field_commands.h"
#include "app/pipeline/command_line.h"
#include "app/pipeline/print.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {
namespace {

struct Arguments {
  PrintRequest request;
  std::string dir, out, ids, paper = "A4";
  std::vector<double> measured;
  double nominal_mm = 100;
};

int EnterMeasured(const Session& session, const Arguments& a) {
  const std::vector<int> ids = a.ids.empty() ? std::vector<int>() : ParseIds(a.ids);
  const MeasuredPrint entered = EnterMeasuredPrint(a.dir, ids, a.measured, a.nominal_mm);
  Terminal terminal = session.MakeTerminal();
  for (const std::string& warning : entered.warnings) terminal.Log(LogLevel::kWarning, warning);
  terminal.ClearProgress();
  Ending ending(fmt::format("Entered the measured size of {}: {:.2f} % of the size asked for",
                            Counted(entered.ids.size(), "tag"), 100 * entered.factor));
  ending.Look("Sizes", std::filesystem::path(a.dir) / "tags.yaml");
  if (!entered.old.empty()) ending.Look("Old file", entered.old);
  session.End(ending.Next("trigpoint plan " + ShellWord(ShownPath(a.dir)) + ", or put the tags up and survey"));
  session.PrintJson({{"command", "print"},
                     {"ok", true},
                     {"tags", entered.ids},
                     {"factor", entered.factor},
                     {"old", entered.old.string()},
                     {"warnings", entered.warnings}});
  return 0;
}

int Print(const Session& session, Arguments a) {
  if (!a.measured.empty()) return EnterMeasured(session, a);
  a.request.dir = a.dir;
  a.request.out = a.out;
  if (!a.ids.empty()) a.request.ids = ParseIds(a.ids);
  a.request.sheets.paper = PaperNamed(a.paper);
  const PrintOutcome outcome = PrintSheetsFor(a.request);
  const PrintedSheets& sheets = outcome.sheets;
  std::string text = Counted(sheets.pages, "page") + " of " + a.request.sheets.paper.name;
  if (sheets.per_sheet > 0) text += fmt::format(", at most {} on a sheet", sheets.per_sheet);
  if (sheets.tiles > 0)
    text += fmt::format(", {} for each piece larger than the paper", Counted(sheets.tiles, "sheet"));
  Ending ending("Wrote " + text);
  ending.Fact("Print", "at 100 %, not fitted to the page");
  ending.Fact("Measure", fmt::format("the bars across and up: {:g} mm each", sheets.bar_mm));
  for (const std::string& check : outcome.checks) ending.Fact("Measure", check);
  ending.Look("PDF", outcome.pdf);
  if (a.request.what != "board") {
    ending.Fact("Added", Counted(outcome.entries_added, "entry", "entries") + " to " +
                             ShownPath(std::filesystem::path(a.dir) / "tags.yaml"));
    if (!outcome.old.empty()) ending.Look("Old file", outcome.old);
    ending.Next(fmt::format("trigpoint print {} --measured LENGTH --nominal {:g}   (LENGTH: the bar as measured, mm)",
                            ShellWord(ShownPath(a.dir)), sheets.bar_mm));
  }
  if (a.request.what == "board") {
    ending.Next("trigpoint calibrate " + ShellWord(ShownPath(a.dir)) + " --images 'board/*.jpg' --target " +
                ShellWord(a.request.target) + " --name NAME   (with 20 pictures of it)");
  }
  if (a.request.what == "scale-bar") {
    ending.Fact("Distance", fmt::format("centre to centre, into distances.csv: {},{},DISTANCE_M,SIGMA_M,control",
                                        a.request.ids[0], a.request.ids[1]));
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
                     {"tags", a.request.ids},
                     {"entries_added", outcome.entries_added},
                     {"old", outcome.old.string()}});
  return 0;
}

}  // namespace

void AddPrintCommand(CLI::App& app, Session& session) {
  std::string families;
  for (const std::string& name : TagFamilyNames()) families += (families.empty() ? "" : ", ") + name;
  CLI::App& command = AddCommand(
      app, session, "print", "sheets with tags, calibration boards or scale bars as PDF, noted in tags.yaml",
      "A tag's size is what tags.yaml calls it: the edge of the black square, corner 0 to corner 1. Tags that fit "
      "share "
      "a\n"
      "sheet, larger ones are cut into sheets with crop marks. Each sheet has a measuring bar both ways; the last page "
      "is\n"
      "a form for where each tag was put. Entries are added to DIR/tags.yaml, never replaced, and the old file is "
      "kept.\n"
      "With --measured nothing is printed: the sizes of the last print (or of --ids) are corrected in tags.yaml by "
      "what "
      "a\n"
      "ruler shows.\n"
      "Families: " +
          families +
          "\n\n"
          "Examples:\n"
          "  trigpoint print my_site --ids 0-11 --size 160\n"
          "  trigpoint print my_site --ids 20-43 --size 40 --paper Letter\n"
          "  trigpoint print my_site --ids 7 --size 500 --paper A3\n"
          "  trigpoint print my_site --measured 99.7 --nominal 100\n"
          "  trigpoint print my_site --what board --target charuco:8x6:0.03:0.022:DICT_4X4_50\n"
          "  trigpoint print my_site --what scale-bar --ids 100,101 --size 80 --length 1000 --paper A3\n");
  const auto a = std::make_shared<Arguments>();
  command.add_option("DIR", a->dir, "the site's folder; it may be empty")->required();
  command.add_option("--what", a->request.what, "tags, board or scale-bar")
      ->check(CLI::IsMember({"tags", "board", "scale-bar"}))
      ->capture_default_str();
  command.add_option("--ids", a->ids, "ids of the tags, as 0-9,12");
  command.add_option("--size", a->request.size_mm, "size of a tag as tags.yaml declares it, mm")
      ->check(CLI::Range(5.0, 5000.0));
  command.add_option("--family", a->request.family, "tag family; default: that of tags.yaml, else tag36h11");
  command.add_option("--paper", a->paper, "A0 to A6, Letter, Legal, Tabloid, or WIDTHxHEIGHT in mm")
      ->capture_default_str();
  command.add_option("--margin", a->request.sheets.margin_mm, "edge of the paper that the printer leaves white, mm")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  command.add_option("--per-sheet", a->request.sheets.per_sheet, "most tags on a sheet; 0: as many as fit")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command.add_option("--target", a->request.target, "board: a file or one line, as `calibrate --target` takes it");
  command.add_option("--length", a->request.length_mm, "scale bar: distance of the two tags' centres, mm")
      ->check(CLI::Range(10.0, 20000.0));
  command.add_option("--measured", a->measured, "length of the printed bar, mm; or of both: across and up")
      ->expected(1, 2)
      ->check(CLI::PositiveNumber);
  command.add_option("--nominal", a->nominal_mm, "length that the bar should have, mm")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--out", a->out, "the PDF; default: DIR/print/<what it holds>.pdf");
  command.add_flag("--force", a->request.force, "replace a PDF that was changed since it was written");
  command.callback([&session, a] { session.action = [a](Session& s) { return Print(s, *a); }; });
}

}  // namespace trigpoint
