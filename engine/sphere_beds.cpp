#include "engine/sphere_beds.h"

#include <numeric>

#include "engine/passing.h"
#include "engine/suite_frame.h"

namespace islet {

void SphereBeds::Find(bool any, std::span<const Contact> contacts, std::span<const Body> bodies,
                      std::span<const Shape> shapes) {
  any_ = any;
  if (!any) return;
  bodies_ = bodies;
  shapes_ = shapes;
  const auto lies = [&](const Contact& c, int body) {
    return shapes[body].kind() == ShapeKind::kSphere && c.gap < 0 && bodies[body].Moves();
  };
  start_.assign(bodies.size() + 1, 0);
  for (const Contact& c : contacts)
    for (const int i : {c.body_a, c.body_b}) start_[i + 1] += lies(c, i);
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  beds_.resize(start_.back());
  for (auto c = contacts.rbegin(); c != contacts.rend(); ++c)  // from the back, so that starts end as starts
    for (const int i : {c->body_a, c->body_b})
      if (lies(*c, i)) beds_[--start_[i + 1]] = *c;
  start_.erase(start_.begin());
  start_.push_back(static_cast<int>(beds_.size()));
}

bool SphereBeds::Passes(double dt, std::span<const Vector3> linear, Contact* contact) const {
  if (!any_) return false;
  const auto traveller = [&](int i) -> Traveller {
    if (StandsStill(bodies_[i])) return {bodies_[i], shapes_[i], Vector3::Zero(), Vector3::Zero()};
    return {bodies_[i], shapes_[i], linear.empty() ? Vector3(dt * bodies_[i].linear_velocity_W) : linear[i],
            dt * bodies_[i].angular_velocity_W};
  };
  const int a = contact->body_a, b = contact->body_b;
  const int sphere = shapes_[b].kind() == ShapeKind::kSphere ? b : a;
  if (shapes_[sphere].kind() != ShapeKind::kSphere) return false;
  const std::span<const Contact> own(beds_.data() + start_[sphere], beds_.data() + start_[sphere + 1]);
  return PassesBy(traveller(a), traveller(b), own, contact);
}

}  // namespace islet
