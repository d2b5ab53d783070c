#include "qp/natural_map.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "parallel/fork.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr int kMostSums = 64;  // of pieces, which are added in their order

}  // namespace

void ImpulseScales(const Problem& problem, std::vector<double>* rho) {
  rho->resize(problem.contacts.size());
  parallel::ForkRanges(problem.num_contacts(), [&](int from, int to) {
    for (int c = from; c < to; ++c) (*rho)[c] = 3 / DelassusTrace(problem, problem.contacts[c]);
  });
}

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses) {
  std::vector<double> rho;
  ImpulseScales(problem, &rho);
  return CoulombMap(problem, velocities, impulses, rho);
}

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses, const std::vector<double>& rho) {
  struct Sums {
    double squares, largest;
  };
  std::array<Sums, kMostSums> sums;
  const int count = problem.num_contacts(),
            piece_size = std::max(2 * parallel::kAtOnce, (count + kMostSums - 1) / kMostSums);
  parallel::Fork((count + piece_size - 1) / piece_size, [&](int piece) {
    Sums part{0, 0};
    for (int c = piece * piece_size; c < std::min(count, (piece + 1) * piece_size); ++c) {
      const ContactTerm& contact = problem.contacts[c];
      Vector3 u = ContactVelocity(contact, velocities.data()) + contact.compliance * impulses[c];
      u[0] += contact.friction * TangentSize(u) - contact.target;
      const Vector3 map = (impulses[c] - ProjectOnCircularCone(impulses[c] - rho[c] * u, contact.friction)) / rho[c];
      part.squares += map.squaredNorm();
      part.largest = std::max(part.largest, map.squaredNorm());
    }
    sums[piece] = part;
  });
  Sums all{0, 0};
  for (int k = 0; k * piece_size < count; ++k) {
    all.squares += sums[k].squares;
    all.largest = std::max(all.largest, sums[k].largest);
  }
  // What is not a number shows in the sum, but not in the largest.
  if (!std::isfinite(all.squares)) all.largest = all.squares;
  return {std::sqrt(all.largest), std::sqrt(all.squares / std::max(1, count))};
}

Vector3 ProjectOnCircularCone(const Vector3& x, double friction) {
  const double tangent = TangentSize(x);
  if (x[0] + friction * tangent <= 0) return Vector3::Zero();  // first: without friction and tangent that is all
  if (tangent <= friction * x[0]) return x;
  const double normal = (x[0] + friction * tangent) / (1 + friction * friction);
  const double share = tangent > 0 ? friction * normal / tangent : 0;
  return {normal, share * x[1], share * x[2]};
}

}  // namespace islet::qp
