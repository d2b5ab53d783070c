// Invariance: what must not change the answer. Threads, the numbers of the bodies, the units, a stop in between.
#include <algorithm>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <numeric>
#include <string>
#include <vector>

#include "engine/contact_suite.h"
#include "scenes/random.h"
#include "scenes/scene.h"
#include "scenes/verify/builders.h"
#include "scenes/verify/check.h"

namespace islet {
namespace {

using namespace verify;

// What a unit of length, mass and time is worth: definitions and settings in other units are the same physics.
struct Units {
  double length = 1, mass = 1, time = 1;

  BodyDefinition Convert(BodyDefinition d) const {
    const Vector3 half = d.shape.half_extents();
    if (d.shape.kind() == ShapeKind::kBox) d.shape = Shape::Box(length * half);
    if (d.shape.kind() == ShapeKind::kSphere) d.shape = Shape::Sphere(length * half.x());
    if (d.mass) *d.mass *= mass;
    d.position_W *= length;
    d.linear_velocity_W *= length / time;
    d.angular_velocity_W /= time;
    return d;
  }
  Settings Convert(Settings s) const {
    s.gravity *= length / (time * time);
    s.freeze_seconds *= time;
    return s;
  }
};

World Build(const std::vector<BodyDefinition>& definitions, const Settings& settings, const Units& units = {}) {
  World world(units.Convert(settings));
  for (const BodyDefinition& d : definitions) world.Add(units.Convert(d));
  return world;
}

BodyDefinition Wall(const Vector3& half, const Vector3& position) {
  return {.shape = Shape::Box(half), .kind = BodyKind::kFixed, .position_W = position, .friction = 0.5};
}

// Cubes, slabs and balls of masses from 0.2 to 5 kg that fall into an open box, turned at random: everything that an engine
// does happens within two seconds.
std::vector<BodyDefinition> FallingHeap(int count, bool only_balls = false) {
  std::vector<BodyDefinition> heap{Wall({2.5, 2.5, 0.5}, {0, 0, -0.5}), Wall({0.5, 2.5, 3}, {2.5, 0, 3}),
                                   Wall({0.5, 2.5, 3}, {-2.5, 0, 3}), Wall({1.99, 0.5, 3}, {0, 2.5, 3}),
                                   Wall({1.99, 0.5, 3}, {0, -2.5, 3})};
  SplitMix64 random(43);
  for (int i = 0; i < count; ++i) {
    const Vector3 place(1.25 * (i % 3 - 1), 1.25 * (i / 3 % 3 - 1), 0.9 + 1.25 * (i / 9));
    BodyDefinition d = only_balls || i % 3 == 0 ? Ball(place, random.Uniform(0.2, 0.5)) : Cube(place);
    if (!only_balls && i % 3 == 1)
      d.shape = Shape::Box({random.Uniform(0.2, 0.35), random.Uniform(0.2, 0.35), random.Uniform(0.1, 0.35)});
    if (!only_balls && i % 3 == 2) d.shape = Shape::Box({0.3, 0.3, 0.3});
    d.mass = std::exp(random.Uniform(std::log(0.2), std::log(5)));
    d.restitution = 0.3;
    d.rotation_WB = random.Rotation(3);
    d.linear_velocity_W = {random.Uniform(-1, 1), random.Uniform(-1, 1), -2};
    d.angular_velocity_W = 2 * random.Direction();
    heap.push_back(d);
  }
  return heap;
}

// Of all poses, velocities, frozen flags and impulses, bit for bit, after each step.
std::vector<std::uint64_t> Hashes(World* world, int frames, double dt) {
  std::vector<std::uint64_t> hashes;
  for (int i = 0; i < frames; ++i) {
    world->Step(dt);
    std::uint64_t hash = world->StateHash();
    for (const Vector3& impulse : world->impulses())
      for (const double x : impulse) hash = (hash ^ std::bit_cast<std::uint64_t>(x)) * 0x100000001b3u;  // FNV-1a
    hashes.push_back(hash);
  }
  return hashes;
}

int CountDifferent(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b) {
  int different = 0;
  for (size_t i = 0; i < a.size(); ++i) different += i >= b.size() || a[i] != b[i];
  return different;
}

// ---- T42

void ThreadsDoNotMatter(const CheckSettings& s, Measurements* out) {
  const int frames = Frames(s.quick ? 1 : 2, s.dt);
  const auto run = [&](int threads) {
    Settings settings = s.engine;
    settings.threads = threads;
    BuiltScene built = BuildScene(*FindScene("cubeglass"), {.count = 60}, settings);
    return Hashes(&built.world, frames, s.dt);
  };
  const std::vector<std::uint64_t> one = run(1);
  for (const int threads : {2, 3, 8})
    out->Absolute("hourglass of 60 cubes, frames that differ on " + std::to_string(threads) + " threads", "", 0,
                  CountDifferent(one, run(threads)), 0);
}

// One step of the same bodies, added in another order. In the order of `definitions`.
std::vector<Twist> StepPermuted(const std::vector<BodyDefinition>& definitions, std::uint64_t seed,
                                const CheckSettings& s, double* scale) {
  std::vector<size_t> order(definitions.size());
  std::iota(order.begin(), order.end(), 0);
  SplitMix64 random(seed);
  for (size_t i = order.size(); seed > 0 && i > 1; --i) std::swap(order[i - 1], order[random.Next() % i]);
  std::vector<BodyDefinition> shuffled;
  for (const size_t i : order) shuffled.push_back(definitions[i]);
  World world = Build(shuffled, s.engine);
  world.Step(s.dt);
  std::vector<Twist> velocities(definitions.size());
  for (size_t place = 0; place < order.size(); ++place) {
    const Body& b = world.bodies()[place];
    velocities[order[place]] = {b.linear_velocity_W, b.angular_velocity_W};
  }
  for (const BodyDefinition& d : definitions) *scale = std::max(*scale, d.linear_velocity_W.norm());
  return velocities;
}

// Root mean square over the bodies, as the tolerance is one over the contacts; the worst of five orders. Of v_ref.
double ChangeByOrder(const std::vector<BodyDefinition>& definitions, const CheckSettings& s) {
  double scale = s.engine.gravity.norm() * s.dt;  // v_ref: what tolerances are relative to
  const std::vector<Twist> first = StepPermuted(definitions, 0, s, &scale);
  double worst = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const std::vector<Twist> other = StepPermuted(definitions, seed, s, &scale);
    double sum = 0;
    int moving = 0;
    for (size_t i = 0; i < first.size(); ++i) {
      if (definitions[i].kind != BodyKind::kDynamic) continue;
      sum += (first[i].linear_W - other[i].linear_W).squaredNorm() +
             std::pow(definitions[i].shape.radius(), 2) * (first[i].angular_W - other[i].angular_W).squaredNorm();
      ++moving;
    }
    worst = std::max(worst, std::sqrt(sum / moving));
  }
  return worst / scale;
}

constexpr double kRestShare = 1e-4;  // of g dt: what is slower rests

// [m/s] of the fastest point that moves.
double Fastest(const World& world) {
  double fastest = 0;
  for (const Body& b : world.bodies())
    if (b.Moves()) fastest = std::max(fastest, b.linear_velocity_W.norm() + b.radius * b.angular_velocity_W.norm());
  return fastest;
}

// The same bodies as they are in a world.
std::vector<BodyDefinition> DefinitionsIn(const World& world, std::vector<BodyDefinition> definitions) {
  for (size_t i = 0; i < definitions.size(); ++i) {
    const Body& b = world.bodies()[i];
    definitions[i].position_W = b.position_W;
    definitions[i].rotation_WB = b.rotation_WB;
    definitions[i].linear_velocity_W = b.linear_velocity_W;
    definitions[i].angular_velocity_W = b.angular_velocity_W;
  }
  return definitions;
}

// The bodies as they are at some moment of a run, or once they rest after that, for which they have four times as long: how long
// a heap trembles is chance. They rest by themselves, without impulses that the world remembers: what friction wedges may rest or move, and
// both are exact answers (certified to 1e-9 of v_ref, 2e-2 apart).
std::vector<BodyDefinition> DefinitionsAt(std::vector<BodyDefinition> definitions, int frames, const CheckSettings& s,
                                          bool at_rest = false) {
  World world = Build(definitions, s.engine);
  StepTimes(&world, frames, s.dt);
  const double rest = kRestShare * s.engine.gravity.norm() * s.dt;
  for (int k = 0; at_rest && k < 3 * frames; ++k) {
    if (Fastest(world) <= rest) {
      const std::vector<BodyDefinition> resting = DefinitionsIn(world, definitions);
      world = Build(resting, s.engine);
      StepTimes(&world, 1, s.dt);
      if (Fastest(world) <= rest) return resting;
    }
    StepTimes(&world, 1, s.dt);
  }
  return DefinitionsIn(world, definitions);
}

// Frictionless or at rest: there the velocities are unique. Where bodies slide several answers obey Coulomb's law, and the
// numbers decide between them.
// Of 26 heaps of boxes (dt 1/250 to 1/60) two change by 9e-5 and 2e-4, the others by less than 5e-5; of nine at rest (1/230 to 1/60) two by
// 2e-3 and 5e-3 (the second one still moved after 64 s), the others by less than 4e-7.
constexpr double kGapSlack = 1e-3;
void NumbersDoNotMatter(const CheckSettings& s, Measurements* out) {
  std::vector<BodyDefinition> pyramid{Floor()};
  SplitMix64 random(42);
  for (int row = 0; row < 6; ++row)
    for (int i = 0; i < 6 - row; ++i)
      pyramid.push_back(Cube({1.02 * i + 0.51 * row, 0.03 * i, row + 0.5}, 0.5, 0, random.Uniform(0.2, 5)));
  const double tolerance = 2 * s.engine.tolerance;  // two answers, each within the tolerance of the right one
  out->AtMost("renumbered pyramid of 21 cubes: change of velocities / v_ref", "", ChangeByOrder(pyramid, s), tolerance);
  for (const auto& [seconds, name] : {std::pair(0.5, "0.5 s"), std::pair(1.0, "1 s")}) {
    std::vector<BodyDefinition> balls = FallingHeap(27, true), boxes = FallingHeap(27);
    for (BodyDefinition& d : balls) d.friction = 0;
    for (BodyDefinition& d : boxes) d.friction = 0;
    const int frames = Frames(seconds, s.dt);
    out->AtMost(std::string("renumbered heap of balls, no friction, after ") + name, "",
                ChangeByOrder(DefinitionsAt(balls, frames, s), s), kGapSlack,
                "gaps of a crowd may miss their end by 2.5e-4 of a size");
    out->AtMost(
        std::string("renumbered heap of boxes, no friction, after ") + name, "",
        ChangeByOrder(DefinitionsAt(boxes, frames, s), s), kGapSlack,
        "of two faces whose gaps differ by less than 1e-6 to 1e-4 of a size detection takes that of the smaller "
        "number for the contact's normal");
  }
  out->AtMost("renumbered heap with friction at rest", "",
              ChangeByOrder(DefinitionsAt(FallingHeap(27), Frames(16, s.dt), s, /*at_rest=*/true), s), kGapSlack);
}

void MeasureOrder(const CheckSettings& s, Measurements* out) {
  ThreadsDoNotMatter(s, out);
  NumbersDoNotMatter(s, out);
}

// ---- T43

// [lengths] farthest that a body of b is from where a has it, over a run in steps of dt of each one's units.
double Deviation(World* a, const Units& ua, World* b, const Units& ub, int frames, double dt) {
  double worst = 0;
  for (int frame = 0; frame < frames; ++frame) {
    a->Step(ua.time * dt);
    b->Step(ub.time * dt);
    for (size_t i = 0; i < a->bodies().size(); ++i) {
      const Body &p = a->bodies()[i], &q = b->bodies()[i];
      const double apart = (p.position_W / ua.length - q.position_W / ub.length).norm(),
                   turned = (p.rotation_WB.coeffs() - q.rotation_WB.coeffs()).norm();
      worst = Worse(worst, Worse(apart, turned));
    }
  }
  return worst;
}

struct UnitsCase {
  const char* name;
  Units units;
};

// A block that slides, a ball that bounces, one that rolls and a stack, far from each other: nothing here is chaotic.
std::vector<BodyDefinition> OrderlyScene() {
  std::vector<BodyDefinition> scene{Floor()};
  scene.push_back(Cube({0, 0, 0.5}));
  scene.back().linear_velocity_W = {3, 1, 0};
  scene.push_back(Ball({20, 0, 1.5}, 0.5, 0.5, 0.8));
  scene.push_back(Ball({40, 0, 0.5}));
  scene.back().linear_velocity_W = {2, 0, 0};
  for (int i = 0; i < 4; ++i) scene.push_back(Cube({60, 0, i + 0.5}, 0.5, 0, 1 + i));
  return scene;
}

void MeasureScale(const CheckSettings& s, Measurements* out) {
  // Powers of two change no digit of any number: with no hidden unit in the engine, every bit of a chaotic fall stays. (Even
  // powers for the mass: the solver takes its root.)
  constexpr UnitsCase kBinary[] = {{"length x 2^10", {0x1p10, 1, 1}},
                                   {"length x 2^-10", {0x1p-10, 1, 1}},
                                   {"mass x 2^20", {1, 0x1p20, 1}},
                                   {"mass x 2^-20", {1, 0x1p-20, 1}},
                                   {"g x 64", {1, 1, 0x1p-3}},
                                   {"length x 2^10, same g", {0x1p10, 1, 0x1p5}},
                                   {"length x 2^-10, mass x 2^-20, same g", {0x1p-10, 0x1p-20, 0x1p-5}}};
  const std::vector<BodyDefinition> heap = FallingHeap(27), orderly = OrderlyScene();
  const int frames = Frames(s.quick ? 1.5 : 3, s.dt);
  for (const auto& [name, units] : kBinary) {
    World one = Build(heap, s.engine), other = Build(heap, s.engine, units);
    out->AtMost(std::string("heap, ") + name + ": farthest apart, in lengths", "",
                Deviation(&one, {}, &other, units, frames, s.dt), 0);
  }
  // Other factors round: 1e-16 a step, and what the solver's tolerance makes of it.
  const UnitsCase kDecimal[] = {{"length x 1e3", {1e3, 1, 1}},
                                {"length x 1e-3", {1e-3, 1, 1}},
                                {"mass x 1e6", {1, 1e6, 1}},
                                {"mass x 1e-6", {1, 1e-6, 1}},
                                {"g x 100", {1, 1, 0.1}},
                                {"length x 1e3, same g", {1e3, 1, std::sqrt(1e3)}},
                                {"length x 1e-3, mass x 1e-6, same g", {1e-3, 1e-6, std::sqrt(1e-3)}}};
  for (const auto& [name, units] : kDecimal) {
    World one = Build(orderly, s.engine), other = Build(orderly, s.engine, units);
    out->AtMost(std::string("slide, bounce, roll and stack, ") + name, "",
                Deviation(&one, {}, &other, units, frames, s.dt), 1e-9);
  }
}

// ---- T45

void MeasureRestart(const CheckSettings& s, Measurements* out) {
  const std::vector<BodyDefinition> heap = FallingHeap(27);
  for (const auto& [seconds, when] :
       {std::pair(0.25, "in mid-impact"), std::pair(0.6, "in the heap"), std::pair(3.0, "coming to rest")}) {
    const int before = Frames(seconds, s.dt), after = Frames(1, s.dt);
    World world = Build(heap, s.engine);
    StepTimes(&world, before, s.dt);
    const WorldSnapshot snapshot = world.Save();
    const std::vector<std::uint64_t> whole = Hashes(&world, after, s.dt);
    Settings more_threads = s.engine;
    more_threads.threads = 2;
    World other(more_threads);
    other.Restore(snapshot);
    out->Absolute(std::string(when) + ", into a new world: frames that differ", "", 0,
                  CountDifferent(whole, Hashes(&other, after, s.dt)), 0);
    world.Restore(snapshot);
    out->Absolute(std::string(when) + ", back in the same world: frames that differ", "", 0,
                  CountDifferent(whole, Hashes(&world, after, s.dt)), 0);
  }
}

constexpr Check kChecks[] = {
    {"T42", "order of work and numbers of bodies", Gate::kGate,
     "equal bits on any number of threads; velocities equal to the tolerance under any numbering", MeasureOrder},
    {"T43", "units", Gate::kGate, "equal motion in units of length, mass and time", MeasureScale},
    {"T45", "restart from a snapshot", Gate::kGate, "equal bits", MeasureRestart},
};

}  // namespace

std::span<const Check> InvarianceChecks() { return kChecks; }

}  // namespace islet
