#include "scenes/live/live_run.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace islet {
namespace {

constexpr int kMostThrown = 1000;    // balls in one run
constexpr double kPullRate = 12;     // [rad/s] of the damped spring by which a body is dragged
constexpr double kSwingRate = 12;    // [1/s] at which its swing dies down meanwhile
constexpr double kFarthestPull = 5;  // [m] a longer spring pulls no harder

}  // namespace

LiveRun::LiveRun(World world, double dt, Drive drive) : world_(std::move(world)), dt_(dt), drive_(std::move(drive)) {}

void LiveRun::Do(const LiveCommand& command) {
  using Kind = LiveCommand::Kind;
  switch (command.kind) {
    case Kind::kRun:
      running_ = true;
      break;
    case Kind::kPause:
      running_ = false;
      break;
    case Kind::kStep:
      running_ = false, step_ = true;
      break;
    case Kind::kThrow:
      Throw(command);
      break;
    case Kind::kDrag: {
      const World& world = world_;
      if (command.body >= static_cast<int>(world.bodies().size()) || world.body(command.body).removed ||
          world.body(command.body).kind != BodyKind::kDynamic)
        throw std::invalid_argument("message: body must be a dynamic one; got " + std::to_string(command.body));
      if (drag_ && drag_->body != command.body) LetGo();
      const Body& body = world.body(command.body);
      const Vector3 force = drag_ ? drag_->force_W : body.force_W, torque = drag_ ? drag_->torque_W : body.torque_W;
      drag_ = Drag{command.body, command.from, command.vector, force, torque};
      break;
    }
    case Kind::kRelease:
      LetGo();
      break;
    case Kind::kGravity:
      world_.SetGravity(command.vector);
      gravity_W_ = command.vector;
      break;
    case Kind::kFriction:
      for (int i = 0; i < static_cast<int>(world_.bodies().size()); ++i)
        if (!world_.body(i).removed) world_.SetMaterial(i, command.value, world_.body(i).restitution);
      friction_ = command.value;
      break;
  }
  changed_ |= command.kind == Kind::kThrow || command.kind == Kind::kDrag || command.kind == Kind::kGravity ||
              command.kind == Kind::kFriction;
}

void LiveRun::Throw(const LiveCommand& command) {
  if (thrown_ >= kMostThrown)
    throw std::invalid_argument("message: throw: at most " + std::to_string(kMostThrown) + " balls in one run");
  if (!ball_ || ball_->radius() != command.radius) ball_ = Shape::Sphere(command.radius);
  if (!world_.Overlapping(*ball_, command.from, Quaternion::Identity()).empty())
    throw std::invalid_argument("message: throw: a ball does not fit there");
  BodyDefinition body{
      .shape = *ball_, .density = command.density, .position_W = command.from, .linear_velocity_W = command.vector};
  body.friction = friction_.value_or(body.friction);
  world_.Add(body);
  ++thrown_;
  ++generation_;
}

// A spring that is critically damped, for what the body weighs at the point where it pulls; gravity is held besides.
void LiveRun::Pull() {
  if (!drag_) return;
  const Body& body = world_.body(drag_->body);
  const Vector3 arm = body.rotation_WB * drag_->at_B, point = body.position_W + arm;
  Vector3 way = drag_->to_W - point;
  if (way.norm() > kFarthestPull) way *= kFarthestPull / way.norm();
  Matrix3 cross;
  cross << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
  const Matrix3 yields =
      Matrix3::Identity() / body.mass - cross * body.InverseInertiaW() * cross;  // [1/kg] to a force there
  const Vector3 pull = yields.ldlt().solve(kPullRate * kPullRate * way - 2 * kPullRate * body.VelocityAt(point));
  world_.SetForce(drag_->body, pull - body.mass * world_.settings().gravity,
                  arm.cross(pull) - kSwingRate * body.AngularMomentumW());
}

void LiveRun::LetGo() {
  if (drag_) world_.SetForce(drag_->body, drag_->force_W, drag_->torque_W);
  drag_.reset();
}

bool LiveRun::Advance() {
  if (!running_ && !step_) return false;
  step_ = false;
  if (drive_) drive_(steps_ * dt_, &world_);
  if (gravity_W_ && *gravity_W_ != world_.settings().gravity) world_.SetGravity(*gravity_W_);
  Pull();
  report_ = world_.Step(dt_);
  ++steps_;
  return true;
}

}  // namespace islet
