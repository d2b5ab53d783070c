// Simbody: compliant contact (Hertz, Hunt and Crossley), an integrator with error control. Lines: Runge-Kutta-Merson (the
// default) with contacts of a plane-strain modulus of 1e7 and of 1e9 Pa, which a user must choose, and semi-explicit Euler
// with 1e7; swept is the integrator's accuracy, 1e-3 by default.
//
// It has contact of spheres and half-spaces with each other and of a brick with a half-space, but of no brick with a brick
// or a sphere (two triangle meshes on an elastic foundation would do, with a mesh and a stiffness to be chosen for each
// scene). So a static box of half a width of 5 m or more is the half-space below its top, and a plan in which a moving box
// may meet another body is refused. Restitution is by dissipation: 1 - e at 1 m/s. The transition velocity of friction is
// Simbody's default, 1 cm/s. Friction is the harmonic mean, so each body gets the plan's.
//
// Compiled as C++17: Simbody's headers compare indices in a way that C++20 calls ambiguous.
#include <Simbody.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "bench/peers/peer.h"

namespace islet::peers {
namespace {

constexpr double kWide = 5;  // [m] half the width of a static box that is wide enough to count as a half-space

SimTK::Vec3 ToSimbody(const Vector3& v) { return {v.x(), v.y(), v.z()}; }
Vector3 FromSimbody(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }
SimTK::Transform ToSimbody(const State& s) {
  const Quaternion& q = s.rotation_WB;
  return {SimTK::Rotation(SimTK::Quaternion(q.w(), q.x(), q.y(), q.z())), ToSimbody(s.position_W)};
}

void CheckThatItCan(const WorldPlan& plan) {
  using Form = BodyPlan::Form;
  int boxes = 0, spheres = 0;
  for (const BodyPlan& body : plan.bodies) {
    if (body.form == Form::kHull) throw std::runtime_error("Simbody: no contact of two hulls");
    if (!body.Moves() && (body.form != Form::kBox || body.half_extents.head<2>().minCoeff() < kWide))
      throw std::runtime_error("Simbody: a static body that is no half-space");
    if (body.Moves()) ++(body.form == Form::kBox ? boxes : spheres);
  }
  if (boxes > 1 || (boxes == 1 && spheres > 0))
    throw std::runtime_error("Simbody: no contact of a box with a moving body");
}

class SimbodyPeer final : public Peer {
 public:
  SimbodyPeer(const WorldPlan& plan, const Setting& setting)
      : plan_(plan), matter_(system_), forces_(system_), tracker_(system_), contacts_(system_, tracker_) {
    CheckThatItCan(plan);
    SimTK::Force::UniformGravity gravity(forces_, matter_, ToSimbody(plan.gravity));
    const double stiffness = setting.solver.find("1e9") != std::string::npos ? 1e9 : 1e7;  // [Pa]
    const SimTK::ContactMaterial material(stiffness, 1 - plan.restitution, plan.friction, plan.friction, 0);
    for (const BodyPlan& body : plan.bodies) Add(body, material);
    SimTK::State state = system_.realizeTopology();
    system_.realizeModel(state);
    for (size_t i = 0; i < plan.bodies.size(); ++i) {
      if (!plan.bodies[i].Moves()) continue;
      const State& start = plan.bodies[i].start;
      bodies_[i].setQToFitTransform(state, ToSimbody(start));
      bodies_[i].setUToFitVelocity(
          state, SimTK::SpatialVec(ToSimbody(start.angular_velocity_W), ToSimbody(start.linear_velocity_W)));
    }
    if (setting.solver.rfind("Euler", 0) == 0) {
      integrator_ = std::make_unique<SimTK::SemiExplicitEuler2Integrator>(system_);
    } else {
      integrator_ = std::make_unique<SimTK::RungeKuttaMersonIntegrator>(system_);
    }
    if (setting.tolerance > 0) integrator_->setAccuracy(setting.tolerance);
    stepper_ = std::make_unique<SimTK::TimeStepper>(system_, *integrator_);
    stepper_->initialize(state);
  }

  void Step(double dt) override {
    stepper_->stepTo(++steps_ * dt);
    system_.realize(integrator_->getState(), SimTK::Stage::Velocity);
  }

  State Read(int number) const override {
    if (!plan_.bodies[number].Moves()) return plan_.bodies[number].start;
    const SimTK::State& state = integrator_->getState();
    const SimTK::MobilizedBody& body = bodies_[number];
    const SimTK::Quaternion q = body.getBodyRotation(state).convertRotationToQuaternion();
    return {FromSimbody(body.getBodyOriginLocation(state)), Quaternion(q[0], q[1], q[2], q[3]),
            FromSimbody(body.getBodyOriginVelocity(state)), FromSimbody(body.getBodyAngularVelocity(state))};
  }

  int Contacts() const override { return tracker_.getActiveContacts(integrator_->getState()).getNumContacts(); }

 private:
  void Add(const BodyPlan& plan, const SimTK::ContactMaterial& material) {
    using SimTK::ContactGeometry;
    const bool box = plan.form == BodyPlan::Form::kBox;
    if (!plan.Moves()) {  // a half-space lies where its x is positive
      const SimTK::Transform top(SimTK::Rotation(SimTK::Pi / 2, SimTK::YAxis),
                                 SimTK::Vec3(0, 0, plan.half_extents.z()));
      matter_.updGround().updBody().addContactSurface(ToSimbody(plan.start) * top,
                                                      SimTK::ContactSurface(ContactGeometry::HalfSpace(), material));
      bodies_.push_back(matter_.updGround());
      return;
    }
    const Vector3 inertia = plan.Inertia();
    SimTK::Body::Rigid rigid(
        SimTK::MassProperties(plan.mass, SimTK::Vec3(0), SimTK::Inertia(inertia.x(), inertia.y(), inertia.z())));
    if (box) {
      rigid.addContactSurface(SimTK::Transform(),
                              SimTK::ContactSurface(ContactGeometry::Brick(ToSimbody(plan.half_extents)), material));
    } else {
      rigid.addContactSurface(SimTK::Transform(),
                              SimTK::ContactSurface(ContactGeometry::Sphere(plan.radius), material));
    }
    SimTK::MobilizedBody::Free body(matter_.updGround(), SimTK::Transform(), rigid, SimTK::Transform());
    if (!plan.push_W.isZero()) SimTK::Force::ConstantForce(forces_, body, SimTK::Vec3(0), ToSimbody(plan.push_W));
    bodies_.push_back(body);
  }

  WorldPlan plan_;
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  SimTK::ContactTrackerSubsystem tracker_;
  SimTK::CompliantContactSubsystem contacts_;
  std::vector<SimTK::MobilizedBody> bodies_;
  std::unique_ptr<SimTK::Integrator> integrator_;
  std::unique_ptr<SimTK::TimeStepper> stepper_;
  int steps_ = 0;
};

std::unique_ptr<Peer> Make(const WorldPlan& plan, const Setting& setting) {
  return std::make_unique<SimbodyPeer>(plan, setting);
}

}  // namespace

Engine TheEngine() {
  Engine engine{"simbody", ISLET_PEER_VERSION, "double", {}, Make};
  for (const char* solver : {"Merson 1e7", "Merson 1e9", "Euler 1e7"}) {
    for (const double accuracy : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
      Setting setting;
      setting.solver = solver;
      setting.sweep = "tolerance";
      setting.tolerance = accuracy;
      setting.is_default = accuracy == 1e-3 && setting.solver == "Merson 1e7";
      setting.quick = accuracy == 1e-3 || accuracy == 1e-5;
      engine.settings.push_back(setting);
    }
  }
  return engine;
}

}  // namespace islet::peers
