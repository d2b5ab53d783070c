// What a page needs of a run that goes on while it is looked at: the page without a film, and lines for it, which src/live.js reads.
//
//   in:  a run's head, a frame     out: the page; a line for each
//   A line of a frame: its bodies and its contacts as page_chunk.h keeps them, deflated, then its numbers as page_head.h has them,
//   each in base64, with a space between them. A frame is a chunk of its own, so that any of them can be skipped.
//   position_step: [m] PositionStep of the run's beginning; it stays when bodies are added
//   errors: as CheckPageHead and CheckPageFrame     threads: pure functions
#pragma once

#include <string>

#include "scenes/film/film.h"

namespace islet {

std::string LivePage();
std::string LiveHead(const FilmHead& head, double position_step);
std::string LiveFrame(const FilmHead& head, const FilmFrame& frame, double position_step);

}  // namespace islet
