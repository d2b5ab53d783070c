// What the client for Bullet takes from its world.
#include <gtest/gtest.h>

#include <btBulletDynamicsCommon.h>

#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>

#include "bench/clients/bullet_solver.h"

namespace islet::clients {
namespace {

// A ball at 60 m/s meets another, in two worlds: the host lets them meet, or has one ignore the other.
TEST(BulletBodies, WhoIgnoresTheOtherIsNotMet) {
  for (const bool ignore : {false, true}) {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    BulletSolver solver(Vector3::Zero(), 1, broadphase.getOverlappingPairCache());
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity({0, 0, 0});
    world.getSimulationIslandManager()->setSplitIslands(false);
    btSphereShape ball(0.5);
    const btVector3 inertia = btVector3(1, 1, 1) / 10;
    btRigidBody moving(1, nullptr, &ball, inertia), hit(1, nullptr, &ball, inertia);
    moving.setWorldTransform(btTransform(btQuaternion::getIdentity(), {-1.5, 0, 0}));
    moving.setLinearVelocity({60, 0, 0});
    moving.setIgnoreCollisionCheck(&hit, ignore);
    world.addRigidBody(&moving);
    world.addRigidBody(&hit);
    for (int step = 0; step < 6; ++step) world.stepSimulation(1.0 / 60, 0);
    if (ignore)
      EXPECT_EQ(moving.getLinearVelocity().x(), 60);
    else
      EXPECT_LT(moving.getLinearVelocity().x(), 59);
    world.removeRigidBody(&moving);
    world.removeRigidBody(&hit);
  }
}

}  // namespace
}  // namespace islet::clients
