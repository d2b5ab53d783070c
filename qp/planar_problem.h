// An island that is symmetric about a plane, as a problem in that plane: two translations and one rotation a body, and contacts
// that lie behind each other made one.
//
//   taken if    a direction e (normal to the plane) is found such that all free velocities, contact normals and drifts lie in the
//               plane and every inertia has the axis e; and contacts that look the same along e (lever arms, friction, target;
//               mostly a mirrored pair, or one alone in the plane) can share an impulse such that nothing tilts out of the
//               plane. All to kPlanarTolerance: of v_ref, and of a body's radius of gyration
//   exact       all contacts of a group have the same velocity, so the law holds at each of them, for its share, if it holds for
//               the group. The convex models have one answer, so this is it
//
// The problem in the plane is an ordinary one with axes (x, y in the plane, z = e): its Jacobians act on components 0, 1 and 5
// alone and have nothing in their third row, which planar_system.h makes use of.
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <array>
#include <span>
#include <vector>

#include "qp/problem.h"
#include "qp/solution.h"

namespace islet::qp {

inline constexpr double kPlanarTolerance = 1e-9;

// What a contact in the plane stands for in space.
struct PlanarWeight {
  int size = 0;         // contacts
  double response = 0;  // W_nn of one of them
};

class PlanarProblem {
 public:
  // False if the problem is not symmetric about a plane; a crowd of bodies is refused at the first few that are not.
  bool Reduce(const Problem& problem, double velocity_scale);

  const Problem& problem() const { return reduced_; }
  Vector3 normal() const { return axes_.col(2); }  // e, of the plane

  std::span<const PlanarWeight> weights() const { return weights_; }  // one per contact

  // From the contacts of the whole problem to those of the plane.
  void MergeImpulses(std::span<const Vector3> whole, std::vector<Vector3>* merged) const;
  void MergeScales(std::span<const double> whole, std::vector<double>* merged) const;  // of the natural map

  // The answer of the whole problem from that of the plane: impulses, slips, and velocities that follow from the impulses.
  // Returns how far these are from the ones in the plane [velocity, at a radius of gyration]: a rounding error times the
  // impulses if all is well.
  double Expand(const Problem& whole, const Solution& planar, Solution* solution) const;

 private:
  // A contact's part in the plane.
  struct Member {
    int group = -1;
    double along[2] = {0, 0};        // its tangents' components in the plane
    double height = 0;               // over the plane, in radii of gyration of one of its bodies
    double share = 0;                // of the group's impulse
    std::array<double, 8> levers{};  // by which it would tilt its bodies: sides, rows n and t, two axes
  };
  // Contacts that look the same along e.
  struct Group {
    double above = 0, below = 0;  // sums of heights
    double total = 0;             // of the shares, before they are made to add up to one
    std::array<double, 8> levers{};
  };

  bool ReduceAbout(const Vector3& e, const Problem& problem);
  bool ReduceBodies(const Problem& problem);
  bool Look(const ContactTerm& contact, ContactTerm* flat, Member* member) const;
  bool LooksLike(const ContactTerm& a, const ContactTerm& b) const;
  bool Balance(int first_group, size_t begin, size_t end);
  double Radius(int body) const { return body < 0 ? 1.0 : radii_[body]; }

  double scale_ = 1;  // v_ref
  Matrix3 axes_;      // columns: x, y in the plane, e
  Problem reduced_;
  std::vector<double> radii_;  // of gyration, per body
  std::vector<Member> members_;
  std::vector<Group> groups_;
  std::vector<PlanarWeight> weights_;
  std::vector<int> order_;  // contacts, by pair of bodies
};

}  // namespace islet::qp
