// Bodies that stand on each other and move along one line: one unknown a body, answered in linear time.
//
//   taken if   all normals are parallel; every body lies on at most one other (or a wall) and carries at most one; contacts with
//              friction do not slide; and equal impulses at those contacts of a pair that ask for most turn neither body. All to
//              kColumnTolerance: of v_ref, and of a body's radius of gyration
//   exact      such impulses make nothing slide or turn, so every model has this answer; the convex ones have no other velocities
//   method     the velocities that bodies gain along the line minimise sum of m dv^2 / 2 where each is to exceed that of the body
//              below by what their contacts ask for. That is isotonic regression; neighbours that would violate their order are
//              pooled [BC90: Best & Chakravarti, Active set algorithms for isotonic regression, 1990, section 3]
//   threads    one caller at a time; allocates only while problems grow
#pragma once

#include <span>
#include <vector>

#include "qp/problem.h"

namespace islet::qp {

inline constexpr double kColumnTolerance = 1e-9;

class Column {
 public:
  // Impulses, one per contact; false if the bodies are no column, or walls at both ends. velocities: v0, 6 numbers a body.
  bool Solve(const Problem& problem, double velocity_scale, std::span<const double> velocities,
             std::vector<Vector3>* impulses);

 private:
  static constexpr int kNobody = -2, kWall = -1;
  struct Joint {  // of a body and what is below it
    int below = kNobody, above = kNobody;
    double demand = 0;  // what the velocity gained above is to exceed that gained below by
    int pressing = 0;   // contacts that ask for as much
    Vector6 levers =
        Vector6::Zero();  // sums over them: moments that unit impulses have about the body below and the one above
    double impulse = 0;
  };
  struct Block {  // bodies that stay together, from chain_[first] up
    int first = 0;
    double mass = 0, momentum = 0;
    double Speed() const { return momentum / mass; }
  };

  bool FindJoints(const Problem& problem, double tolerance, const double* velocities);
  bool FindChain();
  void Pool(const Problem& problem);
  void Load(const Problem& problem);
  bool TurnsNothing(const Problem& problem) const;

  Vector3 up_;
  std::vector<int> upper_;       // body of each contact, the one above
  std::vector<double> demands_;  // per contact
  std::vector<Joint> joints_;    // per body: the one below it
  std::vector<int> chain_;       // bodies from the bottom up
  std::vector<double> offsets_;  // per place in the chain: sum of the demands up to there
  std::vector<Block> blocks_;
};

}  // namespace islet::qp
