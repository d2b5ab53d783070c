// The linear algebra of InteriorPoint: residuals, Newton matrix, directions, steps. The loop that uses them is in
// interior_point.cpp.
#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/interior_point/interior_point.h"
#include "qp/natural_map.h"

namespace islet::qp {
namespace {

constexpr int kMaxRefinements = 4;

}  // namespace

RowArrays InteriorPoint::Arrays() {
  return {batches_.batches(), kOctagonEdges[0].data(), s_.data(),       z_.data(),        primal_.data(),
          lambda_.data(),     point_.data(),           inverse_.data(), softening_.data()};
}

InteriorPoint::Residuals InteriorPoint::ComputeResiduals() {
  const int fields = kkt_.num_fields(), stride = 6 * fields;
  partial_.assign(2 * (batches_.size() / parallel::kAtOnce + 1), 0.0);
  ForBatches([&](int first, int last) {
    const RowSums sums = kernels_->residuals(Arrays(), first, last, y_.data(), forces_.data());
    partial_[2 * (first / parallel::kAtOnce)] = sums.gap;
    partial_[2 * (first / parallel::kAtOnce) + 1] = sums.worst;
  });
  parallel::ForkRanges(scaled_.num_bodies(), [&](int first, int last) {
    batches_.Gather(*kernels_, first, last, forces_.data(), gathered_.data());
    for (int i = first; i < last; ++i) {
      const BodyTerm& body = scaled_.bodies[i];
      const Vector6 momentum = MassTimes(body, At(y_, stride * i));
      const Vector6 free = MassTimes(body, body.velocity);
      if (fields == 1) {
        At(dual_, stride * i) = momentum - free - At(gathered_, stride * i);
      } else {
        At(dual_, stride * i) = momentum - MassTimes(body, At(y_, stride * i + 6)) - At(gathered_, stride * i);
        At(dual_, stride * i + 6) = free - momentum - At(gathered_, stride * i + 6);
      }
    }
  });
  Residuals residuals{0, 0, MassNorm(dual_)};
  for (size_t piece = 0; piece < partial_.size(); piece += 2) {
    residuals.gap += partial_[piece];
    residuals.primal = std::max(residuals.primal, partial_[piece + 1]);
  }
  return residuals;
}

// [velocity] of a momentum residual: root mean square in the mass metric.
double InteriorPoint::MassNorm(const std::vector<double>& momentum) const {
  const int fields = kkt_.num_fields(), stride = 6 * fields;
  double sum = 0, mass = 0;
  for (int i = 0; i < scaled_.num_bodies(); ++i) {
    mass += scaled_.bodies[i].mass;
    for (int f = 0; f < fields; ++f) {
      const Vector6 r = At(momentum, stride * i + 6 * f);
      sum += r.dot(InverseMassTimes(scaled_.bodies[i], r));
    }
  }
  return std::sqrt(sum / mass);
}

bool InteriorPoint::HasNaturalMap() const {
  return kkt_.num_fields() == 1 &&
         std::all_of(rows_.begin(), rows_.end(), [](const Rows& rows) { return rows.cone.kind != ConeKind::kOctagon; });
}

// Of the convex law with the velocities at hand, rms over the contacts.
double InteriorPoint::NaturalMap() const {
  double sum = 0;
  for (const Rows& rows : rows_) {
    const Vector3 j = ImpulseAt(rows.cone, z_, rows.place);
    const Vector3 u = FieldVelocity(scaled_.contacts[rows.contact], 6, 0, y_) + rows.offset + rows.compliance * j;
    sum += ((j - ProjectOnCircularCone(j - rows.rho * u, rows.cone.friction)) / rows.rho).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(rows_.size()));
}

// Scalings, what the matrix needs of them, and the target of the affine direction.
bool InteriorPoint::UpdateScalings() {
  const bool kinetic = kkt_.num_fields() == 2;
  partial_.assign(batches_.size() / parallel::kAtOnce + 1, 0.0);
  ForBatches([&](int first, int last) {
    if (!kernels_->scale(Arrays(), first, last, direction_.target.data(), scaling_blocks_.data()))
      partial_[first / parallel::kAtOnce] = 1;
    for (int b = first; b < last; ++b) {
      const RowBatch& batch = batches_.batches()[b];
      const Lanes* block = &scaling_blocks_[9 * b];
      for (int l = 0; l < kRowLanes && batch.used[l] > 0; ++l) {
        if (kinetic && batch.sign > 0) {
          normal_blocks_[batch.contact[l]] = block[0].at[l];
        } else {
          for (int i = 0; i < 9; ++i) blocks_[batch.contact[l]](i) = block[i].at[l];  // symmetric
        }
      }
    }
  });
  return std::none_of(partial_.begin(), partial_.end(), [](double failed) { return failed > 0; });
}

// The largest of run(first, last) over the batches.
template <typename Run>
double InteriorPoint::WorstBound(const Run& run) {
  partial_.assign(batches_.size() / parallel::kAtOnce + 1, 0.0);
  ForBatches([&](int first, int last) { partial_[first / parallel::kAtOnce] = run(first, last); });
  return *std::max_element(partial_.begin(), partial_.end());
}

void InteriorPoint::AimAt(double goal) {
  ForBatches([&](int first, int last) { kernels_->aim(Arrays(), direction_.View(), first, last, goal); });
}

// With t the target in scaled space: W dz + W^-1 ds = t, ds = T (J dy + R dj) - weight r_p, dj = T^T dz. Eliminating ds and
// dz leaves dj = (I + D R)^-1 (g - D J dy), g = T^T W^-1 (t + W^-1 weight r_p). ds is kept once more as it is: where it passes
// through the scalings and back the digits of the large part of a sliding contact's velocity are lost to the small one.
void InteriorPoint::ComputeDirection(double weight, bool refine, Direction* direction) {
  const int unknowns = 6 * kkt_.num_fields();
  ForBatches(
      [&](int first, int last) { kernels_->start(Arrays(), direction->View(), first, last, weight, forces_.data()); });
  parallel::ForkRanges(scaled_.num_bodies(), [&](int first, int last) {
    batches_.Gather(*kernels_, first, last, forces_.data(), direction->dy.data());
    for (int i = unknowns * first; i < unknowns * last; ++i) direction->dy[i] -= weight * dual_[i];
  });
  kkt_.Solve(direction->dy.data());
  direction->bound = WorstBound([&](int first, int last) {
    return kernels_->complete(Arrays(), direction->View(), first, last, weight, direction->dy.data());
  });
  double before = INFINITY;
  for (int i = 0; refine && i < kMaxRefinements; ++i) {
    const double error = DirectionError(weight, direction);
    if (error <= refine_to_ || error > 0.5 * before) break;
    before = error;
    kkt_.Solve(error_.data());
    Correct(direction);
  }
}

// Takes error_, now the correction S^-1 e, off the direction. dz changes by what belongs to the correction alone: computed
// anew from dy it would carry rounding as large as W^-2 times the velocities, and no refinement could remove that.
void InteriorPoint::Correct(Direction* direction) {
  for (size_t k = 0; k < direction->dy.size(); ++k) direction->dy[k] -= error_[k];
  direction->bound = WorstBound(
      [&](int first, int last) { return kernels_->correct(Arrays(), direction->View(), first, last, error_.data()); });
}

// What the direction leaves of the momentum balance: Q dy - A^T dz + weight r. The scalings near the solution span sixteen
// orders of magnitude, and the factorisation alone would stop near 1e-7.
double InteriorPoint::DirectionError(double weight, Direction* direction) {
  const int fields = kkt_.num_fields(), stride = 6 * fields;
  ForBatches([&](int first, int last) { kernels_->forces(Arrays(), direction->View(), first, last, forces_.data()); });
  parallel::ForkRanges(scaled_.num_bodies(), [&](int first, int last) {
    batches_.Gather(*kernels_, first, last, forces_.data(), gathered_.data());
    for (int i = first; i < last; ++i) {
      const BodyTerm& body = scaled_.bodies[i];
      const Vector6 dv = MassTimes(body, At(direction->dy, stride * i));
      At(error_, stride * i) = dv + weight * At(dual_, stride * i) - At(gathered_, stride * i);
      if (fields == 1) continue;
      At(error_, stride * i) -= MassTimes(body, At(direction->dy, stride * i + 6));
      At(error_, stride * i + 6) = weight * At(dual_, stride * i + 6) - dv - At(gathered_, stride * i + 6);
    }
  });
  return MassNorm(error_);
}

void InteriorPoint::Advance(double step) {
  for (size_t i = 0; i < y_.size(); ++i) y_[i] += step * direction_.dy[i];
  ForBatches([&](int first, int last) { kernels_->advance(Arrays(), direction_.View(), first, last, step); });
}

}  // namespace islet::qp
