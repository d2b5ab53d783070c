// Body of the sweep kernels for one vector width. Included by sweep_kernels_<isa>.cpp and sweep_kernels_<isa>_single.cpp, which
// define ISLET_LANES (numbers in a vector), ISLET_SINGLE for floats, ISLET_KERNEL_SET and ISLET_KERNEL_NAME. Nothing but builtins is used here: an inline function of a shared
// header, compiled with wider vectors, could be chosen by the linker for everyone.
#include "qp/gauss_seidel/sweep_kernels.h"
#include "qp/linear_algebra/lanes_impl.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

using Batch = SweepBatch<Number>;
using State = SweepState<Number>;
using Velocity = SweepVelocity<Number>;

// In double precision with the bracket; two or three are usual. Singles only go ahead of doubles, and take one step a visit.
constexpr int kMostSteps = sizeof(Number) == sizeof(double) ? kHalvings : 1;
// Of mu j_n / |j_t|; only the direction depends on it.
constexpr Number kNewtonTolerance = sizeof(Number) == sizeof(double) ? Number(1e-6) : Number(1e-5);

// Six components of the velocities of kLanes bodies, lane by lane, and back.
inline void Gather(const Velocity* y, const int* body, Vec* out) {
  Gather([&](int i) { return y[body[i]].y; }, out);
}
#if defined(ISLET_SINGLE) && ISLET_LANES == 8
inline void Scatter(const Vec* in, const int* body, Velocity* y) {
  const Vec all[8] = {in[0], in[1], in[2], in[3], in[4], in[5], Vec{}, Vec{}};
  Vec out[8];
  Transpose(all, out);
  for (int i = 0; i < 8; ++i) Store(y[body[i]].y, out[i]);
}
#elif ISLET_LANES == 8
inline void Scatter(const Vec* in, const int* body, Velocity* y) {
  const Vec zero = {};
  Vec pair[4][2];  // [components 2m and 2m + 1][even or odd bodies]: 128 bits a body
  for (int m = 0; m < 3; ++m) {
    pair[m][0] = ISLET_SHUFFLE(in[2 * m], in[2 * m + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    pair[m][1] = ISLET_SHUFFLE(in[2 * m], in[2 * m + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int k = 0; k < 2; ++k) {
    const Vec p = ISLET_SHUFFLE(pair[0][k], pair[1][k], 0, 1, 8, 9, 2, 3, 10, 11);    // bodies k, k + 2
    const Vec q = ISLET_SHUFFLE(pair[0][k], pair[1][k], 4, 5, 12, 13, 6, 7, 14, 15);  // k + 4, k + 6
    const Vec r = ISLET_SHUFFLE(pair[2][k], zero, 0, 1, 8, 9, 2, 3, 10, 11);
    const Vec s = ISLET_SHUFFLE(pair[2][k], zero, 4, 5, 12, 13, 6, 7, 14, 15);
    Store(y[body[k]].y, ISLET_SHUFFLE(p, r, 0, 1, 2, 3, 8, 9, 10, 11));
    Store(y[body[k + 2]].y, ISLET_SHUFFLE(p, r, 4, 5, 6, 7, 12, 13, 14, 15));
    Store(y[body[k + 4]].y, ISLET_SHUFFLE(q, s, 0, 1, 2, 3, 8, 9, 10, 11));
    Store(y[body[k + 6]].y, ISLET_SHUFFLE(q, s, 4, 5, 6, 7, 12, 13, 14, 15));
  }
}
#elif ISLET_LANES == 4
inline void Scatter(const Vec* in, const int* body, Velocity* y) {
  const Vec rest[4] = {in[4], in[5], Vec{}, Vec{}};
  Vec out[4];
  Transpose(in, out);
  for (int i = 0; i < 4; ++i) Store(y[body[i]].y, out[i]);
  Transpose(rest, out);
  for (int i = 0; i < 4; ++i) Store(y[body[i]].y + 4, out[i]);
}
#else
inline void Scatter(const Vec* in, const int* body, Velocity* y) {
  for (int k = 0; k < 6; ++k)
    for (int i = 0; i < 2; ++i) y[body[i]].y[k] = in[k][i];
}
#endif

// Constants of kLanes contacts.
struct Law {
  Vec normal, tangent[2], shear[2], friction;
};

// For the lanes in `slides`: j_t = t_k / (1 + lambda tangent_k^2) with lambda > 0 the root of mu j_n / |j_t| = 1, which is
// nearly linear in lambda: Newton's method inside a bracket whose upper end may still be infinite. In contact coordinates
// x_n is that of a contact that sticks, whatever x_t. The answer lies on the cone exactly, by its last scaling; lambda is
// left one step better than the answer, for the next sweep. A lane that has arrived stays, whoever else is still on the way: what a
// contact gets must not depend on its neighbours in the vector.
inline void Slide(const Law& law, Mask slides, Vec* x, Vec* lambda) {
  const Vec zero = {}, one = zero + 1, infinite = zero + Number(__builtin_inf());
  const Vec t1 = law.tangent[0] * x[1], t2 = law.tangent[1] * x[2], n = law.normal * x[0];
  const Vec a1 = law.tangent[0] * law.tangent[0], a2 = law.tangent[1] * law.tangent[1];
  const Vec start = one / (a1 + a2);
  const Mask seeks = slides & (law.friction > zero);
  Vec l = *lambda, low = zero, high = infinite, scale1 = zero, scale2 = zero;
  Mask going = seeks;
  for (int i = 0; i < kMostSteps; ++i) {
    const Vec q1 = one + l * a1, q2 = one + l * a2, r = one / (q1 * q2);
    const Vec d1 = r * q2, d2 = r * q1, j1 = t1 * d1, j2 = t2 * d2, sheared = law.shear[0] * j1 + law.shear[1] * j2,
              jn = n + sheared;
    const Vec p1 = j1 * a1 * d1, p2 = j2 * a2 * d2, squared = j1 * j1 + j2 * j2, inverse = one / Root(squared);
    const Vec g = law.friction * inverse, value = g * jn - one;
    const Vec slope = g * (jn * (j1 * p1 + j2 * p2) * inverse * inverse - law.shear[0] * p1 - law.shear[1] * p2);
    const Vec newton = l - value / slope;
    const Vec fit = law.friction * n / (squared * inverse - law.friction * sheared);
    scale1 = going ? fit * d1 : scale1;
    scale2 = going ? fit * d2 : scale2;
    low = value < zero ? l : low;
    high = value < zero ? high : l;
    const Mask inside = (newton > low) & (newton < high);
    const Mask close = (value <= kNewtonTolerance) & (value >= -kNewtonTolerance);
    const Vec halved = high == infinite ? 4 * l + start : Number(0.5) * (low + high);
    l = going ? (inside ? newton : (close ? l : halved)) : l;
    going &= ~close;
    if (!Any(going)) break;
  }
  x[1] = slides ? scale1 * x[1] : x[1];
  x[2] = slides ? scale2 * x[2] : x[2];
  *lambda = seeks ? l : zero;
}

// The exact law at kLanes contacts: x goes in as the impulses that bring u to zero.
inline void SolveCoulomb(const Law& law, Vec* x, Vec* lambda) {
  const Vec zero = {};
  const Vec j1 = law.tangent[0] * x[1], j2 = law.tangent[1] * x[2];
  const Vec reach = law.friction * (law.normal * x[0] + law.shear[0] * j1 + law.shear[1] * j2);
  const Mask closed = x[0] > zero;
  const Mask slides = closed & ~((reach >= zero) & (j1 * j1 + j2 * j2 <= reach * reach));
  for (int d = 0; d < 3; ++d) x[d] = closed ? x[d] : zero;
  if (Any(slides)) {
    Slide(law, slides, x, lambda);
  } else {
    *lambda = zero;
  }
}

// u += T^T R T x
inline void AddCompliance(const Law& law, Vec compliance, const Vec* x, Vec* u) {
  const Vec j1 = law.tangent[0] * x[1], j2 = law.tangent[1] * x[2];
  const Vec jn = law.normal * x[0] + law.shear[0] * j1 + law.shear[1] * j2;
  u[0] += compliance * law.normal * jn;
  u[1] += compliance * law.tangent[0] * (j1 + law.shear[0] * jn);
  u[2] += compliance * law.tangent[1] * (j2 + law.shear[1] * jn);
}

// Lane by lane of a batch, however many lanes a vector has: the bits of a sum depend on its order.
struct Sums {
  Vec largest, change, ahead;
};
constexpr int kParts = kBatchLanes / kLanes;  // vectors in a batch

inline void Visit(const Batch& batch, int lane, bool compliant, Vec momentum, State* state, Velocity* velocities,
                  Sums* sums) {
  const int* body_a = batch.body[0] + lane;
  const int* body_b = batch.body[1] + lane;
  Vec ya[6], yb[6], u[3], before[3], x[3], change[3];
  Gather(velocities, body_a, ya);
  Gather(velocities, body_b, yb);
  const Law law{Load(batch.normal + lane),
                {Load(batch.tangent[0] + lane), Load(batch.tangent[1] + lane)},
                {Load(batch.shear[0] + lane), Load(batch.shear[1] + lane)},
                Load(batch.friction + lane)};
  for (int d = 0; d < 3; ++d) {
    Vec first = Load(batch.offset[d] + lane), second = {};
    for (int k = 0; k < 6; ++k) {
      first += Load(batch.rows[0][d][k] + lane) * ya[k];
      second += Load(batch.rows[1][d][k] + lane) * yb[k];
    }
    u[d] = first + second;
    before[d] = Load(state->x[d] + lane);
    x[d] = change[d] = before[d] + momentum * (before[d] - Load(state->previous[d] + lane));
    Store(state->previous[d] + lane, before[d]);
  }
  if (compliant) AddCompliance(law, Load(batch.compliance + lane), x, u);
  for (int d = 0; d < 3; ++d) x[d] -= u[d];
  Vec lambda = Load(state->lambda + lane);
  SolveCoulomb(law, x, &lambda);
  Store(state->lambda + lane, lambda);
  for (int d = 0; d < 3; ++d) {
    Store(state->x[d] + lane, x[d]);
    change[d] = x[d] - change[d];
    sums->change += change[d] * change[d];
    sums->ahead += change[d] * (x[d] - before[d]);
  }
  for (int k = 0; k < 6; ++k) {
    for (int d = 0; d < 3; ++d) {
      ya[k] += Load(batch.rows[0][d][k] + lane) * change[d];
      yb[k] += Load(batch.rows[1][d][k] + lane) * change[d];
    }
  }
  Scatter(ya, body_a, velocities);
  Scatter(yb, body_b, velocities);
  const Vec j1 = law.tangent[0] * change[1], j2 = law.tangent[1] * change[2];
  const Vec jn = law.normal * change[0] + law.shear[0] * j1 + law.shear[1] * j2;
  sums->largest = Max(Max(Max(Abs(j1), Abs(j2)), Abs(jn)) * Load(batch.weight + lane), sums->largest);
}

// The same without friction: one row a contact.
inline void VisitNormal(const Batch& batch, int lane, Vec momentum, State* state, Velocity* velocities, Sums* sums) {
  const int* body_a = batch.body[0] + lane;
  const int* body_b = batch.body[1] + lane;
  Vec ya[6], yb[6], a[6], b[6], first = Load(batch.offset[0] + lane), second = {};
  Gather(velocities, body_a, ya);
  Gather(velocities, body_b, yb);
  for (int k = 0; k < 6; ++k) {
    a[k] = Load(batch.rows[0][0][k] + lane);
    b[k] = Load(batch.rows[1][0][k] + lane);
    first += a[k] * ya[k];
    second += b[k] * yb[k];
  }
  const Vec before = Load(state->x[0] + lane);
  const Vec ahead = before + momentum * (before - Load(state->previous[0] + lane));
  const Vec x = Max(ahead - (first + second), Vec{}), change = x - ahead;
  Store(state->previous[0] + lane, before);
  Store(state->x[0] + lane, x);
  for (int k = 0; k < 6; ++k) {
    ya[k] += a[k] * change;
    yb[k] += b[k] * change;
  }
  Scatter(ya, body_a, velocities);
  Scatter(yb, body_b, velocities);
  sums->change += change * change;
  sums->ahead += change * (x - before);
  sums->largest = Max(Abs(Load(batch.normal + lane) * change) * Load(batch.weight + lane), sums->largest);
}

// Over the lanes.
SweepSums Total(const Sums (&sums)[kParts]) {
  SweepSums out;
  for (const Sums& part : sums) {
    for (int i = 0; i < kLanes; ++i) {
      out.largest = part.largest[i] > out.largest ? part.largest[i] : out.largest;
      out.change += part.change[i];
      out.ahead += part.ahead[i];
    }
  }
#ifdef __AVX__
  // The compiler forgets it on this path, and then all narrow code that follows runs at half its speed.
  _mm256_zeroupper();
#endif
  return out;
}

SweepSums SweepCoulomb(int num_batches, const Batch* batches, bool compliant, Number momentum, State* states,
                       Velocity* velocities) {
  Sums sums[kParts] = {};
  for (int b = 0; b < num_batches; ++b)
    for (int lane = 0; lane < batches[b].used; lane += kLanes)
      Visit(batches[b], lane, compliant, Vec{} + momentum, states + b, velocities, &sums[lane / kLanes]);
  return Total(sums);
}

SweepSums SweepNormal(int num_batches, const Batch* batches, Number momentum, State* states, Velocity* velocities) {
  Sums sums[kParts] = {};
  for (int b = 0; b < num_batches; ++b)
    for (int lane = 0; lane < batches[b].used; lane += kLanes)
      VisitNormal(batches[b], lane, Vec{} + momentum, states + b, velocities, &sums[lane / kLanes]);
  return Total(sums);
}

}  // namespace

extern const SweepKernels<Number> ISLET_KERNEL_SET;
const SweepKernels<Number> ISLET_KERNEL_SET = {ISLET_KERNEL_NAME, SweepCoulomb, SweepNormal};

}  // namespace islet::qp
