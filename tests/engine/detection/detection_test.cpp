#include "engine/detection/detection.h"

#include <algorithm>
#include <random>
#include <stdexcept>
#include <tuple>

#include <gtest/gtest.h>

#include "engine/geometry/narrow_phase.h"
#include "parallel/worker_pool.h"
#include "tests/support/no_alloc.h"

namespace islet {
namespace {

struct Scene {
  std::vector<Body> bodies;
  std::vector<Shape> shapes;
  std::vector<Vector3> travel_W;
  std::vector<double> margins;

  int Add(const Shape& shape, const Vector3& position, BodyKind kind = BodyKind::kDynamic) {
    Body body;
    body.kind = kind;
    body.position_W = position;
    bodies.push_back(body);
    shapes.push_back(shape);
    travel_W.push_back(Vector3::Zero());
    margins.push_back(0.01);
    return static_cast<int>(bodies.size()) - 1;
  }
};

std::vector<Contact> Detect(const Scene& scene, bool include_frozen = false, int workers = 1) {
  parallel::WorkerPool pool(workers);
  Detector detector(&pool);
  std::vector<Contact> contacts;
  detector.Detect(scene.bodies, scene.shapes, scene.travel_W, scene.margins, &contacts, include_frozen);
  return contacts;
}

std::vector<std::pair<int, int>> Pairs(const std::vector<Contact>& contacts) {
  std::vector<std::pair<int, int>> pairs;
  for (const Contact& c : contacts) pairs.emplace_back(c.body_a, c.body_b);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}
using PairList = std::vector<std::pair<int, int>>;

bool Same(const Contact& p, const Contact& q) {
  return p.body_a == q.body_a && p.body_b == q.body_b && p.feature == q.feature && p.point_W == q.point_W &&
         p.normal_W == q.normal_W && p.gap == q.gap;
}

// Cubes, spheres and hulls thrown into a box of walls on a half-space; some frozen, some kinematic, some removed.
Scene RandomScene(unsigned seed, int count) {
  std::mt19937 rng(seed);
  auto uniform = [&](double lower, double upper) { return std::uniform_real_distribution<double>(lower, upper)(rng); };
  Scene scene;
  scene.Add(Shape::HalfSpace(), Vector3::Zero(), BodyKind::kFixed);
  scene.Add(Shape::Box({35, 0.5, 35}), {0, -4.5, 0}, BodyKind::kFixed);
  std::vector<Vector3> cloud;
  for (int i = 0; i < 15; ++i) cloud.emplace_back(uniform(-0.6, 0.6), uniform(-0.6, 0.6), uniform(-0.6, 0.6));
  const Shape hull = Shape::ConvexHull(cloud);
  for (int i = 0; i < count; ++i) {
    const Shape shape = i % 3 == 0 ? Shape::Sphere(0.5) : (i % 3 == 1 ? Shape::Box({0.5, 0.4, 0.6}) : hull);
    const int body = scene.Add(shape, {uniform(-4, 4), uniform(-4, 4), uniform(0, 6)});
    scene.bodies[body].rotation_WB =
        Quaternion(Eigen::Vector4d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1)).normalized());
    scene.travel_W[body] = 0.1 * Vector3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    scene.margins[body] = uniform(0, 0.05);
    scene.bodies[body].restitution = uniform(0, 1);
    if (i % 7 == 0) scene.bodies[body].frozen = true;
    if (i % 11 == 0) scene.bodies[body].kind = BodyKind::kKinematic, scene.bodies[body].frozen = false;
    if (i % 22 == 0) scene.bodies[body].linear_velocity_W.x() = 1;
    if (i % 13 == 0) scene.bodies[body].removed = true;
  }
  return scene;
}

// Every pair, straight from the header's words, without boxes and without a tree.
std::vector<Contact> BruteForce(const Scene& scene, bool include_frozen) {
  std::vector<Contact> contacts;
  const int n = static_cast<int>(scene.bodies.size());
  auto still = [](const Body& body) {
    if (body.kind == BodyKind::kFixed) return true;
    if (body.kind == BodyKind::kKinematic) return body.linear_velocity_W.norm() + body.angular_velocity_W.norm() == 0;
    return body.frozen;
  };
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      const Body &body_a = scene.bodies[a], &body_b = scene.bodies[b];
      if (body_a.removed || body_b.removed) continue;
      if (body_a.kind != BodyKind::kDynamic && body_b.kind != BodyKind::kDynamic) continue;
      if (!include_frozen && still(body_a) && still(body_b)) continue;
      const Vector3 travel = scene.travel_W[b] - scene.travel_W[a];
      std::vector<Contact> found;
      CollideShapes(scene.shapes[a], {body_a.position_W, body_a.rotation_WB.toRotationMatrix()}, scene.shapes[b],
                    {body_b.position_W, body_b.rotation_WB.toRotationMatrix()},
                    scene.margins[a] + scene.margins[b] + travel.norm(), &found);
      for (Contact& c : found) c.body_a = a, c.body_b = b;
      std::stable_sort(found.begin(), found.end(),
                       [](const Contact& p, const Contact& q) { return p.feature < q.feature; });
      contacts.insert(contacts.end(), found.begin(), found.end());
    }
  }
  return contacts;
}

TEST(Detector, CubeOnGroundUnderASphere) {
  Scene scene;
  scene.Add(Shape::HalfSpace(), {0, 0, 0}, BodyKind::kFixed);
  scene.Add(Shape::Box({0.5, 0.5, 0.5}), {0, 0, 0.5});
  scene.Add(Shape::Sphere(0.5), {0, 0, 1.505});
  const auto contacts = Detect(scene);
  ASSERT_EQ(contacts.size(), 5u);
  EXPECT_EQ(Pairs(contacts), (PairList{{0, 1}, {1, 2}}));
  EXPECT_NEAR(contacts[4].gap, 0.005, 1e-15);
}

TEST(Detector, ReachGrowsWithTheRelativeTravelOnly) {
  Scene scene;
  scene.Add(Shape::Sphere(0.5), {0, 0, 0});
  scene.Add(Shape::Sphere(0.5), {2, 0, 0});
  EXPECT_TRUE(Detect(scene).empty());
  scene.travel_W[0] = {0.7, 0, 0};
  scene.travel_W[1] = {-0.31, 0, 0};
  EXPECT_EQ(Detect(scene).size(), 1u);
  scene.travel_W[0] = scene.travel_W[1] = {-5, 0, 0};  // side by side: they do not come nearer
  EXPECT_TRUE(Detect(scene).empty());
}

TEST(Detector, WhoMeetsWhom) {
  Scene scene;
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  const int ground = scene.Add(Shape::HalfSpace(), {0, 0, 0}, BodyKind::kFixed);
  const int frozen_1 = scene.Add(cube, {0, 0, 0.5});
  const int frozen_2 = scene.Add(cube, {0, 0, 1.5});
  const int kinematic = scene.Add(cube, {1, 0, 0.5}, BodyKind::kKinematic);
  scene.bodies[frozen_1].frozen = scene.bodies[frozen_2].frozen = true;
  EXPECT_TRUE(Detect(scene).empty());
  const PairList frozen_pairs{{ground, frozen_1}, {frozen_1, frozen_2}, {frozen_1, kinematic}, {frozen_2, kinematic}};
  EXPECT_EQ(Pairs(Detect(scene, true)), frozen_pairs);
  scene.bodies[kinematic].angular_velocity_W.z() = 1;
  EXPECT_EQ(Pairs(Detect(scene)), (PairList{{frozen_1, kinematic}, {frozen_2, kinematic}}));
  scene.bodies[kinematic].removed = true;
  EXPECT_TRUE(Detect(scene).empty());
  const int awake = scene.Add(cube, {0, 0, 2.5});
  EXPECT_EQ(Pairs(Detect(scene)), (PairList{{frozen_2, awake}}));
}

TEST(Detector, FindsWhatBruteForceFinds) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Scene scene = RandomScene(seed, 150);
    for (bool include_frozen : {false, true}) {
      // The swept boxes may drop pairs that only the reach would keep: those have no contact the travel can close.
      const auto expected = BruteForce(scene, include_frozen);
      const auto contacts = Detect(scene, include_frozen);
      EXPECT_GT(contacts.size(), 100u);
      size_t next = 0, dropped = 0;
      for (const Contact& c : expected) {
        if (next < contacts.size() && Same(c, contacts[next])) {
          ++next;
        } else {
          ++dropped;
          EXPECT_GT(c.gap, 0);
        }
      }
      EXPECT_EQ(next, contacts.size());
      EXPECT_LT(dropped, expected.size() / 2);
    }
    Scene at_rest = scene;
    for (Vector3& travel : at_rest.travel_W) travel.setZero();
    const auto expected = BruteForce(at_rest, false);
    const auto contacts = Detect(at_rest);
    for (const Contact& c : expected) {
      if (c.gap > 0) continue;
      EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(), [&](const Contact& d) { return Same(c, d); }));
    }
  }
}

TEST(Detector, SameBitsForAnyNumberOfWorkersAndAnyHistoryOfTheTree) {
  parallel::WorkerPool pool(2);
  Detector detector(&pool);
  std::vector<Contact> contacts;
  for (unsigned frame = 0; frame < 80; ++frame) {
    const Scene scene = RandomScene(100 + frame % 40, 300 - static_cast<int>(frame));
    detector.Detect(scene.bodies, scene.shapes, scene.travel_W, scene.margins, &contacts);
    const auto fresh = Detect(scene, false, 1);
    ASSERT_EQ(contacts.size(), fresh.size());
    for (size_t c = 0; c < fresh.size(); ++c) ASSERT_TRUE(Same(contacts[c], fresh[c]));
  }
}

// One detector that keeps what it found against one that never saw the world before: bodies that drift, stay, jump, come,
// go, freeze, wake, change their kind, their shape, their material; half-spaces that come and go.
TEST(Detector, KeptContactsAreThoseOfAFreshDetection) {
  for (const int workers : {1, 3}) {
    std::mt19937 rng(7);
    auto uniform = [&](double lower, double upper) {
      return std::uniform_real_distribution<double>(lower, upper)(rng);
    };
    auto one_in = [&](int n) { return std::uniform_int_distribution<int>(1, n)(rng) == 1; };
    auto vector = [&](double size) {
      return Vector3(uniform(-size, size), uniform(-size, size), uniform(-size, size));
    };
    parallel::WorkerPool pool(workers);
    Detector detector(&pool), forgetful(&pool, /*keep=*/false);
    std::vector<Contact> contacts, anew;
    Scene scene = RandomScene(3, 250);
    size_t found = 0, kept = 0;
    for (int call = 0; call < 120; ++call) {
      const double share = call % 4 == 0 ? 1 : uniform(0, 0.3);  // of the bodies that move in this call
      const int n = static_cast<int>(scene.bodies.size());
      for (int i = 2; i < n; ++i) {
        Body& body = scene.bodies[i];
        if (uniform(0, 1) < share) {
          body.position_W += scene.travel_W[i] + vector(1e-3);
          body.rotation_WB = (body.rotation_WB * Quaternion(Eigen::AngleAxisd(uniform(-0.1, 0.1), Vector3::UnitX())));
          if (one_in(2)) scene.travel_W[i] = vector(one_in(5) ? 0.5 : 0.05);
          if (one_in(3)) scene.margins[i] = uniform(0, 0.05);
        }
        if (one_in(200)) body.position_W = Vector3(uniform(-4, 4), uniform(-4, 4), uniform(0, 6));
        if (one_in(100)) body.frozen = body.kind == BodyKind::kDynamic && !body.frozen;
        if (one_in(300)) body.removed = !body.removed;
        if (one_in(300)) body.kind = body.kind == BodyKind::kDynamic ? BodyKind::kKinematic : BodyKind::kDynamic;
        if (body.kind == BodyKind::kKinematic) {
          body.frozen = false;
          body.linear_velocity_W.x() = one_in(2) ? 1 : 0;
        }
        if (one_in(200)) scene.shapes[i] = Shape::Box({uniform(0.2, 0.6), 0.5, 0.4});
      }
      if (one_in(8)) scene.Add(Shape::Sphere(0.4), {uniform(-4, 4), uniform(-4, 4), uniform(0, 6)});
      if (one_in(20)) scene.Add(Shape::HalfSpace(), {0, 0, uniform(-1, 0.5)}, BodyKind::kFixed);
      if (one_in(20)) scene.bodies[0].removed = !scene.bodies[0].removed;
      if (one_in(20)) {  // the last ones leave for good, as in another world
        const size_t left = scene.bodies.size() - 3;
        scene.bodies.resize(left);
        scene.shapes.erase(scene.shapes.begin() + static_cast<std::ptrdiff_t>(left), scene.shapes.end());
        scene.travel_W.resize(left);
        scene.margins.resize(left);
      }
      const bool include_frozen = one_in(3);
      detector.Detect(scene.bodies, scene.shapes, scene.travel_W, scene.margins, &contacts, include_frozen);
      const auto fresh = Detect(scene, include_frozen);
      forgetful.Detect(scene.bodies, scene.shapes, scene.travel_W, scene.margins, &anew, include_frozen);
      ASSERT_EQ(contacts.size(), fresh.size()) << "call " << call;
      ASSERT_EQ(anew.size(), fresh.size()) << "call " << call;
      for (size_t c = 0; c < fresh.size(); ++c) {
        ASSERT_TRUE(Same(contacts[c], fresh[c])) << "call " << call;
        ASSERT_TRUE(Same(anew[c], fresh[c])) << "call " << call;
      }
      found += fresh.size();
      kept += detector.kept().contacts;
      EXPECT_EQ(forgetful.kept().pairs, 0);
    }
    EXPECT_GT(found, 20000u);
    EXPECT_GT(kept, found / 4);
  }
}

// On one worker, whose allocations are seen. Once a motion has been seen, going through it again allocates only where FCL
// builds its tree anew: once in 32 calls.
TEST(Detector, AllocatesNothingAfterWarmUp) {
  const Scene scene = RandomScene(5, 200);
  parallel::WorkerPool pool(1);
  Detector detector(&pool);
  std::vector<Contact> contacts;
  constexpr int kCalls = 96;
  int allocating = 0;
  for (int round = 0; round < 4; ++round) {
    Scene moving = scene;
    allocating = 0;
    for (int call = 0; call < kCalls; ++call) {
      const double side = call < kCalls / 2 ? 0.02 : -0.02;
      for (size_t i = 2; i < moving.bodies.size(); i += 1 + call % 3) moving.bodies[i].position_W.x() += side;
      const testing::AllocationCounter counter;
      detector.Detect(moving.bodies, moving.shapes, moving.travel_W, moving.margins, &contacts);
      allocating += counter.count() > 0;
    }
  }
  EXPECT_LE(allocating, kCalls / 32 + 1);
}

TEST(Detector, OrderOfTheBodiesDoesNotMatter) {
  const Scene scene = RandomScene(17, 120);
  const int n = static_cast<int>(scene.bodies.size());
  std::vector<int> order(n);
  for (int i = 0; i < n; ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), std::mt19937(2));
  Scene shuffled;
  for (int i : order) {
    shuffled.bodies.push_back(scene.bodies[i]);
    shuffled.shapes.push_back(scene.shapes[i]);
    shuffled.travel_W.push_back(scene.travel_W[i]);
    shuffled.margins.push_back(scene.margins[i]);
  }
  using Summary = std::tuple<int, int, double, double, double>;
  auto summarise = [](const std::vector<Contact>& contacts, const std::vector<int>* names) {
    std::vector<Summary> list;
    for (const Contact& c : contacts) {
      const int a = names ? (*names)[c.body_a] : c.body_a, b = names ? (*names)[c.body_b] : c.body_b;
      list.emplace_back(std::min(a, b), std::max(a, b), c.point_W.x(), c.point_W.y(), c.gap);
    }
    std::sort(list.begin(), list.end());
    return list;
  };
  const auto here = summarise(Detect(scene), nullptr), there = summarise(Detect(shuffled), &order);
  ASSERT_EQ(here.size(), there.size());
  for (size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(std::get<0>(here[i]), std::get<0>(there[i]));
    EXPECT_EQ(std::get<1>(here[i]), std::get<1>(there[i]));
    EXPECT_NEAR(std::get<2>(here[i]), std::get<2>(there[i]), 1e-11);
    EXPECT_NEAR(std::get<3>(here[i]), std::get<3>(there[i]), 1e-11);
    EXPECT_NEAR(std::get<4>(here[i]), std::get<4>(there[i]), 1e-12);
  }
}

TEST(Detector, SortedByPairThenFeature) {
  const auto contacts = Detect(RandomScene(23, 200));
  for (size_t c = 1; c < contacts.size(); ++c) {
    const Contact &p = contacts[c - 1], &q = contacts[c];
    EXPECT_LT(p.body_a, p.body_b);
    EXPECT_LE(std::make_tuple(p.body_a, p.body_b, p.feature), std::make_tuple(q.body_a, q.body_b, q.feature));
  }
}

TEST(Detector, RejectsSpansOfDifferentSizes) {
  Scene scene;
  scene.Add(Shape::Sphere(1), {0, 0, 0});
  scene.travel_W.clear();
  EXPECT_THROW(Detect(scene), std::invalid_argument);
}

TEST(Detector, EmptyWorldAndOnlyHalfSpaces) {
  Scene scene;
  EXPECT_TRUE(Detect(scene).empty());
  scene.Add(Shape::HalfSpace(), {0, 0, 0}, BodyKind::kFixed);
  scene.Add(Shape::HalfSpace(), {0, 0, -1}, BodyKind::kKinematic);
  EXPECT_TRUE(Detect(scene).empty());
}

}  // namespace
}  // namespace islet
