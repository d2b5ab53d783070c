#include "engine/geometry/face_clip.h"

#include <algorithm>
#include <limits>

#include "engine/geometry/narrow_phase.h"

namespace islet {
namespace {

// 31 bits: bodies' roles, faces, the two polygon sides that meet. Exact up to 128 faces of 127 sides; hulls beyond that
// may give two points of a pair the same number.
std::uint32_t FaceFeature(const ClipInput& input, int edge_in, int edge_out) {
  auto bits = [](int value, int count) { return static_cast<std::uint32_t>(value) & ((1u << count) - 1u); };
  return bits(input.reference_is_b, 1) << 30 | bits(input.reference_face, 7) << 23 |
         bits(input.incident_face, 7) << 16 | bits(edge_in, 8) << 8 | bits(edge_out, 8);
}

double CutSlack(const ClipInput& input) { return 1e-9 * input.size; }

}  // namespace

// Sutherland-Hodgman: keeps what lies behind the plane. Corners within the slack count as behind, so that faces whose
// sides coincide keep their own corners, and with them their features.
void FaceClip::Cut(const Vector3& on_plane, const Vector3& outward, double slack, int side) {
  const size_t count = polygon_.size();
  heights_.clear();
  bool inside = true;
  for (const Corner& corner : polygon_) {
    heights_.push_back(outward.dot(corner.point - on_plane));
    inside = inside && heights_.back() <= slack;
  }
  if (inside) return;
  scratch_.clear();
  for (size_t k = 0; k < count; ++k) {
    const size_t after = k + 1 < count ? k + 1 : 0;
    const Corner& here = polygon_[k];
    const double height = heights_[k], next_height = heights_[after];
    const bool in = height <= slack, next_in = next_height <= slack;
    if (in) scratch_.push_back(here);
    if (in == next_in) continue;
    const double t = std::clamp(height / (height - next_height), 0.0, 1.0);
    Corner crossing{here.point + t * (polygon_[after].point - here.point), here.edge_out, side};
    if (!in) std::swap(crossing.edge_in, crossing.edge_out);
    scratch_.push_back(crossing);
  }
  std::swap(polygon_, scratch_);
}

void FaceClip::Emit(const ClipInput& input, const Corner& corner, double gap, std::vector<Contact>* contacts) const {
  contacts->push_back(MakeContact(input.origin_W + corner.point - (0.5 * gap) * input.normal,
                                  input.reference_is_b ? Vector3(-input.normal) : input.normal, gap,
                                  FaceFeature(input, corner.edge_in, corner.edge_out)));
}

double FaceClip::Append(const ClipInput& input, std::vector<Contact>* contacts) {
  const int sides = input.num_reference;
  polygon_.clear();
  for (int k = 0; k < input.num_incident; ++k) {
    polygon_.push_back({input.incident[k], sides + (k > 0 ? k : input.num_incident) - 1, sides + k});
  }
  const double slack = CutSlack(input);
  for (int k = 0; k < sides && !polygon_.empty(); ++k) {
    const Vector3& from = input.reference[k];
    const Vector3& to = input.reference[k + 1 < sides ? k + 1 : 0];
    Cut(from, (to - from).cross(input.normal).normalized(), slack, k);
  }
  const Vector3& on_plane = input.reference[0];
  const size_t first = contacts->size();
  const double merge_square = slack * slack;
  double least = std::numeric_limits<double>::infinity();
  for (const Corner& corner : polygon_) {
    const double gap = input.normal.dot(corner.point - on_plane);
    if (gap > input.reach) continue;
    const Vector3 point = input.origin_W + corner.point - (0.5 * gap) * input.normal;
    const bool known = std::any_of(contacts->begin() + static_cast<std::ptrdiff_t>(first), contacts->end(),
                                   [&](const Contact& c) { return (c.point_W - point).squaredNorm() <= merge_square; });
    if (known) continue;
    Emit(input, corner, gap, contacts);
    least = std::min(least, gap);
  }
  return least;
}

double FaceClip::Outside(const ClipInput& input, const Vector3& point) {
  double outside = 0;
  for (int s = 0; s < input.num_reference; ++s) {
    const Vector3 &from = input.reference[s], &to = input.reference[s + 1 < input.num_reference ? s + 1 : 0];
    outside = std::max(outside, (to - from).cross(input.normal).normalized().dot(point - from));
  }
  return outside;
}

void FaceClip::AppendNearestCorners(const ClipInput& input, double highest, std::vector<Contact>* contacts) const {
  const auto gap = [&](int k) { return input.normal.dot(input.incident[k] - input.reference[0]); };
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < input.num_incident; ++k)
    if (gap(k) <= highest) least = std::min(least, Outside(input, input.incident[k]));
  for (int k = 0; k < input.num_incident; ++k)
    if (gap(k) <= highest && Outside(input, input.incident[k]) <= least + CutSlack(input))
      Emit(input, {input.incident[k], 255, input.num_reference + k}, gap(k), contacts);
}

bool FaceClip::AppendCornersBeside(const ClipInput& input, double highest, double beside,
                                   std::vector<Contact>* contacts) const {
  const size_t first = contacts->size();
  for (int k = 0; k < input.num_incident; ++k) {
    const Vector3& point = input.incident[k];
    const double gap = input.normal.dot(point - input.reference[0]);
    if (gap > highest) continue;
    const double outside = Outside(input, point);
    if (outside > CutSlack(input) && outside <= beside)
      Emit(input, {point, 255, input.num_reference + k}, gap, contacts);
  }
  return contacts->size() > first;
}

}  // namespace islet
