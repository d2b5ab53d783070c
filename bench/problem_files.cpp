#include "bench/problem_files.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <numeric>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

namespace islet::qp {
namespace {

constexpr double kPileFriction = 0.4;
constexpr double kJitter = 0.2;  // [m]
constexpr double kReach = 1.2;   // [m] centres nearer than this touch
constexpr double kPush = 0.3;    // [m/s] sideways, of a tower's cubes

class Jitter {
 public:
  explicit Jitter(unsigned seed) : engine_(seed) {}
  double Number(double size) { return size * (2 * static_cast<double>(engine_()) / 4294967296.0 - 1); }
  Vector3 Vector(double size) {
    const double x = Number(size), y = Number(size), z = Number(size);
    return {x, y, z};
  }

 private:
  std::mt19937 engine_;
};

BodyTerm MakeCube() {
  BodyTerm body;
  body.inertia = Matrix3::Identity() / 6;
  body.inverse_inertia = Matrix3::Identity() * 6;
  body.velocity[2] = -kGravityStep;
  return body;
}

struct Frame {
  std::vector<BodyTerm> bodies;
  std::vector<Vector3> at;
  std::vector<ContactTerm> contacts;
};

void ReadVector(std::istream& in, Vector3* vector) { in >> (*vector)[0] >> (*vector)[1] >> (*vector)[2]; }

void ReadBody(std::istream& in, Frame* frame) {
  int id;
  Vector3 inertia, position;
  Eigen::Quaterniond turn;
  BodyTerm body;
  in >> id >> body.mass;
  ReadVector(in, &inertia), ReadVector(in, &position);
  in >> turn.w() >> turn.x() >> turn.y() >> turn.z();
  for (double& v : body.velocity) in >> v;
  const Matrix3 rotation = turn.normalized().toRotationMatrix();
  body.inertia = rotation * inertia.asDiagonal() * rotation.transpose();
  body.inverse_inertia = rotation * inertia.cwiseInverse().asDiagonal() * rotation.transpose();
  frame->bodies.push_back(body);
  frame->at.push_back(position);
}

void ReadContact(std::istream& in, Frame* frame) {
  int a = -1, b = -1;
  double depth = 0, mu = 0, restitution = 0;
  Vector3 point, normal;
  in >> a >> b;
  ReadVector(in, &point), ReadVector(in, &normal);
  in >> depth >> mu >> restitution;
  const int known = static_cast<int>(frame->at.size());
  if (a < 0 || a >= known || b >= known) throw std::runtime_error("contact of an unknown body");
  const Vector3 from_b = b < 0 ? Vector3(0, 0, 0) : Vector3(point - frame->at[b]);
  frame->contacts.push_back(MakeContact(a, b, point - frame->at[a], from_b, normal, mu));
}

Frame ReadFrame(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path.string() + ": cannot be read");
  Frame frame;
  Vector3 gravity(0, 0, 0);
  for (std::string line, word; std::getline(file, line); word.clear()) {
    std::istringstream header(line);
    int count = 0;
    header >> word;
    if (word == "gravity") ReadVector(header, &gravity);
    if (word == "bodies" || word == "contacts") header >> count;
    for (int i = 0; i < count; ++i) {
      if (!std::getline(file, line)) throw std::runtime_error(path.string() + ": ends within its " + word);
      std::istringstream in(line);
      word == "bodies" ? ReadBody(in, &frame) : ReadContact(in, &frame);
      if (!in) throw std::runtime_error(path.string() + ": not a line of " + word + ": " + line);
    }
  }
  for (BodyTerm& body : frame.bodies) body.velocity.head<3>() += gravity / 30;
  return frame;
}

// Per body, the number of its island's representative.
std::vector<int> FindIslands(const Frame& frame) {
  std::vector<int> root(frame.bodies.size());
  std::iota(root.begin(), root.end(), 0);
  const std::function<int(int)> find = [&](int i) { return root[i] == i ? i : root[i] = find(root[i]); };
  for (const ContactTerm& c : frame.contacts)
    if (c.body_b >= 0) root[find(c.body_a)] = find(c.body_b);
  for (size_t i = 0; i < root.size(); ++i) root[i] = find(static_cast<int>(i));
  return root;
}

}  // namespace

std::vector<std::filesystem::path> MeasuredFrames() {
  std::vector<std::filesystem::path> files;
  if (const char* folder = std::getenv("ISLET_PROBLEMS")) {
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".txt") files.push_back(entry.path());
  } else {
    std::fprintf(stderr, "ISLET_PROBLEMS is not set: no measured frames\n");
  }
  std::sort(files.begin(), files.end());
  return files;
}

Island ReadLargestIsland(const std::filesystem::path& path) {
  const Frame frame = ReadFrame(path);
  const std::vector<int> root = FindIslands(frame);
  std::vector<int> size(root.size()), id(root.size(), -1);
  for (const int r : root) ++size[r];
  const int largest = static_cast<int>(std::max_element(size.begin(), size.end()) - size.begin());
  Island island;
  std::vector<double> velocities;
  for (size_t i = 0; i < root.size(); ++i) {
    if (root[i] != largest) continue;
    id[i] = island.problem.num_bodies();
    island.problem.bodies.push_back(frame.bodies[i]);
    for (const double v : frame.bodies[i].velocity) velocities.push_back(v);
  }
  for (size_t k = 0; k < frame.contacts.size(); ++k) {
    ContactTerm contact = frame.contacts[k];
    if (root[contact.body_a] != largest) continue;
    contact.body_a = id[contact.body_a];
    if (contact.body_b >= 0) contact.body_b = id[contact.body_b];
    const double approach = std::max(0.0, -ContactVelocity(contact, velocities.data())[0]);
    island.scale = std::max(island.scale, approach);
    island.problem.contacts.push_back(contact);
  }
  return island;
}

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

Island MakePile(int nx, int ny, int nz, unsigned seed) {
  Jitter jitter(seed);
  Island pile;
  std::vector<Vector3> at;
  for (int i = 0; i < nx * ny * nz; ++i) {
    at.push_back(Vector3(i % nx, i / nx % ny, i / nx / ny) + jitter.Vector(kJitter));
    pile.problem.bodies.push_back(MakeCube());
  }
  const auto touch = [&](int a, int b, const Vector3& normal) {
    for (int c = 0; c < 3; ++c) {
      const Vector3 point = at[b] - 0.5 * normal + jitter.Vector(kJitter);
      const Vector3 from_a = a < 0 ? Vector3(0, 0, 0) : Vector3(point - at[a]);
      pile.problem.contacts.push_back(MakeContact(a, b, from_a, point - at[b], normal, kPileFriction));
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
      if (gap.norm() < kReach) touch(a, b, gap.normalized());
    }
  }
  return pile;
}

Island MakeTower(int cubes, unsigned seed) {
  Jitter jitter(seed);
  Island tower;
  for (int b = 0; b < cubes; ++b) {
    tower.problem.bodies.push_back(MakeCube());
    tower.problem.bodies[b].velocity[0] = jitter.Number(kPush);
    tower.problem.bodies[b].velocity[1] = jitter.Number(kPush);
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5})
        tower.problem.contacts.push_back(
            MakeContact(b - 1, b, {x, y, 0.5}, {x, y, -0.5}, Vector3::UnitZ(), kPileFriction));
  }
  return tower;
}

}  // namespace islet::qp
