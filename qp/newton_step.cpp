// The linear algebra of InteriorPoint: residuals, Newton matrix, directions, steps. The loop that uses them is in
// interior_point.cpp.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "parallel/fork.h"
#include "qp/body_algebra.h"
#include "qp/interior_point.h"

namespace islet::qp {
namespace {

constexpr int kMaxRefinements = 4;

size_t NumPieces(int num_rows) { return (num_rows + kRowsPerPiece - 1) / kRowsPerPiece; }

// softening = (I + D R)^-1 and D <- (I + D R)^-1 D, for R = compliance I + softness n n^T. By rows, I + D R is well scaled
// even where D spans many orders; updating D by a matrix of rank one instead would lose its small part.
void Soften(double compliance, double softness, Matrix3* d, Matrix3* softening) {
  if (softness > 0) {
    *softening =
        (Matrix3::Identity() + *d * Vector3(compliance + softness, compliance, compliance).asDiagonal()).inverse();
    *d = (*softening * *d).eval();
  } else {
    const Eigen::LLT<Matrix3> factors(Matrix3::Identity() + compliance * *d);
    *softening = factors.solve(Matrix3::Identity());
    *d = factors.solve(*d).eval();
  }
}

}  // namespace

InteriorPoint::Residuals InteriorPoint::ComputeResiduals() {
  const int fields = kkt_.num_fields(), stride = 6 * fields, num_rows = static_cast<int>(rows_.size());
  const size_t nc = scaled_.contacts.size();
  forces_.resize(rows_.size());
  partial_.assign(2 * NumPieces(num_rows), 0.0);
  parallel::ForkRanges(num_rows, kRowsPerPiece, [&](int first, int last) {
    double gap = 0, worst = 0;
    double mapped[kMaxRows];
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      const ContactTerm& contact = scaled_.contacts[rows.contact];
      const Vector3 j = MapFromRows(rows.cone, &z_[rows.first]);
      forces_[rows.field * nc + rows.contact] = rows.sign * j;
      MapToRows(rows.cone, FieldVelocity(contact, stride, rows.field, y_) + rows.offset + rows.Yield(j), mapped);
      for (int i = 0; i < NumRows(rows.cone.kind); ++i) {
        primal_[rows.first + i] = s_[rows.first + i] - mapped[i];
        worst = std::max(worst, std::abs(primal_[rows.first + i]));
        gap += s_[rows.first + i] * z_[rows.first + i];
      }
    }
    partial_[2 * (first / kRowsPerPiece)] = gap;
    partial_[2 * (first / kRowsPerPiece) + 1] = worst;
  });
  parallel::ForkRanges(scaled_.num_bodies(), kBodiesPerPiece, [&](int first, int last) {
    for (int i = first; i < last; ++i) {
      const BodyTerm& body = scaled_.bodies[i];
      const Vector6 momentum = MassTimes(body, At(y_, stride * i));
      const Vector6 free = MassTimes(body, body.velocity);
      if (fields == 1) {
        At(dual_, stride * i) = momentum - free - incidence_.Gather(scaled_, i, forces_.data());
      } else {
        At(dual_, stride * i) =
            momentum - MassTimes(body, At(y_, stride * i + 6)) - incidence_.Gather(scaled_, i, forces_.data());
        At(dual_, stride * i + 6) = free - momentum - incidence_.Gather(scaled_, i, forces_.data() + nc);
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

bool InteriorPoint::UpdateScalings() {
  partial_.assign(NumPieces(static_cast<int>(rows_.size())), 0.0);
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    for (int r = first; r < last; ++r) {
      Scaling scaling = ScalingOf(r);
      if (!UpdateScaling(rows_[r].cone.kind, &s_[rows_[r].first], &z_[rows_[r].first], &scaling))
        partial_[first / kRowsPerPiece] = 1;
      eta_[r] = scaling.eta;
    }
  });
  return std::none_of(partial_.begin(), partial_.end(), [](double failed) { return failed > 0; });
}

void InteriorPoint::FactoriseNewton() {
  const int nc = scaled_.num_contacts();
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    for (int r = first; r < last; ++r) {
      const Matrix3 block = ScalingBlock(rows_[r].cone, ScalingOf(r));
      if (r >= nc) {
        normal_blocks_[r - nc] = block(0, 0);
      } else {
        blocks_[r] = block;
        if (rows_[r].IsSoft()) Soften(rows_[r].compliance, rows_[r].softness, &blocks_[r], &softening_[r]);
      }
    }
  });
  kkt_.Factorise(scaled_, blocks_, normal_blocks_);
}

void InteriorPoint::AimAt(double goal, double share) {
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    for (int r = first; r < last; ++r) {
      const int at = rows_[r].first;
      AimAtCentre(rows_[r].cone.kind, &lambda_[at], &ds_[at], &dz_[at], goal, share, &target_[at]);
    }
  });
}

// With t the target in scaled space: W dz + W^-1 ds = t, ds = T (J dy + R dj) - weight r_p, dj = T^T dz. Eliminating ds and
// dz leaves dj = (I + D R)^-1 (g - D J dy), g = T^T W^-1 (t + W^-1 weight r_p).
void InteriorPoint::ComputeDirection(double weight, bool refine) {
  const int fields = kkt_.num_fields();
  const size_t nc = scaled_.contacts.size();
  constants_.resize(rows_.size());
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    double a[kMaxRows], b[kMaxRows];
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      ApplyInverseScaling(rows.cone.kind, ScalingOf(r), &primal_[rows.first], a);
      for (int i = 0; i < NumRows(rows.cone.kind); ++i) a[i] = weight * a[i] + target_[rows.first + i];
      ApplyInverseScaling(rows.cone.kind, ScalingOf(r), a, b);
      constants_[r] = MapFromRows(rows.cone, b);
      if (rows.IsSoft()) constants_[r] = (softening_[r] * constants_[r]).eval();
      forces_[rows.field * nc + rows.contact] = rows.sign * constants_[r];
    }
  });
  parallel::ForkRanges(scaled_.num_bodies(), kBodiesPerPiece, [&](int first, int last) {
    for (int i = first; i < last; ++i) {
      for (int f = 0; f < fields; ++f) {
        const int at = 6 * (fields * i + f);
        At(dy_, at) = incidence_.Gather(scaled_, i, forces_.data() + f * nc) - weight * At(dual_, at);
      }
    }
  });
  kkt_.Solve(dy_.data());
  CompleteDirection(weight);
  double before = INFINITY;
  for (int i = 0; refine && i < kMaxRefinements; ++i) {
    const double error = DirectionError(weight);
    if (error <= refine_to_ || error > 0.5 * before) break;
    before = error;
    kkt_.Solve(error_.data());
    Correct();
  }
}

// ds and dz, in scaled space, that belong to dy_; ds once more as it is, for where it passes through the scalings and back
// the digits of the large part of a sliding contact's velocity are lost to the small one.
void InteriorPoint::CompleteDirection(double weight) {
  const int stride = 6 * kkt_.num_fields();
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      const int d = NumRows(rows.cone.kind);
      double* move = &ds_plain_[rows.first];
      Vector3 dw = FieldVelocity(scaled_.contacts[rows.contact], stride, rows.field, dy_);
      if (rows.IsSoft()) dw = (softening_[r].transpose() * dw + rows.Yield(constants_[r])).eval();
      MapToRows(rows.cone, dw, move);
      for (int i = 0; i < d; ++i) move[i] -= weight * primal_[rows.first + i];
      ApplyInverseScaling(rows.cone.kind, ScalingOf(r), move, &ds_[rows.first]);
      for (int i = 0; i < d; ++i) dz_[rows.first + i] = target_[rows.first + i] - ds_[rows.first + i];
    }
  });
}

// Takes error_, now the correction S^-1 e, off the direction. dz changes by what belongs to the correction alone: computed
// anew from dy it would carry rounding as large as W^-2 times the velocities, and no refinement could remove that.
void InteriorPoint::Correct() {
  const int stride = 6 * kkt_.num_fields();
  for (size_t k = 0; k < dy_.size(); ++k) dy_[k] -= error_[k];
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    double a[kMaxRows], b[kMaxRows];
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      Vector3 dw = FieldVelocity(scaled_.contacts[rows.contact], stride, rows.field, error_);
      if (rows.IsSoft()) dw = (softening_[r].transpose() * dw).eval();
      MapToRows(rows.cone, dw, a);
      ApplyInverseScaling(rows.cone.kind, ScalingOf(r), a, b);
      for (int i = 0; i < NumRows(rows.cone.kind); ++i) {
        ds_plain_[rows.first + i] -= a[i];
        ds_[rows.first + i] -= b[i];
        dz_[rows.first + i] += b[i];
      }
    }
  });
}

// What the direction leaves of the momentum balance: Q dy - A^T dz + weight r. The scalings near the solution span sixteen
// orders of magnitude, and the factorisation alone would stop near 1e-7.
double InteriorPoint::DirectionError(double weight) {
  const int fields = kkt_.num_fields(), stride = 6 * fields;
  const size_t nc = scaled_.contacts.size();
  error_.resize(dy_.size());
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    double dz[kMaxRows];
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      ApplyInverseScaling(rows.cone.kind, ScalingOf(r), &dz_[rows.first], dz);
      forces_[rows.field * nc + rows.contact] = rows.sign * MapFromRows(rows.cone, dz);
    }
  });
  parallel::ForkRanges(scaled_.num_bodies(), kBodiesPerPiece, [&](int first, int last) {
    for (int i = first; i < last; ++i) {
      const BodyTerm& body = scaled_.bodies[i];
      const Vector6 dv = MassTimes(body, At(dy_, stride * i));
      At(error_, stride * i) = dv + weight * At(dual_, stride * i) - incidence_.Gather(scaled_, i, forces_.data());
      if (fields == 1) continue;
      At(error_, stride * i) -= MassTimes(body, At(dy_, stride * i + 6));
      At(error_, stride * i + 6) =
          weight * At(dual_, stride * i + 6) - dv - incidence_.Gather(scaled_, i, forces_.data() + nc);
    }
  });
  return MassNorm(error_);
}

double InteriorPoint::LongestStep(double limit) {
  partial_.assign(NumPieces(static_cast<int>(rows_.size())), limit);
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    double step = limit;
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      step = MaxStep(rows.cone.kind, &lambda_[rows.first], &ds_[rows.first], step);
      step = MaxStep(rows.cone.kind, &lambda_[rows.first], &dz_[rows.first], step);
    }
    partial_[first / kRowsPerPiece] = step;
  });
  return *std::min_element(partial_.begin(), partial_.end());
}

void InteriorPoint::Advance(double step) {
  for (size_t i = 0; i < y_.size(); ++i) y_[i] += step * dy_[i];
  parallel::ForkRanges(static_cast<int>(rows_.size()), kRowsPerPiece, [&](int first, int last) {
    double move[kMaxRows];
    for (int r = first; r < last; ++r) {
      const Rows& rows = rows_[r];
      const int d = NumRows(rows.cone.kind);
      for (int i = 0; i < d; ++i) s_[rows.first + i] += step * ds_plain_[rows.first + i];
      ApplyInverseScaling(rows.cone.kind, ScalingOf(r), &dz_[rows.first], move);
      for (int i = 0; i < d; ++i) z_[rows.first + i] += step * move[i];
    }
  });
}

}  // namespace islet::qp
