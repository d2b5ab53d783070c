// What a page tells beside its chunks: the film's head as JSON, and the numbers of the curves.
//
//   in: a film's head, its frames     out: text that may stand in a <script> of HTML, whatever the names hold
//   errors: std::invalid_argument of a head whose bodies or shapes are not there or not finite
//   units: SI     threads: pure functions
#pragma once

#include <string>
#include <vector>

#include "scenes/film/film.h"
#include "scenes/viewer/page_chunk.h"

namespace islet {

void CheckPageHead(const FilmHead& head);

// One frame's, in the order that PageHeadJson tells.
void AppendNumbers(const FilmFrame& frame, std::vector<double>* numbers);

// Of all frames: little-endian doubles, one number of all frames after the other.
std::string NumberBytes(const std::vector<double>& numbers);

std::string PageHeadJson(const FilmHead& head, const PageChunk& sum, const std::vector<int>& chunk_sizes,
                         double position_step, const std::string& stopped_by, const std::string& start);

}  // namespace islet
