// T52, T53, T56, T58: bounces on whatever a slab is, a bat, and scenes seen from moving and turned frames.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "scenes/verify/motion_family.h"

namespace islet::verify {
namespace {

enum class Slab { kFixed, kKinematic, kDynamic, kHeavy, kFrozen, kMoving };

constexpr double kBallRadius = 0.1, kThickness = 0.1, kDrop = 0.5;  // [m]

struct Bouncer {
  World world;
  int ball;
  double lift = 0;  // [m/s] at which the slab, and all with it, rises
};

Bouncer BuildBouncer(const Settings& engine, Slab kind, double restitution, double dt) {
  Bouncer b{World(engine), 0};
  b.world.Add(Floor(0.5, 0));
  BodyDefinition slab{.shape = Shape::Box({1, 1, 0.5 * kThickness}),
                      .position_W = {0, 0, 0.5 * kThickness},
                      .friction = 0.5,
                      .restitution = 0};
  slab.mass = kind == Slab::kHeavy ? 1000 : 5;
  if (kind == Slab::kFixed) slab.kind = BodyKind::kFixed;
  if (kind == Slab::kKinematic || kind == Slab::kMoving) slab.kind = BodyKind::kKinematic;
  if (kind == Slab::kMoving) slab.linear_velocity_W.z() = b.lift = 0.7;
  if (slab.kind != BodyKind::kDynamic) slab.mass.reset();
  b.world.Add(slab);
  if (kind == Slab::kFrozen) StepTimes(&b.world, Frames(1, dt), dt);
  BodyDefinition ball = Ball({0.3, 0.1, b.world.body(1).position_W.z() + 0.5 * kThickness + kBallRadius + kDrop},
                             kBallRadius, 0, restitution);
  ball.linear_velocity_W.z() = b.lift;
  b.ball = b.world.Add(ball);
  return b;
}

// [m] height above the slab to which it would rise, as the slab sees it.
double HeightOf(const Bouncer& b) {
  const Body &ball = b.world.body(b.ball), &slab = b.world.body(1);
  const double speed = ball.linear_velocity_W.z() - b.lift;
  return ball.position_W.z() - slab.position_W.z() - 0.5 * kThickness - kBallRadius + speed * speed / (2 * kGravity);
}

constexpr std::pair<Slab, const char*> kSlabs[] = {{Slab::kFixed, "fixed"},     {Slab::kKinematic, "kinematic"},
                                                   {Slab::kDynamic, "dynamic"}, {Slab::kHeavy, "heavy"},
                                                   {Slab::kFrozen, "frozen"},   {Slab::kMoving, "moving"}};

// A scene of which nothing is chaotic: a box slides, a ball bounces, a rod is thrown, on a slab that carries them.
World BuildScene(const Settings& engine, const Quaternion& turn, const Vector3& velocity) {
  Settings settings = engine;
  settings.gravity = turn * Vector3(0, 0, -kGravity);
  World world(settings);
  const auto add = [&](BodyDefinition d) {
    d.position_W = turn * d.position_W;
    d.rotation_WB = turn * d.rotation_WB;
    d.linear_velocity_W = turn * d.linear_velocity_W + velocity;
    d.angular_velocity_W = turn * d.angular_velocity_W;
    world.Add(d);
  };
  BodyDefinition slab{.shape = Shape::Box({10, 10, 0.5}),
                      .kind = BodyKind::kKinematic,
                      .position_W = {0, 0, -0.5},
                      .friction = 0.5,
                      .restitution = 0.5};
  add(slab);
  BodyDefinition box = Cube({-3, 0, 0.5}, 0.5, 0);
  box.linear_velocity_W = {3, 1, 0};
  add(box);
  add(Ball({3, 0, 1.5}, 0.5, 0.5, 0.6));
  BodyDefinition rod{
      .shape = Shape::Box({0.5, 0.05, 0.05}), .position_W = {0, 4, 1}, .friction = 0.5, .restitution = 0.3};
  rod.rotation_WB = Turn(0.4, Vector3(1, 2, 0));
  rod.angular_velocity_W = {1, 4, 2};
  add(rod);
  return world;
}

}  // namespace

void MeasureSlabs(const CheckSettings& s, Measurements* out) {
  constexpr double kRestitution = 0.8;
  for (const auto& [kind, name] : kSlabs) {
    Bouncer b = BuildBouncer(s.engine, kind, kRestitution, s.dt);
    int bounces = 0, failed = 0;
    double off = 0, before = -1;
    for (int i = 0; i < Frames(3, s.dt) && bounces < 5; ++i) {
      failed += b.world.Step(s.dt).Failed();
      const double speed = b.world.body(b.ball).linear_velocity_W.z() - b.lift;
      bounces += before < 0 && speed > 0;
      if (speed > 0) off = std::max(off, std::abs(HeightOf(b) / (kDrop * std::pow(kRestitution, 2 * bounces)) - 1));
      before = speed;
    }
    out->Absolute(std::string(name) + ": bounces in 3 s", "", 5, bounces, 0);
    out->AtMost(std::string(name) + ": heights off e^(2 n) h0", "", off, 1e-4);
    out->Absolute(std::string(name) + ": steps that the ledger calls failed", "", 0, failed, 0);
  }
}

void MeasureElastic(const CheckSettings& s, Measurements* out) {
  const int most = s.quick ? 30 : 100;
  for (const auto& [kind, name] : kSlabs) {
    if (kind == Slab::kMoving) continue;
    Bouncer b = BuildBouncer(s.engine, kind, 1, s.dt);
    int bounces = 0, failed = 0;
    double before = -1;
    for (int i = 0; i < Frames(0.7 * most, s.dt) && bounces < most; ++i) {
      failed += b.world.Step(s.dt).Failed();
      const double speed = b.world.body(b.ball).linear_velocity_W.z();
      bounces += before < 0 && speed > 0;
      before = speed;
    }
    out->Absolute(std::string(name) + ": bounces", "", most, bounces, 0);
    out->AtMost(std::string(name) + ": change of height", "", std::abs(HeightOf(b) / kDrop - 1), 1e-4);
    out->Absolute(std::string(name) + ": steps that the ledger calls failed", "", 0, failed, 0);
  }
}

// A bat of 2 m that the user turns hits a ball at rest, weightless and without friction: along the bat's normal the ball leaves at
// (1 + e) times the speed that the bat has there.
void MeasureBat(const CheckSettings& s, Measurements* out) {
  constexpr double kHalfThick = 0.03, kBall = 0.04;   // [m]
  for (const double restitution : {0.3, 0.6, 1.0}) {  // less, and it catches up with the ball in the same step
    double off = 0;
    int failed = 0;
    for (const double turn_of_step : {0.03, 0.3, 0.6}) {  // [rad]
      const double turn = turn_of_step / s.dt;            // [rad/s]
      for (int phase = 0; phase < 6; ++phase) {
        Settings engine = s.engine;
        engine.gravity.setZero();
        World world(engine);
        BodyDefinition bat{.shape = Shape::Box({1, kHalfThick, kHalfThick}),
                           .kind = BodyKind::kKinematic,
                           .friction = 0,
                           .restitution = restitution};
        bat.angular_velocity_W.z() = turn;
        world.Add(bat);
        const double along = 0.3 + 0.1 * phase, start = 0.2 + 0.13 * phase;  // [m], [rad] that it turns before it hits
        const int ball = world.Add(
            Ball(Turn(start, Vector3::UnitZ()) * Vector3(along, kHalfThick + kBall, 0), kBall, 0, restitution));
        for (int i = 0; i < 40 && world.body(ball).linear_velocity_W.isZero(0); ++i)
          failed += world.Step(s.dt).Failed();
        off =
            std::max(off, std::abs(world.body(ball).linear_velocity_W.norm() / ((1 + restitution) * turn * along) - 1));
      }
    }
    const std::string of = "e = " + std::to_string(restitution).substr(0, 3);
    out->AtMost(of + ": speed off (1 + e) w r", "", off, 1e-6);
    out->Absolute(of + ": steps that the ledger calls failed", "", 0, failed, 0);
  }
}

void MeasureFrames(const CheckSettings& s, Measurements* out) {
  const Quaternion turn = Turn(1, Vector3(3, 1, 2));
  const Vector3 velocity(3, -2, 5);
  const struct {
    const char* name;
    Quaternion turn;
    Vector3 velocity;
  } kFrames[] = {{"moving at 6.2 m/s", Quaternion::Identity(), velocity},
                 {"turned by 1 rad", turn, Vector3::Zero()},
                 {"both", turn, velocity}};
  for (const auto& frame : kFrames) {
    World one = BuildScene(s.engine, Quaternion::Identity(), Vector3::Zero());
    World other = BuildScene(s.engine, frame.turn, frame.velocity);
    double place = 0, angle = 0;
    for (int i = 0; i < Frames(1.5, s.dt); ++i) {
      one.Step(s.dt);
      other.Step(s.dt);
      for (size_t k = 0; k < one.bodies().size(); ++k) {
        const Body &a = one.bodies()[k], &b = other.bodies()[k];
        const double apart = (frame.turn * a.position_W + other.time() * frame.velocity - b.position_W).norm(),
                     turned = (frame.turn * a.rotation_WB).angularDistance(b.rotation_WB);
        place = Worse(place, apart);
        angle = Worse(angle, turned);
      }
    }
    out->AtMost(std::string(frame.name) + ": farthest apart", "m", place, 1e-5);
    out->AtMost(std::string(frame.name) + ": turned apart", "rad", angle, 1e-4);
  }
}

}  // namespace islet::verify
