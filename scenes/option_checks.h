// What several commands ask of their options.
//   errors: std::invalid_argument that names the option and its value
#pragma once

#include <optional>
#include <string>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace islet {

inline constexpr double kLongestRun = 1e6;  // [s]

// good: whether the value follows the rule, asked so that NaN does not.
void RequireRange(const char* option, double value, bool good, const char* rule);
void RequireRange(const char* option, int value, bool good, const char* rule);
void RequireRange(const char* option, const std::string& value, bool good, const char* rule);

void RequireTolerance(double tolerance);
void RequireThreads(const std::optional<int>& threads);
void RequireTime(const char* option,
                 const std::optional<double>& seconds);  // above zero, and no longer than the longest run

// What an option that takes the name of a file says of its value: nothing, or why not. An empty name is a variable that was not set, not a wish for
// no file; "-" is a name.
std::string FileOrDash(const std::string& name);

// Whole numbers of a command's options are decimal: 010 is ten, as `seq -w` writes it.
void ReadDecimals(CLI::App* command);

// An option that takes seconds as seconds_option.h reads them.
CLI::Option* AddTime(CLI::App* command, const char* name, std::optional<double>* target, const char* help);

}  // namespace islet
