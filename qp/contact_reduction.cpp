#include "qp/contact_reduction.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

constexpr double kSame = 1e-12;  // of the Jacobians' size: what is a rounding error

const Jacobian& Side(const ContactTerm& contact, int side) {
  return side == 0 ? contact.jacobian_a : contact.jacobian_b;
}

// Whether two contacts have the same bodies and axes: only their lever arms may differ.
bool SameFace(const ContactTerm& c, const ContactTerm& d) {
  if (c.body_a != d.body_a || c.body_b != d.body_b || c.friction != d.friction) return false;
  for (int side = 0; side < 2; ++side)
    if (!(Side(c, side).leftCols<3>() - Side(d, side).leftCols<3>()).isZero(kSame)) return false;
  return true;
}

// Twice the area of the triangle.
template <typename Point>
double Turn(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

}  // namespace

bool ContactReduction::Reduce(const Problem& problem) {
  const int nc = problem.num_contacts();
  place_.assign(nc, 0);
  combinations_.resize(nc);
  for (int first = 0, last; first < nc; first = last) {
    for (last = first + 1; last < nc && SameFace(problem.contacts[first], problem.contacts[last]);) ++last;
    if (last - first > 1) ReduceFace(problem, first, last);
  }
  if (std::none_of(place_.begin(), place_.end(), [](int place) { return place < 0; })) return false;
  reduced_.bodies = problem.bodies;
  reduced_.contacts.clear();
  for (int c = 0; c < nc; ++c) {
    if (place_[c] < 0) continue;
    place_[c] = reduced_.num_contacts();
    reduced_.contacts.push_back(problem.contacts[c]);
  }
  return true;
}

// Contacts first .. last - 1 have the same bodies and axes.
void ContactReduction::ReduceFace(const Problem& problem, int first, int last) {
  const ContactTerm& shown = problem.contacts[first];
  const int side = shown.body_b >= 0 ? 1 : 0;
  const Vector3 axes[2] = {Side(shown, side).row(1).head<3>().transpose(),
                           Side(shown, side).row(2).head<3>().transpose()};
  points_.clear();
  for (int c = first; c < last; ++c) {
    const Vector3 lever = Side(problem.contacts[c], side).row(0).tail<3>().transpose();
    points_.push_back({lever.dot(axes[0]), lever.dot(axes[1]), c});
  }
  FindHull();
  for (const Point& point : points_) {
    const bool corner =
        std::any_of(hull_.begin(), hull_.end(), [&](const Point& p) { return p.contact == point.contact; });
    if (!corner && Combine(problem, point, &combinations_[point.contact])) place_[point.contact] = -1;
  }
}

// Andrew's monotone chain, without points on edges and without twins. Leaves points_ sorted.
void ContactReduction::FindHull() {
  std::sort(points_.begin(), points_.end(), [](const Point& a, const Point& b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.contact < b.contact;
  });
  hull_.clear();
  const auto add = [&](const Point& point, size_t base) {
    while (hull_.size() > base + 1 && Turn(hull_[hull_.size() - 2], hull_.back(), point) <= 0) hull_.pop_back();
    hull_.push_back(point);
  };
  for (const Point& point : points_) add(point, 0);
  const size_t base = hull_.size() - 1;
  for (size_t i = points_.size() - 1; i-- > 0;) add(points_[i], base);
  if (hull_.size() > 1) hull_.pop_back();  // the first once more
  if (hull_.size() == 2 && hull_[0].x == hull_[1].x && hull_[0].y == hull_[1].y) hull_.pop_back();  // all are twins
}

// Of the triangles of the hull's fan the one that the point lies deepest in, and what that leaves of the contact.
bool ContactReduction::Combine(const Problem& problem, const Point& point, Combination* combination) const {
  double deepest = -INFINITY;
  const auto offer = [&](const Point& a, const Point& b, const Point& c, const std::array<double, 3>& weights) {
    const double depth = *std::min_element(weights.begin(), weights.end());
    if (!(depth > deepest)) return;
    deepest = depth;
    *combination = {{a.contact, b.contact, c.contact}, weights};
  };
  for (size_t k = 1; k + 1 < hull_.size(); ++k) {
    const Point &a = hull_[0], &b = hull_[k], &c = hull_[k + 1];
    const double area = Turn(a, b, c);
    if (area > 0) offer(a, b, c, {Turn(point, b, c) / area, Turn(a, point, c) / area, Turn(a, b, point) / area});
  }
  if (hull_.size() == 2) {  // on a line
    const double x = hull_[1].x - hull_[0].x, y = hull_[1].y - hull_[0].y;
    const double along = ((point.x - hull_[0].x) * x + (point.y - hull_[0].y) * y) / (x * x + y * y);
    offer(hull_[0], hull_[1], hull_[1], {1 - along, along, 0});
  }
  if (hull_.size() == 1) offer(hull_[0], hull_[0], hull_[0], {1, 0, 0});
  if (!(deepest >= -kSame)) return false;
  for (double& weight : combination->weights) weight = std::max(0.0, weight);
  const ContactTerm& contact = problem.contacts[point.contact];
  Jacobian left[2] = {contact.jacobian_a, contact.jacobian_b};
  Vector3 drift = contact.drift;
  double target = contact.target, size = 0;
  for (int k = 0; k < 3; ++k) {
    const ContactTerm& corner = problem.contacts[combination->corners[k]];
    for (int side = 0; side < 2; ++side) {
      left[side] -= combination->weights[k] * Side(corner, side);
      size = std::max(size, Side(corner, side).cwiseAbs().maxCoeff());
    }
    drift -= combination->weights[k] * corner.drift;
    target -= combination->weights[k] * corner.target;
  }
  const double speed = std::max({1e-300, contact.drift.norm(), std::abs(contact.target)});
  return contact.compliance == 0 && left[0].isZero(10 * kSame * size) && left[1].isZero(10 * kSame * size) &&
         drift.norm() <= 10 * kSame * speed && target <= 10 * kSame * speed;
}

void ContactReduction::Select(std::span<const Vector3> whole, std::vector<Vector3>* kept) const {
  kept->clear();
  if (whole.size() != place_.size()) return;
  for (size_t c = 0; c < whole.size(); ++c)
    if (place_[c] >= 0) kept->push_back(whole[c]);
}

void ContactReduction::Expand(const Solution& reduced, Solution* solution) const {
  solution->status = reduced.status;
  solution->velocities = reduced.velocities;
  solution->coulomb_reached = reduced.coulomb_reached;
  solution->rounds = reduced.rounds;
  solution->gap = reduced.gap;
  solution->impulses.assign(place_.size(), Vector3::Zero());
  solution->slips.assign(place_.size(), 0.0);
  for (size_t c = 0; c < place_.size(); ++c) {
    if (place_[c] < 0) continue;
    solution->impulses[c] = reduced.impulses[place_[c]];
    solution->slips[c] = reduced.slips[place_[c]];
  }
  for (size_t c = 0; c < place_.size(); ++c) {
    if (place_[c] >= 0) continue;
    for (int k = 0; k < 3; ++k)
      solution->slips[c] += combinations_[c].weights[k] * solution->slips[combinations_[c].corners[k]];
  }
}

}  // namespace islet::qp
