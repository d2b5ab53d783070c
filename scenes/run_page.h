// The page of a run, written while the run goes on: what `islet view` and `islet run --html` leave.
//
//   errors: a page that cannot be written must not end the run: Add() keeps the error, Finish() throws it, std::runtime_error that names
//           the file, std::invalid_argument for frames that are none. Without Finish() no file is left
#pragma once

#include <exception>
#include <optional>
#include <string>

#include "scenes/film/film.h"
#include "scenes/output_file.h"
#include "scenes/viewer/page.h"

namespace islet {

class RunPage {
 public:
  RunPage(const std::string& path, FilmHead head, const PageOptions& options);
  void Add(const FilmFrame& frame);
  std::string Finish(const std::string& stopped_by);  // a line for people: where it is, how large

 private:
  template <typename Write>
  void Try(const Write& write);

  std::string path_;
  FilmHead head_;
  OutputFile file_;
  std::optional<PageWriter> writer_;
  std::exception_ptr error_;  // the first
};

}  // namespace islet
