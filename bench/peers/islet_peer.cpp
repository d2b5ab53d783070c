// islet as it stands, through its front door. Lines: normal effort, quick, thorough, the convex model. Freezing is off
// unless the setting says sleeping. The tolerance of the QPs is swept too; it has no knob called iterations.
#include "bench/peers/peer.h"
#include "bench/peers/sweeps.h"
#include "engine/world.h"

namespace islet::peers {
namespace {

islet::Settings SettingsOf(const WorldPlan& plan, const Setting& setting) {
  islet::Settings settings;
  settings.gravity = plan.gravity;
  settings.threads = setting.threads;
  settings.freezing = setting.sleeping ? Freezing::kCertified : Freezing::kOff;
  if (setting.solver == "quick") settings.effort = qp::kQuickEffort;
  if (setting.solver == "thorough") settings.effort = qp::kThoroughEffort;
  if (setting.solver == "convex") settings.model = Model::kConvex;
  if (setting.tolerance > 0) settings.tolerance = setting.tolerance;
  return settings;
}

Shape ShapeOf(const BodyPlan& body) {
  if (body.form == BodyPlan::Form::kBox) return Shape::Box(body.half_extents);
  if (body.form == BodyPlan::Form::kSphere) return Shape::Sphere(body.radius);
  return Shape::ConvexHull(body.corners);
}

class IsletPeer final : public Peer {
 public:
  IsletPeer(const WorldPlan& plan, const Setting& setting) : world_(SettingsOf(plan, setting)) {
    for (const BodyPlan& body : plan.bodies) {
      BodyDefinition definition{.shape = ShapeOf(body)};
      definition.kind = body.Moves() ? BodyKind::kDynamic : BodyKind::kFixed;
      if (body.Moves()) definition.mass = body.mass;
      definition.position_W = body.start.position_W;
      definition.rotation_WB = body.start.rotation_WB;
      definition.linear_velocity_W = body.start.linear_velocity_W;
      definition.angular_velocity_W = body.start.angular_velocity_W;
      definition.friction = plan.friction;
      definition.restitution = plan.restitution;
      const int number = world_.Add(definition);
      if (!body.push_W.isZero()) world_.SetForce(number, body.push_W, Vector3::Zero());
    }
  }

  void Step(double dt) override { contacts_ = world_.Step(dt).contacts; }

  State Read(int body) const override {
    const Body& b = world_.body(body);
    return {b.position_W, b.rotation_WB, b.linear_velocity_W, b.angular_velocity_W};
  }

  int Contacts() const override { return contacts_; }

 private:
  World world_;
  int contacts_ = 0;
};

std::unique_ptr<Peer> Make(const WorldPlan& plan, const Setting& setting) {
  return std::make_unique<IsletPeer>(plan, setting);
}

}  // namespace

Engine TheEngine() {
  constexpr int kRates[] = {15, 30, 60, 120, 240, 480}, kQuickRates[] = {30, 60, 240}, kFewRates[] = {30, 60, 120};
  constexpr double kTolerances[] = {1e-3, 1e-4, 1e-5, 1e-7, 1e-8};
  Engine engine{.name = "islet", .version = ISLET_VERSION, .precision = "double", .settings = {}, .make = Make};
  AddTimeSteps({.solver = "normal", .dt = 1.0 / 30, .sleeping = true, .is_default = true}, kRates, kQuickRates,
               &engine.settings);
  AddTimeSteps({.solver = "normal", .dt = 1.0 / 30}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "quick", .dt = 1.0 / 30}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "convex", .dt = 1.0 / 30}, kFewRates, {}, &engine.settings);
  for (const double tolerance : kTolerances) {
    engine.settings.push_back(
        {.solver = "normal", .sweep = "tolerance", .dt = 1.0 / 30, .tolerance = tolerance, .quick = tolerance == 1e-4});
  }
  AddTimeSteps({.solver = "quick", .dt = 1.0 / 30, .sleeping = true}, kFewRates, {}, &engine.settings);
  AddTimeSteps({.solver = "normal", .dt = 1.0 / 30, .threads = 2}, kFewRates, {}, &engine.settings);
  return engine;
}

}  // namespace islet::peers
