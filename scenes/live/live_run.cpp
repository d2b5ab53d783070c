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

LiveRun::LiveRun(World world, double dt) : world_(std::move(world)), dt_(dt) {}

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
      drag_ = Drag{command.body, command.from, command.vector};
      break;
    }
    case Kind::kRelease:
      LetGo();
      break;
    case Kind::kGravity:
      world_.SetGravity(command.vector);
      break;
    case Kind::kFriction:
      for (int i = 0; i < static_cast<int>(world_.bodies().size()); ++i)
        if (!world_.body(i).removed) world_.SetMaterial(i, command.value, world_.body(i).restitution);
      break;
  }
}

void LiveRun::Throw(const LiveCommand& command) {
  if (thrown_ >= kMostThrown)
    throw std::invalid_argument("message: throw: at most " + std::to_string(kMostThrown) + " balls in one run");
  const Shape ball = Shape::Sphere(command.radius);
  if (!world_.Overlapping(ball, command.from, Quaternion::Identity()).empty())
    throw std::invalid_argument("message: throw: a ball does not fit there");
  world_.Add(
      {.shape = ball, .density = command.density, .position_W = command.from, .linear_velocity_W = command.vector});
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
  if (drag_) world_.SetForce(drag_->body, Vector3::Zero(), Vector3::Zero());
  drag_.reset();
}

bool LiveRun::Advance() {
  if (!running_ && !step_) return false;
  step_ = false;
  Pull();
  report_ = world_.Step(dt_);
  ++steps_;
  return true;
}

}  // namespace islet
