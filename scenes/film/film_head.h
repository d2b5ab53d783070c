// The head of a film as JSON, for recordings; numbers come back bit for bit.
//
//   keys    program, version, scene, title, about (if any), command, arguments, scene_text (if any), dt, tolerance, gravity, bounds (if any),
//           shapes: kind and its numbers, a hull with all of its polytope
//           bodies: [how many alike in a row, shape, kind, mass]
//   limits  of bytes, values, bodies and shapes, held before memory is asked for
//   errors  std::invalid_argument with the key and its value; a custom shape is one
#pragma once

#include <string>
#include <string_view>

#include "scenes/film/film.h"

namespace islet {

inline constexpr std::size_t kMostHeadBytes = 8 << 20;
inline constexpr std::size_t kMostFilmBodies = 1 << 17;

std::string HeadToJson(const FilmHead& head);
FilmHead HeadFromJson(std::string_view text);

}  // namespace islet
