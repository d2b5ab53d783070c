// islet's contact suite inside a DART world: a ConstraintSolver that takes the place of DART's boxed LCP. DART detects and moves.
//
//   world->setConstraintSolver(std::make_unique<islet::clients::DartSolver>(1));
//   world->getConstraintSolver()->setCollisionDetector(...);
//
//   each step  overlaps are undone by the smallest displacements (ContactSuite::Project), velocities are resolved all at once, and poses
//              set so that DART, which moves bodies by their final velocities, moves them by the mean that islet asks for
//   contacts   DART's points, those still open too, with DART's mixing of coefficients; without names: islet finds again who is nearest
//   bodies     on free joints, or fixed: in a skeleton that is not mobile, or welded to the world. Written for DART 6.12, whose free joint
//              keeps the velocity in the world while it turns
//   errors     std::runtime_error that names the skeleton: other joints, other constraints than contacts, soft bodies
#pragma once

#include <dart/constraint/ConstraintSolver.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <unordered_map>
#include <vector>

#include "engine/contact_suite.h"
#include "parallel/worker_pool.h"

namespace islet::clients {

class DartSolver final : public dart::constraint::ConstraintSolver {
 public:
  explicit DartSolver(int threads);

  void setFromOtherConstraintSolver(const ConstraintSolver& other) override;

  const StepReport& report() const { return report_; }  // of the last step

 private:
  class EveryStep;

  void solveConstrainedGroup(dart::constraint::ConstrainedGroup& group) override;
  void RefuseOthers() const;
  void AddBody(dart::dynamics::BodyNode* node);
  void AddContact(const dart::collision::Contact& contact);
  void HandBack();

  parallel::WorkerPool pool_;
  ContactSuite suite_;
  Vector3 gravity_W_ = Vector3::Zero();  // of the first skeleton; what others have besides counts as a force
  std::vector<Body> bodies_;
  std::vector<dart::dynamics::FreeJoint*> joints_;  // of each body; null: fixed
  std::unordered_map<const dart::dynamics::BodyNode*, int> numbers_;
  std::vector<Contact> contacts_, scratch_;
  StepReport report_;
};

}  // namespace islet::clients
