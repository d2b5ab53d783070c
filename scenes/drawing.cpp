#include "scenes/drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

namespace islet {
namespace {

std::string Hex(const Colour& colour) {
  const auto byte = [](double v) { return static_cast<int>(std::lround(255 * std::clamp(v, 0.0, 1.0))); };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(colour[0]), byte(colour[1]), byte(colour[2]));
}

// One gradient a colour, not a ball.
std::string GradientName(const Colour& colour) {
  std::string name = Hex(colour);
  name[0] = 's';
  return name;
}

std::string Gradient(const Colour& colour) {
  return fmt::format(
      "<radialGradient id=\"{}\" cx=\".36\" cy=\".3\" r=\".75\"><stop offset=\"0\" stop-color=\"{}\"/>"
      "<stop offset=\".55\" stop-color=\"{}\"/><stop offset=\"1\" stop-color=\"{}\"/></radialGradient>\n",
      GradientName(colour), Hex(paint::Bright(colour)), Hex(paint::Middle(colour)), Hex(paint::Dark(colour)));
}
static_assert(paint::kLightX == .36 && paint::kLightY == .3 && paint::kLightRadius == .75 &&
              paint::kLightMiddle == .55);

std::string Ball(const Mark& mark) {
  return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"url(#{})\"/>\n", mark.outline[0].x(),
                     mark.outline[0].y(), mark.radius, GradientName(mark.colour));
}

std::string Path(const Mark& mark) {
  std::string path = "<path d=\"";
  for (size_t i = 0; i < mark.outline.size(); ++i)
    fmt::format_to(std::back_inserter(path), "{}{:.1f} {:.1f}", i == 0 ? 'M' : 'L', mark.outline[i].x(),
                   mark.outline[i].y());
  path.append("Z\" fill=\"").append(Hex(mark.colour)).append("\"");
  if (mark.opacity < 1) path += fmt::format(" fill-opacity=\"{}\"", fmt::format("{:g}", mark.opacity).substr(1));
  return path + "/>\n";
}

}  // namespace

std::string Svg(const Drawing& drawing) {
  std::set<std::string> gradients;
  for (const Mark& mark : drawing.marks)
    if (mark.radius > 0) gradients.insert(Gradient(mark.colour));
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\">\n<defs>\n",
      drawing.size.x(), drawing.size.y());
  for (const std::string& gradient : gradients) svg += gradient;
  svg += fmt::format(
      "</defs>\n<rect width=\"100%\" height=\"100%\" fill=\"#{:06x}\"/>\n"
      "<g stroke=\"#{:06x}\" stroke-opacity=\".45\" stroke-width=\".8\" stroke-linejoin=\"round\">\n",
      paint::kPaper, paint::kInk);
  static_assert(paint::kInkOpacity == .45 && paint::kInkWidth == .8);
  for (const Mark& mark : drawing.marks) svg += mark.radius > 0 ? Ball(mark) : Path(mark);
  return svg + "</g>\n</svg>\n";
}

}  // namespace islet
