// islet's contact suite inside a Bullet world: a btConstraintSolver that takes the place of Bullet's own. Bullet detects and moves.
//
//   btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
//   world.getSimulationIslandManager()->setSplitIslands(false);   // islet finds its own
//
//   each step  overlaps are undone by the smallest displacements (ContactSuite::Project), velocities are resolved, and poses shifted so that
//              Bullet, which moves bodies by their final velocities, moves them by the mean that islet asks for
//   contacts   Bullet's points, without names: islet finds again who is nearest. Joints are not resolved
//   sleeping   is Bullet's to switch off (DISABLE_DEACTIVATION)
#pragma once

#include <vector>

#include <BulletDynamics/ConstraintSolver/btConstraintSolver.h>

#include "engine/contact_suite.h"
#include "parallel/worker_pool.h"

namespace islet::clients {

class BulletSolver final : public btConstraintSolver {
 public:
  BulletSolver(const Vector3& gravity_W, int threads);

  btScalar solveGroup(btCollisionObject** bodies, int num_bodies, btPersistentManifold** manifolds, int num_manifolds,
                      btTypedConstraint** constraints, int num_constraints, const btContactSolverInfo& info,
                      btIDebugDraw* drawer, btDispatcher* dispatcher) override;
  void reset() override {}
  btConstraintSolverType getSolverType() const override { return BT_SEQUENTIAL_IMPULSE_SOLVER; }

  const StepReport& report() const { return report_; }  // of the last step

 private:
  int Number(const btCollisionObject* object);
  void AddContacts(const btPersistentManifold& manifold);
  void HandBack(double dt);

  Vector3 gravity_W_;
  parallel::WorkerPool pool_;
  ContactSuite suite_;
  std::vector<Body> bodies_;             // by Bullet's number in its world; what is not of the group is removed
  std::vector<btRigidBody*> of_bullet_;  // of those that move
  std::vector<Contact> contacts_, scratch_;
  StepReport report_;
};

}  // namespace islet::clients
