#include "qp/newton/least_change.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "qp/body_algebra.h"

namespace islet::testing {
namespace {

using qp::LeastChange;
using qp::Problem;
using qp::Vector3;
using qp::Vector6;

// Of a body at the origin, with a wall below: normal y, tangents x and z.
qp::Jacobian JacobianAt(const Vector3& point) {
  qp::Jacobian jacobian;
  const Vector3 axes[] = {Vector3::UnitY(), Vector3::UnitX(), Vector3::UnitZ()};
  for (int row = 0; row < 3; ++row) jacobian.row(row) << axes[row].transpose(), point.cross(axes[row]).transpose();
  return jacobian;
}

// Bodies side by side, each on four feet of friction 1/2 at (+-1, -1, +-1).
Problem Tables(int count) {
  Problem problem;
  problem.bodies.resize(count);
  for (int body = 0; body < count; ++body)
    for (const double x : {-1.0, 1.0})
      for (const double z : {-1.0, 1.0}) {
        qp::ContactTerm& foot = problem.contacts.emplace_back();
        foot.body_b = body;
        foot.jacobian_b = JacobianAt({x, -1, z});
        foot.friction = 0.5;
      }
  return problem;
}

// A push along x by its centre, and the turn about z that balances it on the feet's level.
std::vector<double> Push(int count, double push) {
  std::vector<double> wanted(6 * count, 0.0);
  for (int body = 0; body < count; ++body) wanted[6 * body] = push, wanted[6 * body + 5] = push;
  return wanted;
}

void ExpectGiven(const Problem& problem, const std::vector<Vector3>& impulses, const std::vector<Vector3>& change,
                 const std::vector<double>& wanted) {
  std::vector<double> left = wanted;
  for (size_t c = 0; c < change.size(); ++c) {
    AddForce(problem.contacts[c], 6, 0, -1, change[c], &left);
    const Vector3 j = impulses[c] + change[c];
    EXPECT_LE(j.tail<2>().norm(), problem.contacts[c].friction * j[0] * (1 + 1e-12)) << c;
  }
  for (const double miss : left) EXPECT_NEAR(miss, 0, 1e-9);
}

// By symmetry each foot gives a quarter.
TEST(LeastChange, IsSharedByAllThatPressAlike) {
  Problem problem = Tables(1);
  const std::vector<Vector3> impulses(4, Vector3(1, 0, 0));
  LeastChange least;
  least.Prepare(impulses, &problem);
  std::vector<Vector3> change;
  ASSERT_TRUE(least.Find(Push(1, 0.4), {1e-10}, 1e-9, LeastChange::Reach::kFar, &change));
  for (const Vector3& part : change) EXPECT_LT((part - Vector3(0, 0.1, 0)).norm(), 1e-9) << part.transpose();
}

// Feet that push each other apart as hard as friction lets them: two can give no more, and along the cones nothing gives a push without a
// turn. The other two can.
TEST(LeastChange, IsFoundWhereWhatIsAtHandIsAtItsEnd) {
  Problem problem = Tables(1);
  const std::vector<Vector3> impulses = {{1, -0.5, 0}, {1, -0.5, 0}, {1, 0.5, 0}, {1, 0.5, 0}};
  LeastChange least;
  least.Prepare(impulses, &problem);
  std::vector<Vector3> change;
  for (const double push : {0.4, 1.9}) {
    ASSERT_TRUE(least.Find(Push(1, push), {1e-10}, 1e-9, LeastChange::Reach::kFar, &change)) << push;
    ExpectGiven(problem, impulses, change, Push(1, push));
  }
}

// A body between two walls that press it with 1 each, and friction 1/2: a push of 1.1 along them needs 1.1. What gives it presses little harder,
// however often that is asked anew from what was found.
TEST(LeastChange, WallsDoNotPressHarderAndHarder) {
  Problem problem;
  problem.bodies.resize(1);
  for (const double side : {-1.0, 1.0}) {
    qp::ContactTerm& wall = problem.contacts.emplace_back();
    wall.body_b = 0;
    wall.jacobian_b = JacobianAt({0, side, 0});
    wall.jacobian_b.row(0) *= -side;
    wall.friction = 0.5;
  }
  std::vector<Vector3> impulses(2, Vector3(1, 0, 0)), change;
  std::vector<double> wanted(6, 0.0);
  for (int k = 0; k < 12; ++k) {
    wanted[0] = k == 0 ? 1.1 : k % 2 == 0 ? 2.2 : -2.2;
    for (Vector3& j : impulses) j[0] = std::min(j[0], 1.1);  // what presses harder would do
    LeastChange least;
    least.Prepare(impulses, &problem);
    ASSERT_TRUE(least.Find(wanted, {1e-10}, 1e-9, LeastChange::Reach::kFar, &change)) << k;
    ExpectGiven(problem, impulses, change, wanted);
    for (size_t c = 0; c < 2; ++c) impulses[c] += change[c];
    EXPECT_LT(impulses[0][0], 2) << k;
  }
}

// Friction gives 2 of the four feet's load; then the one that is pushed harder gives way, along the push, and not its neighbour.
TEST(LeastChange, TellsWhoGivesWay) {
  Problem problem = Tables(2);
  std::vector<Vector3> impulses(8, Vector3(1, 0, 0)), change;
  LeastChange least;
  least.Prepare(impulses, &problem);
  std::vector<double> wanted = Push(2, 1);
  for (const int at : {6, 11}) wanted[at] = 2.1;
  EXPECT_FALSE(least.Find(wanted, {1e-10, 1e-10}, 1e-9, LeastChange::Reach::kFar, &change));
  for (const Vector3& part : change) EXPECT_EQ(part, Vector3::Zero());
  const std::vector<double>& way = least.mechanism();
  const Eigen::Map<const Vector6> stands(&way[0]), slides(&way[6]);
  EXPECT_LT(stands.norm(), 0.1 * slides.norm());
  EXPECT_GT(slides[0], 0.5 * slides.norm());
  for (const int at : {6, 11}) wanted[at] = 1.9;
  ASSERT_TRUE(least.Find(wanted, {1e-10, 1e-10}, 1e-9, LeastChange::Reach::kFar, &change));
  ExpectGiven(problem, impulses, change, wanted);
}

}  // namespace
}  // namespace islet::testing
