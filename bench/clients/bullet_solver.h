// islet's contact suite inside a Bullet world: a btConstraintSolver that takes the place of Bullet's own. Bullet detects and moves.
//
//   btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
//   world.getSimulationIslandManager()->setSplitIslands(false);   // islet finds its own
//
//   each step  as in client_step.h; Bullet's narrow phase is asked again, for the pairs of its broad phase, where bodies come to
//   contacts   Bullet's points, without names: islet finds again who is nearest. Joints are not resolved
//   refused    by std::runtime_error: linear and angular factors, rolling and spinning friction
//   sleeping   is Bullet's to switch off (DISABLE_DEACTIVATION)
#pragma once

#include <utility>
#include <vector>

#include <BulletDynamics/ConstraintSolver/btConstraintSolver.h>

#include "bench/clients/client_step.h"
#include "parallel/worker_pool.h"

class btOverlappingPairCache;

namespace islet::clients {

class BulletSolver final : public btConstraintSolver {
 public:
  // near: the pairs of the world's broad phase, broadphase.getOverlappingPairCache(); null: those that have manifolds alone.
  BulletSolver(const Vector3& gravity_W, int threads, btOverlappingPairCache* near);

  btScalar solveGroup(btCollisionObject** bodies, int num_bodies, btPersistentManifold** manifolds, int num_manifolds,
                      btTypedConstraint** constraints, int num_constraints, const btContactSolverInfo& info,
                      btIDebugDraw* drawer, btDispatcher* dispatcher) override;
  void reset() override {}
  btConstraintSolverType getSolverType() const override { return BT_SEQUENTIAL_IMPULSE_SOLVER; }

  const StepReport& report() const { return step_.report(); }  // of the last step

 private:
  int Number(const btCollisionObject* object);
  void ReadContacts(const btPersistentManifold& manifold, std::vector<Contact>* contacts);
  void FindPairs(btPersistentManifold** manifolds, int num_manifolds);
  bool AddFound(double dt, btDispatcher* dispatcher);
  void HandBack(double dt);

  Vector3 gravity_W_;
  btOverlappingPairCache* near_;
  parallel::WorkerPool pool_;
  ClientStep step_;  // its bodies by Bullet's number in its world; what is not of the group is removed
  std::vector<btRigidBody*> of_bullet_;  // of those that move
  std::vector<std::pair<const btCollisionObject*, const btCollisionObject*>> pairs_;
  std::vector<Contact> found_;
};

}  // namespace islet::clients
