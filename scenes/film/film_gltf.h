// A recording as glTF 2.0, binary (.glb), for Blender and other programs that draw.
//
//   out: a node for each body, of its name and number; a mesh for each shape, shared by the bodies that have it, twice where some of them
//        move and some do not; bodies that move animated by a key for each frame (translation and rotation, linear), the others standing.
//        Half-spaces are squares about their body that reach twice as far as the bodies get.
//   frames: y up, as glTF demands: (x, y, z) of ours is (x, z, -y) there. [m], [s]; keys in single precision, as the film has them
//   errors: std::invalid_argument for a film without frames, for times that single precision does not tell apart, and for more than 1 GB
//   threads: belongs to one
#pragma once

#include <string>

#include "scenes/film/film_file.h"

namespace islet {

std::string FilmToGlb(FilmReader* reader);  // the bytes of the file; reads all frames

}  // namespace islet
