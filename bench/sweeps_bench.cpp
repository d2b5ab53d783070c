// Gauss-Seidel sweeps: what one costs on one and two threads, and how near to exact Coulomb friction how many bring an island.
//
//   ISLET_PROBLEMS=folder bench_sweeps          the largest islands of the measured frames in a folder, then piles of our own
//   bench_sweeps --benchmark_filter=pile        the piles alone
//
// What the columns mean and what was measured: bench/README.md, "Sweeps".
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numeric>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "parallel/worker_pool.h"
#include "qp/gauss_seidel.h"
#include "qp/island_solver.h"

namespace islet::qp {
namespace {

constexpr double kGravityStep = 9.81 / 30;  // [m/s] in a step of 1/30 s
constexpr int kTurns = 15;                  // the best of these counts
constexpr int kSweepsPerTurn = 100;
constexpr int kMarks[] = {10, 30, 100, 300, 1000};

struct Island {
  Problem problem;
  double scale = kGravityStep;  // [m/s] v_ref
};

ContactTerm MakeContact(int a, int b, const Vector3& from_a, const Vector3& from_b, const Vector3& normal, double mu) {
  ContactTerm contact{.body_a = a, .body_b = b, .friction = mu};
  Matrix3 frame;
  frame.row(0) = normal.normalized();
  frame.row(1) = normal.unitOrthogonal();
  frame.row(2) = normal.normalized().cross(normal.unitOrthogonal());
  const auto jacobian = [&](double sign, const Vector3& arm) {
    Matrix3 cross;
    cross << 0, -arm[2], arm[1], arm[2], 0, -arm[0], -arm[1], arm[0], 0;
    Jacobian j;
    j << sign * frame, -sign * frame * cross;
    return j;
  };
  if (a >= 0) contact.jacobian_a = jacobian(-1, from_a);
  if (b >= 0) contact.jacobian_b = jacobian(1, from_b);
  return contact;
}

// Cubes of edge 1 and mass 1 in a jittered lattice on a floor between walls, one step under gravity.
Island MakePile(int nx, int ny, int nz) {
  std::mt19937 engine(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
  };
  const auto jitter = [&] { return Vector3(uniform(-0.2, 0.2), uniform(-0.2, 0.2), uniform(-0.2, 0.2)); };
  Island pile;
  std::vector<Vector3> at;
  for (int i = 0; i < nx * ny * nz; ++i) {
    at.push_back(Vector3(i % nx, i / nx % ny, i / nx / ny) + jitter());
    BodyTerm body;
    body.inertia = Matrix3::Identity() / 6;
    body.inverse_inertia = Matrix3::Identity() * 6;
    body.velocity[2] = -kGravityStep;
    pile.problem.bodies.push_back(body);
  }
  const auto touch = [&](int a, int b, const Vector3& normal) {
    for (int c = 0; c < 3; ++c) {
      const Vector3 point = at[b] - 0.5 * normal + jitter();
      pile.problem.contacts.push_back(
          MakeContact(a, b, a < 0 ? Vector3(0, 0, 0) : Vector3(point - at[a]), point - at[b], normal, 0.4));
    }
  };
  for (int b = 0; b < nx * ny * nz; ++b) {
    if (b / nx / ny == 0) touch(-1, b, {0, 0, 1});
    if (b % nx == 0) touch(-1, b, {1, 0, 0});
    if (b % nx == nx - 1) touch(-1, b, {-1, 0, 0});
    if (b / nx % ny == 0) touch(-1, b, {0, 1, 0});
    if (b / nx % ny == ny - 1) touch(-1, b, {0, -1, 0});
    for (int a = 0; a < b; ++a) {
      const Vector3 gap = at[b] - at[a];
      if (gap.norm() < 1.2) touch(a, b, gap.normalized());
    }
  }
  return pile;
}

struct Frame {
  std::vector<BodyTerm> bodies;
  std::vector<Vector3> at;
  std::vector<ContactTerm> contacts;
};

// Text: "gravity x y z"; "bodies n" and n lines; "contacts m" and m lines. Gravity of 1/30 s is added to the velocities.
Frame ReadFrame(const std::filesystem::path& path) {
  std::ifstream file(path);
  Frame frame;
  Vector3 gravity(0, 0, 0);
  for (std::string line, word; std::getline(file, line);) {
    std::istringstream header(line);
    int count = 0;
    header >> word;
    if (word == "gravity") header >> gravity[0] >> gravity[1] >> gravity[2];
    if (word == "bodies" || word == "contacts") header >> count;
    for (int i = 0; i < count && std::getline(file, line); ++i) {
      std::istringstream in(line);
      if (word == "bodies") {
        int id;
        Vector3 inertia, position;
        Eigen::Quaterniond turn;
        BodyTerm body;
        in >> id >> body.mass >> inertia[0] >> inertia[1] >> inertia[2] >> position[0] >> position[1] >> position[2] >>
            turn.w() >> turn.x() >> turn.y() >> turn.z();
        for (double& v : body.velocity) in >> v;
        const Matrix3 rotation = turn.normalized().toRotationMatrix();
        body.inertia = rotation * inertia.asDiagonal() * rotation.transpose();
        body.inverse_inertia = rotation * inertia.cwiseInverse().asDiagonal() * rotation.transpose();
        body.velocity.head<3>() += gravity / 30;
        frame.bodies.push_back(body);
        frame.at.push_back(position);
        continue;
      }
      int a = -1, b = -1;
      double depth, mu = 0;
      Vector3 point, normal;
      in >> a >> b >> point[0] >> point[1] >> point[2] >> normal[0] >> normal[1] >> normal[2] >> depth >> mu;
      const int known = static_cast<int>(frame.at.size());
      if (a < 0 || a >= known || b >= known) throw std::runtime_error(path.string() + ": contact of an unknown body");
      const Vector3 from_b = b < 0 ? Vector3(0, 0, 0) : Vector3(point - frame.at[b]);
      frame.contacts.push_back(MakeContact(a, b, point - frame.at[a], from_b, normal, mu));
    }
  }
  return frame;
}

// The static-contact problem of the island with the most bodies.
Island ReadLargestIsland(const std::filesystem::path& path) {
  const Frame frame = ReadFrame(path);
  Island island;
  std::vector<int> root(frame.bodies.size()), size(frame.bodies.size()), id(frame.bodies.size(), -1);
  std::iota(root.begin(), root.end(), 0);
  const std::function<int(int)> find = [&](int i) { return root[i] == i ? i : root[i] = find(root[i]); };
  for (const ContactTerm& c : frame.contacts)
    if (c.body_b >= 0) root[find(c.body_a)] = find(c.body_b);
  for (size_t i = 0; i < root.size(); ++i) ++size[find(static_cast<int>(i))];
  const int largest = static_cast<int>(std::max_element(size.begin(), size.end()) - size.begin());
  for (size_t i = 0; i < root.size(); ++i) {
    if (find(static_cast<int>(i)) != largest) continue;
    id[i] = island.problem.num_bodies();
    island.problem.bodies.push_back(frame.bodies[i]);
  }
  std::vector<double> velocities;
  for (const BodyTerm& body : island.problem.bodies)
    velocities.insert(velocities.end(), body.velocity.begin(), body.velocity.end());
  for (ContactTerm c : frame.contacts) {
    if (find(c.body_a) != largest) continue;
    c.body_a = id[c.body_a];
    if (c.body_b >= 0) c.body_b = id[c.body_b];
    island.scale = std::max(island.scale, -ContactVelocity(c, velocities.data())[0]);
    island.problem.contacts.push_back(c);
  }
  return island;
}

struct Start {
  std::vector<Vector3> impulses;
  std::vector<double> velocities;
};

Start ColdStart(const Problem& problem) {
  Start start{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), {}};
  for (const BodyTerm& body : problem.bodies)
    start.velocities.insert(start.velocities.end(), body.velocity.begin(), body.velocity.end());
  return start;
}

Start ConvexAnswer(const Island& island) {
  Settings settings;
  settings.model = Model::kConvex;
  settings.velocity_scale = island.scale;
  IslandSolver solver;
  Solution solution;
  solver.Solve(island.problem, settings, &solution);
  return {solution.impulses, solution.velocities};
}

double Seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// [s] the best turn of Prepare and of a sweep.
struct Times {
  double prepare = INFINITY, sweep = INFINITY;
};

void TimeOnce(const Problem& problem, parallel::WorkerPool* pool, GaussSeidel* solver, Times* times) {
  Start start = ColdStart(problem);
  pool->ForEach(1, [&](int, int) {
    const double begin = Seconds();
    solver->Prepare(problem);
    const double middle = Seconds();
    solver->Sweep(problem, kSweepsPerTurn, 0, &start.impulses, &start.velocities);
    times->prepare = std::min(times->prepare, middle - begin);
    times->sweep = std::min(times->sweep, (Seconds() - middle) / kSweepsPerTurn);
  });
}

void Cost(benchmark::State& state, const std::function<Island()>& make) {
  const Island island = make();
  parallel::WorkerPool one(1), two(2);
  GaussSeidel solver_one, solver_two;
  Times times_one, times_two;
  for (auto _ : state) {  // in turns: both see the same machine
    TimeOnce(island.problem, &one, &solver_one, &times_one);
    TimeOnce(island.problem, &two, &solver_two, &times_two);
  }
  state.counters["contacts"] = island.problem.num_contacts();
  state.counters["bodies"] = island.problem.num_bodies();
  state.counters["one_ms"] = 1e3 * times_one.sweep;
  state.counters["two_ms"] = 1e3 * times_two.sweep;
  state.counters["one/two"] = times_one.sweep / times_two.sweep;
  state.counters["one_ns/contact"] = 1e9 * times_one.sweep / island.problem.num_contacts();
  state.counters["one_prepare_ms"] = 1e3 * times_one.prepare;
  state.counters["two_prepare_ms"] = 1e3 * times_two.prepare;
}

void Accuracy(benchmark::State& state, const std::function<Island()>& make, bool warm, Pace pace) {
  const Island island = make();
  const Problem& problem = island.problem;
  const Start start = warm ? ConvexAnswer(island) : ColdStart(problem);
  GaussSeidel solver;
  solver.Prepare(problem);
  for (auto _ : state) {
    state.counters["0"] = CoulombMap(problem, start.velocities, start.impulses).rms / island.scale;
    for (int sweeps : kMarks) {
      Start end = start;
      solver.Sweep(problem, sweeps, 0, &end.impulses, &end.velocities, pace);
      state.counters[std::to_string(sweeps)] = CoulombMap(problem, end.velocities, end.impulses).rms / island.scale;
    }
  }
}

void RegisterAll() {
  const auto add = [](const std::string& name, const std::function<Island()>& make) {
    benchmark::RegisterBenchmark((name + "/cost").c_str(), Cost, make)
        ->Iterations(kTurns)
        ->Unit(benchmark::kMillisecond);
    for (const bool warm : {false, true}) {
      for (const Pace pace : {Pace::kPlain, Pace::kMomentum}) {
        const std::string row = name + (warm ? "/warm" : "/cold") + (pace == Pace::kPlain ? "/plain" : "/momentum");
        benchmark::RegisterBenchmark(row.c_str(), Accuracy, make, warm, pace)
            ->Iterations(1)
            ->Unit(benchmark::kMillisecond);
      }
    }
  };
  std::vector<std::filesystem::path> files;
  if (const char* folder = std::getenv("ISLET_PROBLEMS")) {
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".txt") files.push_back(entry.path());
  } else {
    std::fprintf(stderr, "ISLET_PROBLEMS is not set: no measured frames\n");
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files) add(file.stem().string(), [file] { return ReadLargestIsland(file); });
  for (const int edge : {2, 5, 10}) {
    add("pile_" + std::to_string(edge * edge * edge), [edge] { return MakePile(edge, edge, edge); });
  }
}

}  // namespace
}  // namespace islet::qp

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::AddCustomContext("kernels", islet::qp::BestSweepKernels().name);
  islet::qp::RegisterAll();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
