// How far one step of an engine is from Coulomb's law, from poses and velocities alone. No impulse is asked of the engine:
// those that explain the step best are found here.
//
// Contacts c are found again at the poses before the step (contact_points.h). The contacts must have given the momentum
//   p = M (v_after - v_before) - M g dt        (angular momenta about the centres of mass, so that free flight has p = 0)
// and each impulse f_c must obey Signorini and Coulomb with the velocity u_c after the step: K* contains u^_c, f_c in K,
// f_c . u^_c = 0, with u^ = u + mu |u_t| n. The impulses that come closest to all of it minimise a convex function,
//   1/2 |J^T f - p|^2 in M^-1  +  s sum of f_c . u^+_c     over f_c in K,     u^+: with the negative part of u_n left out,
// by projected gradients with momentum. What is left is the error of a body b:
//   e_b^2 = ( |J^T f - p|^2_b in M^-1  +  its part of sum W_c |f_c - P_K(f_c - s u^_c / W_c)|^2  +  2 m_b (s d_b)^2 ) / (m_b (g dt)^2)
// The second is the natural map with W_c = a third of the trace of the contact's inverse mass; of a contact of two moving bodies
// each gets half. The third is motion that no velocity tells, such as a correction of overlap in the poses: d_b is how far the
// mean velocity (x_after - x_before) / dt of the centre is from every mixture of the velocities before and after the step (of a
// body over open gaps: also that of free fall), and the like of its rotation, weighted by the largest moment of inertia; twice,
// because a velocity that pushes bodies apart counts in both other parts.
// With s = dt / (1/60 s) errors of forces count in units of gravity and errors of velocities in units of g/60 s = 0.16 m/s,
// whatever dt is. The error of the step is the mean of min(1, e_b) over the bodies that are judged: 0 exact, 1 a world that takes
// no notice of contacts or gravity.
//
// Not judged: what flies free, and the two bodies of a collision, that is of a contact that closed at more than g/60 s before
// the step and overlaps by no more than one step and 5 mm can have made: what is right there is a matter of the law of impact,
// and laws differ. How many that are is told (`candidates`). Their neighbours are judged, though an engine that first solves
// impacts and then contacts obeys no law of one step there.
// Free of charge: approaching where there was a gap before the step; separating at up to restitution times the approach; force
// across a gap of up to 5 mm; motion below the rounding of a float; what a rule of first order makes of a fast rotation.
// Charged: whatever pushes overlapping bodies apart, by velocity or in the poses, and what our fit has not converged to.
//   in:  plan, states before and after one step of dt [s]    errors: std::invalid_argument without gravity (g is the unit)
//   threads: one meter a thread
#pragma once

#include <map>
#include <span>
#include <utility>
#include <vector>

#include "bench/charts/contact_points.h"
#include "bench/peers/peer.h"

namespace islet::charts {

struct CoulombError {
  double error = 0;                                        // as above
  double told = 0;                                         // the same with motion that no velocity tells left out
  double momentum = 0, natural_map = 0, displacement = 0;  // its parts, root mean squares, not cut off at 1
  int contacts = 0, iterations = 0;
  int judged = 0;      // bodies; 0: no error can be told
  int candidates = 0;  // bodies that touch, those that are not judged because of a collision included
};

class CoulombMeter {
 public:
  explicit CoulombMeter(const peers::WorldPlan& plan);

  CoulombError Measure(std::span<const peers::State> before, std::span<const peers::State> after, double dt);

 private:
  struct Twist {  // velocity, or impulse
    Vector3 linear = Vector3::Zero(), angular = Vector3::Zero();
  };
  struct Fitted {  // one contact
    int body_a = 0, body_b = 0;
    Vector3 arm_a = Vector3::Zero(), arm_b = Vector3::Zero();  // [m] from the centres of mass
    Vector3 normal = Vector3::Zero();                          // from a to b
    Vector3 slip = Vector3::Zero(), offer = Vector3::Zero();   // [m/s] s u^ and s u^+ after the step
    bool collides = false, closed = false;
    double response = 0;                                        // [1/kg] W_c
    double slope = 0;                                           // [1/kg] at least the curvature that its impulse sees
    Vector3 impulse = Vector3::Zero(), last = Vector3::Zero();  // [N s] on body b
    Vector3 ahead = Vector3::Zero();                            // [N s] where the gradient is taken
  };

  struct Remembered {
    Vector3 arm_b, impulse;  // [m], [N s]
  };

  void FindContacts(std::span<const peers::State> before, std::span<const peers::State> after, double dt);
  void MeasureMomentum(std::span<const peers::State> before, std::span<const peers::State> after, double dt);
  void SetSlopes();
  int Fit(double unit_energy);
  // [J] twice the energy of d_b.
  double Untold(int body, const peers::State& before, const peers::State& after, double dt, bool settled) const;
  void Explain(Vector3 Fitted::*impulse);  // fills unexplained_
  Vector3 At(const std::vector<Twist>& twists, const Fitted& contact) const;
  Vector3 Project(const Vector3& impulse, const Vector3& normal) const;

  const peers::WorldPlan& plan_;
  std::vector<Matrix3> inverse_inertia_;  // [1/(kg m^2)] W, before the step; zero: static
  std::vector<double> inverse_mass_;      // [1/kg]
  std::vector<Twist> gained_;             // [N s, N m s] p
  std::vector<Twist> unexplained_;        // [m/s, rad/s] M^-1 (J^T f - p)
  std::vector<Fitted> contacts_;
  std::map<std::pair<int, int>, std::vector<Remembered>> remembered_;  // of the last step, by bodies
  std::vector<ContactPoint> found_;
};

}  // namespace islet::charts
