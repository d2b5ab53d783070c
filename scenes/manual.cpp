#include "scenes/manual.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <vector>

namespace islet {
namespace {

// Text as it is: troff's own characters lose their meaning, and a hyphen stays one that can be copied.
std::string Plain(const std::string& text) {
  std::string plain;
  bool line_begins = true;
  for (const char c : text) {
    if (line_begins && (c == '.' || c == '\'')) plain += "\\&";
    if (c == '\\') {
      plain += "\\e";
    } else if (c == '-') {
      plain += "\\-";
    } else {
      plain += c;
    }
    line_begins = c == '\n';
  }
  return plain;
}

std::string Bold(const std::string& text) { return "\\fB" + Plain(text) + "\\fP"; }
std::string Italic(const std::string& text) { return "\\fI" + Plain(text) + "\\fP"; }

// A footer: paragraphs, and after "Examples:" lines that are kept as they are.
std::string Footer(const std::string& footer) {
  constexpr std::string_view kExamples = "Examples:\n";
  const size_t begin = footer.find(kExamples);
  std::string paragraphs = footer.substr(0, begin);
  while (paragraphs.ends_with('\n')) paragraphs.pop_back();
  std::string text = paragraphs.empty() ? "" : ".PP\n" + Plain(paragraphs) + "\n";
  if (begin == std::string::npos) return text;
  return text + ".PP\nExamples:\n.PP\n.nf\n" + Plain(footer.substr(begin + kExamples.size())) + "\n.fi\n";
}

std::string OptionItem(const CLI::Option& option) {
  std::string names;
  for (const std::string& name : option.get_snames()) names += (names.empty() ? "" : ", ") + Bold("-" + name);
  for (const std::string& name : option.get_lnames()) names += (names.empty() ? "" : ", ") + Bold("--" + name);
  if (option.get_positional()) names = Italic(option.get_type_name());
  if (!option.get_positional() && !option.get_type_name().empty()) names += " " + Italic(option.get_type_name());
  return ".TP\n" + names + "\n" + Plain(option.get_description()) + "\n";
}

// In the order of their definition, a heading before each group.
std::string Options(const CLI::App& command) {
  std::string text, group;
  for (const CLI::Option* const option : command.get_options()) {
    if (option->get_group().empty()) continue;  // hidden
    if (option->get_group() != group && option->get_group() != "Options")
      text += ".PP\n" + Italic(option->get_group()) + "\n";
    group = option->get_group();
    text += OptionItem(*option);
  }
  return text;
}

std::string Synopsis(const CLI::App& command) {
  std::string line = Bold("islet " + command.get_name());
  for (const CLI::Option* const option : command.get_options()) {
    if (!option->get_positional()) continue;
    std::string word = Italic(option->get_type_name());
    if (option->get_items_expected_max() > 1) word += " ...";
    line += option->get_required() ? " " + word : " [" + word + "]";
  }
  return line + " [" + Italic("OPTION") + " ...]\n";
}

}  // namespace

std::string Manual(const CLI::App& program, const std::string& version) {
  const auto commands = program.get_subcommands([](const CLI::App*) { return true; });
  std::string text = fmt::format(".TH ISLET 1 \"\" \"islet {}\" \"User Commands\"\n", version);
  text += ".SH NAME\nislet \\- " + Plain(program.get_description()) + "\n.SH SYNOPSIS\n";
  for (const CLI::App* const command : commands) {
    if (command != commands.front()) text += ".br\n";
    text += Synopsis(*command);
  }
  text += ".SH OPTIONS\n" + Options(program);
  text += ".SH COMMANDS\n";
  for (const CLI::App* const command : commands) {
    text += ".SS " + Plain(command->get_name()) + "\n" + Plain(command->get_description()) + ".\n";
    text += Options(*command) + Footer(command->get_footer());
  }
  text += ".SH EXIT STATUS\n" + Footer(program.get_footer());
  text +=
      ".SH ENVIRONMENT\n"
      ".TP\n.B COLUMNS\nhow many characters the line may have that tells how far a run is; without it the terminal is "
      "asked\n"
      ".TP\n.B ISLET_KERNELS\nsse2, avx2 or avx512: narrower vectors than the widest that the machine has\n";
  return text;
}

}  // namespace islet
