#include "bench/clients/bullet_solver.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>

#include "bench/clients/undo_overlaps.h"

namespace islet::clients {
namespace {

Vector3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
btVector3 ToBullet(const Vector3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

Settings SuiteSettings(const Vector3& gravity_W) {
  Settings settings;
  settings.gravity = gravity_W;
  settings.freezing = Freezing::kOff;  // Bullet puts bodies to sleep, or nobody does
  return settings;
}

double RadiusOf(const btCollisionObject& object) {
  btVector3 centre;
  btScalar radius;
  object.getCollisionShape()->getBoundingSphere(centre, radius);
  return std::min<double>(radius + centre.length(), 1e6);
}

}  // namespace

BulletSolver::BulletSolver(const Vector3& gravity_W, int threads)
    : gravity_W_(gravity_W), pool_(threads), suite_(SuiteSettings(gravity_W), &pool_) {}

// The object's place in Bullet's world, which it keeps; fills its body at the first call of a step.
int BulletSolver::Number(const btCollisionObject* object) {
  const auto number = static_cast<size_t>(object->getWorldArrayIndex());
  if (number >= bodies_.size()) {
    Body absent;
    absent.removed = true;
    bodies_.resize(number + 1, absent);
    of_bullet_.resize(number + 1, nullptr);
  }
  Body& b = bodies_[number];
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
    b.kind = BodyKind::kDynamic;
    b.mass = 1 / rigid->getInvMass();
    b.inertia_B = FromBullet(rigid->getInvInertiaDiagLocal()).cwiseInverse().asDiagonal();
    b.force_W = FromBullet(rigid->getTotalForce()) - b.mass * gravity_W_;  // Bullet adds gravity to the forces
    b.torque_W = FromBullet(rigid->getTotalTorque());
    of_bullet_[number] = rigid;
  }
  return static_cast<int>(number);
}

void BulletSolver::AddContacts(const btPersistentManifold& manifold) {
  if (manifold.getNumContacts() == 0 || !manifold.getBody0()->hasContactResponse() ||
      !manifold.getBody1()->hasContactResponse())
    return;
  const int first = Number(manifold.getBody0()), second = Number(manifold.getBody1());
  if (!bodies_[first].Moves() && !bodies_[second].Moves()) return;
  for (int k = 0; k < manifold.getNumContacts(); ++k) {
    const btManifoldPoint& point = manifold.getContactPoint(k);
    Contact c;
    c.body_a = std::min(first, second);
    c.body_b = std::max(first, second);
    c.point_W = 0.5 * FromBullet(point.getPositionWorldOnA() + point.getPositionWorldOnB());
    c.normal_W = (first < second ? -1 : 1) *
                 FromBullet(point.m_normalWorldOnB).normalized();  // Bullet's points into its first body
    c.gap = point.getDistance();
    c.touches = Touches(c, bodies_);
    c.friction = point.m_combinedFriction;
    c.restitution = std::clamp<double>(point.m_combinedRestitution, 0, 1);
    contacts_.push_back(c);
  }
}

void BulletSolver::HandBack(double dt) {
  const std::span<const Twist> before = suite_.velocities_before_gravity();
  for (size_t i = 0; i < bodies_.size(); ++i) {
    btRigidBody* const rigid = of_bullet_[i];
    if (!rigid || bodies_[i].removed) continue;
    const Body& b = bodies_[i];
    const Vector3 shifted = b.position_W + 0.5 * dt * (before[i].linear_W - b.linear_velocity_W);
    const Quaternion& q = b.rotation_WB;
    btTransform pose;
    pose.setOrigin(ToBullet(shifted));
    pose.setRotation(btQuaternion(static_cast<btScalar>(q.x()), static_cast<btScalar>(q.y()),
                                  static_cast<btScalar>(q.z()), static_cast<btScalar>(q.w())));
    rigid->setWorldTransform(pose);
    rigid->setLinearVelocity(ToBullet(b.linear_velocity_W));
    rigid->setAngularVelocity(ToBullet(b.angular_velocity_W));
  }
}

btScalar BulletSolver::solveGroup(btCollisionObject** bodies, int num_bodies, btPersistentManifold** manifolds,
                                  int num_manifolds, btTypedConstraint**, int, const btContactSolverInfo& info,
                                  btIDebugDraw*, btDispatcher*) {
  for (Body& b : bodies_) b.removed = true;
  std::fill(of_bullet_.begin(), of_bullet_.end(), nullptr);
  contacts_.clear();
  for (int i = 0; i < num_bodies; ++i) Number(bodies[i]);
  for (int i = 0; i < num_manifolds; ++i) AddContacts(*manifolds[i]);
  std::stable_sort(contacts_.begin(), contacts_.end(), EarlierPair);
  UndoOverlaps(bodies_, contacts_, &scratch_, &suite_);
  suite_.Resolve(info.m_timeStep, bodies_, contacts_, &report_);
  HandBack(info.m_timeStep);
  return 0;
}

}  // namespace islet::clients
