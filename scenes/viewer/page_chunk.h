// Some frames of a film as bytes that a browser takes apart again: scenes/viewer/src/decode.js reads what this writes.
//
//   in:  consecutive frames of one film     out: two blocks of bytes, bodies and contacts, not compressed
//   A body whose pose is the same in all of them is kept as it is, in single precision. The others are kept in steps:
//   positions of PoseSteps::position, components of the rotation of kRotationStep. Both as differences to where the two frames before
//   point. Sizes (impulses, accuracy) are kept as logarithms: 400 and 1,000 steps a decade, so to 0.3 % and 0.12 %. Directions are kept
//   on an octahedron, 1,023 steps an edge: to 0.1 degrees.
//   errors: std::invalid_argument that names frame and body of a number that is not finite, or a body that is not there
//   units: SI    frames: W world     threads: pure functions
#pragma once

#include <span>
#include <string>

#include "scenes/film/film.h"

namespace islet {

inline constexpr double kRotationStep = 1.0 / 16384;

struct PageChunk {
  std::string bodies, contacts;
  int frames = 0;
  double position_error = 0, rotation_error = 0;  // [m], [rad] largest
  size_t contacts_kept = 0, contacts_all = 0;
  int frames_cut = 0;  // whose contacts are not all kept
};

// [m] a power of two, small against the smallest body that moves.
double PositionStep(const FilmHead& head);

// Throws if a frame does not fit to the head.
void CheckPageFrame(const FilmHead& head, const FilmFrame& frame);

// Of each frame at most so many contacts, those that press most. The frames have been checked.
PageChunk EncodePageChunk(const FilmHead& head, std::span<const FilmFrame> frames, double position_step,
                          size_t most_contacts);

}  // namespace islet
