#include "qp/newton/proximal.h"

#include <algorithm>
#include <cmath>

#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr double kPace = 5;  // by which springs become stiffer, or softer
constexpr int kEasy = 4;     // Newton steps of a proximal step that may become stiffer

}  // namespace

Matrix3 SpringSlope(Vector3 pull, double friction, double rests) {
  if (std::abs(pull[0]) < rests) pull[0] = rests;
  const double tangent = TangentSize(pull);
  Matrix3 slope = Matrix3::Zero();
  if (pull[0] <= 0) return slope;
  if (tangent < friction * pull[0]) return Matrix3::Identity();
  slope(0, 0) = 1;
  if (tangent == 0) return slope;
  const double cosine = pull[1] / tangent, sine = pull[2] / tangent, turn = friction * pull[0] / tangent;
  slope.bottomLeftCorner<2, 1>() << friction * cosine, friction * sine;
  slope.bottomRightCorner<2, 2>() << turn * sine * sine, -turn * sine * cosine, -turn * sine * cosine,
      turn * cosine * cosine;
  return slope;
}

double ProximalPace::Stiffness(double residual, double speed) {
  stiffness_ = std::min(stiffness_, limit_);
  if (speed > 0) stiffness_ = std::max(kLeast, std::min(stiffness_, residual / (kUlp * speed)));
  return stiffness_;
}

bool ProximalPace::Takes(double map, bool solved, int newton_steps, bool refines) {
  const bool better = map < best_;
  stalled_ = map < (refines ? 0.5 * halved_ : best_) ? 0 : stalled_ + 1;
  if (stalled_ == 0) halved_ = map;
  if (better) best_ = map;
  const bool taken = solved || better;
  if (taken) {
    if (newton_steps <= kEasy) stiffness_ *= kPace;
    limit_ = std::min(kMost, kPace * limit_);
  } else {
    stiffness_ /= kPace;
    limit_ = stiffness_;
  }
  return taken;
}

bool ProximalPace::GoesOn(bool refines) const {
  return stiffness_ > kLeast && stalled_ < (refines ? kPatience / 4 : kPatience);
}

}  // namespace islet::qp
