// The page of a run, written while the run goes on: what `islet view` and `islet run --html` leave.
//
//   errors: std::runtime_error that names the file; without Finish() no file is left
#pragma once

#include <string>

#include "scenes/film/film.h"
#include "scenes/output_file.h"
#include "scenes/viewer/page.h"

namespace islet {

class RunPage {
 public:
  RunPage(const std::string& path, FilmHead head, const PageOptions& options);
  void Add(const FilmFrame& frame) { writer_.Add(frame); }
  std::string Finish(const std::string& stopped_by);  // a line for people: where it is, how large

 private:
  std::string path_;
  FilmHead head_;
  OutputFile file_;
  PageWriter writer_;
};

}  // namespace islet
