// What lets a shell complete the program's command line: commands, options, names of scenes and checks, and files.
//
//   in: the definitions of the commands, and words that may stand where an argument without a name may, by that argument's name
//   out: the text that a shell reads; nothing is asked of the program while completing
//   errors: std::invalid_argument for a shell that is not known
#pragma once

#include <map>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace islet {

using ArgumentWords = std::map<std::string, std::vector<std::string>>;

// shell: bash, zsh or fish.
std::string Completion(const CLI::App& program, const std::string& shell, const ArgumentWords& words);

}  // namespace islet
