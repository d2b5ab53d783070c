// DART: one skeleton with a free joint a body, Bullet's collision detector (DART's manual advises it for boxes over its
// default, FCL). Lines: Dantzig (the default boxed LCP solver), PGS, islet (our contact suite as its solver). Default: 1 ms; 1/960 s stands for it.
//
// Friction is the smaller one of two bodies, restitution the product: bodies get the root of it. DART has no sleeping.
#include <cmath>
#include <dart/collision/bullet/BulletCollisionDetector.hpp>
#include <dart/config.hpp>
#include <dart/constraint/BoxedLcpConstraintSolver.hpp>
#include <dart/constraint/PgsBoxedLcpSolver.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/BoxShape.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/dynamics/SphereShape.hpp>
#include <dart/dynamics/WeldJoint.hpp>
#include <dart/simulation/World.hpp>

#include "bench/clients/dart_solver.h"
#include "bench/peers/peer.h"
#include "bench/peers/sweeps.h"

namespace islet::peers {
namespace {

constexpr int kMostContacts = 100000;  // DART's own default is 1000, too few for 100 cubes and silently so

class DartPeer final : public Peer {
 public:
  DartPeer(const WorldPlan& plan, const Setting& setting) : world_(dart::simulation::World::create()) {
    world_->setGravity(plan.gravity);
    world_->setTimeStep(setting.dt);
    if (setting.solver == "islet") world_->setConstraintSolver(std::make_unique<clients::DartSolver>(1));
    dart::constraint::ConstraintSolver* solver = world_->getConstraintSolver();
    solver->setCollisionDetector(dart::collision::BulletCollisionDetector::create());
    solver->getCollisionOption().maxNumContacts = kMostContacts;
    if (setting.solver == "PGS") {
      const auto pgs = std::make_shared<dart::constraint::PgsBoxedLcpSolver>();
      if (setting.iterations > 0) {
        auto option = pgs->getOption();
        option.mMaxIteration = setting.iterations;
        pgs->setOption(option);
      }
      static_cast<dart::constraint::BoxedLcpConstraintSolver*>(solver)->setBoxedLcpSolver(pgs);
    }
    for (const BodyPlan& body : plan.bodies) Add(plan, body);
  }

  void Step(double) override {
    for (const auto& [body, push] : pushed_) body->addExtForce(push);  // at its centre of mass, for one step
    world_->step();
  }

  State Read(int number) const override {
    const dart::dynamics::BodyNode* body = bodies_[number];
    const Eigen::Isometry3d& pose = body->getTransform();
    return {pose.translation(), Quaternion(pose.linear()), body->getLinearVelocity(), body->getAngularVelocity()};
  }

  int Contacts() const override { return static_cast<int>(world_->getLastCollisionResult().getNumContacts()); }

 private:
  void Add(const WorldPlan& plan, const BodyPlan& body) {
    using namespace dart::dynamics;
    const SkeletonPtr skeleton = Skeleton::create("body" + std::to_string(bodies_.size()));
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = body.start.position_W;
    pose.linear() = body.start.rotation_WB.toRotationMatrix();
    ShapePtr shape;
    if (body.form == BodyPlan::Form::kBox) {
      shape = std::make_shared<BoxShape>(2 * body.half_extents);
    } else if (body.form == BodyPlan::Form::kHull) {
      throw std::runtime_error("DART 6.12 has no convex hull");
    } else {
      shape = std::make_shared<SphereShape>(body.radius);
    }
    BodyNode* node = nullptr;
    if (body.Moves()) {
      FreeJoint* joint = nullptr;
      std::tie(joint, node) = skeleton->createJointAndBodyNodePair<FreeJoint>();
      node->setInertia(Inertia(body.mass, Vector3::Zero(), body.Inertia().asDiagonal()));
      FreeJoint::setTransformOf(joint, pose);
      joint->setLinearVelocity(body.start.linear_velocity_W);
      joint->setAngularVelocity(body.start.angular_velocity_W);
    } else {
      WeldJoint* joint = nullptr;
      std::tie(joint, node) = skeleton->createJointAndBodyNodePair<WeldJoint>();
      joint->setTransformFromParentBodyNode(pose);
      skeleton->setMobile(false);
    }
    auto* holder = node->createShapeNodeWith<CollisionAspect, DynamicsAspect>(shape);
    holder->getDynamicsAspect()->setFrictionCoeff(plan.friction);
    holder->getDynamicsAspect()->setRestitutionCoeff(std::sqrt(plan.restitution));
    if (!body.push_W.isZero()) pushed_.emplace_back(node, body.push_W);
    bodies_.push_back(node);
    world_->addSkeleton(skeleton);
  }

  dart::simulation::WorldPtr world_;
  std::vector<dart::dynamics::BodyNode*> bodies_;
  std::vector<std::pair<dart::dynamics::BodyNode*, Vector3>> pushed_;
};

std::unique_ptr<Peer> Make(const WorldPlan& plan, const Setting& setting) {
  return std::make_unique<DartPeer>(plan, setting);
}

}  // namespace

Engine TheEngine() {
  constexpr int kRates[] = {60, 120, 240, 480, 960}, kQuickRates[] = {60, 960};
  constexpr int kClientRates[] = {30, 60, 120, 240, 960}, kClientQuickRates[] = {60, 240};
  constexpr int kCounts[] = {10, 100, 300};
  Engine engine{.name = "dart", .version = DART_VERSION, .precision = "double", .settings = {}, .make = Make};
  AddTimeSteps({.solver = "Dantzig", .dt = 1.0 / 960, .is_default = true}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "PGS"}, kRates, {}, &engine.settings);
  AddIterations({.solver = "PGS"}, kCounts, {}, &engine.settings);
  AddTimeSteps({.solver = "islet"}, kClientRates, kClientQuickRates, &engine.settings);
  return engine;
}

}  // namespace islet::peers
