// One factorisation of the Newton matrix against CHOLMOD supernodal with OpenBLAS, both on this machine in this run.
//
//   ISLET_PROBLEMS=folder bench_factorisation                            the measured frames in a folder, then piles of our own
//   bench_factorisation --benchmark_filter=pile                          the piles alone
//   OPENBLAS_CORETYPE=SkylakeX bench_factorisation                       OpenBLAS's AVX-512 kernels where it does not choose them
//
// A row is one matrix. The competitors take turns, the least times of many turns are compared. What the columns mean and what
// was measured: bench/README.md, "Factorisation".
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <Eigen/QR>
#include <Eigen/SparseCore>

#include "bench/problem_files.h"
#include "parallel/worker_pool.h"
#include "qp/build_facts.h"
#include "qp/linear_algebra/kkt.h"

#ifdef ISLET_HAVE_CHOLMOD
#include <cholmod.h>
#include <dlfcn.h>
extern "C" void openblas_set_num_threads(int);
extern "C" char* openblas_get_corename();
#endif

namespace islet::qp {
namespace {

using Sparse = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

// Cubes of edge 1 in a jittered lattice between floor and walls; one to four contacts per touching pair.
Problem MakeUnevenPile(int nx, int ny, int nz) {
  std::mt19937 engine(static_cast<unsigned>(nx * 10000 + ny * 100 + nz));
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
  };
  const auto jitter = [&] { return Vector3(uniform(-0.2, 0.2), uniform(-0.2, 0.2), uniform(-0.2, 0.2)); };
  Problem pile;
  std::vector<Vector3> at;
  for (int i = 0; i < nx * ny * nz; ++i) {
    at.push_back(Vector3(i % nx, i / nx % ny, i / nx / ny) + jitter());
    BodyTerm body;
    body.inertia = Matrix3::Identity() / 6;
    body.inverse_inertia = Matrix3::Identity() * 6;
    pile.bodies.push_back(body);
  }
  const auto touch = [&](int a, int b, const Vector3& normal) {
    const int count = 1 + static_cast<int>(engine() % 4);
    for (int c = 0; c < count; ++c) {
      const Vector3 point = at[b] - 0.5 * normal + jitter();
      pile.contacts.push_back(
          MakeContact(a, b, a < 0 ? Vector3(0, 0, 0) : Vector3(point - at[a]), point - at[b], normal, 0));
    }
  };
  for (int b = 0; b < nx * ny * nz; ++b) {
    const int x = b % nx, y = b / nx % ny, z = b / nx / ny;
    if (z == 0) touch(-1, b, {0, 0, 1});
    if (x == 0) touch(-1, b, {1, 0, 0});
    if (y == 0) touch(-1, b, {0, 1, 0});
    for (int a = 0; a < b; ++a) {
      const Vector3 gap = at[b] - at[a];
      if (gap.norm() < 1.2) touch(a, b, gap.normalized());
    }
  }
  return pile;
}

// As spread out as an interior point's scalings before its end: eigenvalues 1e-4 to 1e4 in any direction.
std::vector<Matrix3> RandomScalings(size_t count) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> exponent(-4, 4), entry(-1, 1);
  std::vector<Matrix3> d(count);
  for (Matrix3& block : d) {
    const Matrix3 any = Matrix3::NullaryExpr([&] { return entry(engine); });
    const Matrix3 q = any.householderQr().householderQ();
    const Vector3 values = Vector3::NullaryExpr([&] { return std::pow(10.0, exponent(engine)); });
    const Matrix3 product = q * values.asDiagonal() * q.transpose();
    block = (product + product.transpose()) / 2;
  }
  return d;
}

Sparse LowerTriangle(const Problem& problem, const std::vector<Matrix3>& d) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](int row, int column, const Eigen::Matrix<double, 6, 6>& block) {
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 6; ++i)
        if (6 * row + i >= 6 * column + j) entries.push_back({6 * row + i, 6 * column + j, block(i, j)});
  };
  for (int i = 0; i < problem.num_bodies(); ++i) {
    Eigen::Matrix<double, 6, 6> mass = Eigen::Matrix<double, 6, 6>::Zero();
    mass.topLeftCorner<3, 3>() = problem.bodies[i].mass * Matrix3::Identity();
    mass.bottomRightCorner<3, 3>() = problem.bodies[i].inertia;
    add(i, i, mass);
  }
  for (size_t c = 0; c < d.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Jacobian &ja = contact.jacobian_a, &jb = contact.jacobian_b;
    const int a = contact.body_a, b = contact.body_b;
    if (a >= 0) add(a, a, ja.transpose() * d[c] * ja);
    if (b >= 0) add(b, b, jb.transpose() * d[c] * jb);
    if (a >= 0 && b >= 0 && a > b) add(a, b, ja.transpose() * d[c] * jb);
    if (a >= 0 && b >= 0 && a < b) add(b, a, jb.transpose() * d[c] * ja);
  }
  Sparse lower(6 * problem.num_bodies(), 6 * problem.num_bodies());
  lower.setFromTriplets(entries.begin(), entries.end());
  return lower;
}

// |b - S x| over |S| |x| + |b|, in the Frobenius norm.
double RelativeResidual(const Sparse& lower, const Eigen::VectorXd& x, const Eigen::VectorXd& b) {
  const Eigen::VectorXd product = lower.selfadjointView<Eigen::Lower>() * x;
  return (product - b).norm() / (lower.norm() * x.norm() + b.norm());
}

class Stopwatch {
 public:
  double Seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

// Of many turns: what it takes on a machine that does nothing else.
double Least(const std::vector<double>& values) {
  return values.empty() ? NAN : *std::min_element(values.begin(), values.end());
}

// What one competitor took, turn by turn [s].
struct Times {
  std::vector<double> factorise, solve;
  double analyse = 0, residual = 0, flops = 0;
};

#ifdef ISLET_HAVE_CHOLMOD
// CHOLMOD 3 opens OpenMP regions of four threads, whatever OMP_NUM_THREADS says; on few cores they get in each other's way.
// Zero active levels make such regions run in the calling thread.
void SetOpenMpLevels(int levels) {
  using Setter = void (*)(int);
  static const Setter set = reinterpret_cast<Setter>(dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"));
  if (set != nullptr) set(levels);
}

class Cholmod {
 public:
  // levels: of OpenMP. 0: one thread, 1: as it comes.
  Cholmod(const Sparse& lower, int levels, Times* times) : lower_(lower), levels_(levels), times_(times) {
    SetOpenMpLevels(levels);
    openblas_set_num_threads(1);
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    view_.nrow = static_cast<size_t>(lower_.rows()), view_.ncol = static_cast<size_t>(lower_.cols());
    view_.nzmax = static_cast<size_t>(lower_.nonZeros());
    view_.p = lower_.outerIndexPtr(), view_.i = lower_.innerIndexPtr(), view_.x = lower_.valuePtr();
    view_.stype = -1, view_.itype = CHOLMOD_INT, view_.xtype = CHOLMOD_REAL, view_.dtype = CHOLMOD_DOUBLE;
    view_.sorted = 1, view_.packed = 1;
    const Stopwatch watch;
    factor_ = cholmod_analyze(&view_, &common_);
    times_->analyse = watch.Seconds();
    times_->flops = common_.fl;
  }
  ~Cholmod() {
    cholmod_free_dense(&x_, &common_), cholmod_free_dense(&y_, &common_), cholmod_free_dense(&e_, &common_);
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  void Turn(const Eigen::VectorXd& b, int repeats) {
    SetOpenMpLevels(levels_);
    const Stopwatch watch;
    for (int i = 0; i < repeats; ++i) cholmod_factorize(&view_, factor_, &common_);
    times_->factorise.push_back(watch.Seconds() / repeats);
    Eigen::VectorXd copy = b;
    cholmod_dense right{};
    right.nrow = right.d = right.nzmax = static_cast<size_t>(b.size()), right.ncol = 1;
    right.x = copy.data(), right.xtype = CHOLMOD_REAL, right.dtype = CHOLMOD_DOUBLE;
    const Stopwatch solving;
    for (int i = 0; i < repeats; ++i)
      cholmod_solve2(CHOLMOD_A, factor_, &right, nullptr, &x_, nullptr, &y_, &e_, &common_);
    times_->solve.push_back(solving.Seconds() / repeats);
    const Eigen::Map<Eigen::VectorXd> x(static_cast<double*>(x_->x), b.size());
    times_->residual = RelativeResidual(lower_, x, b);
  }

 private:
  Sparse lower_;
  int levels_;
  Times* times_;
  cholmod_common common_;
  cholmod_sparse view_{};
  cholmod_factor* factor_ = nullptr;
  cholmod_dense *x_ = nullptr, *y_ = nullptr, *e_ = nullptr;
};
#endif

class Ours {
 public:
  Ours(const Problem& problem, const std::vector<Matrix3>& d, int threads, Times* times)
      : problem_(problem), d_(d), times_(times), pool_(threads) {
    kkt_.Prepare(problem_, 1);
    KktSystem again;  // a system that has its memory but another graph, as from frame to frame
    const Problem other = MakeUnevenPile(10, 10, 10);
    std::vector<double> analyse;
    for (int i = 0; i < 5; ++i) {
      again.Prepare(other, 1);
      const Stopwatch watch;
      again.Prepare(problem_, 1);
      analyse.push_back(watch.Seconds());
    }
    times_->analyse = Least(analyse);
  }

  // Inside of a task of the pool, as the engine does it: idle workers may help.
  void Turn(const Eigen::VectorXd& b, const Sparse& lower, int repeats) {
    pool_.ForEach(1, [&](int, int) {
      const Stopwatch watch;
      for (int i = 0; i < repeats; ++i) kkt_.Factorise(d_, none_);
      times_->factorise.push_back(watch.Seconds() / repeats);
      const Stopwatch solving;
      for (int i = 0; i < repeats; ++i) {
        x_ = b;
        kkt_.Solve(x_.data());
      }
      times_->solve.push_back(solving.Seconds() / repeats);
    });
    times_->residual = RelativeResidual(lower, x_, b);
  }
  const BlockCholesky& cholesky() const { return kkt_.cholesky(); }
  const Eigen::VectorXd& x() const { return x_; }

 private:
  const Problem& problem_;
  const std::vector<Matrix3>& d_;
  Times* times_;
  parallel::WorkerPool pool_;
  KktSystem kkt_;
  std::vector<double> none_;
  Eigen::VectorXd x_;
};

void Factorisation(benchmark::State& state, const std::function<Problem()>& make) {
  const Problem problem = make();
  const std::vector<Matrix3> d = RandomScalings(problem.contacts.size());
  const Sparse lower = LowerTriangle(problem, d);
  std::mt19937 engine(9);
  const Eigen::VectorXd b =
      Eigen::VectorXd::NullaryExpr(lower.rows(), [&] { return std::uniform_real_distribution<double>(-1, 1)(engine); });
  Times times_one, times_two, times_cholmod, times_as_it_comes;
  Ours one(problem, d, 1, &times_one), two(problem, d, 2, &times_two);
#ifdef ISLET_HAVE_CHOLMOD
  Cholmod cholmod(lower, 0, &times_cholmod), as_it_comes(lower, 1, &times_as_it_comes);
#endif
  const int repeats = problem.num_bodies() < 100 ? 100 : 1;  // of what is too short to time
  for (auto _ : state) {
    one.Turn(b, lower, repeats);
    two.Turn(b, lower, repeats);
#ifdef ISLET_HAVE_CHOLMOD
    cholmod.Turn(b, repeats);
    as_it_comes.Turn(b, repeats);
#endif
    state.SetIterationTime(times_one.factorise.back());
  }
  if (!(one.x().array() == two.x().array()).all()) state.SkipWithError("one and two threads differ");
  const double flops = one.cholesky().Flops();
  const auto report = [&](const std::string& name, const Times& times) {
    state.counters[name + "_ms"] = 1e3 * Least(times.factorise);
    state.counters[name + "_solve_ms"] = 1e3 * Least(times.solve);
    state.counters[name + "_analyse_ms"] = 1e3 * times.analyse;
    state.counters[name + "_residual"] = times.residual;
  };
  state.counters["bodies"] = problem.num_bodies();
  state.counters["contacts"] = problem.num_contacts();
  state.counters["gflop"] = 1e-9 * flops;
  report("one", times_one);
  report("two", times_two);
  state.counters["one_GF/s"] = 1e-9 * flops / Least(times_one.factorise);
  state.counters["two_GF/s"] = 1e-9 * flops / Least(times_two.factorise);
  state.counters["one/two"] = Least(times_one.factorise) / Least(times_two.factorise);
  state.counters["solve_one/two"] = Least(times_one.solve) / Least(times_two.solve);
  if (times_cholmod.factorise.empty()) return;
  report("cholmod", times_cholmod);
  state.counters["cholmod_gflop"] = 1e-9 * times_cholmod.flops;
  state.counters["as_it_comes_ms"] = 1e3 * Least(times_as_it_comes.factorise);
  state.counters["cholmod/one"] = Least(times_cholmod.factorise) / Least(times_one.factorise);
  state.counters["cholmod/two"] = Least(times_cholmod.factorise) / Least(times_two.factorise);
  state.counters["as_it_comes/one"] = Least(times_as_it_comes.factorise) / Least(times_one.factorise);
  state.counters["as_it_comes/two"] = Least(times_as_it_comes.factorise) / Least(times_two.factorise);
}

void RegisterAll() {
  const auto add = [](const std::string& name, const std::function<Problem()>& make, int turns) {
    benchmark::RegisterBenchmark(name.c_str(), Factorisation, make)
        ->Iterations(turns)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  for (const auto& file : MeasuredFrames())
    add(
        file.stem().string(), [file] { return ReadLargestIsland(file).problem; }, 41);
  constexpr std::array<std::array<int, 3>, 7> kPiles{
      {{2, 1, 1}, {2, 2, 1}, {5, 2, 1}, {3, 2, 2}, {4, 4, 3}, {6, 6, 6}, {10, 10, 10}}};
  for (const std::array<int, 3>& pile : kPiles) {
    add(
        "pile_" + std::to_string(pile[0] * pile[1] * pile[2]),
        [pile] { return MakeUnevenPile(pile[0], pile[1], pile[2]); }, 41);
  }
}

}  // namespace
}  // namespace islet::qp

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
#ifdef ISLET_HAVE_CHOLMOD
  benchmark::AddCustomContext("openblas", openblas_get_corename());
#else
  std::fprintf(stderr, "built without CHOLMOD and OpenBLAS: nothing to compare with\n");
#endif
  benchmark::AddCustomContext("kernels", islet::qp::ChosenKernels());
  islet::qp::RegisterAll();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
