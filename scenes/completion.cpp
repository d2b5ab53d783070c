#include "scenes/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <stdexcept>

namespace islet {
namespace {

struct Choice {                    // an option
  std::vector<std::string> names;  // "--count", "-h"
  std::string type, help;
  bool takes_value() const { return !type.empty(); }
  bool takes_file() const { return type.starts_with("FILE") || type.starts_with("DIR"); }
};

struct Argument {  // without a name
  std::string name, type;
  std::vector<std::string> words;
  bool many = false;
  bool takes_file() const { return type.starts_with("FILE"); }
};

struct Command {
  std::string name, help;
  std::vector<Choice> options;
  std::vector<Argument> arguments;
};

Command CommandOf(const CLI::App& app, const ArgumentWords& words) {
  Command command{app.get_name(), app.get_description(), {}, {}};
  for (const CLI::Option* const option : app.get_options()) {
    if (option->get_group().empty()) continue;  // hidden
    if (option->get_positional()) {
      const std::string name = option->get_name(true);
      const auto found = words.find(name);
      command.arguments.push_back({name, option->get_type_name(),
                                   found == words.end() ? std::vector<std::string>{} : found->second,
                                   option->get_items_expected_max() > 1});
      continue;
    }
    Choice choice{{}, option->get_type_name(), option->get_description()};
    for (const std::string& name : option->get_lnames()) choice.names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) choice.names.push_back("-" + name);
    command.options.push_back(choice);
  }
  return command;
}

std::vector<std::string> AllNames(const Command& command) {
  std::vector<std::string> names;
  for (const Choice& option : command.options) names.insert(names.end(), option.names.begin(), option.names.end());
  return names;
}

std::vector<std::string> NamesOf(const Command& command, bool (*wanted)(const Choice&)) {
  std::vector<std::string> names;
  for (const Choice& option : command.options)
    if (wanted(option)) names.insert(names.end(), option.names.begin(), option.names.end());
  return names;
}

// In single quotes, as shells read it; `inside` is how a quote is written there.
std::string Quoted(const std::string& text, const char* inside) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string(inside) : std::string(1, c);
  return quoted + "'";
}

std::string Escaped(const std::string& text, std::string_view characters) {
  std::string escaped;
  for (const char c : text) {
    if (characters.find(c) != std::string_view::npos) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string Bash(const Command& program, const std::vector<Command>& commands) {
  std::vector<std::string> names;
  for (const Command& command : commands) names.push_back(command.name);
  std::string text = fmt::format(
      "# bash completion for islet; made by `islet completion bash`\n"
      "_islet_files() {{\n"
      "  compopt -o filenames 2>/dev/null\n"
      "  mapfile -t COMPREPLY < <(compgen -f -- \"$1\")\n"
      "}}\n"
      "_islet() {{\n"
      "  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}} command='' words='' i\n"
      "  COMPREPLY=()\n"
      "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
      "    case ${{COMP_WORDS[i]}} in {}) command=${{COMP_WORDS[i]}}; break ;; esac\n"
      "  done\n"
      "  case $command in\n"
      "    '') words='{} {}' ;;\n",
      fmt::join(names, "|"), fmt::join(names, " "), fmt::join(AllNames(program), " "));
  for (const Command& command : commands) {
    text += fmt::format("    {})\n", command.name);
    const auto files = NamesOf(command, [](const Choice& o) { return o.takes_file(); });
    const auto values = NamesOf(command, [](const Choice& o) { return o.takes_value() && !o.takes_file(); });
    text += "      case $previous in\n";
    if (!files.empty())
      text += fmt::format("        {}) _islet_files \"$current\"; return ;;\n", fmt::join(files, "|"));
    if (!values.empty()) text += fmt::format("        {}) return ;;\n", fmt::join(values, "|"));
    text += "        *) ;;\n      esac\n";
    std::vector<std::string> words;
    bool any_file = false;
    for (const Argument& argument : command.arguments) {
      words.insert(words.end(), argument.words.begin(), argument.words.end());
      any_file = any_file || argument.takes_file();
    }
    if (any_file) text += "      if [[ $current != -* ]]; then _islet_files \"$current\"; return; fi\n";
    text += fmt::format("      if [[ $current == -* ]]; then words='{}'; else words='{}'; fi ;;\n",
                        fmt::join(AllNames(command), " "), fmt::join(words, " "));
  }
  return text +
         "  esac\n"
         "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")\n"
         "}\n"
         "complete -F _islet islet\n";
}

// A line for _arguments.
std::string ZshOption(const Choice& option, const std::string& name) {
  std::string spec = name + "[" + Escaped(option.help, "[]\\:") + "]";
  if (option.takes_value()) spec += ":" + Escaped(option.type, "[]\\:") + ":" + (option.takes_file() ? "_files" : " ");
  return Quoted(spec, "'\\''");
}

std::string ZshArguments(const Command& command) {
  std::string text = "_arguments";
  for (const Choice& option : command.options)
    for (const std::string& name : option.names) text += " \\\n        " + ZshOption(option, name);
  for (const Argument& argument : command.arguments) {
    const std::string action = !argument.words.empty() ? fmt::format("({})", fmt::join(argument.words, " "))
                               : argument.takes_file() ? "_files"
                                                       : " ";
    text += " \\\n        " + Quoted((argument.many ? "*:" : ":") + argument.name + ":" + action, "'\\''");
  }
  return text;
}

std::string Zsh(const Command& program, const std::vector<Command>& commands) {
  std::string text =
      "#compdef islet\n# zsh completion for islet; made by `islet completion zsh`\n_islet() {\n"
      "  local -a commands\n  commands=(\n";
  for (const Command& command : commands)
    text += "    " + Quoted(command.name + ":" + Escaped(command.help, ":\\"), "'\\''") + "\n";
  text += "  )\n  if (( CURRENT == 2 )); then\n    _describe -t commands command commands\n    " +
          ZshArguments(program) + "\n    return\n  fi\n";
  text += "  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case $command in\n";
  for (const Command& command : commands)
    text += fmt::format("    {})\n      {} ;;\n", command.name, ZshArguments(command));
  return text + "  esac\n}\n_islet \"$@\"\n";
}

std::string FishOption(const Choice& option, const std::string& condition) {
  std::string line = "complete -c islet -n " + condition;
  for (const std::string& name : option.names)
    line += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
  if (option.takes_value()) line += option.takes_file() ? " -r -F" : " -x";
  return line + " -d " + Quoted(Escaped(option.help, "\\"), "\\'") + "\n";
}

std::string Fish(const Command& program, const std::vector<Command>& commands) {
  std::string text = "# fish completion for islet; made by `islet completion fish`\ncomplete -c islet -f\n";
  for (const Choice& option : program.options) text += FishOption(option, "__fish_use_subcommand");
  for (const Command& command : commands) {
    text += fmt::format("complete -c islet -n __fish_use_subcommand -a {} -d {}\n", command.name,
                        Quoted(Escaped(command.help, "\\"), "\\'"));
    const std::string seen = "'__fish_seen_subcommand_from " + command.name + "'";
    for (const Choice& option : command.options) text += FishOption(option, seen);
    for (const Argument& argument : command.arguments) {
      if (!argument.words.empty())
        text += fmt::format("complete -c islet -n {} -a '{}'\n", seen, fmt::join(argument.words, " "));
      if (argument.takes_file()) text += fmt::format("complete -c islet -n {} -F\n", seen);
    }
  }
  return text;
}

}  // namespace

std::string Completion(const CLI::App& program, const std::string& shell, const ArgumentWords& words) {
  const Command whole = CommandOf(program, {});
  std::vector<Command> commands;
  for (const CLI::App* const app : program.get_subcommands([](const CLI::App*) { return true; }))
    commands.push_back(CommandOf(*app, words));
  if (shell == "bash") return Bash(whole, commands);
  if (shell == "zsh") return Zsh(whole, commands);
  if (shell == "fish") return Fish(whole, commands);
  throw std::invalid_argument("the shells are bash, zsh and fish; got " + shell);
}

}  // namespace islet
