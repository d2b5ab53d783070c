// A drawing as pixels: the PNG that its SVG would look like. The only room that sees cairo (in drawing_png.cpp).
//
//   out: the bytes of the file, one pixel a px, 24 bits
//   errors: std::runtime_error if cairo cannot make it
#pragma once

#include <string>

#include "scenes/drawing.h"

namespace islet {

std::string Png(const Drawing& drawing);
std::string CairoVersion();  // of the library that this process runs on

}  // namespace islet
