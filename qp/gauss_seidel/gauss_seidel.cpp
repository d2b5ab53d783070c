#include "qp/gauss_seidel/gauss_seidel.h"

#include <algorithm>
#include <cmath>

#include "parallel/fork.h"
#include "qp/body_algebra.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

using Block = Eigen::Map<Vector3>;
using ConstBlock = Eigen::Map<const Vector3>;

// Nesterov's momentum wants a gradient; the law of friction is none, and full momentum circles around jammed piles for ever.
constexpr double kMaxMomentum = 0.8;
constexpr double kMaxGrowth = 2;  // of |x - z|^2 from sweep to sweep

// Lower G with G G^T = a; a column of zeros where a has no more rank.
Matrix3 Root(const Matrix3& a) {
  Matrix3 g = Matrix3::Zero();
  for (int j = 0; j < 3; ++j) {
    double pivot = a(j, j);
    for (int k = 0; k < j; ++k) pivot -= g(j, k) * g(j, k);
    if (!(pivot > 0)) continue;
    g(j, j) = std::sqrt(pivot);
    for (int i = j + 1; i < 3; ++i) {
      double value = a(i, j);
      for (int k = 0; k < j; ++k) value -= g(i, k) * g(j, k);
      g(i, j) = value / g(j, j);
    }
  }
  return g;
}

// The velocities of x + momentum (x - previous): they are linear in the impulses.
template <typename Number>
void Extrapolate(Number momentum, int count, SweepVelocity<Number>* velocities, SweepVelocity<Number>* previous) {
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < 8; ++k) {
      const Number y = velocities[i].y[k];
      velocities[i].y[k] = y + momentum * (y - previous[i].y[k]);
      previous[i].y[k] = y;
    }
  }
}

}  // namespace

template <typename Number>
void GaussSeidel::MakeRoom(Field<Number>* field) const {
  field->batches.resize(order_.num_batches());
  field->states.resize(order_.num_batches());
  field->velocities.resize(roots_.size() + order_.sections().size());
  field->previous.resize(roots_.size());
}

void GaussSeidel::Prepare(const Problem& problem) {
  order_.Build(problem);
  roots_.resize(problem.bodies.size());
  parallel::ForkRanges(problem.num_bodies(), [&](int first, int last) {
    for (int i = first; i < last; ++i) {
      roots_[i].mass_root = 1 / std::sqrt(problem.bodies[i].mass);
      roots_[i].inertia_root = Root(problem.bodies[i].inverse_inertia);
    }
  });
  compliant_ = std::any_of(problem.contacts.begin(), problem.contacts.end(),
                           [](const ContactTerm& c) { return c.compliance > 0; });
  normal_ = !compliant_ && std::none_of(problem.contacts.begin(), problem.contacts.end(),
                                        [](const ContactTerm& c) { return c.friction > 0; });
  single_prepared_ = false;
  sums_.resize(order_.sections().size());
  axes_.resize(problem.contacts.size());
  MakeRoom(&plain_);
  ForkBatches([&](int first, int last) {
    size_t section = 0;
    for (int b = first; b < last; ++b) {
      const auto ends = [&] { return order_.sections()[section].first_batch + order_.sections()[section].num_batches; };
      while (b >= ends()) ++section;
      PrepareBatch(problem, b, static_cast<int>(roots_.size() + section));
    }
  });
}

// run(first, last) for ranges of all batches.
template <typename Run>
void GaussSeidel::ForkBatches(const Run& run) const {
  parallel::ForkRanges(order_.num_batches(), run, parallel::kAtOnce / kBatchLanes);
}

// still: the place of an immovable body.
void GaussSeidel::PrepareBatch(const Problem& problem, int number, int still) {
  SweepBatch<double>& batch = plain_.batches[number];
  batch.used = 0;
  for (int lane = 0; lane < kBatchLanes; ++lane) {
    const int c = order_.contacts()[number * kBatchLanes + lane];
    const auto place = [&](int body) { return body >= 0 ? order_.places()[body] : still; };
    batch.body[0][lane] = c >= 0 ? place(problem.contacts[c].body_a) : still;
    batch.body[1][lane] = c >= 0 ? place(problem.contacts[c].body_b) : still;
    if (c >= 0) {
      batch.used = lane + 1;
      if (normal_)
        PrepareNormal(problem, c, lane, &batch);
      else
        PrepareContact(problem, c, lane, &batch);
      continue;
    }
    for (int d = 0; d < 3; ++d) {
      for (int side = 0; side < 2; ++side)
        for (int k = 0; k < 6; ++k) batch.rows[side][d][k][lane] = 0;
      batch.offset[d][lane] = d == 0 ? 1 : 0;
    }
    batch.normal[lane] = batch.weight[lane] = 1;
    batch.tangent[0][lane] = batch.tangent[1][lane] = batch.shear[0][lane] = batch.shear[1][lane] = 0;
    batch.friction[lane] = batch.compliance[lane] = 0;
  }
}

void GaussSeidel::PrepareContact(const Problem& problem, int number, int lane, SweepBatch<double>* out) {
  const ContactTerm& contact = problem.contacts[number];
  SweepBatch<double>& batch = *out;
  const int bodies[2] = {contact.body_a, contact.body_b};
  const Jacobian* const jacobians[2] = {&contact.jacobian_a, &contact.jacobian_b};
  Jacobian rows[2];
  Matrix3 w = contact.compliance * Matrix3::Identity();
  for (int side = 0; side < 2; ++side) {
    rows[side].setZero();
    if (bodies[side] < 0) continue;
    const BodyRoot& root = roots_[bodies[side]];
    rows[side].leftCols<3>() = root.mass_root * jacobians[side]->leftCols<3>();
    rows[side].rightCols<3>().noalias() = jacobians[side]->rightCols<3>() * root.inertia_root;
    w.noalias() += rows[side] * rows[side].transpose();
  }
  // Axes of the tangential operator with the normal eliminated, and their stiffnesses.
  const double a = w(1, 1) - w(1, 0) * w(0, 1) / w(0, 0);
  const double b = w(1, 2) - w(1, 0) * w(0, 2) / w(0, 0);
  const double c = w(2, 2) - w(2, 0) * w(0, 2) / w(0, 0);
  const double half = 0.5 * (a - c), size = std::sqrt(half * half + b * b);
  double cosine = 1, sine = 0;
  if (size > 0) {
    cosine = std::sqrt(0.5 * (1 + std::abs(half) / size));
    sine = 0.5 * b / (size * cosine);
    if (half < 0) std::swap(cosine, sine);
    if (half < 0 && cosine < 0) cosine = -cosine, sine = -sine;
  }
  axes_[number] = {cosine, sine};
  const double stiffness[2] = {a * cosine * cosine + 2 * b * cosine * sine + c * sine * sine,
                               a * sine * sine - 2 * b * cosine * sine + c * cosine * cosine};
  Matrix3 t = Matrix3::Zero();  // impulses j = T x
  const double normal = 1 / std::sqrt(w(0, 0));
  const double shear[2] = {-(cosine * w(0, 1) + sine * w(0, 2)) / w(0, 0),
                           -(cosine * w(0, 2) - sine * w(0, 1)) / w(0, 0)};
  const double axis[2][2] = {{cosine, sine}, {-sine, cosine}};
  t(0, 0) = normal;
  for (int k = 0; k < 2; ++k) {
    const double tangent = stiffness[k] > kRounding * w(0, 0) ? 1 / std::sqrt(stiffness[k]) : 0;
    t(0, 1 + k) = tangent * shear[k];
    t(1, 1 + k) = tangent * axis[k][0];
    t(2, 1 + k) = tangent * axis[k][1];
    batch.tangent[k][lane] = tangent;
    batch.shear[k][lane] = shear[k];
  }
  const Vector3 offset = t.transpose() * (contact.drift - contact.target * Vector3::UnitX());
  for (int side = 0; side < 2; ++side) {
    const Jacobian scaled = t.transpose() * rows[side];
    for (int d = 0; d < 3; ++d)
      for (int k = 0; k < 6; ++k) batch.rows[side][d][k][lane] = scaled(d, k);
  }
  for (int d = 0; d < 3; ++d) batch.offset[d][lane] = offset[d];
  batch.normal[lane] = normal;
  batch.friction[lane] = contact.friction;
  batch.weight[lane] = w(0, 0);
  batch.compliance[lane] = contact.compliance;
}

// The same bits for what the kernel without friction reads.
void GaussSeidel::PrepareNormal(const Problem& problem, int number, int lane, SweepBatch<double>* batch) {
  const ContactTerm& contact = problem.contacts[number];
  const int bodies[2] = {contact.body_a, contact.body_b};
  const Jacobian* const jacobians[2] = {&contact.jacobian_a, &contact.jacobian_b};
  Vector6 rows[2];
  double w = 0;
  for (int side = 0; side < 2; ++side) {
    rows[side].setZero();
    if (bodies[side] < 0) continue;
    const BodyRoot& root = roots_[bodies[side]];
    const Vector6 row = jacobians[side]->row(0).transpose();
    rows[side].head<3>() = root.mass_root * row.head<3>();
    for (int k = 0; k < 3; ++k) {
      const auto column = root.inertia_root.col(k);
      rows[side][3 + k] = row[3] * column[0] + row[4] * column[1] + row[5] * column[2];
    }
    double square = 0;
    for (int k = 0; k < 6; ++k) square += rows[side][k] * rows[side][k];
    w += square;
  }
  const double normal = 1 / std::sqrt(w);
  for (int side = 0; side < 2; ++side)
    for (int k = 0; k < 6; ++k) batch->rows[side][0][k][lane] = normal * rows[side][k];
  for (int k = 0; k < 2; ++k) batch->tangent[k][lane] = batch->shear[k][lane] = 0;
  batch->offset[0][lane] = normal * (contact.drift[0] - contact.target);
  batch->normal[lane] = normal;
  batch->friction[lane] = batch->compliance[lane] = 0;
  batch->weight[lane] = w;
  axes_[number] = {1, 0};
}

// Velocity of the frame in which single precision sweeps: that of the centre of mass, where most of the energy is its.
Vector3 GaussSeidel::CommonVelocity(const Problem& problem, const std::vector<double>& velocities) {
  double mass = 0, squares = 0;
  Vector3 momentum = Vector3::Zero();
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const Vector3 v = ConstBlock(velocities.data() + 6 * i);
    mass += problem.bodies[i].mass;
    momentum += problem.bodies[i].mass * v;
    squares += problem.bodies[i].mass * v.squaredNorm();
  }
  const Vector3 mean = momentum / mass;
  return mass * mean.squaredNorm() > 0.5 * squares ? mean : Vector3::Zero();
}

// The batches of double precision, rounded. Seen from the frame walls move; what two bodies do to each other is the same.
void GaussSeidel::PrepareSingle(const Problem& problem) {
  MakeRoom(&single_);
  const auto shift = [&](int b, int lane) {
    const SweepBatch<double>& from = plain_.batches[b];
    const int c = order_.contacts()[b * kBatchLanes + lane];
    if (c < 0 || (problem.contacts[c].body_a >= 0 && problem.contacts[c].body_b >= 0)) return;
    const int side = problem.contacts[c].body_a < 0 ? 1 : 0;
    const int body = side == 0 ? problem.contacts[c].body_a : problem.contacts[c].body_b;
    for (int d = 0; d < (normal_ ? 1 : 3) && body >= 0; ++d) {
      double offset = from.offset[d][lane];
      for (int k = 0; k < 3; ++k) offset += from.rows[side][d][k][lane] * frame_[k] / roots_[body].mass_root;
      single_.batches[b].offset[d][lane] = static_cast<float>(offset);
    }
  };
  const auto round = [&](int b) {
    const SweepBatch<double>& from = plain_.batches[b];
    SweepBatch<float>& to = single_.batches[b];
    std::copy_n(&from.rows[0][0][0][0], sizeof from.rows / sizeof(double), &to.rows[0][0][0][0]);
    std::copy_n(&from.offset[0][0], 3 * kBatchLanes, &to.offset[0][0]);
    std::copy_n(&from.tangent[0][0], 2 * kBatchLanes, &to.tangent[0][0]);
    std::copy_n(&from.shear[0][0], 2 * kBatchLanes, &to.shear[0][0]);
    std::copy_n(from.normal, kBatchLanes, to.normal);
    std::copy_n(from.friction, kBatchLanes, to.friction);
    std::copy_n(from.weight, kBatchLanes, to.weight);
    std::copy_n(from.compliance, kBatchLanes, to.compliance);
    std::copy_n(&from.body[0][0], 2 * kBatchLanes, &to.body[0][0]);
    to.used = from.used;
    for (int lane = 0; lane < kBatchLanes && !frame_.isZero(0); ++lane) shift(b, lane);
  };
  ForkBatches([&](int first, int last) {
    for (int b = first; b < last; ++b) round(b);
  });
  single_prepared_ = true;
}

// Whoever sweeps a part moves its bodies ahead first: they are at hand.
template <typename Number>
SweepSums GaussSeidel::SweepOnce(bool ahead, Number momentum, Field<Number>* field) {
  const std::vector<int>& phases = order_.phase_start();
  for (size_t p = 0; p + 1 < phases.size(); ++p) {
    parallel::Fork(phases[p + 1] - phases[p], [&](int piece) {
      const int number = phases[p] + piece;
      if (ahead && p == 0) {
        const int first = order_.body_start()[piece], last = order_.body_start()[piece + 1];
        Extrapolate(momentum, last - first, &field->velocities[first], &field->previous[first]);
      }
      const SweepOrder::Section& section = order_.sections()[number];
      const SweepBatch<Number>* batches = &field->batches[section.first_batch];
      SweepState<Number>* states = &field->states[section.first_batch];
      SweepVelocity<Number>* velocities = field->velocities.data();
      sums_[number] =
          normal_ ? field->kernels->normal(section.num_batches, batches, momentum, states, velocities)
                  : field->kernels->coulomb(section.num_batches, batches, compliant_, momentum, states, velocities);
    });
  }
  SweepSums total;
  for (const SweepSums& sums : sums_) {
    total.largest = std::max(total.largest, sums.largest);
    total.change += sums.change;
    total.ahead += sums.ahead;
  }
  return total;
}

// Into the coordinates of the kernels: x = T^-1 j, y = G^-1 v = G^T M v.
template <typename Number>
void GaussSeidel::Load(const Problem& problem, const std::vector<Vector3>& impulses,
                       const std::vector<double>& velocities, Field<Number>* field) const {
  const int bodies = static_cast<int>(roots_.size());
  ForkBatches([&](int from, int to) {
    for (int b = from; b < to; ++b) LoadBatch(impulses, b, &field->states[b]);
  });
  std::fill(field->velocities.begin() + bodies, field->velocities.end(), SweepVelocity<Number>{});
  parallel::ForkRanges(bodies, [&](int from, int to) {
    for (int i = from; i < to; ++i) {
      const double* v = velocities.data() + 6 * i;
      const Vector3 linear = ConstBlock(v) / roots_[i].mass_root;
      const Vector3 momentum = problem.bodies[i].inertia * ConstBlock(v + 3);
      const Vector3 angular = roots_[i].inertia_root.transpose() * momentum;
      SweepVelocity<Number> y{};
      for (int k = 0; k < 3; ++k) y.y[k] = static_cast<Number>(linear[k]), y.y[3 + k] = static_cast<Number>(angular[k]);
      field->velocities[order_.places()[i]] = field->previous[order_.places()[i]] = y;
    }
  });
}

template <typename Number>
void GaussSeidel::LoadBatch(const std::vector<Vector3>& impulses, int number, SweepState<Number>* state) const {
  const SweepBatch<double>& batch = plain_.batches[number];
  for (int lane = 0; lane < kBatchLanes; ++lane) {
    for (int d = 0; d < 3; ++d) state->x[d][lane] = state->previous[d][lane] = 0;
    state->lambda[lane] = 0;
    const int c = order_.contacts()[number * kBatchLanes + lane];
    if (c < 0) continue;
    const Vector3& j = impulses[c];
    const double t[2] = {axes_[c].cosine * j[1] + axes_[c].sine * j[2], axes_[c].cosine * j[2] - axes_[c].sine * j[1]};
    double normal = j[0];
    for (int k = 0; k < 2; ++k) {
      normal -= batch.shear[k][lane] * t[k];
      if (batch.tangent[k][lane] > 0) state->x[1 + k][lane] = static_cast<Number>(t[k] / batch.tangent[k][lane]);
    }
    state->x[0][lane] = static_cast<Number>(normal / batch.normal[lane]);
    for (int d = 0; d < 3; ++d) state->previous[d][lane] = state->x[d][lane];
  }
}

template <typename Number>
void GaussSeidel::Unload(const Field<Number>& field, std::vector<Vector3>* impulses,
                         std::vector<double>* velocities) const {
  const int bodies = static_cast<int>(roots_.size());
  parallel::ForkRanges(bodies, [&](int from, int to) {
    for (int i = from; i < to; ++i) {
      double* v = velocities->data() + 6 * i;
      const Number* y = field.velocities[order_.places()[i]].y;
      Block{v} = Vector3(y[0], y[1], y[2]) * roots_[i].mass_root;
      Block(v + 3).noalias() = roots_[i].inertia_root * Vector3(y[3], y[4], y[5]);
    }
  });
  ForkBatches([&](int from, int to) {
    for (int b = from; b < to; ++b) UnloadBatch(field.states[b], b, impulses);
  });
}

template <typename Number>
void GaussSeidel::UnloadBatch(const SweepState<Number>& state, int number, std::vector<Vector3>* impulses) const {
  const SweepBatch<double>& batch = plain_.batches[number];
  for (int lane = 0; lane < kBatchLanes; ++lane) {
    const int c = order_.contacts()[number * kBatchLanes + lane];
    if (c < 0) continue;
    const double t[2] = {batch.tangent[0][lane] * state.x[1][lane], batch.tangent[1][lane] * state.x[2][lane]};
    (*impulses)[c] = {batch.normal[lane] * state.x[0][lane] + batch.shear[0][lane] * t[0] + batch.shear[1][lane] * t[1],
                      axes_[c].cosine * t[0] - axes_[c].sine * t[1], axes_[c].sine * t[0] + axes_[c].cosine * t[1]};
  }
}

template <typename Number>
int GaussSeidel::SweepIn(Field<Number>* field, const Problem& problem, int max_sweeps, double tolerance,
                         std::vector<Vector3>* impulses, std::vector<double>* velocities, Pace pace) {
  double largest = 0;
  for (const Vector3& j : *impulses) largest = std::max(largest, j.cwiseAbs().maxCoeff());
  for (Vector3& j : *impulses)
    if (j.cwiseAbs().maxCoeff() < kRounding * kRounding * largest) j.setZero();  // before its square is no number
  Load(problem, *impulses, *velocities, field);
  double theta = 1, last_change = INFINITY;
  Number momentum = 0;
  int sweep = 0;
  while (sweep < max_sweeps) {
    ++sweep;
    const SweepSums sums = SweepOnce(pace == Pace::kMomentum, momentum, field);
    if (sums.largest <= tolerance) break;
    if (pace == Pace::kPlain) continue;
    const bool astray = sums.ahead < 0 || sums.change > kMaxGrowth * last_change;
    const double next = astray ? 1 : 0.5 * (1 + std::sqrt(1 + 4 * theta * theta));
    momentum = static_cast<Number>(astray ? 0 : std::min((theta - 1) / next, kMaxMomentum));
    theta = next;
    last_change = sums.change;
  }
  Unload(*field, impulses, velocities);
  return sweep;
}

int GaussSeidel::Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
                       std::vector<double>* velocities, Pace pace, Precision precision) {
  if (problem.contacts.empty() || max_sweeps <= 0) return 0;
  if (precision == Precision::kDouble)
    return SweepIn(&plain_, problem, max_sweeps, tolerance, impulses, velocities, pace);
  if (!single_prepared_) {
    frame_ = CommonVelocity(problem, *velocities);
    PrepareSingle(problem);
  }
  for (int i = 0; i < problem.num_bodies(); ++i) Block{velocities->data() + 6 * i} -= frame_;
  const int sweeps = SweepIn(&single_, problem, max_sweeps, tolerance, impulses, velocities, pace);
  for (int c = 0; c < problem.num_contacts(); ++c)  // single precision meets the cone to its own rounding
    (*impulses)[c] = CutToCone((*impulses)[c], problem.contacts[c].friction);
  VelocitiesAfter(problem, *impulses, velocities);
  return sweeps;
}

}  // namespace islet::qp
