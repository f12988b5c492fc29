// manual: man pages and shell completion, made from the same definitions as --help.
#include <fmt/format.h>

#include "app/cli/interchange_commands.h"
#include "datasets/io/text.h"
#include "datasets/project/outputs.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

std::vector<const CLI::App*> Commands(const CLI::App& root) {
  return root.get_subcommands([](const CLI::App*) { return true; });
}

// Text for roff: no line may begin with a dot or quote, a backslash is doubled, a hyphen stays one.
std::string Roff(const std::string& text) {
  std::string out;
  bool begins = true;
  for (char c : text) {
    if (begins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
    begins = c == '\n';
  }
  return out;
}

// "--quiet", "--log-level TEXT", "DIR".
std::string Usage(const CLI::Option& option) {
  if (option.get_positional()) return option.get_name(true);
  std::string text = option.get_name(false, true);
  for (size_t at = text.find(','); at != std::string::npos; at = text.find(',', at + 2)) text.replace(at, 1, ", ");
  return option.get_items_expected_max() == 0 ? text : text + " " + option.get_type_name();
}

std::string ManualPage(const CLI::App& root, const CLI::App* command, const std::string& version) {
  const std::string name = command == nullptr ? "trigpoint" : "trigpoint-" + command->get_name();
  const CLI::App& app = command == nullptr ? root : *command;
  std::string text = ".TH \"" + Roff(name) + "\" 1 \"\" \"trigpoint " + version + "\" \"Trigpoint\"\n.SH NAME\n" +
                     Roff(name) + " \\- " +
                     Roff(command == nullptr ? "from a folder of images to localized panoramas, and how good they are"
                                             : app.get_description()) +
                     "\n";
  text += ".SH SYNOPSIS\n.B trigpoint";
  if (command == nullptr) {
    text += "\n.I command\nDIR [options]\n.SH COMMANDS\n";
    for (const CLI::App* sub : Commands(root)) {
      text += ".TP\n.B " + Roff(sub->get_name()) + "\n" + Roff(sub->get_description()) + "\n";
    }
    text += ".SH SEE ALSO\n";
    std::string all;
    for (const CLI::App* sub : Commands(root)) {
      all += (all.empty() ? "" : ", ") + ("trigpoint-" + sub->get_name()) + "(1)";
    }
    return text + Roff(all) + "\n";
  }
  text += " " + Roff(app.get_name()) + "\n";
  std::string options;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) text += ".I " + Roff(option->get_name(true)) + "\n";
    options += ".TP\n.B " + Roff(Usage(*option)) + "\n" + Roff(option->get_description());
    if (!option->get_default_str().empty()) options += " (default: " + Roff(option->get_default_str()) + ")";
    options += "\n";
  }
  text += "[options]\n.SH OPTIONS\n" + options;
  // The footer has tables and examples whose lines matter.
  text += ".SH DETAILS\n.nf\n" + Roff(app.get_footer()) + "\n.fi\n.SH SEE ALSO\ntrigpoint(1)\n";
  return text;
}

std::string Quoted(const std::string& text) {
  std::string out = "'";
  for (char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string LongNames(const CLI::App& app) {
  std::string names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names += (names.empty() ? "--" : " --") + name;
  }
  return names;
}

std::string BashCompletion(const CLI::App& root) {
  std::string commands, cases;
  for (const CLI::App* sub : Commands(root)) {
    commands += (commands.empty() ? "" : " ") + sub->get_name();
    cases += "    " + sub->get_name() + ") options=" + Quoted(LongNames(*sub)) + " ;;\n";
  }
  return "# bash completion for trigpoint, made from its command definitions\n_trigpoint() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} options=\n  COMPREPLY=()\n"
         "  if [[ $COMP_CWORD -eq 1 ]]; then\n    COMPREPLY=($(compgen -W " +
         Quoted(commands + " --help --version") +
         " -- \"$current\"))\n    return\n  fi\n"
         "  case ${COMP_WORDS[1]} in\n" +
         cases +
         "  esac\n"
         "  if [[ $current == -* ]]; then\n    COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))\n  else\n    "
         "compopt -o filenames 2>/dev/null\n    COMPREPLY=($(compgen -f -- \"$current\"))\n  fi\n}\n"
         "complete -F _trigpoint trigpoint\n";
}

std::string ZshCompletion(const CLI::App& root) {
  std::string commands, cases;
  for (const CLI::App* sub : Commands(root)) {
    std::string help = sub->get_description();
    commands += "    " + Quoted(sub->get_name() + ":" + help) + "\n";
    cases += "    " + sub->get_name() + ") options=(" + LongNames(*sub) + ") ;;\n";
  }
  return "#compdef trigpoint\n# made from its command definitions\n_trigpoint() {\n  local -a commands options\n  "
         "commands=(\n" +
         commands +
         "  )\n  if (( CURRENT == 2 )); then\n    _describe command commands\n    return\n  fi\n  case $words[2] in\n" +
         cases +
         "  esac\n  if [[ $PREFIX == -* ]]; then\n    compadd -- $options\n  else\n    _files\n  fi\n}\n"
         // As a file of fpath it is called by its name; sourced, it registers itself.
         "if [[ $funcstack[1] == _trigpoint ]]; then\n  _trigpoint \"$@\"\nelse\n  compdef _trigpoint trigpoint\nfi\n";
}

std::string FishCompletion(const CLI::App& root) {
  std::string text = "# fish completion for trigpoint, made from its command definitions\n";
  for (const CLI::App* sub : Commands(root)) {
    text += "complete -c trigpoint -n __fish_use_subcommand -a " + sub->get_name() + " -d " +
            Quoted(sub->get_description()) + "\n";
    for (const CLI::Option* option : sub->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        text += "complete -c trigpoint -n '__fish_seen_subcommand_from " + sub->get_name() + "' -l " + name +
                (option->get_items_expected_max() == 0 ? "" : " -r") + " -d " + Quoted(option->get_description()) +
                "\n";
      }
    }
  }
  return text;
}

std::string Completion(const CLI::App& root, const std::string& shell) {
  return shell == "bash" ? BashCompletion(root) : shell == "zsh" ? ZshCompletion(root) : FishCompletion(root);
}

}  // namespace

void AddCompletionCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(app, session, "completion", "print the completion of commands and options for a shell",
                                 "The Debian package has it in place. Without it:\n"
                                 "  bash   eval \"$(trigpoint completion bash)\"   in ~/.bashrc\n"
                                 "  zsh    trigpoint completion zsh > ~/.zfunc/_trigpoint   (a folder of fpath)\n"
                                 "  fish   trigpoint completion fish > ~/.config/fish/completions/trigpoint.fish\n\n"
                                 "Example:\n  eval \"$(trigpoint completion bash)\"");
  const auto shell = std::make_shared<std::string>();
  command.add_option("SHELL", *shell, "bash, zsh or fish")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command.callback([&app, &session, shell] {
    session.action = [&app, shell](Session&) {
      std::fputs(Completion(app, *shell).c_str(), stdout);
      return 0;
    };
  });
}

void AddManualCommand(CLI::App& app, Session& session, const std::string& version) {
  CLI::App& command =
      AddCommand(app, session, "manual", "write man pages and shell completion",
                 "DIR/man1/trigpoint*.1, DIR/trigpoint (bash), DIR/_trigpoint (zsh), DIR/trigpoint.fish. The\n"
                 "Debian package has them in place.\n\n"
                 "Example:\n  trigpoint manual ~/.local/share/trigpoint");
  const auto dir = std::make_shared<std::string>();
  command.add_option("DIR", *dir, "where they go")->required();
  command.callback([&app, &session, dir, version] {
    session.action = [&app, dir, version](Session& s) {
      OutputFiles output(*dir);
      const fs::path out = output.staging();
      std::vector<std::pair<fs::path, std::string>> files = {
          {out / "man1/trigpoint.1", ManualPage(app, nullptr, version)},
          {out / "trigpoint", BashCompletion(app)},
          {out / "_trigpoint", ZshCompletion(app)},
          {out / "trigpoint.fish", FishCompletion(app)}};
      for (const CLI::App* sub : Commands(app)) {
        files.emplace_back(out / "man1" / ("trigpoint-" + sub->get_name() + ".1"), ManualPage(app, sub, version));
      }
      for (const auto& [file, text] : files) WriteFileAtomically(file, text);
      output.Publish();
      s.End(Ending("Wrote " + Counted(files.size(), "file") + " to " + *dir));
      s.PrintJson({{"command", "manual"}, {"ok", true}, {"files", files.size()}});
      return 0;
    };
  });
}

}  // namespace trigpoint
