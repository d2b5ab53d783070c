// Walks through every door that README.md names, linked to an installed islet.
#include <islet/contact_suite.h>
#include <islet/parallel/worker_pool.h>
#include <islet/world.h>

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#if defined(TBB_VERSION_MAJOR) || defined(FCL_VERSION) || defined(SUITESPARSE_VERSION)
#error "a header of islet shows a library that it uses inside"
#endif

namespace {

int failures = 0;
void Expect(bool holds, const char* what) {
  if (holds) return;
  std::printf("not so: %s\n", what);
  ++failures;
}

void DropACube() {
  islet::Settings settings;
  settings.threads = 1;
  settings.Validate();
  islet::World world(settings);
  world.Add({.shape = islet::Shape::HalfSpace(), .kind = islet::BodyKind::kFixed});
  const int cube = world.Add({.shape = islet::Shape::Box({0.5, 0.5, 0.5}), .position_W = {0, 0, 1}});
  const int ball = world.Add({.shape = islet::Shape::Sphere(0.25), .position_W = {3, 0, 0.25}});
  world.SetMaterialCallback([](const islet::Contact& contact, const islet::Body&, const islet::Body&) {
    return islet::Material{islet::MixFriction(contact.friction, 0.5), islet::MixRestitution(contact.restitution, 0)};
  });
  int problems = 0;
  world.SetProblemObserver([&](const islet::ProblemRecord& record) { problems += record.problem.num_contacts() > 0; });
  const islet::WorldSnapshot start = world.Save();
  islet::StepReport run;
  for (int i = 0; i < 60; ++i) run.Append(world.Step(1.0 / 60));
  Expect(std::abs(world.body(cube).position_W.z() - 0.5) < 1e-4, "the cube lies on the floor");
  Expect(world.body(ball).KineticEnergy() < 1e-12, "the ball rests");
  Expect(!run.Failed() && run.ledger.Clean() && problems > 0, "every step is clean");
  const auto hash = world.StateHash();
  world.Restore(start);
  for (int i = 0; i < 60; ++i) world.Step(1.0 / 60);
  Expect(world.StateHash() == hash, "what is restored goes the same way");
  try {
    world.Add({.shape = islet::Shape::Sphere(1), .friction = -1});
    Expect(false, "a friction of -1 is refused");
  } catch (const std::invalid_argument& error) {
    Expect(std::string(error.what()).find("friction") != std::string::npos, "the message names the field");
  }
}

// A simulator with its own bodies and contacts.
void ResolveOnly() {
  islet::parallel::WorkerPool pool(2);
  islet::ContactSuite suite(islet::Settings{}, &pool);
  std::vector<islet::Body> bodies(2);
  bodies[0].kind = islet::BodyKind::kFixed;
  bodies[1].radius = 1;
  bodies[1].linear_velocity_W = {0, 0, -1};
  islet::Contact contact;
  contact.body_a = 0, contact.body_b = 1;
  contact.point_W = {0, 0, -1};
  islet::StepReport report;
  suite.Resolve(0.01, bodies, std::vector{contact}, &report);
  Expect(std::abs(islet::NormalVelocity(contact, bodies[0], bodies[1])) < 1e-9, "the contact does not close");
  Expect(std::abs(suite.impulses()[0].z() - 1) < 0.2, "the impulse stops a kilogram");
  islet::ApplyImpulse(contact, islet::ContactFrame(contact.normal_W) * islet::Vector3(1, 0, 0), bodies);
  Expect(std::abs(islet::RelativeVelocity(contact, bodies[0], bodies[1]).z() - 1) < 1e-9, "a newton second more");
  Expect(std::string(islet::ToString(islet::QpStatus::kSolved)) == "solved", "a status has a name");
}

}  // namespace

int main() {
  DropACube();
  ResolveOnly();
  std::printf("%d failures\n", failures);
  return failures;
}
