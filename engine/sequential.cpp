#include "engine/sequential.h"

#include <numeric>

namespace islet {
namespace {

BounceBody MakeBounceBody(const Body& body) {
  BounceBody out;
  out.position_W = body.position_W;
  out.linear_velocity_W = body.linear_velocity_W;
  out.angular_velocity_W = body.angular_velocity_W;
  if (body.kind == BodyKind::kDynamic) {
    out.inverse_mass = 1 / body.mass;
    out.inverse_inertia_W = body.InverseInertiaW();
  }
  return out;
}

}  // namespace

int BounceLimit(int setting, int num_bodies, int num_contacts) {
  if (setting != kAutoBounceLimit) return setting;
  return num_bodies < 50 ? num_bodies : num_contacts / 10;
}

void SequentialResolver::Load(std::span<const int> group_bodies, std::span<const int> group_contacts,
                              const ContactFrames& contacts, std::span<const Body> bodies) {
  if (local_.size() < bodies.size()) local_.resize(bodies.size(), -1);
  locals_.clear();
  for (const int number : group_bodies) {
    local_[number] = static_cast<int>(locals_.size());
    locals_.push_back(MakeBounceBody(bodies[number]));
  }
  const auto place = [&](int number) {
    if (local_[number] >= 0) return local_[number];
    locals_.push_back(MakeBounceBody(bodies[number]));  // a wall: one copy per contact, it never changes
    return static_cast<int>(locals_.size()) - 1;
  };
  sides_.clear();
  for (const int number : group_contacts) {
    const Contact& contact = contacts.contacts[number];
    const int a = place(contact.body_a);
    sides_.emplace_back(a, place(contact.body_b));
  }
  touch_start_.assign(locals_.size() + 1, 0);
  for (const auto& [a, b] : sides_) ++touch_start_[a + 1], ++touch_start_[b + 1];
  std::partial_sum(touch_start_.begin(), touch_start_.end(), touch_start_.begin());
  touches_.resize(2 * sides_.size());
  for (size_t c = sides_.size();
       c-- > 0;) {  // filled from the back; touch_start_ ends one step early and is shifted below
    touches_[--touch_start_[sides_[c].first + 1]] = static_cast<int>(c);
    touches_[--touch_start_[sides_[c].second + 1]] = static_cast<int>(c);
  }
  touch_start_.erase(touch_start_.begin());
  touch_start_.push_back(static_cast<int>(touches_.size()));
  for (const int number : group_bodies) local_[number] = -1;
}

double SequentialResolver::NormalVelocityOf(int c, const Contact& contact) const {
  const auto& [a, b] = sides_[c];
  return contact.normal_W.dot(locals_[b].VelocityAt(contact.point_W) - locals_[a].VelocityAt(contact.point_W));
}

int SequentialResolver::Resolve(std::span<const int> group_bodies, std::span<const int> group_contacts,
                                const ContactFrames& contacts, const Settings& settings, double threshold,
                                std::span<Body> bodies, std::span<Vector3> impulses) {
  const int limit = BounceLimit(settings.bounce_limit, static_cast<int>(group_bodies.size()),
                                static_cast<int>(group_contacts.size()));
  if (limit == 0 || group_contacts.empty()) return 0;
  Load(group_bodies, group_contacts, contacts, bodies);
  keys_.resize(group_contacts.size());
  for (size_t c = 0; c < keys_.size(); ++c)
    keys_[c] = NormalVelocityOf(static_cast<int>(c), contacts.contacts[group_contacts[c]]);
  queue_.Assign(keys_);
  int bounces = 0;
  for (; bounces < limit && queue_.top_key() < -threshold; ++bounces) {
    const int c = queue_.top(), number = group_contacts[c];
    const Contact& contact = contacts.contacts[number];
    const Matrix3& frame = contacts.frames[number];
    const auto [a, b] = sides_[c];
    const Vector3 impulse = BounceImpulse(locals_[a], locals_[b], contact, frame, settings.bounce_law);
    impulses[number] += impulse;
    locals_[a].ApplyImpulse(-(frame * impulse), contact.point_W);
    locals_[b].ApplyImpulse(frame * impulse, contact.point_W);
    for (const int side : {a, b}) {
      if (locals_[side].inverse_mass == 0) continue;
      for (int t = touch_start_[side]; t < touch_start_[side + 1]; ++t)
        queue_.Update(touches_[t], NormalVelocityOf(touches_[t], contacts.contacts[group_contacts[touches_[t]]]));
    }
  }
  for (size_t i = 0; i < group_bodies.size() && bounces > 0; ++i) {
    bodies[group_bodies[i]].linear_velocity_W = locals_[i].linear_velocity_W;
    bodies[group_bodies[i]].angular_velocity_W = locals_[i].angular_velocity_W;
  }
  return bounces;
}

}  // namespace islet
