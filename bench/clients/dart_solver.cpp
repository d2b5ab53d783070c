#include "bench/clients/dart_solver.h"

#include <algorithm>
#include <dart/collision/CollisionObject.hpp>
#include <dart/constraint/ConstraintBase.hpp>
#include <dart/constraint/ContactConstraint.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/ShapeNode.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/dynamics/SoftBodyNode.hpp>
#include <dart/dynamics/WeldJoint.hpp>
#include <limits>
#include <stdexcept>
#include <string>

namespace islet::clients {
namespace {

using dart::dynamics::BodyNode;
using dart::dynamics::FreeJoint;
using dart::dynamics::ShapeNode;

Settings SuiteSettings() {
  Settings settings;
  settings.freezing = Freezing::kOff;  // DART puts no body to sleep
  return settings;
}

[[noreturn]] void Refuse(const dart::dynamics::Skeleton& skeleton, const std::string& why) {
  throw std::runtime_error("DartSolver: skeleton '" + skeleton.getName() + "' " + why);
}

// A child that is welded to what is fixed is fixed.
bool Fixed(const BodyNode& node) {
  if (!node.getSkeleton()->isMobile()) return true;
  if (!dynamic_cast<const dart::dynamics::WeldJoint*>(node.getParentJoint())) return false;
  return !node.getParentBodyNode() || Fixed(*node.getParentBodyNode());
}

double RadiusOf(BodyNode* node) {
  double radius = 0;
  for (const ShapeNode* shape : node->getShapeNodesWith<dart::dynamics::CollisionAspect>()) {
    const auto& box = shape->getShape()->getBoundingBox();
    const Vector3 middle = shape->getRelativeTransform() * Vector3(0.5 * (box.getMin() + box.getMax()));
    radius = std::max(radius, (middle - node->getLocalCOM()).norm() + box.computeHalfExtents().norm());
  }
  return std::min(radius, 1e6);
}

// DART's own, and its default where a shape has none.
double FrictionOf(const ShapeNode& shape) {
  const auto* dynamics = shape.getDynamicsAspect();
  return dynamics ? dynamics->getFrictionCoeff() : 1;
}
double RestitutionOf(const ShapeNode& shape) {
  const auto* dynamics = shape.getDynamicsAspect();
  return dynamics ? dynamics->getRestitutionCoeff() : 0;
}

}  // namespace

// DART calls solveConstrainedGroup() only for what overlaps. This constraint is always active and constrains nothing: with it there is a
// call in each step, so that contacts still open are resolved and bodies in flight are moved as islet asks.
class DartSolver::EveryStep final : public dart::constraint::ConstraintBase {
 public:
  explicit EveryStep(const std::vector<dart::dynamics::SkeletonPtr>& skeletons) : skeletons_(&skeletons) {}
  // Its solver is gone; the one in its place has taken over what was constrained.
  void Retire() { skeletons_ = nullptr; }
  bool isActive() const override { return skeletons_ && !skeletons_->empty(); }
  dart::dynamics::SkeletonPtr getRootSkeleton() const override { return skeletons_->front(); }
  void update() override {}
  void getInformation(dart::constraint::ConstraintInfo*) override {}
  void applyUnitImpulse(std::size_t) override {}
  void getVelocityChange(double*, bool) override {}
  void excite() override {}
  void unexcite() override {}
  void applyImpulse(double*) override {}

 private:
  const std::vector<dart::dynamics::SkeletonPtr>* skeletons_;
};

DartSolver::DartSolver(int threads)
    : pool_(threads), step_(SuiteSettings(), &pool_), every_step_(std::make_shared<EveryStep>(mSkeletons)) {
  mCollisionOption.maxNumContacts =
      std::numeric_limits<int>::max();  // by default those after the first 1000 are left out
  addConstraint(every_step_);
}
DartSolver::~DartSolver() { every_step_->Retire(); }

void DartSolver::setFromOtherConstraintSolver(const ConstraintSolver& other) {
  ConstraintSolver::setFromOtherConstraintSolver(other);
  std::erase_if(mManualConstraints, [](const auto& of) { return dynamic_cast<const EveryStep*>(of.get()) != nullptr; });
  addConstraint(every_step_);
}

void DartSolver::RefuseOthers() const {
  for (const auto& constraint : mActiveConstraints) {
    if (dynamic_cast<const EveryStep*>(constraint.get()) ||
        dynamic_cast<const dart::constraint::ContactConstraint*>(constraint.get()))
      continue;
    Refuse(*constraint->getRootSkeleton(), "has a constraint that is no contact of rigid bodies");
  }
}

// By now DART has added gravity and forces to the velocities: what it added is taken off again, and handed to the suite as a force.
void DartSolver::AddBody(BodyNode* node) {
  Body b;
  auto* const joint = dynamic_cast<FreeJoint*>(node->getParentJoint());
  const bool fixed = Fixed(*node);
  if (!fixed && (!joint || node->getParentBodyNode() || !joint->getTransformFromChildBodyNode().matrix().isIdentity()))
    Refuse(*node->getSkeleton(), "has a body that is neither fixed nor on a free joint at its origin");
  if (dynamic_cast<dart::dynamics::SoftBodyNode*>(node)) Refuse(*node->getSkeleton(), "has a soft body");
  const Eigen::Isometry3d& pose = node->getTransform();
  const Matrix3 rotation = pose.linear();
  b.kind = fixed ? BodyKind::kFixed : BodyKind::kDynamic;
  b.position_W = pose * node->getLocalCOM();
  b.rotation_WB = Quaternion(rotation).normalized();
  b.radius = RadiusOf(node);
  if (!fixed) {
    const Vector3 arm_B = node->getLocalCOM();
    b.mass = node->getMass();
    b.inertia_B = node->getInertia().getMoment();
    const Eigen::Matrix<double, 6, 1> after = joint->getVelocities(), gained = joint->getAccelerations();
    const Vector3 turn_B = gained.head<3>(), spin_B = after.head<3>() - mTimeStep * turn_B;
    // The classical acceleration of the origin is what DART has added.
    const Vector3 origin_B = gained.tail<3>() + after.head<3>().cross(Vector3(after.tail<3>()));
    const Vector3 velocity_B = after.tail<3>() - mTimeStep * origin_B;
    const Vector3 acceleration_B =
        origin_B + turn_B.cross(arm_B) + spin_B.cross(spin_B.cross(arm_B));  // of the centre of mass
    b.linear_velocity_W = rotation * (velocity_B + spin_B.cross(arm_B));
    b.angular_velocity_W = rotation * spin_B;
    b.force_W = b.mass * (rotation * acceleration_B - mSkeletons.front()->getGravity());
    b.torque_W = rotation * (b.inertia_B * turn_B + spin_B.cross(b.inertia_B * spin_B));
  }
  numbers_[node] = static_cast<int>(step_.bodies.size());
  step_.bodies.push_back(b);
  joints_.push_back(fixed ? nullptr : joint);
}

std::optional<Contact> DartSolver::ContactOf(const dart::collision::Contact& contact) const {
  if (dart::collision::Contact::isZeroNormal(contact.normal)) return {};
  const ShapeNode& shape1 = *contact.collisionObject1->getShapeFrame()->asShapeNode();
  const ShapeNode& shape2 = *contact.collisionObject2->getShapeFrame()->asShapeNode();
  const int first = numbers_.at(shape1.getBodyNodePtr().get()), second = numbers_.at(shape2.getBodyNodePtr().get());
  if (first == second || (!joints_[first] && !joints_[second])) return {};
  Contact c;
  c.body_a = std::min(first, second);
  c.body_b = std::max(first, second);
  c.point_W = contact.point;
  c.normal_W = (first < second ? -1 : 1) * contact.normal.normalized();  // DART's points into its first body
  c.gap = -contact.penetrationDepth;
  c.friction = std::min(FrictionOf(shape1), FrictionOf(shape2));
  c.restitution = std::clamp(RestitutionOf(shape1) * RestitutionOf(shape2), 0.0, 1.0);
  return c;
}

// Whether two bodies meet unseen in the step as it was resolved.
bool DartSolver::AddFound() {
  bool far = false;
  for (size_t i = 0; i < joints_.size(); ++i) far = far || step_.MovesFar(static_cast<int>(i));
  if (!far) return false;
  for (size_t i = 0; i < joints_.size(); ++i) {
    if (!joints_[i]) continue;
    const Body& b = step_.bodies[i];
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = b.rotation_WB.toRotationMatrix();
    pose.translation() = b.position_W - pose.linear() * joints_[i]->getChildBodyNode()->getLocalCOM();
    joints_[i]->setTransform(pose);
  }
  dart::collision::CollisionResult found;
  mCollisionGroup->collide(mCollisionOption, &found);
  bool any = false;
  for (const dart::collision::Contact& contact : found.getContacts())
    if (const std::optional<Contact> c = ContactOf(contact)) any = step_.AddFound(*c) || any;
  return any;
}

// DART now moves by dt v and turns by dt w, both in the world, and keeps them: poses are set back by that from where they are to be.
void DartSolver::HandBack() {
  for (size_t i = 0; i < joints_.size(); ++i) {
    FreeJoint* const joint = joints_[i];
    if (!joint) continue;
    const Body& b = step_.bodies[i];
    const Vector3 arm_W = b.rotation_WB * joint->getChildBodyNode()->getLocalCOM();
    const Vector3 velocity_W = b.linear_velocity_W - b.angular_velocity_W.cross(arm_W);  // of the body's origin
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Turned(-mTimeStep * b.angular_velocity_W, b.rotation_WB).toRotationMatrix();
    pose.translation() = b.position_W - arm_W - mTimeStep * velocity_W;
    Eigen::Matrix<double, 6, 1> velocities;
    velocities << pose.linear().transpose() * b.angular_velocity_W, pose.linear().transpose() * velocity_W;
    joint->setTransform(pose);
    joint->setVelocities(velocities);
  }
}

// The first call of a step resolves all groups, from the detector's own list: it holds the contacts still open as well.
void DartSolver::solveConstrainedGroup(dart::constraint::ConstrainedGroup& group) {
  if (&group != &mConstrainedGroups.front()) return;
  RefuseOthers();
  step_.Begin(mTimeStep, mSkeletons.front()->getGravity());
  joints_.clear();
  numbers_.clear();
  for (const auto& skeleton : mSkeletons)
    for (BodyNode* node : skeleton->getBodyNodes()) AddBody(node);
  for (const dart::collision::Contact& contact : mCollisionResult.getContacts())
    if (const std::optional<Contact> c = ContactOf(contact)) step_.contacts.push_back(*c);
  step_.UndoOverlaps();
  step_.Resolve();
  for (int round = 0; round < kRounds && AddFound(); ++round) step_.Resolve();
  HandBack();
}

}  // namespace islet::clients
