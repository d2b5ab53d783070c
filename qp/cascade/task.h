// One island's problem, and what is asked of its answer: what all strategies of the cascade share.
#pragma once

#include <algorithm>
#include <span>

#include "qp/problem.h"
#include "qp/settings.h"

namespace islet::qp {

struct Task {
  const Problem& problem;
  const Settings& settings;
  std::span<const Vector3> start;     // impulses to begin with, one per contact, or empty
  const std::vector<double>& scales;  // rho of the natural map, per contact; empty where only the closed form is asked
  double scale() const { return settings.velocity_scale; }
  double goal() const { return settings.tolerance * settings.velocity_scale; }  // of the natural map
  bool coulomb() const { return settings.model == Model::kCoulomb; }
};

inline constexpr int kSmallIsland = 32;  // bodies: up to them an answer is as good as iterations get
inline bool IsSmall(const Problem& problem) { return problem.num_bodies() <= kSmallIsland; }

inline bool AllZero(std::span<const Vector3> impulses) {
  return std::all_of(impulses.begin(), impulses.end(), [](const Vector3& j) { return j.isZero(0); });
}

inline bool AnyCompliance(const Problem& problem) {
  return std::any_of(problem.contacts.begin(), problem.contacts.end(), [](const auto& c) { return c.compliance > 0; });
}

// The kinetic model differs from the convex one only where something bounces.
inline bool IsConvex(const Task& task) {
  return task.settings.model != Model::kKinetic ||
         std::none_of(task.problem.contacts.begin(), task.problem.contacts.end(),
                      [](const auto& c) { return c.target > 0; });
}

// Without friction the models are one, unless something bounces in the kinetic one: exact friction with mu = 0.
inline bool IsExactFriction(const Task& task) {
  const bool rubs = std::any_of(task.problem.contacts.begin(), task.problem.contacts.end(),
                                [](const auto& c) { return c.friction > 0; });
  return rubs ? task.coulomb() && task.settings.cone == Cone::kCircular : IsConvex(task);
}

}  // namespace islet::qp
