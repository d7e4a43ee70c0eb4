#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "server/cli/commands.hpp"

namespace anchord::cli {
namespace {

std::vector<const CLI::App*> listed(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* sub) { return !sub->get_group().empty(); });
}

/// In single quotes, for a shell.
std::string in_quotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

struct Word {
  std::string name, help;
};

/// What may follow a command: its own commands, then its options.
std::vector<Word> words_of(const CLI::App& app) {
  std::vector<Word> out;
  for (const auto* sub : listed(app)) out.push_back({sub->get_name(), sub->get_description()});
  for (const auto* option : app.get_options())
    for (const auto& name : option->get_lnames()) out.push_back({"--" + name, option->get_description()});
  return out;
}

/// Every command with the words before it: "", " serve", " token create".
void each(const CLI::App& app, const std::string& path,
          const std::function<void(const std::string&, const CLI::App&)>& act) {
  act(path, app);
  for (const auto* sub : listed(app)) each(*sub, path + " " + sub->get_name(), act);
}

/// The lines that both shells share: `path` becomes the command that the words so far name.
std::string path_cases(const CLI::App& app) {
  std::string names;
  each(app, "", [&](const std::string& path, const CLI::App&) {
    if (!path.empty()) names += (names.empty() ? "" : "|") + in_quotes(path);
  });
  return "    case \"$path $word\" in " + names + ") path=\"$path $word\" ;; esac\n";
}

std::string bash_script(const CLI::App& app) {
  std::string out =
      "# bash completion of anchord: source <(anchord completion bash)\n"
      "_anchord() {\n"
      "  local cur=${COMP_WORDS[COMP_CWORD]} path= word words=\n"
      "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n" +
      path_cases(app) +
      "  done\n"
      "  case \"$path\" in\n";
  each(app, "", [&](const std::string& path, const CLI::App& at) {
    std::string words;
    for (const auto& word : words_of(at)) words += (words.empty() ? "" : " ") + word.name;
    out += "    " + in_quotes(path) + ") words=" + in_quotes(words) + " ;;\n";
  });
  return out +
         "  esac\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$cur\"))\n"
         "}\n"
         "complete -o default -F _anchord anchord\n";
}

/// One line of text before the colon and one after it, as _describe wants them.
std::string described(const Word& word) {
  std::string help = word.help.substr(0, word.help.find('\n'));
  std::ranges::replace(help, ':', ' ');
  return in_quotes(word.name + (help.empty() ? "" : ":" + help));
}

std::string zsh_script(const CLI::App& app) {
  std::string out =
      "#compdef anchord\n"
      "# zsh completion of anchord: anchord completion zsh > \"${fpath[1]}/_anchord\"\n"
      "_anchord() {\n"
      "  local path= word\n"
      "  local -a known\n"
      "  for word in \"${(@)words[2,CURRENT-1]}\"; do\n" +
      path_cases(app) +
      "  done\n"
      "  case \"$path\" in\n";
  each(app, "", [&](const std::string& path, const CLI::App& at) {
    out += "    " + in_quotes(path) + ") known=(";
    for (const auto& word : words_of(at)) out += "\n      " + described(word);
    out += ") ;;\n";
  });
  return out +
         "  esac\n"
         "  _describe -V anchord known || _files\n"
         "}\n"
         "compdef _anchord anchord 2>/dev/null || true\n";
}

/// Text for roff: no line of it is a request, no character an escape.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n'))
      out += std::string("\\&") + c;
    else
      out += c;
  }
  return out;
}

/// "--listen TEXT", "id".
std::string written(const CLI::Option& option) {
  std::string out;
  for (const auto& name : option.get_snames()) out += (out.empty() ? "-" : ", -") + name;
  for (const auto& name : option.get_lnames()) out += (out.empty() ? "--" : ", --") + name;
  if (out.empty()) return option.get_name(true);
  return option.get_items_expected_min() > 0 ? out + " " + option.get_type_name() : out;
}

std::string man_page(const CLI::App& app) {
  std::string out =
      ".TH ANCHORD 1 \"\" \"anchord " ANCHORD_VERSION
      "\" \"User Commands\"\n"
      ".SH NAME\nanchord \\- find where a building's UWB anchors are on the globe\n"
      ".SH SYNOPSIS\n.B anchord\n.I COMMAND\n[\\fIOPTIONS\\fR]\n"
      ".SH DESCRIPTION\nA server that finds the positions of ultra\\-wideband anchors from ranges and RTK "
      "fixes of a drone, with commands that prepare, simulate, solve and check such flights.\n"
      ".SH COMMANDS\n";
  each(app, "", [&](const std::string& path, const CLI::App& at) {
    if (path.empty()) return;
    out += ".SS anchord" + roff(path) + "\n" + roff(at.get_description()) + "\n";
    for (const auto* option : at.get_options()) {
      if (option->get_name() == "--help") continue;
      out += ".TP\n.B " + roff(written(*option)) + "\n" + roff(option->get_description()) + "\n";
      if (!option->get_envname().empty())
        out += "Environment: \\fB" + roff(option->get_envname()) + "\\fR.\n";
    }
  });
  return out +
         ".SH EXIT STATUS\n0: done; 1: failed; 2: input or arguments that cannot be used.\n"
         ".SH ENVIRONMENT\n.TP\n.B ANCHORD_TOKEN\nAccess token for commands that send requests to a running "
         "server.\n"
         ".TP\n.B ANCHORD_DATA_DIR\nFolder of the database.\n";
}

}  // namespace

void add_completion_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("completion", "Print a script that completes commands in bash or zsh");
  const auto shell = std::make_shared<std::string>();
  command->add_option("shell", *shell, "bash or zsh")->required()->check(CLI::IsMember({"bash", "zsh"}));
  command->callback([&exit_code, &app, shell] {
    std::fputs((*shell == "bash" ? bash_script(app) : zsh_script(app)).c_str(), stdout);
    exit_code = 0;
  });
}

void add_man_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("man", "Print the manual page (anchord man | man -l -)");
  command->callback([&exit_code, &app] {
    std::fputs(man_page(app).c_str(), stdout);
    exit_code = 0;
  });
}

}  // namespace anchord::cli
