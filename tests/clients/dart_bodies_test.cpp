// What the client for DART takes and refuses.
#include <gtest/gtest.h>

#include <dart/collision/bullet/BulletCollisionDetector.hpp>
#include <dart/constraint/BoxedLcpConstraintSolver.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/BoxShape.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/simulation/World.hpp>
#include <stdexcept>
#include <string>

#include "bench/clients/dart_solver.h"

namespace islet::clients {
namespace {

using namespace dart::dynamics;

dart::simulation::WorldPtr WorldOf(const SkeletonPtr& skeleton) {
  auto world = dart::simulation::World::create();
  world->setTimeStep(1.0 / 60);
  world->setConstraintSolver(std::make_unique<DartSolver>(1));
  world->getConstraintSolver()->setCollisionDetector(dart::collision::BulletCollisionDetector::create());
  world->addSkeleton(skeleton);
  return world;
}

TEST(DartBodies, OtherJointsAreRefusedByName) {
  const SkeletonPtr door = Skeleton::create("door");
  door->createJointAndBodyNodePair<RevoluteJoint>();
  const auto world = WorldOf(door);
  try {
    world->step();
    FAIL() << "a hinge was taken";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("'door'"), std::string::npos) << error.what();
  }
}

// The centre of mass beside the body's origin, full inertia: it flies on a parabola while the body spins, and angular momentum is kept.
TEST(DartBodies, CentreOfMassOffTheOrigin) {
  const SkeletonPtr skeleton = Skeleton::create("hammer");
  const auto [joint, node] = skeleton->createJointAndBodyNodePair<FreeJoint>();
  node->setInertia(Inertia(2, Vector3(0.3, -0.1, 0.2), Vector3(1, 2, 2.5).asDiagonal()));
  joint->setAngularVelocity(Vector3(1, 2, 3));
  joint->setLinearVelocity(Vector3(1, 0, 5));
  const auto world = WorldOf(skeleton);
  const auto momentum = [&node = node]() -> Vector3 {
    const Matrix3 rotation = node->getTransform().linear();
    return rotation * node->getInertia().getMoment() * rotation.transpose() * node->getAngularVelocity();
  };
  const Vector3 start = node->getCOM(), velocity = node->getCOMLinearVelocity(), angular = momentum();
  for (int step = 0; step < 60; ++step) world->step();
  EXPECT_LT((node->getCOM() - (start + velocity + 0.5 * Vector3(0, 0, -9.81))).norm(), 1e-9);
  EXPECT_LT((momentum() - angular).norm(), 1e-9);
}

// Another solver takes the world over, then DART's own.
TEST(DartBodies, SolversAreReplaced) {
  const SkeletonPtr skeleton = Skeleton::create("ball");
  const auto [joint, node] = skeleton->createJointAndBodyNodePair<FreeJoint>();
  const auto world = WorldOf(skeleton);
  world->step();
  world->setConstraintSolver(std::make_unique<DartSolver>(2));
  world->step();
  EXPECT_NE(dynamic_cast<DartSolver*>(world->getConstraintSolver()), nullptr);
  world->setConstraintSolver(std::make_unique<dart::constraint::BoxedLcpConstraintSolver>());
  for (int step = 2; step < 60; ++step) world->step();
  EXPECT_NEAR(node->getCOMLinearVelocity().z(), -9.81, 1e-9);
}

// A force of DART's own, applied for one step at a time, reaches the suite.
TEST(DartBodies, ForcesAreHandedOn) {
  const SkeletonPtr skeleton = Skeleton::create("pushed");
  const auto [joint, node] = skeleton->createJointAndBodyNodePair<FreeJoint>();
  node->setInertia(Inertia(2, Vector3(0.1, 0, 0), Vector3(1, 2, 2.5).asDiagonal()));
  joint->setAngularVelocity(Vector3(0.5, 0, 1));
  const auto world = WorldOf(skeleton);
  const Vector3 velocity = node->getCOMLinearVelocity();
  for (int step = 0; step < 60; ++step) {
    node->addExtForce(Vector3(4, 0, 2 * 9.81), node->getLocalCOM(), false, true);
    world->step();
  }
  EXPECT_LT((node->getCOMLinearVelocity() - velocity - Vector3(2, 0, 0)).norm(), 1e-9);
}

}  // namespace
}  // namespace islet::clients
