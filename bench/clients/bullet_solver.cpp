#include "bench/clients/bullet_solver.h"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <LinearMath/btAabbUtil2.h>
#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <stdexcept>
#include <string>

namespace islet::clients {
namespace {

Vector3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
btVector3 ToBullet(const Vector3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

btTransform ToBullet(const Vector3& position_W, const Quaternion& q) {
  return btTransform(btQuaternion(static_cast<btScalar>(q.x()), static_cast<btScalar>(q.y()),
                                  static_cast<btScalar>(q.z()), static_cast<btScalar>(q.w())),
                     ToBullet(position_W));
}

Settings SuiteSettings(const Vector3& gravity_W) {
  Settings settings;
  settings.gravity = gravity_W;
  settings.freezing = Freezing::kOff;  // Bullet puts bodies to sleep, or nobody does
  return settings;
}

// What the suite does not know of is refused, or it would be lost in silence.
void RequirePlain(const btRigidBody& rigid) {
  const auto refuse = [&](const char* what) {
    throw std::runtime_error("BulletSolver: body " + std::to_string(rigid.getWorldArrayIndex()) + " has a " + what);
  };
  const btVector3 all(1, 1, 1);
  if (!(rigid.getLinearFactor() == all)) refuse("linear factor");
  if (!(rigid.getAngularFactor() == all)) refuse("angular factor");
  if (rigid.getRollingFriction() != 0) refuse("rolling friction");
  if (rigid.getSpinningFriction() != 0) refuse("spinning friction");
}

double RadiusOf(const btCollisionObject& object) {
  btVector3 centre;
  btScalar radius;
  object.getCollisionShape()->getBoundingSphere(centre, radius);
  return std::min<double>(radius + centre.length(), 1e6);
}

}  // namespace

BulletSolver::BulletSolver(const Vector3& gravity_W, int threads, btOverlappingPairCache* near)
    : gravity_W_(gravity_W), near_(near), pool_(threads), step_(SuiteSettings(gravity_W), &pool_) {}

// The object's place in Bullet's world, which it keeps; fills its body at the first call of a step.
int BulletSolver::Number(const btCollisionObject* object) {
  const auto number = static_cast<size_t>(object->getWorldArrayIndex());
  if (number >= step_.bodies.size()) {
    Body absent;
    absent.removed = true;
    step_.bodies.resize(number + 1, absent);
    of_bullet_.resize(number + 1, nullptr);
  }
  Body& b = step_.bodies[number];
  if (!b.removed) return static_cast<int>(number);
  b = {};
  const btQuaternion q = object->getWorldTransform().getRotation();
  b.position_W = FromBullet(object->getWorldTransform().getOrigin());
  b.rotation_WB = Quaternion(q.w(), q.x(), q.y(), q.z()).normalized();
  b.radius = RadiusOf(*object);
  b.kind = object->isStaticObject() ? BodyKind::kFixed : BodyKind::kKinematic;
  auto* rigid = const_cast<btRigidBody*>(btRigidBody::upcast(object));
  if (rigid && !object->isStaticObject()) {
    b.linear_velocity_W = FromBullet(rigid->getLinearVelocity());
    b.angular_velocity_W = FromBullet(rigid->getAngularVelocity());
  }
  if (rigid && rigid->getInvMass() > 0 && !object->isStaticOrKinematicObject()) {
    RequirePlain(*rigid);
    b.kind = BodyKind::kDynamic;
    b.mass = 1 / rigid->getInvMass();
    b.inertia_B = FromBullet(rigid->getInvInertiaDiagLocal()).cwiseInverse().asDiagonal();
    b.force_W = FromBullet(rigid->getTotalForce()) - b.mass * gravity_W_;  // Bullet adds gravity to the forces
    b.torque_W = FromBullet(rigid->getTotalTorque());
    of_bullet_[number] = rigid;
  }
  return static_cast<int>(number);
}

void BulletSolver::ReadContacts(const btPersistentManifold& manifold, std::vector<Contact>* contacts) {
  const int first = Number(manifold.getBody0()), second = Number(manifold.getBody1());
  for (int k = 0; k < manifold.getNumContacts(); ++k) {
    const btManifoldPoint& point = manifold.getContactPoint(k);
    Contact c;
    c.body_a = std::min(first, second);
    c.body_b = std::max(first, second);
    c.point_W = 0.5 * FromBullet(point.getPositionWorldOnA() + point.getPositionWorldOnB());
    c.normal_W = (first < second ? -1 : 1) *
                 FromBullet(point.m_normalWorldOnB).normalized();  // Bullet's points into its first body
    c.gap = point.getDistance();
    c.friction = point.m_combinedFriction;
    c.restitution = std::clamp<double>(point.m_combinedRestitution, 0, 1);
    contacts->push_back(c);
  }
}

// Who may meet: by Bullet's broad phase, whose boxes are swept; without it by its manifolds, which compounds and meshes get only where
// their parts overlap. Who ignores the other meets nobody.
void BulletSolver::FindPairs(btPersistentManifold** manifolds, int num_manifolds) {
  pairs_.clear();
  const auto add = [&](const btCollisionObject* a, const btCollisionObject* b) {
    if (!a->hasContactResponse() || !b->hasContactResponse()) return;
    if (!a->checkCollideWith(b) || !b->checkCollideWith(a)) return;
    if (step_.bodies[Number(a)].Moves() || step_.bodies[Number(b)].Moves()) pairs_.emplace_back(a, b);
  };
  if (!near_) {
    for (int i = 0; i < num_manifolds; ++i) add(manifolds[i]->getBody0(), manifolds[i]->getBody1());
    return;
  }
  const btBroadphasePairArray& near = near_->getOverlappingPairArray();
  for (int i = 0; i < near.size(); ++i)
    add(static_cast<const btCollisionObject*>(near[i].m_pProxy0->m_clientObject),
        static_cast<const btCollisionObject*>(near[i].m_pProxy1->m_clientObject));
}

// Whether two bodies meet unseen in the step as it was resolved.
bool BulletSolver::AddFound(double dt, btDispatcher* dispatcher) {
  btDispatcherInfo how;
  how.m_timeStep = static_cast<btScalar>(dt);
  for (size_t i = 0; i < of_bullet_.size(); ++i)
    if (of_bullet_[i])
      of_bullet_[i]->setWorldTransform(ToBullet(step_.bodies[i].position_W, step_.bodies[i].rotation_WB));
  found_.clear();
  for (const auto& [a, b] : pairs_) {
    if (!step_.MovesFar(a->getWorldArrayIndex()) && !step_.MovesFar(b->getWorldArrayIndex())) continue;
    btVector3 low_a, high_a, low_b, high_b;
    a->getCollisionShape()->getAabb(a->getWorldTransform(), low_a, high_a);
    b->getCollisionShape()->getAabb(b->getWorldTransform(), low_b, high_b);
    if (!TestAabbAgainstAabb2(low_a, high_a, low_b, high_b)) continue;
    const btCollisionObjectWrapper one(nullptr, a->getCollisionShape(), a, a->getWorldTransform(), -1, -1);
    const btCollisionObjectWrapper other(nullptr, b->getCollisionShape(), b, b->getWorldTransform(), -1, -1);
    btCollisionAlgorithm* const algorithm =
        dispatcher->findAlgorithm(&one, &other, nullptr, BT_CONTACT_POINT_ALGORITHMS);
    btManifoldResult result(&one, &other);
    result.setPersistentManifold(nullptr);
    algorithm->processCollision(&one, &other, how, &result);
    btManifoldArray manifolds;  // a compound has one a child
    algorithm->getAllContactManifolds(manifolds);
    for (int k = 0; k < manifolds.size(); ++k) ReadContacts(*manifolds[k], &found_);
    algorithm->~btCollisionAlgorithm();
    dispatcher->freeCollisionAlgorithm(algorithm);
  }
  bool any = false;
  for (const Contact& c : found_) any = step_.AddFound(c) || any;
  return any;
}

// Bullet now moves by dt v and turns in its own way by w: poses are set back by that from where they are to be.
void BulletSolver::HandBack(double dt) {
  for (size_t i = 0; i < of_bullet_.size(); ++i) {
    btRigidBody* const rigid = of_bullet_[i];
    if (!rigid) continue;
    const Body& b = step_.bodies[i];
    btTransform moved;
    btTransformUtil::integrateTransform(btTransform::getIdentity(), ToBullet(b.linear_velocity_W),
                                        ToBullet(b.angular_velocity_W), static_cast<btScalar>(dt), moved);
    const btTransform place = ToBullet(b.position_W - FromBullet(moved.getOrigin()), b.rotation_WB);
    rigid->setWorldTransform(btTransform(moved.getRotation().inverse() * place.getRotation(), place.getOrigin()));
    rigid->setLinearVelocity(ToBullet(b.linear_velocity_W));
    rigid->setAngularVelocity(ToBullet(b.angular_velocity_W));
  }
}

btScalar BulletSolver::solveGroup(btCollisionObject** bodies, int num_bodies, btPersistentManifold** manifolds,
                                  int num_manifolds, btTypedConstraint**, int, const btContactSolverInfo& info,
                                  btIDebugDraw*, btDispatcher* dispatcher) {
  if (num_bodies == 0) return 0;  // Bullet asks once more when it is done with its islands
  step_.Begin(info.m_timeStep, gravity_W_);
  of_bullet_.clear();
  for (int i = 0; i < num_bodies; ++i) Number(bodies[i]);
  for (int i = 0; i < num_manifolds; ++i) {
    const btCollisionObject *a = manifolds[i]->getBody0(), *b = manifolds[i]->getBody1();
    if (!a->hasContactResponse() || !b->hasContactResponse()) continue;
    if (!step_.bodies[Number(a)].Moves() && !step_.bodies[Number(b)].Moves()) continue;
    ReadContacts(*manifolds[i], &step_.contacts);
  }
  FindPairs(manifolds, num_manifolds);
  step_.UndoOverlaps();
  step_.Resolve();
  for (int round = 0; round < kRounds && AddFound(info.m_timeStep, dispatcher); ++round) step_.Resolve();
  HandBack(info.m_timeStep);
  return 0;
}

}  // namespace islet::clients
