// Body of the row kernels for one vector width. Included by row_kernels_<isa>.cpp, which define ISLET_LANES (doubles in a
// vector) and ISLET_KERNEL_SET. Nothing but builtins is used here: an inline function of a shared header,
// compiled with wider vectors, could be chosen by the linker for everyone.
#include "qp/interior_point/row_cones_impl.h"

namespace islet::qp {
namespace {

// body(rows, lane) for each vector of the batch, with rows.value its number of rows at compile time.
template <int N>
struct Count {
  static constexpr int value = N;
};
template <typename Body>
inline void ForBatch(const RowBatch& batch, const Body& body) {
  for (int lane = 0; lane < kRowLanes; lane += kLanes) {
    if (batch.rows == 3) {
      body(Count<3>{}, lane);
    } else if (batch.rows == 1) {
      body(Count<1>{}, lane);
    } else {
      body(Count<8>{}, lane);
    }
  }
}

// J y: what the unknowns make of the contact velocity. A ray needs the normal part alone.
template <int N>
inline void ContactVelocity(const RowBatch& batch, int lane, const double* y, Vec (&u)[3]) {
  Vec a[6], b[6];
  Gather([&](int i) { return y + batch.velocity[0][lane + i]; }, a);
  Gather([&](int i) { return y + batch.velocity[1][lane + i]; }, b);
  for (int d = 0; d < 3; ++d) {
    u[d] = Vec{};
    if (N == 1 && d > 0) continue;
    Vec second = {};
    for (int k = 0; k < 6; ++k) {
      u[d] += Load(batch.jacobian[0][d][k] + lane) * a[k];
      second += Load(batch.jacobian[1][d][k] + lane) * b[k];
    }
    u[d] += second;
  }
}

inline void AddYield(const RowBatch& batch, int lane, const Vec (&j)[3], Vec (&u)[3]) {
  for (int d = 0; d < 3; ++d) u[d] += Load(batch.compliance + lane) * j[d];
}

// u <- S^T u, S = (I + D R)^-1.
inline void SoftenVelocity(const Lanes* softening, int lane, Vec (&u)[3]) {
  Vec s[3] = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) s[j] += Load(softening[3 * i + j].at + lane) * u[i];
  for (int i = 0; i < 3; ++i) u[i] = s[i];
}

RowSums Residuals(const RowArrays& arrays, int from, int to, const double* y, Lanes* forces) {
  constexpr int kParts = kRowLanes / kLanes;
  Vec gap[kParts] = {}, worst = {};  // lane by lane of a batch: the bits of a sum depend on its order
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec s[N], z[N], mapped[N], u[3], j[3];
      const Vec mu = Load(batch.friction + lane);
      LoadRows(arrays.s + batch.first, lane, s);
      LoadRows(arrays.z + batch.first, lane, z);
      MapFromRows(mu, arrays.edges, z, j);
      for (int d = 0; d < 3; ++d) Store(forces[3 * b + d].at + lane, batch.sign * j[d]);
      ContactVelocity<N>(batch, lane, y, u);
      for (int d = 0; d < 3; ++d) u[d] += Load(batch.offset[d] + lane);
      AddYield(batch, lane, j, u);
      MapToRows(mu, arrays.edges, u, mapped);
      Vec product = {};
      for (int i = 0; i < N; ++i) {
        product += s[i] * z[i];
        mapped[i] = s[i] - mapped[i];
        worst = Max(Abs(mapped[i]), worst);
      }
      gap[lane / kLanes] += Load(batch.used + lane) * product;
      StoreRows(mapped, lane, arrays.primal + batch.first);
    });
  }
  RowSums sums;
  for (int l = 0; l < kRowLanes; ++l) sums.gap += gap[l / kLanes][l % kLanes];
  for (int l = 0; l < kLanes; ++l)
    if (worst[l] > sums.worst) sums.worst = worst[l];
  return sums;
}

bool Scale(const RowArrays& arrays, int from, int to, Lanes* target, Lanes* d) {
  Vec fails = {};
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec s[N], z[N], point[N], inverse[N], lambda[N], block[3][3], softening[3][3];
      LoadRows(arrays.s + batch.first, lane, s);
      LoadRows(arrays.z + batch.first, lane, z);
      FindScaling(s, z, point, inverse, lambda, &fails);
      StoreRows(point, lane, arrays.point + batch.first);
      StoreRows(inverse, lane, arrays.inverse + batch.first);
      StoreRows(lambda, lane, arrays.lambda + batch.first);
      for (int i = 0; i < N; ++i) Store(target[batch.first + i].at + lane, -lambda[i] * Load(batch.used + lane));
      ScalingBlock(Load(batch.friction + lane), arrays.edges, point, inverse, block);
      if (batch.soft) {
        Soften(Load(batch.compliance + lane), block, softening);
        for (int i = 0; i < 9; ++i) Store(arrays.softening[9 * b + i].at + lane, softening[i / 3][i % 3]);
      }
      for (int i = 0; i < 9; ++i) Store(d[9 * b + i].at + lane, block[i / 3][i % 3]);
    });
  }
  for (int l = 0; l < kLanes; ++l)
    if (fails[l] > 0) return false;
  return true;
}

void Aim(const RowArrays& arrays, const RowDirection& direction, int from, int to, double goal) {
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec ds[N], dz[N], lambda[N], product[N];
      LoadRows(direction.ds + batch.first, lane, ds);
      LoadRows(direction.dz + batch.first, lane, dz);
      LoadRows(arrays.lambda + batch.first, lane, lambda);
      JordanProduct(ds, dz, product);
      for (int i = 0; i < N; ++i) product[i] = (N == 3 && i > 0 ? 0 : goal) - product[i];
      JordanDivide(lambda, product);
      for (int i = 0; i < N; ++i) product[i] = (product[i] - lambda[i]) * Load(batch.used + lane);
      StoreRows(product, lane, direction.target + batch.first);
    });
  }
}

void Centre(const RowArrays& arrays, const RowDirection& now, const RowDirection& next, int from, int to, double low,
            double high) {
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec ds[N], dz[N], lambda[N], target[N], product[N];
      LoadRows(now.ds + batch.first, lane, ds);
      LoadRows(now.dz + batch.first, lane, dz);
      LoadRows(now.target + batch.first, lane, target);
      LoadRows(arrays.lambda + batch.first, lane, lambda);
      for (int i = 0; i < N; ++i) ds[i] += lambda[i], dz[i] += lambda[i];
      JordanProduct(ds, dz, product);
      BandCorrection(low, high, product);
      JordanDivide(lambda, product);
      for (int i = 0; i < N; ++i) target[i] += product[i] * Load(batch.used + lane);
      StoreRows(target, lane, next.target + batch.first);
    });
  }
}

void Start(const RowArrays& arrays, const RowDirection& direction, int from, int to, double weight, Lanes* forces) {
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec x[N], target[N], point[N], inverse[N], g[3];
      LoadRows(arrays.primal + batch.first, lane, x);
      LoadRows(direction.target + batch.first, lane, target);
      LoadRows(arrays.point + batch.first, lane, point);
      LoadRows(arrays.inverse + batch.first, lane, inverse);
      Unscale(point, inverse, x);
      for (int i = 0; i < N; ++i) x[i] = weight * x[i] + target[i];
      Unscale(point, inverse, x);
      MapFromRows(Load(batch.friction + lane), arrays.edges, x, g);
      if (batch.soft) {
        const Vec plain[3] = {g[0], g[1], g[2]};
        const Lanes* softening = arrays.softening + 9 * b;
        for (int i = 0; i < 3; ++i) {
          g[i] = Vec{};
          for (int j = 0; j < 3; ++j) g[i] += Load(softening[3 * i + j].at + lane) * plain[j];
        }
      }
      for (int d = 0; d < 3; ++d) {
        Store(direction.constants[3 * b + d].at + lane, g[d]);
        Store(forces[3 * b + d].at + lane, batch.sign * g[d]);
      }
    });
  }
}

inline double Largest(Vec bound) {
  double largest = 0;
  for (int l = 0; l < kLanes; ++l)
    if (bound[l] > largest) largest = bound[l];
  return largest;
}

double Complete(const RowArrays& arrays, const RowDirection& direction, int from, int to, double weight,
                const double* dy) {
  Vec bound = {};
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec u[3], move[N], x[N], point[N], inverse[N], lambda[N];
      LoadRows(arrays.point + batch.first, lane, point);
      LoadRows(arrays.inverse + batch.first, lane, inverse);
      LoadRows(arrays.lambda + batch.first, lane, lambda);
      LoadRows(arrays.primal + batch.first, lane, x);
      ContactVelocity<N>(batch, lane, dy, u);
      if (batch.soft) {
        Vec constants[3];
        LoadRows(direction.constants + 3 * b, lane, constants);
        SoftenVelocity(arrays.softening + 9 * b, lane, u);
        AddYield(batch, lane, constants, u);
      }
      MapToRows(Load(batch.friction + lane), arrays.edges, u, move);
      for (int i = 0; i < N; ++i) move[i] -= weight * x[i];
      StoreRows(move, lane, direction.plain + batch.first);
      Unscale(point, inverse, move);
      StoreRows(move, lane, direction.ds + batch.first);
      bound = StepBound(lambda, move, bound);
      LoadRows(direction.target + batch.first, lane, x);
      for (int i = 0; i < N; ++i) x[i] -= move[i];
      StoreRows(x, lane, direction.dz + batch.first);
      bound = StepBound(lambda, x, bound);
    });
  }
  return Largest(bound);
}

double Correct(const RowArrays& arrays, const RowDirection& direction, int from, int to, const double* correction) {
  Vec bound = {};
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec u[3], move[N], x[N], point[N], inverse[N], lambda[N];
      LoadRows(arrays.point + batch.first, lane, point);
      LoadRows(arrays.inverse + batch.first, lane, inverse);
      LoadRows(arrays.lambda + batch.first, lane, lambda);
      ContactVelocity<N>(batch, lane, correction, u);
      if (batch.soft) SoftenVelocity(arrays.softening + 9 * b, lane, u);
      MapToRows(Load(batch.friction + lane), arrays.edges, u, move);
      LoadRows(direction.plain + batch.first, lane, x);
      for (int i = 0; i < N; ++i) x[i] -= move[i];
      StoreRows(x, lane, direction.plain + batch.first);
      Unscale(point, inverse, move);
      LoadRows(direction.ds + batch.first, lane, x);
      for (int i = 0; i < N; ++i) x[i] -= move[i];
      StoreRows(x, lane, direction.ds + batch.first);
      bound = StepBound(lambda, x, bound);
      LoadRows(direction.dz + batch.first, lane, x);
      for (int i = 0; i < N; ++i) x[i] += move[i];
      StoreRows(x, lane, direction.dz + batch.first);
      bound = StepBound(lambda, x, bound);
    });
  }
  return Largest(bound);
}

// dz as it is, not scaled.
template <int N>
inline void PlainImpulse(const RowArrays& arrays, const RowDirection& direction, int first, int lane, Vec (&dz)[N]) {
  Vec point[N], inverse[N];
  LoadRows(arrays.point + first, lane, point);
  LoadRows(arrays.inverse + first, lane, inverse);
  LoadRows(direction.dz + first, lane, dz);
  Unscale(point, inverse, dz);
}

void Forces(const RowArrays& arrays, const RowDirection& direction, int from, int to, Lanes* forces) {
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      Vec dz[rows.value], j[3];
      PlainImpulse(arrays, direction, batch.first, lane, dz);
      MapFromRows(Load(batch.friction + lane), arrays.edges, dz, j);
      for (int d = 0; d < 3; ++d) Store(forces[3 * b + d].at + lane, batch.sign * j[d]);
    });
  }
}

void Advance(const RowArrays& arrays, const RowDirection& direction, int from, int to, double step) {
  for (int b = from; b < to; ++b) {
    const RowBatch& batch = arrays.batches[b];
    ForBatch(batch, [&](auto rows, int lane) {
      constexpr int N = rows.value;
      Vec dz[N], x[N], move[N];
      PlainImpulse(arrays, direction, batch.first, lane, dz);
      LoadRows(direction.plain + batch.first, lane, move);
      LoadRows(arrays.s + batch.first, lane, x);
      for (int i = 0; i < N; ++i) x[i] += step * move[i];
      StoreRows(x, lane, arrays.s + batch.first);
      LoadRows(arrays.z + batch.first, lane, x);
      for (int i = 0; i < N; ++i) x[i] += step * dz[i];
      StoreRows(x, lane, arrays.z + batch.first);
    });
  }
}

void GatherForces(int from, int to, const int* start, const SideRows* sides, const int* force_at, const Lanes* forces,
                  double* out) {
  constexpr int kParts = kRowLanes / kLanes;
  const double* values = forces[0].at;
  for (int place = from; place < to; ++place) {
    Vec sum[kParts] = {};
    for (int p = start[place]; p < start[place + 1]; ++p) {
      const double* force = values + force_at[p];
      for (int d = 0; d < 3; ++d)
        for (int t = 0; t < kParts; ++t) sum[t] += Load(sides[p].rows[d] + t * kLanes) * force[d * kRowLanes];
    }
    for (int i = 0; i < 6; ++i) out[6 * place + i] = sum[i / kLanes][i % kLanes];
  }
}

}  // namespace

extern const RowKernels ISLET_KERNEL_SET;
const RowKernels ISLET_KERNEL_SET = {&Residuals, &Scale,   &Aim,    &Centre,  &Start,
                                     &Complete,  &Correct, &Forces, &Advance, &GatherForces};

}  // namespace islet::qp
