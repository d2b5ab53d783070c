#include "qp/gauss_seidel.h"

#include <algorithm>
#include <cmath>

#include "parallel/fork.h"

namespace islet::qp {
namespace {

constexpr int kPrepareBatches = 32;  // in one piece
// Nesterov's momentum wants a gradient; the law of friction is none, and full momentum circles around jammed piles for ever.
constexpr double kMaxMomentum = 0.8;
constexpr double kMaxGrowth = 2;  // of |x - z|^2 from sweep to sweep
constexpr double kFlat = 1e-14;   // of W_nn: a tangent that moves nothing

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

}  // namespace

void GaussSeidel::Prepare(const Problem& problem) {
  order_.Build(problem);
  roots_.resize(problem.bodies.size());
  for (size_t i = 0; i < roots_.size(); ++i) {
    roots_[i].mass_root = 1 / std::sqrt(problem.bodies[i].mass);
    roots_[i].inertia_root = Root(problem.bodies[i].inverse_inertia);
  }
  compliant_ = std::any_of(problem.contacts.begin(), problem.contacts.end(),
                           [](const ContactTerm& c) { return c.compliance > 0; });
  velocities_.resize(roots_.size() + order_.sections().size());
  previous_.resize(roots_.size());
  sums_.resize(order_.sections().size());
  axes_.resize(problem.contacts.size());
  batches_.resize(order_.num_batches());
  states_.resize(order_.num_batches());
  for (size_t s = 0; s < order_.sections().size(); ++s) {
    const SweepOrder::Section& section = order_.sections()[s];
    const int pieces = (section.num_batches + kPrepareBatches - 1) / kPrepareBatches;
    parallel::Fork(pieces, [&](int piece) {
      const int first = piece * kPrepareBatches, last = std::min(first + kPrepareBatches, section.num_batches);
      for (int b = first; b < last; ++b)
        PrepareBatch(problem, section.first_batch + b, static_cast<int>(roots_.size() + s));
    });
  }
}

// still: the place of an immovable body.
void GaussSeidel::PrepareBatch(const Problem& problem, int number, int still) {
  SweepBatch& batch = batches_[number];
  for (int lane = 0; lane < kBatchLanes; ++lane) {
    const int c = order_.contacts()[number * kBatchLanes + lane];
    batch.body[0][lane] = c >= 0 && problem.contacts[c].body_a >= 0 ? problem.contacts[c].body_a : still;
    batch.body[1][lane] = c >= 0 && problem.contacts[c].body_b >= 0 ? problem.contacts[c].body_b : still;
    if (c >= 0) {
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

void GaussSeidel::PrepareContact(const Problem& problem, int number, int lane, SweepBatch* out) {
  const ContactTerm& contact = problem.contacts[number];
  SweepBatch& batch = *out;
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
    const double tangent = stiffness[k] > kFlat * w(0, 0) ? 1 / std::sqrt(stiffness[k]) : 0;
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

SweepSums GaussSeidel::SweepOnce(double momentum) {
  const std::vector<int>& phases = order_.phase_start();
  for (size_t p = 0; p + 1 < phases.size(); ++p) {
    parallel::Fork(phases[p + 1] - phases[p], [&](int piece) {
      const int number = phases[p] + piece;
      const SweepOrder::Section& section = order_.sections()[number];
      sums_[number] = kernels_->coulomb(section.num_batches, &batches_[section.first_batch], compliant_, momentum,
                                        &states_[section.first_batch], velocities_.data());
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

// The velocities of x + momentum (x - previous): they are linear in the impulses.
void GaussSeidel::Extrapolate(double momentum) {
  for (size_t i = 0; i < roots_.size(); ++i) {
    for (int k = 0; k < 6; ++k) {
      const double y = velocities_[i].y[k];
      velocities_[i].y[k] = y + momentum * (y - previous_[i].y[k]);
      previous_[i].y[k] = y;
    }
  }
}

// Into the coordinates of the kernels: x = T^-1 j, y = G^-1 v = G^T M v.
void GaussSeidel::Load(const Problem& problem, const std::vector<Vector3>& impulses,
                       const std::vector<double>& velocities) {
  using Block = Eigen::Map<Vector3>;
  using ConstBlock = Eigen::Map<const Vector3>;
  for (size_t slot = 0; slot < order_.contacts().size(); ++slot) {
    const int c = order_.contacts()[slot];
    const size_t lane = slot % kBatchLanes;
    const SweepBatch& batch = batches_[slot / kBatchLanes];
    SweepState& state = states_[slot / kBatchLanes];
    for (int d = 0; d < 3; ++d) state.x[d][lane] = state.previous[d][lane] = 0;
    state.lambda[lane] = 0;
    if (c < 0) continue;
    const Vector3& j = impulses[c];
    const double t[2] = {axes_[c].cosine * j[1] + axes_[c].sine * j[2], axes_[c].cosine * j[2] - axes_[c].sine * j[1]};
    double normal = j[0];
    for (int k = 0; k < 2; ++k) {
      normal -= batch.shear[k][lane] * t[k];
      if (batch.tangent[k][lane] > 0) state.x[1 + k][lane] = t[k] / batch.tangent[k][lane];
    }
    state.x[0][lane] = normal / batch.normal[lane];
    for (int d = 0; d < 3; ++d) state.previous[d][lane] = state.x[d][lane];
  }
  velocities_.assign(velocities_.size(), {});
  for (size_t i = 0; i < roots_.size(); ++i) {
    const double* v = velocities.data() + 6 * i;
    Block(velocities_[i].y) = ConstBlock(v) / roots_[i].mass_root;
    const Vector3 momentum = problem.bodies[i].inertia * ConstBlock(v + 3);
    Block(velocities_[i].y + 3).noalias() = roots_[i].inertia_root.transpose() * momentum;
    previous_[i] = velocities_[i];
  }
}

void GaussSeidel::Unload(std::vector<Vector3>* impulses, std::vector<double>* velocities) const {
  using Block = Eigen::Map<Vector3>;
  using ConstBlock = Eigen::Map<const Vector3>;
  for (size_t i = 0; i < roots_.size(); ++i) {
    double* v = velocities->data() + 6 * i;
    Block{v} = ConstBlock(velocities_[i].y) * roots_[i].mass_root;
    Block(v + 3).noalias() = roots_[i].inertia_root * ConstBlock(velocities_[i].y + 3);
  }
  for (size_t slot = 0; slot < order_.contacts().size(); ++slot) {
    const int c = order_.contacts()[slot];
    if (c < 0) continue;
    const size_t lane = slot % kBatchLanes;
    const SweepBatch& batch = batches_[slot / kBatchLanes];
    const SweepState& state = states_[slot / kBatchLanes];
    const double t[2] = {batch.tangent[0][lane] * state.x[1][lane], batch.tangent[1][lane] * state.x[2][lane]};
    (*impulses)[c] = {batch.normal[lane] * state.x[0][lane] + batch.shear[0][lane] * t[0] + batch.shear[1][lane] * t[1],
                      axes_[c].cosine * t[0] - axes_[c].sine * t[1], axes_[c].sine * t[0] + axes_[c].cosine * t[1]};
  }
}

int GaussSeidel::Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
                       std::vector<double>* velocities, Pace pace) {
  if (problem.contacts.empty() || max_sweeps <= 0) return std::max(0, std::min(max_sweeps, 1));
  Load(problem, *impulses, *velocities);
  double theta = 1, last_change = INFINITY, momentum = 0;
  int sweep = 0;
  while (sweep < max_sweeps) {
    ++sweep;
    if (pace == Pace::kMomentum) Extrapolate(momentum);
    const SweepSums sums = SweepOnce(momentum);
    if (sums.largest <= tolerance) break;
    if (pace == Pace::kPlain) continue;
    const bool astray = sums.ahead < 0 || sums.change > kMaxGrowth * last_change;
    const double next = astray ? 1 : 0.5 * (1 + std::sqrt(1 + 4 * theta * theta));
    momentum = astray ? 0 : std::min((theta - 1) / next, kMaxMomentum);
    theta = next;
    last_change = sums.change;
  }
  Unload(impulses, velocities);
  return sweep;
}

}  // namespace islet::qp
