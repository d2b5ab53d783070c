#include "qp/elementary.h"

#include <cmath>
#include <initializer_list>
#include <numbers>

namespace islet {
namespace {

// What is left of an angle beyond a multiple of pi/2, within +-pi/4, and that multiple modulo 4. pi/2 in three parts, of which
// the first two have zeros at their ends: times a multiple below 2^20 they are exact.                          [CW80]
double Reduce(double angle, int* quarter) {
  constexpr double first = 0x1.921fb544p+0, second = 0x1.0b4611a6p-34, third = 0x1.3198a2e037073p-69;
  if (std::abs(angle) > 1e5) angle = std::fmod(angle, 2 * std::numbers::pi);
  const double multiple = std::floor(angle / (std::numbers::pi / 2) + 0.5);
  *quarter = static_cast<int>(static_cast<long long>(multiple) & 3);
  return ((angle - multiple * first) - multiple * second) - multiple * third;
}

// Of Taylor's series for |x| <= pi/4, what follows its first term, over that: each term is the one before times -x^2 / (k (k - 1)). What
// is left out is below 5e-17.
double Alternating(double square, std::initializer_list<double> shares) {
  double sum = 0;
  for (const double share : shares) sum = -(1 + sum) * (square * share);
  return sum;
}
double SineNear(double x) {
  return x + x * Alternating(x * x, {1.0 / (17 * 16), 1.0 / (15 * 14), 1.0 / (13 * 12), 1.0 / (11 * 10), 1.0 / (9 * 8),
                                     1.0 / (7 * 6), 1.0 / (5 * 4), 1.0 / (3 * 2)});
}
double CosineNear(double x) {
  const double square = x * x;
  const double sum = Alternating(square, {1.0 / (18 * 17), 1.0 / (16 * 15), 1.0 / (14 * 13), 1.0 / (12 * 11),
                                          1.0 / (10 * 9), 1.0 / (8 * 7), 1.0 / (6 * 5), 1.0 / (4 * 3)});
  return 1 - (0.5 * square + 0.5 * square * sum);
}

// Of |x| <= tan(pi/16).
double ArcTangentNear(double x) {
  const double square = x * x;
  double sum = 0;
  for (const double per : {1.0 / 25, 1.0 / 23, 1.0 / 21, 1.0 / 19, 1.0 / 17, 1.0 / 15, 1.0 / 13, 1.0 / 11, 1.0 / 9,
                           1.0 / 7, 1.0 / 5, 1.0 / 3})
    sum = (per - sum) * square;
  return x - x * sum;
}

}  // namespace

double Sine(double angle) {
  if (!std::isfinite(angle)) return NAN;
  int quarter;
  const double x = Reduce(angle, &quarter), value = quarter % 2 == 0 ? SineNear(x) : CosineNear(x);
  return quarter < 2 ? value : -value;
}

double Cosine(double angle) {
  if (!std::isfinite(angle)) return NAN;
  int quarter;
  const double x = Reduce(angle, &quarter), value = quarter % 2 == 0 ? CosineNear(x) : SineNear(x);
  return quarter == 0 || quarter == 3 ? value : -value;
}

// Twice half the angle, twice: tan(a / 2) = t / (1 + sqrt(1 + t^2)).
double ArcTangent(double x) {
  if (std::abs(x) > 1) return std::copysign((std::numbers::pi / 2), x) - ArcTangent(1 / x);
  double t = x;
  for (int i = 0; i < 2; ++i) t /= 1 + std::sqrt(1 + t * t);
  return 4 * ArcTangentNear(t);
}

double ArcTangent(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return NAN;
  if (y == 0) return x < 0 ? std::copysign(std::numbers::pi, y) : 0;
  if (std::abs(y) > std::abs(x)) return std::copysign((std::numbers::pi / 2), y) - ArcTangent(x / y);
  const double angle = ArcTangent(y / x);
  return x > 0 ? angle : angle + std::copysign(std::numbers::pi, y);
}

}  // namespace islet
