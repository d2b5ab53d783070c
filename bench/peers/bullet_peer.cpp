// Bullet: btDiscreteDynamicsWorld, dynamic AABB trees. Lines: SI (sequential impulses, the default), NNCG, Dantzig (the
// direct MLCP solver; with it one island per batch, as Bullet's documentation asks), islet (our contact suite as its solver). Default: 10 iterations at 1/60 s.
//
// Bullet multiplies the coefficients of two bodies, so each gets the root. Damping is 0 by default. The collision margin
// (4 cm, inside the box; around a hull, where it would hold wedges apart: 1 mm there) and the restitution threshold (0.2 m/s)
// are Bullet's defaults. Debian has Bullet in float and in double; this file is compiled for each. A body that is pushed is
// woken, as Bullet asks of whoever applies a force.
#include <btBulletDynamicsCommon.h>

#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>
#include <BulletDynamics/ConstraintSolver/btNNCGConstraintSolver.h>
#include <BulletDynamics/MLCPSolvers/btDantzigSolver.h>
#include <BulletDynamics/MLCPSolvers/btMLCPSolver.h>

#include <cmath>

#include "bench/clients/bullet_solver.h"
#include "bench/peers/peer.h"
#include "bench/peers/sweeps.h"

namespace islet::peers {
namespace {

constexpr btScalar kHullMargin = btScalar(0.001);  // [m] Bullet puts it around a hull, and 4 cm by default

btScalar Real(double value) { return static_cast<btScalar>(value); }
btVector3 ToBullet(const Vector3& v) { return {Real(v.x()), Real(v.y()), Real(v.z())}; }
Vector3 FromBullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

class BulletPeer final : public Peer {
 public:
  BulletPeer(const WorldPlan& plan, const Setting& setting) {
    if (setting.solver == "NNCG") {
      solver_ = std::make_unique<btNNCGConstraintSolver>();
    } else if (setting.solver == "Dantzig") {
      direct_ = std::make_unique<btDantzigSolver>();
      solver_ = std::make_unique<btMLCPSolver>(direct_.get());
    } else if (setting.solver == "islet") {
      solver_ = std::make_unique<clients::BulletSolver>(plan.gravity, 1, broadphase_.getOverlappingPairCache());
    } else {
      solver_ = std::make_unique<btSequentialImpulseConstraintSolver>();
    }
    dispatcher_ = std::make_unique<btCollisionDispatcher>(&configuration_);
    world_ = std::make_unique<btDiscreteDynamicsWorld>(dispatcher_.get(), &broadphase_, solver_.get(), &configuration_);
    world_->setGravity(ToBullet(plan.gravity));
    if (setting.iterations > 0) world_->getSolverInfo().m_numIterations = setting.iterations;
    if (setting.solver == "islet") world_->getSimulationIslandManager()->setSplitIslands(false);
    if (setting.solver == "Dantzig") world_->getSolverInfo().m_minimumSolverBatchSize = 1;
    for (const BodyPlan& body : plan.bodies) Add(plan, body, setting.sleeping);
  }

  ~BulletPeer() override {
    for (const auto& body : bodies_) world_->removeRigidBody(body.get());
  }

  void Step(double dt) override {
    for (const auto& [body, push] : pushed_) {
      body->activate();  // a force does not wake a body
      body->applyCentralForce(push);
    }
    world_->stepSimulation(Real(dt), 0);
  }

  State Read(int number) const override {
    const btRigidBody& body = *bodies_[number];
    const btQuaternion q = body.getWorldTransform().getRotation();
    return {FromBullet(body.getWorldTransform().getOrigin()), Quaternion(q.w(), q.x(), q.y(), q.z()),
            FromBullet(body.getLinearVelocity()), FromBullet(body.getAngularVelocity())};
  }

  int Contacts() const override {
    int points = 0;
    for (int i = 0; i < dispatcher_->getNumManifolds(); ++i) {
      points += dispatcher_->getManifoldByIndexInternal(i)->getNumContacts();
    }
    return points;
  }

 private:
  void Add(const WorldPlan& plan, const BodyPlan& body, bool sleeping) {
    if (body.form == BodyPlan::Form::kBox) {
      shapes_.push_back(std::make_unique<btBoxShape>(ToBullet(body.half_extents)));
    } else if (body.form == BodyPlan::Form::kHull) {
      auto hull = std::make_unique<btConvexHullShape>();
      for (const Vector3& corner : body.corners) hull->addPoint(ToBullet(corner));
      hull->setMargin(kHullMargin);
      hull->initializePolyhedralFeatures();  // faces are clipped, instead of one point found a step
      shapes_.push_back(std::move(hull));
    } else {
      shapes_.push_back(std::make_unique<btSphereShape>(Real(body.radius)));
    }
    btVector3 inertia(0, 0, 0);
    if (body.form == BodyPlan::Form::kHull) {
      inertia = ToBullet(body.Inertia());  // Bullet would take that of the box around it
    } else if (body.Moves()) {
      shapes_.back()->calculateLocalInertia(Real(body.mass), inertia);
    }
    btRigidBody::btRigidBodyConstructionInfo info(Real(body.mass), nullptr, shapes_.back().get(), inertia);
    const Quaternion& q = body.start.rotation_WB;
    info.m_startWorldTransform =
        btTransform(btQuaternion(Real(q.x()), Real(q.y()), Real(q.z()), Real(q.w())), ToBullet(body.start.position_W));
    info.m_friction = Real(std::sqrt(plan.friction));
    info.m_restitution = Real(std::sqrt(plan.restitution));
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    bodies_.back()->setLinearVelocity(ToBullet(body.start.linear_velocity_W));
    bodies_.back()->setAngularVelocity(ToBullet(body.start.angular_velocity_W));
    if (!sleeping) bodies_.back()->setActivationState(DISABLE_DEACTIVATION);
    world_->addRigidBody(bodies_.back().get());
    if (!body.push_W.isZero()) pushed_.emplace_back(bodies_.back().get(), ToBullet(body.push_W));
  }

  btDefaultCollisionConfiguration configuration_;
  btDbvtBroadphase broadphase_;
  std::unique_ptr<btCollisionDispatcher> dispatcher_;
  std::unique_ptr<btDantzigSolver> direct_;
  std::unique_ptr<btConstraintSolver> solver_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::unique_ptr<btDiscreteDynamicsWorld> world_;
  std::vector<std::pair<btRigidBody*, btVector3>> pushed_;
};

std::unique_ptr<Peer> Make(const WorldPlan& plan, const Setting& setting) {
  return std::make_unique<BulletPeer>(plan, setting);
}

}  // namespace

Engine TheEngine() {
  constexpr int kClientRates[] = {30, 60, 120, 240};
  constexpr int kRates[] = {30, 60, 120, 240, 480, 960}, kQuickRates[] = {60, 240};
  constexpr int kCounts[] = {5, 20, 50, 100, 200, 500}, kQuickCounts[] = {50};
#ifdef BT_USE_DOUBLE_PRECISION
  Engine engine{.name = "bullet64", .version = {}, .precision = "double", .settings = {}, .make = Make};
#else
  Engine engine{.name = "bullet", .version = {}, .precision = "float", .settings = {}, .make = Make};
#endif
  engine.version = std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
  AddTimeSteps({.solver = "SI", .iterations = 10, .sleeping = true, .is_default = true}, kRates, kQuickRates,
               &engine.settings);
  AddTimeSteps({.solver = "SI", .iterations = 10}, kRates, kQuickRates, &engine.settings);
  AddIterations({.solver = "SI"}, kCounts, kQuickCounts, &engine.settings);
  for (const int rate : {120, 240, 480}) {
    engine.settings.push_back({.solver = "SI", .sweep = "both", .dt = 1.0 / rate, .iterations = 50});
  }
  AddTimeSteps({.solver = "NNCG", .iterations = 10}, kRates, kQuickRates, &engine.settings);
  if (engine.precision == "float") AddIterations({.solver = "NNCG"}, kCounts, {}, &engine.settings);
  AddTimeSteps({.solver = "Dantzig"}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "islet"}, kClientRates, kQuickRates, &engine.settings);
  return engine;
}

}  // namespace islet::peers
