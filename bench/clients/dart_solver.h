// islet's contact suite inside a DART world: a ConstraintSolver that takes the place of DART's boxed LCP. DART detects and moves.
//
//   world->setConstraintSolver(std::make_unique<islet::clients::DartSolver>(1));
//   world->getConstraintSolver()->setCollisionDetector(...);
//
//   each step  as in client_step.h, all contacts at once; DART's detector is asked again where they come to
//   contacts   DART's points, those still open too, with DART's mixing of coefficients; without names: islet finds again who is nearest
//   bodies     on free joints, or fixed: in a skeleton that is not mobile, or welded to the world. Written for DART 6.12, whose free joint
//              keeps the velocity in the world while it turns
//   errors     std::runtime_error that names the skeleton: other joints, other constraints than contacts, soft bodies
#pragma once

#include <dart/constraint/ConstraintSolver.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "bench/clients/client_step.h"
#include "parallel/worker_pool.h"

namespace islet::clients {

class DartSolver final : public dart::constraint::ConstraintSolver {
 public:
  explicit DartSolver(int threads);
  ~DartSolver() override;

  void setFromOtherConstraintSolver(const ConstraintSolver& other) override;

  const StepReport& report() const { return step_.report(); }  // of the last step

 private:
  class EveryStep;

  void solveConstrainedGroup(dart::constraint::ConstrainedGroup& group) override;
  void RefuseOthers() const;
  void AddBody(dart::dynamics::BodyNode* node);
  std::optional<Contact> ContactOf(const dart::collision::Contact& contact) const;
  bool AddFound();
  void HandBack();

  parallel::WorkerPool pool_;
  ClientStep step_;
  std::shared_ptr<EveryStep> every_step_;
  std::vector<dart::dynamics::FreeJoint*> joints_;  // of each body; null: fixed
  std::unordered_map<const dart::dynamics::BodyNode*, int> numbers_;
};

}  // namespace islet::clients
