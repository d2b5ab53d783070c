#include "scenes/drawing_png.h"

#include <cairo.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

namespace islet {
namespace {

template <typename T>
using Owned = std::unique_ptr<T, void (*)(T*)>;

void Require(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("no PNG: ") + cairo_status_to_string(status));
}

Colour ColourOf(unsigned rgb) { return Colour(rgb >> 16 & 255, rgb >> 8 & 255, rgb & 255) / 255; }

void SetColour(cairo_t* canvas, const Colour& colour, double opacity) {
  cairo_set_source_rgba(canvas, colour[0], colour[1], colour[2], opacity);  // cuts at 0 and 1
}

// Fills the path that is there.
void FillBall(cairo_t* canvas, const Mark& mark) {
  const double side = 2 * mark.radius;
  const Eigen::Vector2d light = mark.outline[0] + side * Eigen::Vector2d(paint::kLightX - 0.5, paint::kLightY - 0.5);
  const Owned<cairo_pattern_t> gradient(
      cairo_pattern_create_radial(light.x(), light.y(), 0, light.x(), light.y(), paint::kLightRadius * side),
      cairo_pattern_destroy);
  const auto stop = [&](double at, const Colour& colour) {
    cairo_pattern_add_color_stop_rgb(gradient.get(), at, colour[0], colour[1], colour[2]);
  };
  stop(0, paint::Bright(mark.colour));
  stop(paint::kLightMiddle, paint::Middle(mark.colour));
  stop(1, paint::Dark(mark.colour));
  cairo_set_source(canvas, gradient.get());
  cairo_fill_preserve(canvas);
}

void Paint(cairo_t* canvas, const Mark& mark) {
  cairo_new_path(canvas);
  if (mark.radius > 0) {
    cairo_arc(canvas, mark.outline[0].x(), mark.outline[0].y(), mark.radius, 0, 2 * std::numbers::pi);
  } else {
    for (const Eigen::Vector2d& p : mark.outline) cairo_line_to(canvas, p.x(), p.y());
  }
  cairo_close_path(canvas);
  if (mark.radius > 0) {
    FillBall(canvas, mark);
  } else {
    SetColour(canvas, mark.colour, mark.opacity);
    cairo_fill_preserve(canvas);
  }
  SetColour(canvas, ColourOf(paint::kInk), paint::kInkOpacity);
  cairo_stroke(canvas);
}

cairo_status_t Append(void* text, const unsigned char* bytes, unsigned count) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

std::string Png(const Drawing& drawing) {
  const Owned<cairo_surface_t> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(std::lround(drawing.size.x())),
                                 static_cast<int>(std::lround(drawing.size.y()))),
      cairo_surface_destroy);
  Require(cairo_surface_status(surface.get()));
  const Owned<cairo_t> canvas(cairo_create(surface.get()), cairo_destroy);
  SetColour(canvas.get(), ColourOf(paint::kPaper), 1);
  cairo_paint(canvas.get());
  cairo_set_line_width(canvas.get(), paint::kInkWidth);
  cairo_set_line_join(canvas.get(), CAIRO_LINE_JOIN_ROUND);
  for (const Mark& mark : drawing.marks) Paint(canvas.get(), mark);
  Require(cairo_status(canvas.get()));
  std::string bytes;
  Require(cairo_surface_write_to_png_stream(surface.get(), Append, &bytes));
  return bytes;
}

std::string CairoVersion() { return cairo_version_string(); }

}  // namespace islet
