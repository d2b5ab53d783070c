// MuJoCo: one free joint a body, the model handed over as XML in memory. Lines: Newton (the default: pyramidal cone),
// elliptic (elliptic cone), stiff (elliptic with what the manual names against softness and creep: solref at its documented
// minimum of two steps, solimp 0.99, impratio 10, ten iterations of noslip), CG. Default: 2 ms, 100 iterations; 1/480 s stands
// for it.
//
// MuJoCo has no restitution: it is left at its default, and the plan's is ignored. Friction is sliding alone (condim 3).
// Hulls are given "multiccd", without which two of them touch at one point. Contacts are soft by design. A model that MuJoCo
// cannot allocate is refused.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <sstream>
#include <stdexcept>

#include "bench/peers/peer.h"
#include "bench/peers/sweeps.h"

namespace islet::peers {
namespace {

// Room for contacts, points a body: the first with which MuJoCo can allocate the model (its sizes have 31 bits).
constexpr int kRooms[] = {16, 8, 6, 4};
constexpr int kNoslipIterations = 10;

[[noreturn]] void Fail(const char* message) { throw std::runtime_error(message); }

// MuJoCo calls this from C code, which no exception may cross: the process of this one run ends.
void EndRun(const char* message) {
  std::fprintf(stderr, "MuJoCo: %s\n", message);
  std::_Exit(kRefusedExit);
}

std::string Model(const WorldPlan& plan, const Setting& setting, int points_per_body) {
  const bool stiff = setting.solver == "stiff", elliptic = stiff || setting.solver == "elliptic";
  const char* solver = setting.solver == "CG" ? "CG" : "Newton";
  const auto moving = std::ranges::count_if(plan.bodies, &BodyPlan::Moves);
  std::ostringstream xml;
  xml << std::setprecision(17);
  const auto vector = [&](const char* name, const Vector3& v) {
    xml << ' ' << name << "='" << v.x() << ' ' << v.y() << ' ' << v.z() << '\'';
  };
  const long contacts = points_per_body * moving + 64;
  xml << "<mujoco><size nconmax='" << contacts << "' njmax='" << contacts * (elliptic ? 3 : 4)
      << "'/><option timestep='" << setting.dt << "' cone='" << (elliptic ? "elliptic" : "pyramidal") << "' solver='"
      << solver << '\'';
  if (setting.iterations > 0) xml << " iterations='" << setting.iterations << '\'';
  if (stiff) xml << " impratio='10' noslip_iterations='" << kNoslipIterations << '\'';
  vector("gravity", plan.gravity);
  const bool hulls =
      std::ranges::any_of(plan.bodies, [](const BodyPlan& b) { return b.form == BodyPlan::Form::kHull; });
  xml << (hulls ? "><flag multiccd='enable'/></option>" : "/>") << "<default><geom condim='3' friction='"
      << plan.friction << " 0 0'";
  if (stiff) xml << " solref='" << 2 * setting.dt << " 1' solimp='0.99 0.99 0.001'";
  xml << "/></default><asset>";
  for (size_t i = 0; i < plan.bodies.size(); ++i) {
    if (plan.bodies[i].form != BodyPlan::Form::kHull) continue;
    xml << "<mesh name='hull" << i << "' vertex='";
    for (const Vector3& corner : plan.bodies[i].corners) xml << corner.transpose() << ' ';
    xml << "'/>";
  }
  xml << "</asset><worldbody>";
  for (size_t i = 0; i < plan.bodies.size(); ++i) {
    const BodyPlan& body = plan.bodies[i];
    const bool box = body.form == BodyPlan::Form::kBox, hull = body.form == BodyPlan::Form::kHull;
    const Quaternion& q = body.start.rotation_WB;
    const auto pose = [&] {
      vector("pos", body.start.position_W);
      xml << " quat='" << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << '\'';
    };
    if (body.Moves()) {
      xml << "<body";
      pose();
      xml << "><freejoint/>";
    }
    xml << "<geom type='" << (hull ? "mesh" : box ? "box" : "sphere") << '\'';
    if (hull) {
      xml << " mesh='hull" << i << '\'';
    } else {
      vector("size", box ? body.half_extents : Vector3(body.radius, 0, 0));
    }
    if (body.Moves()) {
      xml << " mass='" << body.mass << "'/></body>";
    } else {
      pose();
      xml << "/>";
    }
  }
  xml << "</worldbody></mujoco>";
  return xml.str();
}

class MujocoPeer final : public Peer {
 public:
  MujocoPeer(const WorldPlan& plan, const Setting& setting) : plan_(plan) {
    mju_user_error = EndRun;
    mju_user_warning = [](const char*) {};
    std::string error;
    for (const int room : kRooms) {
      if (Allocate(Model(plan, setting, room), &error)) break;
    }
    if (!data_) throw std::runtime_error(error);
    int joint = 0;
    for (size_t i = 0; i < plan.bodies.size(); ++i) {
      joints_.push_back(plan.bodies[i].Moves() ? joint++ : -1);
      if (joints_.back() < 0) continue;
      const State& start = plan.bodies[i].start;
      mjtNum* force = data_->xfrc_applied + 6 * model_->jnt_bodyid[joints_.back()];  // W; stays until it is changed
      for (int k = 0; k < 3; ++k) force[k] = plan.bodies[i].push_W[k];
      mjtNum* velocity = data_->qvel + 6 * joints_.back();  // linear in W, angular in B
      const Vector3 spin_B = start.rotation_WB.conjugate() * start.angular_velocity_W;
      for (int k = 0; k < 3; ++k) {
        velocity[k] = start.linear_velocity_W[k];
        velocity[3 + k] = spin_B[k];
      }
    }
  }

  void Step(double) override {
    mj_step(model_.get(), data_.get());
    if (data_->warning[mjWARN_CNSTRFULL].number > 0 || data_->warning[mjWARN_CONTACTFULL].number > 0) {
      Fail("room for contacts exhausted");
    }
    // It begins anew from the start where numbers are not finite or too large, and says so here alone.
    for (const int reset : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data_->warning[reset].number > 0) Fail("it began anew from the start");
  }

  State Read(int number) const override {
    const int joint = joints_[number];
    if (joint < 0) return plan_.bodies[number].start;
    const mjtNum *p = data_->qpos + 7 * joint, *v = data_->qvel + 6 * joint;
    const Quaternion rotation(p[3], p[4], p[5], p[6]);
    return {{p[0], p[1], p[2]}, rotation, {v[0], v[1], v[2]}, rotation * Vector3(v[3], v[4], v[5])};
  }

  int Contacts() const override { return data_->ncon; }

 private:
  bool Allocate(const std::string& xml, std::string* error) {
    const auto files = std::make_unique<mjVFS>();
    mj_defaultVFS(files.get());
    if (mj_makeEmptyFileVFS(files.get(), "model.xml", static_cast<int>(xml.size())) != 0) Fail("no virtual file");
    std::memcpy(files->filedata[0], xml.data(), xml.size());
    char text[1000] = "";
    model_.reset(mj_loadXML("model.xml", files.get(), text, sizeof text));
    mj_deleteVFS(files.get());
    if (model_) data_.reset(mj_makeData(model_.get()));
    if (!data_) *error = model_ ? "mj_makeData: not enough memory" : text;
    return data_ != nullptr;
  }

  struct Free {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };
  WorldPlan plan_;
  std::unique_ptr<mjModel, Free> model_;
  std::unique_ptr<mjData, Free> data_;
  std::vector<int> joints_;  // number of the free joint, -1: static
};

std::unique_ptr<Peer> Make(const WorldPlan& plan, const Setting& setting) {
  return std::make_unique<MujocoPeer>(plan, setting);
}

}  // namespace

Engine TheEngine() {
  constexpr int kRates[] = {60, 120, 240, 480, 960}, kQuickRates[] = {120, 480};
  constexpr int kCounts[] = {3, 10, 30};
  Engine engine{.name = "mujoco", .version = mj_versionString(), .precision = "double", .settings = {}, .make = Make};
  AddTimeSteps({.solver = "Newton", .dt = 1.0 / 480, .is_default = true}, kRates, kQuickRates, &engine.settings);
  AddIterations({.solver = "Newton", .dt = 1.0 / 480}, kCounts, {}, &engine.settings);
  AddTimeSteps({.solver = "elliptic"}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "stiff"}, kRates, kQuickRates, &engine.settings);
  AddTimeSteps({.solver = "CG"}, kRates, {}, &engine.settings);
  return engine;
}

}  // namespace islet::peers
