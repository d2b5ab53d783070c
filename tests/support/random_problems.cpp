#include "tests/support/random_problems.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace islet::testing {
namespace {

constexpr double kStepOfGravity = 9.81 / 60;  // [m/s]

double MassFrom(Random* random, double ratio) { return std::pow(ratio, random->Uniform(0, 1)); }

Vector6 RandomVelocity(Random* random, double size) {
  Vector6 v;
  v << random->Vector(size), random->Vector(size);
  v[2] -= kStepOfGravity;
  return v;
}

Vector6 MassTimes(const qp::BodyTerm& body, const Vector6& v) {
  Vector6 out;
  out << body.mass * v.head<3>(), body.inertia * v.tail<3>();
  return out;
}

Vector6 VelocityOf(const std::vector<double>& velocities, int body) {
  return Eigen::Map<const Vector6>(velocities.data() + 6 * body);
}

}  // namespace

Vector3 Random::Vector(double size) {
  const double x = Uniform(-size, size), y = Uniform(-size, size), z = Uniform(-size, size);
  return {x, y, z};
}

Vector3 Random::Direction() {
  Vector3 v = Vector(1);
  while (v.norm() > 1 || v.norm() < 0.1) v = Vector(1);
  return v.normalized();
}

Matrix3 Random::Rotation() {
  const Vector3 axis = Direction();
  return Eigen::AngleAxisd(Uniform(0, 3), axis).toRotationMatrix();
}

Matrix3 Random::PositiveDefinite(double smallest, double largest) {
  const Matrix3 r = Rotation();
  const double a = Uniform(smallest, largest), b = Uniform(smallest, largest), c = Uniform(smallest, largest);
  const Matrix3 m = r * Vector3(a, b, c).asDiagonal() * r.transpose();
  return 0.5 * (m + m.transpose());
}

void MakeTangents(const Vector3& normal, Vector3* t1, Vector3* t2) {
  *t1 = normal.unitOrthogonal();
  *t2 = normal.cross(*t1);
}

int ProblemBuilder::AddBody(const Vector3& position, double mass, const Matrix3& inertia, const Vector6& velocity) {
  problem.bodies.push_back({mass, inertia, inertia.inverse(), velocity});
  positions.push_back(position);
  return problem.num_bodies() - 1;
}

int ProblemBuilder::AddBox(const Vector3& position, const Vector3& half, double mass, const Vector3& velocity) {
  const Vector3 q = half.cwiseAbs2();
  const Vector3 moments(q[1] + q[2], q[0] + q[2], q[0] + q[1]);
  Vector6 v;
  v << velocity, Vector3::Zero();
  return AddBody(position, mass, Matrix3((mass / 3 * moments).asDiagonal()), v);
}

int ProblemBuilder::AddContact(int a, int b, const Vector3& point, const Vector3& normal, double friction) {
  ContactTerm contact;
  contact.body_a = a;
  contact.body_b = b;
  contact.friction = friction;
  Vector3 t1, t2;
  MakeTangents(normal, &t1, &t2);
  const auto jacobian = [&](int body, double sign) {
    qp::Jacobian j;
    const Vector3 lever = point - positions[body];
    const Vector3 axes[3] = {normal, t1, t2};
    for (int i = 0; i < 3; ++i) j.row(i) << axes[i].transpose(), lever.cross(axes[i]).transpose();
    return qp::Jacobian(sign * j);
  };
  if (a >= 0) contact.jacobian_a = jacobian(a, -1);
  if (b >= 0) contact.jacobian_b = jacobian(b, 1);
  problem.contacts.push_back(contact);
  return problem.num_contacts() - 1;
}

void ProblemBuilder::AddFace(int below, int above, const Vector3& centre, double x, double y, double friction) {
  for (int corner = 0; corner < 4; ++corner) {
    const Vector3 at = centre + Vector3(corner & 1 ? x : -x, corner & 2 ? y : -y, 0);
    AddContact(below, above, at, Vector3::UnitZ(), friction);
  }
}

Problem RandomChain(Random* random, int bodies, double friction_low, double friction_high, double mass_ratio) {
  ProblemBuilder builder;
  for (int i = 0; i < bodies; ++i) {
    const double mass = MassFrom(random, mass_ratio);
    const Vector3 shift = random->Vector(0.3);
    const Vector3 position =
        (i == 0 ? Vector3(0, 0, 0.5) : Vector3(builder.positions.back() + Vector3(0.5, 0, 0.8))) + shift;
    builder.AddBody(position, mass, mass * random->PositiveDefinite(0.05, 0.3), RandomVelocity(random, 1));
    const Vector3 below = i == 0 ? Vector3(position - Vector3(0, 0, 1)) : builder.positions[i - 1];
    const Vector3 normal = i == 0 ? Vector3::UnitZ() : (position - below).normalized();
    const Vector3 jitter = random->Vector(0.1);
    builder.AddContact(i - 1, i, 0.5 * (position + below) + jitter, normal,
                       random->Uniform(friction_low, friction_high));
  }
  return builder.problem;
}

Problem RandomCluster(Random* random, int bodies, double friction_low, double friction_high, double mass_ratio) {
  ProblemBuilder builder;
  const double size = std::cbrt(bodies) * 0.6;
  for (int i = 0; i < bodies; ++i) {
    const double mass = MassFrom(random, mass_ratio);
    Vector3 position = random->Vector(size);
    position[2] = 0.3 + std::abs(position[2]);
    builder.AddBody(position, mass, mass * random->PositiveDefinite(0.05, 0.3), RandomVelocity(random, 1));
    if (position[2] < 0.7 || i == 0) {
      const Vector3 jitter = random->Vector(0.2);
      const Vector3 point(position[0] + jitter[0], position[1] + jitter[1], 0);
      builder.AddContact(-1, i, point, Vector3::UnitZ(), random->Uniform(friction_low, friction_high));
    }
    for (int k = 0; k < i; ++k) {
      const Vector3 between = position - builder.positions[k];
      if (between.norm() > 1.0) continue;
      const int points = random->Integer(1, 3);
      for (int p = 0; p < points; ++p) {
        const Vector3 jitter = random->Vector(0.15);
        builder.AddContact(k, i, builder.positions[k] + 0.5 * between + jitter, between.normalized(),
                           random->Uniform(friction_low, friction_high));
      }
    }
  }
  return builder.problem;
}

Problem RandomStack(Random* random, int boxes, double friction_low, double friction_high, double mass_ratio) {
  ProblemBuilder builder;
  for (int i = 0; i < boxes; ++i) {
    const double x = random->Uniform(-0.1, 0.1), y = random->Uniform(-0.1, 0.1);
    builder.AddBox({x, y, 0.5 + i}, {0.5, 0.5, 0.5}, MassFrom(random, mass_ratio));
    builder.problem.bodies[i].velocity = RandomVelocity(random, random->Integer(0, 1));
    builder.AddFace(i - 1, i, {x, y, 1.0 * i}, 0.5, 0.5, random->Uniform(friction_low, friction_high));
  }
  return builder.problem;
}

std::vector<NamedProblem> RandomIslands(std::uint32_t seed, int count, double largest_ratio, bool bounces) {
  std::vector<NamedProblem> islands;
  Random random(seed);
  for (int i = 0; i < count; ++i) {
    const double ratio = std::pow(largest_ratio, random.Uniform(0, 1));
    const double low = random.Integer(0, 3) == 0 ? 0.0 : random.Uniform(0, 1);
    const double high = low == 0 && random.Integer(0, 1) == 0 ? 0.0 : low + random.Uniform(0, 1);
    NamedProblem island;
    switch (i % 3) {
      case 0:
        island.problem = RandomChain(&random, random.Integer(1, 8), low, high, ratio);
        break;
      case 1:
        island.problem = RandomCluster(&random, random.Integer(1, 8), low, high, ratio);
        break;
      default:
        island.problem = RandomStack(&random, random.Integer(1, 5), low, high, ratio);
        break;
    }
    if (bounces) SetBounces(random.Uniform(0, 1), &island.problem);
    static constexpr const char* kNames[] = {"chain", "cluster", "stack"};
    island.name = std::string(kNames[i % 3]) + " " + std::to_string(i) + " of seed " + std::to_string(seed);
    islands.push_back(std::move(island));
  }
  return islands;
}

void SetBounces(double restitution, Problem* problem) {
  const std::vector<double> v = FreeVelocities(*problem);
  for (ContactTerm& contact : problem->contacts) {
    contact.target = restitution * std::max(0.0, -qp::ContactVelocity(contact, v.data())[0]);
  }
}

double KineticEnergy(const Problem& problem, const std::vector<double>& velocities) {
  double energy = 0;
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const Vector6 v = VelocityOf(velocities, i);
    energy += 0.5 * v.dot(MassTimes(problem.bodies[i], v));
  }
  return energy;
}

std::vector<double> FreeVelocities(const Problem& problem) {
  std::vector<double> v;
  for (const qp::BodyTerm& body : problem.bodies) v.insert(v.end(), body.velocity.begin(), body.velocity.end());
  return v;
}

double VelocityScale(const Problem& problem) {
  const std::vector<double> v = FreeVelocities(problem);
  double scale = kStepOfGravity;
  for (const ContactTerm& contact : problem.contacts)
    scale = std::max(scale, -qp::ContactVelocity(contact, v.data())[0]);
  return scale;
}

double MomentumResidual(const Problem& problem, const std::vector<double>& velocities,
                        const std::vector<Vector3>& impulses) {
  std::vector<Vector6> momentum;
  for (int i = 0; i < problem.num_bodies(); ++i)
    momentum.push_back(MassTimes(problem.bodies[i], VelocityOf(velocities, i) - problem.bodies[i].velocity));
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) momentum[contact.body_a] -= contact.jacobian_a.transpose() * impulses[c];
    if (contact.body_b >= 0) momentum[contact.body_b] -= contact.jacobian_b.transpose() * impulses[c];
  }
  Eigen::Matrix<double, 6, Eigen::Dynamic> residuals(6, problem.num_bodies());
  for (int i = 0; i < problem.num_bodies(); ++i)
    residuals.col(i) << momentum[i].head<3>() / problem.bodies[i].mass,
        problem.bodies[i].inverse_inertia * momentum[i].tail<3>();
  return residuals.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}

double VelocityDistance(const Problem& problem, const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, mass = 0;
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const Vector6 dv = VelocityOf(a, i) - VelocityOf(b, i);
    sum += dv.dot(MassTimes(problem.bodies[i], dv));
    mass += problem.bodies[i].mass;
  }
  return std::sqrt(sum / mass);
}

}  // namespace islet::testing
