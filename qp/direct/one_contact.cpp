#include "qp/direct/one_contact.h"

#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "qp/elementary.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {

OneContact::OneContact(const Matrix3& w) : w_(w), inverse_(w.inverse()) {
  const double a = w(1, 1) - w(1, 0) * w(0, 1) / w(0, 0);
  const double b = w(1, 2) - w(1, 0) * w(0, 2) / w(0, 0);
  const double c = w(2, 2) - w(2, 0) * w(0, 2) / w(0, 0);
  // Half of the angle whose tangent is 2 b / (a - c).
  const double length = std::sqrt((a - c) * (a - c) + 4 * b * b), cosine = length > 0 ? (a - c) / length : 1;
  if (cosine >= 0) {
    cosine_ = std::sqrt(0.5 * (1 + cosine));
    sine_ = length > 0 ? b / (length * cosine_) : 0;
  } else {
    sine_ = std::copysign(std::sqrt(0.5 * (1 - cosine)), b);
    cosine_ = b / (length * sine_);
  }
  stiffness_[0] = a * cosine_ * cosine_ + 2 * b * cosine_ * sine_ + c * sine_ * sine_;
  stiffness_[1] = a * sine_ * sine_ - 2 * b * cosine_ * sine_ + c * cosine_ * cosine_;
}

Vector3 OneContact::SolveCoulomb(const Vector3& q, double friction) const {
  if (q[0] >= 0) return Vector3::Zero();
  if (friction == 0) return {-q[0] / w_(0, 0), 0, 0};
  const Vector3 stick = -(inverse_ * q);
  if (TangentSize(stick) <= friction * stick[0]) return stick;
  return Slide(q, friction);
}

bool OneContact::SolveConvex(const Vector3& q, double friction, Vector3* impulse) const {
  *impulse = Vector3::Zero();
  if (q[0] >= friction * TangentSize(q)) return true;
  const double rounding = 1e-14 * q.norm();
  double low = 0, above = SlipBeyond(low, q, friction, impulse), value = above;
  if (above <= rounding) return true;  // sticks
  double high = above, below = value = SlipBeyond(high, q, friction, impulse);
  for (; below > 0; below = value = SlipBeyond(high, q, friction, impulse)) low = high, above = below, high *= 2;
  int kept = 0;  // which end stayed: its value is halved then, or it would stay for ever
  for (int i = 0; i < 100 && std::abs(value) > rounding; ++i) {
    const double target = high - (high - low) * below / (below - above);
    if (!(target > low && target < high)) break;
    value = SlipBeyond(target, q, friction, impulse);
    if (value > 0) {
      low = target, above = value;
      if (kept == 1) below /= 2;
      kept = 1;
    } else {
      high = target, below = value;
      if (kept == -1) above /= 2;
      kept = -1;
    }
  }
  return std::abs(value) <= 100 * rounding;
}

// mu |u_t| - target of the Coulomb answer whose normal velocity is that target; it falls as the target grows.
double OneContact::SlipBeyond(double target, const Vector3& q, double friction, Vector3* impulse) const {
  *impulse = SolveCoulomb(q - target * Vector3::UnitX(), friction);
  const Vector3 u = w_ * *impulse + q;
  return friction * TangentSize(u) - target;
}

bool OneContact::SolveKinetic(const Vector3& q, double friction, double target, Vector3* impulse,
                              double* multiplier) const {
  *multiplier = 0;
  if (SolveConvex(q, friction, impulse) && w_.row(0).dot(*impulse) + q[0] >= target) return true;
  if (q[0] >= target) return false;
  *impulse = LeastEnergy(q, friction, target);
  const Vector3 u = w_ * *impulse + q;
  *multiplier = impulse->dot(u) / (target - q[0]);
  const Vector3 dual = u - *multiplier * w_.col(0);
  const double outside = friction * TangentSize(dual) - dual[0];
  return *multiplier >= 0 && outside <= kRefined * q.norm();
}

Vector3 OneContact::LeastEnergy(const Vector3& q, double friction, double target) const {
  using Vector2 = Eigen::Vector2d;
  const double normal = w_(0, 0), change = target - q[0];
  const Vector2 coupling = w_.block<2, 1>(1, 0), slope = q.tail<2>() - coupling * q[0] / normal;
  const Eigen::Matrix2d stiffness = w_.block<2, 2>(1, 1) - coupling * coupling.transpose() / normal;
  const auto with = [&](const Vector2& t) { return Vector3((change - coupling.dot(t)) / normal, t[0], t[1]); };
  const Vector3 inside = with(-(stiffness.inverse() * slope));
  if (inside.tail<2>().norm() <= friction * inside[0]) return inside;
  // Else it lies on the edge of the cone, at a direction where the energy has its minimum.
  struct Edge {
    Vector2 t;
    double energy, rise;  // rise: of the energy with the angle
  };
  const auto at = [&](double angle) -> Edge {
    const Vector2 along(Cosine(angle), Sine(angle)), across(-along[1], along[0]);
    const double open = normal + friction * coupling.dot(along);
    if (!(open > 0)) return {Vector2::Zero(), INFINITY, 0};  // reaches to infinity
    const double length = friction * change / open;
    const Vector2 t = length * along, turn = length * (across - friction * coupling.dot(across) / open * along);
    return {t, t.dot(0.5 * stiffness * t + slope), turn.dot(stiffness * t + slope)};
  };
  constexpr int kDirections = 32;
  const double sector = 2 * std::numbers::pi / kDirections;
  int best = 0;
  for (int k = 1; k < kDirections; ++k)
    if (at(k * sector).energy < at(best * sector).energy) best = k;
  double low = (best - 1) * sector, high = (best + 1) * sector;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    const Edge edge = at(middle);
    const bool rises = std::isinf(edge.energy) ? middle > best * sector : edge.rise > 0;
    (rises ? high : low) = middle;
  }
  // (No friction changes no energy; nothing may come out above that, whatever was missed.)
  const Edge sampled = at(best * sector), found = at(0.5 * (low + high));
  const Edge& least = found.energy <= sampled.energy ? found : sampled;
  return with(least.energy < 0 ? least.t : Vector2::Zero());
}

// In the axes of the tangential operator j_t = -b_i / (stiffness_i + lambda) and j_n = (-q_n - W_nt j_t) / W_nn. Newton's
// method on mu j_n / |j_t| - 1, which is nearly linear in lambda, inside a bracket whose upper end may still be infinite.
Vector3 OneContact::Slide(const Vector3& q, double friction) const {
  const double wnn = w_(0, 0);
  const double t1 = q[1] - w_(1, 0) * q[0] / wnn, t2 = q[2] - w_(2, 0) * q[0] / wnn;
  const double b[2] = {cosine_ * t1 + sine_ * t2, -sine_ * t1 + cosine_ * t2};
  const double c[2] = {cosine_ * w_(0, 1) + sine_ * w_(0, 2), -sine_ * w_(0, 1) + cosine_ * w_(0, 2)};
  double j[2], jn = 0, size = 0;
  double low = 0, high = INFINITY;
  double lambda = stiffness_[0] + stiffness_[1];
  for (int i = 0; i < 200; ++i) {
    double dj[2];
    for (int k = 0; k < 2; ++k) {
      const double inverse = 1 / (stiffness_[k] + lambda);
      j[k] = -b[k] * inverse;
      dj[k] = -j[k] * inverse;
    }
    jn = (-q[0] - c[0] * j[0] - c[1] * j[1]) / wnn;
    size = std::sqrt(j[0] * j[0] + j[1] * j[1]);
    if (size == 0) break;
    const double value = friction * jn / size - 1;
    const double slope =
        -friction * ((c[0] * dj[0] + c[1] * dj[1]) / wnn + jn * (j[0] * dj[0] + j[1] * dj[1]) / (size * size)) / size;
    (value < 0 ? low : high) = lambda;
    const double newton = lambda - value / slope;
    // Asked of the Newton step, before the bracket: at the root it may equal the end of the bracket, and halving would
    // jump away from the answer.
    if (std::abs(newton - lambda) <= 1e-15 * lambda || std::abs(value) <= 4e-16) break;
    const double next = newton > low && newton < high ? newton : std::isinf(high) ? 4 * lambda : 0.5 * (low + high);
    if (next == lambda) break;
    lambda = next;
  }
  // On the cone exactly, whatever was rounded.
  const double fit = size > 0 ? friction * jn / size : 0;
  return {jn, fit * (cosine_ * j[0] - sine_ * j[1]), fit * (sine_ * j[0] + cosine_ * j[1])};
}

}  // namespace islet::qp
