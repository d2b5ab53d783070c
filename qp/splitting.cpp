#include "qp/splitting.h"

#include <algorithm>
#include <cmath>

#include "parallel/fork.h"

namespace islet::qp {
namespace {

constexpr double kUniformWeight = 10;  // times the contact's own inertia: most contacts of a pile stick
constexpr double kRelaxation = 1.7;    // share of the new velocity in what the contacts see; converges below 2
constexpr double kLeastWeight = 1e-2;  // times the contact's own inertia
constexpr double kMostWeight = 1e3;
constexpr int kContactsPerPiece = 512;
constexpr int kBodiesPerPiece = 128;

double TangentSize(const Vector3& x) { return std::sqrt(x[1] * x[1] + x[2] * x[2]); }

// f(first, last) over fixed ranges of 0 .. count-1.
template <typename Function>
void ForRanges(int count, int size, const Function& f) {
  parallel::Fork((count + size - 1) / size, [&](int piece) { f(piece * size, std::min(count, (piece + 1) * size)); });
}

}  // namespace

void Splitting::Start(const Problem& problem, KktSystem* kkt) {
  problem_ = &problem;
  kkt_ = kkt;
  kkt->Prepare(problem, 1);
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  inertia_.resize(nc);
  for (int c = 0; c < nc; ++c) inertia_[c] = 3 / DelassusBlock(problem, problem.contacts[c]).trace();
  weights_.resize(nc);
  blocks_.resize(nc);
  velocities_.resize(nc);
  pulls_.resize(nc);
  bodies_.resize(static_cast<size_t>(6) * nb);
  place_start_.assign(nb + 1, 0);
  for (const ContactTerm& c : problem.contacts)
    for (const int body : {c.body_a, c.body_b}) place_start_[body + 1] += body >= 0;
  for (int i = 0; i < nb; ++i) place_start_[i + 1] += place_start_[i];
  places_.resize(place_start_[nb]);
  for (int c = nc - 1; c >= 0; --c) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) places_[--place_start_[contact.body_a + 1]] = {c, true};
    if (contact.body_b >= 0) places_[--place_start_[contact.body_b + 1]] = {c, false};
  }
  place_start_.erase(place_start_.begin());
  place_start_.push_back(static_cast<int>(places_.size()));
}

void Splitting::Run(int iterations, Metric metric, double doubt, std::vector<Vector3>* impulses,
                    std::vector<double>* velocities) {
  const Problem& problem = *problem_;
  for (int c = 0; c < problem.num_contacts(); ++c)
    velocities_[c] = ContactVelocity(problem.contacts[c], velocities->data());
  ChooseMetric(metric, doubt, *impulses);
  kkt_->Factorise(problem, blocks_, no_bounces_);
  for (int i = 0; i < iterations; ++i) {
    SolveBodies(*impulses);
    SolveContacts(impulses);
  }
  for (int i = 0; i < problem.num_bodies(); ++i)
    Eigen::Map<Vector6>(velocities->data() + 6 * i) = problem.bodies[i].velocity;
  for (int c = 0; c < problem.num_contacts(); ++c)
    ApplyImpulse(problem, problem.contacts[c], (*impulses)[c], velocities->data());
}

// j over w, both softened by the doubt: the weights of a contact of which nothing is known are its own inertia.
void Splitting::ChooseMetric(Metric metric, double doubt, const std::vector<Vector3>& impulses) {
  for (int c = 0; c < problem_->num_contacts(); ++c) {
    const ContactTerm& contact = problem_->contacts[c];
    const double soft_impulse = doubt * inertia_[c];
    double normal = kUniformWeight * inertia_[c], tangent = normal;
    if (metric == Metric::kAdapted) {
      const Vector3 &j = impulses[c], &w = velocities_[c];
      normal = (std::max(0.0, j[0]) + soft_impulse) / (std::max(0.0, w[0] - contact.target) + doubt);
      tangent = (TangentSize(j) + soft_impulse) / (TangentSize(w) + doubt);
    }
    const double least = kLeastWeight * inertia_[c], most = kMostWeight * inertia_[c];
    weights_[c] = {std::clamp(normal, least, most), contact.friction > 0 ? std::clamp(tangent, least, most) : 0};
    blocks_[c] = Vector3(weights_[c].normal, weights_[c].tangent, weights_[c].tangent).asDiagonal();
  }
}

void Splitting::SolveBodies(const std::vector<Vector3>& impulses) {
  const Problem& problem = *problem_;
  ForRanges(problem.num_contacts(), kContactsPerPiece, [&](int first, int last) {
    for (int c = first; c < last; ++c) {
      const Vector3 w = velocities_[c] - problem.contacts[c].drift;
      const Weight& d = weights_[c];
      pulls_[c] = impulses[c] + Vector3(d.normal * w[0], d.tangent * w[1], d.tangent * w[2]);
    }
  });
  ForRanges(problem.num_bodies(), kBodiesPerPiece, [&](int first, int last) {
    for (int i = first; i < last; ++i) {
      const BodyTerm& body = problem.bodies[i];
      Vector6 sum;
      sum.head<3>() = body.mass * body.velocity.head<3>();
      sum.tail<3>().noalias() = body.inertia * body.velocity.tail<3>();
      for (int p = place_start_[i]; p < place_start_[i + 1]; ++p) {
        const ContactTerm& contact = problem.contacts[places_[p].contact];
        const Jacobian& jacobian = places_[p].is_a ? contact.jacobian_a : contact.jacobian_b;
        sum.noalias() += jacobian.transpose() * pulls_[places_[p].contact];
      }
      Eigen::Map<Vector6>(bodies_.data() + 6 * i) = sum;
    }
  });
  kkt_->Solve(bodies_.data());
}

// The law for u_hat = q + (D^-1 + compliance) j with q = u - D^-1 j_before, over-relaxed: normal and tangents decouple.
void Splitting::SolveContacts(std::vector<Vector3>* impulses) {
  ForRanges(problem_->num_contacts(), kContactsPerPiece, [&](int first, int last) {
    for (int c = first; c < last; ++c) {
      const ContactTerm& contact = problem_->contacts[c];
      Vector3& w = velocities_[c];
      Vector3& j = (*impulses)[c];
      const double soft_n = 1 / weights_[c].normal, soft_t = contact.friction > 0 ? 1 / weights_[c].tangent : 0;
      Vector3 q = kRelaxation * ContactVelocity(contact, bodies_.data()) + (1 - kRelaxation) * w;
      q -= Vector3(soft_n * j[0], soft_t * j[1], soft_t * j[2]);
      j.setZero();
      j[0] = std::max(0.0, (contact.target - q[0]) / (soft_n + contact.compliance));
      if (j[0] > 0 && contact.friction > 0) {
        const double stop = TangentSize(q) / (soft_t + contact.compliance), limit = contact.friction * j[0];
        const double share = (stop <= limit ? 1 : limit / stop) / (soft_t + contact.compliance);
        j[1] = -share * q[1];
        j[2] = -share * q[2];
      }
      w = q + Vector3(soft_n * j[0], soft_t * j[1], soft_t * j[2]);
    }
  });
}

}  // namespace islet::qp
