// ODE. Lines: QuickStep (20 iterations by default), "QuickStep slip": the same with the first friction direction along the
// slip, as ODE's manual advises where the direction matters; WorldStep (its direct solver). ODE names no time step; 1/60 s
// is taken as the default.
//
// Contacts: at most 8 points a pair; dContactApprox1 (friction in proportion to the normal force); bounce above 0.1 m/s, as
// in ODE's own demonstrations. ERP and CFM are ODE's defaults (0.2; 1e-10 in double). Hash space. QuickStep draws the order
// of its constraints from ODE's random numbers: the seed is set to 0 when a world is made.
#include <ode/ode.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/peers/peer.h"
#include "bench/peers/sweeps.h"

namespace islet::peers {
namespace {

constexpr int kPointsPerPair = 8;
constexpr double kBounceThreshold = 0.1;  // [m/s]
constexpr double kLeastSlip = 1e-3;       // [m/s] slower slip has no direction worth following

Vector3 FromOde(const dReal* v) { return {v[0], v[1], v[2]}; }

class OdePeer final : public Peer {
 public:
  OdePeer(const WorldPlan& plan, const Setting& setting)
      : direct_(setting.solver == "WorldStep"),
        along_slip_(setting.solver == "QuickStep slip"),
        friction_(plan.friction),
        restitution_(plan.restitution) {
    dInitODE2(0);
    dRandSetSeed(0);
    world_ = dWorldCreate();
    space_ = dHashSpaceCreate(nullptr);
    joints_ = dJointGroupCreate(0);
    dWorldSetGravity(world_, plan.gravity.x(), plan.gravity.y(), plan.gravity.z());
    if (setting.iterations > 0) dWorldSetQuickStepNumIterations(world_, setting.iterations);
    dWorldSetAutoDisableFlag(world_, setting.sleeping ? 1 : 0);
    for (const BodyPlan& body : plan.bodies) Add(body);
  }

  ~OdePeer() override {
    dJointGroupDestroy(joints_);
    dSpaceDestroy(space_);
    dWorldDestroy(world_);
    dCloseODE();
  }

  void Step(double dt) override {
    for (const auto& [body, push] : pushed_) {
      dBodyEnable(body);  // a force does not wake a body
      dBodyAddForce(body, push.x(), push.y(), push.z());
    }
    dJointGroupEmpty(joints_);
    contacts_ = 0;
    dSpaceCollide(space_, this, [](void* self, dGeomID a, dGeomID b) { static_cast<OdePeer*>(self)->Touch(a, b); });
    if (direct_) {
      dWorldStep(world_, dt);
    } else {
      dWorldQuickStep(world_, dt);
    }
  }

  State Read(int number) const override {
    const dBodyID body = bodies_[number];
    if (body == nullptr) return fixed_[number];
    const dReal* q = dBodyGetQuaternion(body);
    return {FromOde(dBodyGetPosition(body)), Quaternion(q[0], q[1], q[2], q[3]), FromOde(dBodyGetLinearVel(body)),
            FromOde(dBodyGetAngularVel(body))};
  }

  int Contacts() const override { return contacts_; }

 private:
  dGeomID GeomOf(const BodyPlan& plan) {
    const Vector3 sides = 2 * plan.half_extents;
    if (plan.form == BodyPlan::Form::kBox) return dCreateBox(space_, sides.x(), sides.y(), sides.z());
    if (plan.form == BodyPlan::Form::kSphere) return dCreateSphere(space_, plan.radius);
    hulls_.push_back(std::make_unique<Hull>());  // ODE keeps pointers to it
    Hull& hull = *hulls_.back();
    for (const Vector3& corner : plan.corners) hull.points.insert(hull.points.end(), corner.begin(), corner.end());
    for (const std::vector<int>& face : plan.faces) {
      const Vector3 &p = plan.corners[face[0]], &q = plan.corners[face[1]], &r = plan.corners[face[2]];
      const Vector3 normal = (q - p).cross(r - p).normalized();
      hull.planes.insert(hull.planes.end(), {normal.x(), normal.y(), normal.z(), normal.dot(p)});
      hull.polygons.push_back(static_cast<unsigned>(face.size()));
      hull.polygons.insert(hull.polygons.end(), face.begin(), face.end());
    }
    return dCreateConvex(space_, hull.planes.data(), static_cast<unsigned>(plan.faces.size()), hull.points.data(),
                         static_cast<unsigned>(plan.corners.size()), hull.polygons.data());
  }

  void Add(const BodyPlan& plan) {
    const Vector3 sides = 2 * plan.half_extents;
    const bool box = plan.form == BodyPlan::Form::kBox;
    const dGeomID geom = GeomOf(plan);
    const Quaternion& q = plan.start.rotation_WB;
    const dQuaternion rotation = {q.w(), q.x(), q.y(), q.z()};
    const Vector3 &p = plan.start.position_W, &v = plan.start.linear_velocity_W, &w = plan.start.angular_velocity_W;
    dBodyID body = nullptr;
    if (plan.Moves()) {
      body = dBodyCreate(world_);
      dMass mass;
      if (box) {
        dMassSetBoxTotal(&mass, plan.mass, sides.x(), sides.y(), sides.z());
      } else if (plan.form == BodyPlan::Form::kHull) {
        const Vector3 inertia = plan.Inertia();
        dMassSetParameters(&mass, plan.mass, 0, 0, 0, inertia.x(), inertia.y(), inertia.z(), 0, 0, 0);
      } else {
        dMassSetSphereTotal(&mass, plan.mass, plan.radius);
      }
      dBodySetMass(body, &mass);
      dGeomSetBody(geom, body);
      dBodySetPosition(body, p.x(), p.y(), p.z());
      dBodySetQuaternion(body, rotation);
      dBodySetLinearVel(body, v.x(), v.y(), v.z());
      dBodySetAngularVel(body, w.x(), w.y(), w.z());
    } else {
      dGeomSetPosition(geom, p.x(), p.y(), p.z());
      dGeomSetQuaternion(geom, rotation);
    }
    if (!plan.push_W.isZero()) pushed_.emplace_back(body, plan.push_W);
    bodies_.push_back(body);
    fixed_.push_back(plan.start);
  }

  void Touch(dGeomID a, dGeomID b) {
    const dBodyID body_a = dGeomGetBody(a), body_b = dGeomGetBody(b);
    if (body_a == nullptr && body_b == nullptr) return;
    dContact contacts[kPointsPerPair] = {};
    const int count = dCollide(a, b, kPointsPerPair, &contacts[0].geom, sizeof(dContact));
    for (int i = 0; i < count; ++i) {
      dSurfaceParameters& surface = contacts[i].surface;
      surface.mode = dContactApprox1;
      surface.mu = friction_;
      if (restitution_ > 0) {
        surface.mode |= dContactBounce;
        surface.bounce = restitution_;
        surface.bounce_vel = kBounceThreshold;
      }
      if (along_slip_) AlignWithSlip(body_a, body_b, &contacts[i]);
      dJointAttach(dJointCreateContact(world_, joints_, &contacts[i]), body_a, body_b);
    }
    contacts_ += count;
  }

  static Vector3 VelocityAt(dBodyID body, const dReal* point) {
    if (body == nullptr) return Vector3::Zero();
    dVector3 velocity;
    dBodyGetPointVel(body, point[0], point[1], point[2], velocity);
    return FromOde(velocity);
  }

  static void AlignWithSlip(dBodyID a, dBodyID b, dContact* contact) {
    const Vector3 normal = FromOde(contact->geom.normal);
    Vector3 slip = VelocityAt(a, contact->geom.pos) - VelocityAt(b, contact->geom.pos);
    slip -= slip.dot(normal) * normal;
    if (slip.norm() < kLeastSlip) return;
    slip.normalize();
    contact->surface.mode |= dContactFDir1;
    for (int k = 0; k < 3; ++k) contact->fdir1[k] = slip[k];
  }

  struct Hull {
    std::vector<dReal> planes, points;
    std::vector<unsigned> polygons;
  };

  bool direct_, along_slip_;
  double friction_, restitution_;
  dWorldID world_;
  dSpaceID space_;
  dJointGroupID joints_;
  std::vector<std::unique_ptr<Hull>> hulls_;
  std::vector<dBodyID> bodies_;
  std::vector<State> fixed_;
  std::vector<std::pair<dBodyID, Vector3>> pushed_;
  int contacts_ = 0;
};

std::unique_ptr<Peer> Make(const WorldPlan& plan, const Setting& setting) {
  return std::make_unique<OdePeer>(plan, setting);
}

}  // namespace

Engine TheEngine() {
  constexpr int kRates[] = {30, 60, 120, 240, 480, 960}, kQuickRates[] = {60, 240};
  constexpr int kCounts[] = {5, 50, 100, 200, 500}, kQuickCounts[] = {100};
  Engine engine{.name = "ode", .version = ISLET_PEER_VERSION, .precision = "double", .settings = {}, .make = Make};
  AddTimeSteps({.solver = "QuickStep", .iterations = 20, .is_default = true}, kRates, kQuickRates, &engine.settings);
  AddIterations({.solver = "QuickStep"}, kCounts, kQuickCounts, &engine.settings);
  for (const int rate : {120, 240, 480}) {
    engine.settings.push_back({.solver = "QuickStep", .sweep = "both", .dt = 1.0 / rate, .iterations = 100});
  }
  AddTimeSteps({.solver = "QuickStep", .iterations = 20, .sleeping = true}, kRates, {}, &engine.settings);
  AddTimeSteps({.solver = "QuickStep slip", .iterations = 20}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "WorldStep"}, kRates, kQuickRates, &engine.settings);
  return engine;
}

}  // namespace islet::peers
