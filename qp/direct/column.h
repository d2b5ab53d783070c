// Bodies that stand on each other and move along one line: one unknown a body, answered in linear time.
//
//   taken if   all normals are parallel; every body lies on at most one other (or a wall) and carries at most one; contacts with
//              friction do not slide; and those of a pair that ask for most can share its impulse such that nothing turns
//   exact      such impulses make nothing slide or turn, so every model has this answer; the convex ones have no other velocities
//   method     the velocities that bodies gain along the line minimise sum of m dv^2 / 2 where each is to exceed that of the body
//              below by what their contacts ask for. That is isotonic regression; neighbours that would violate their order are
//              pooled [BC90]. Each pair's impulse then acts where it balances the moments of all that is above, and is shared
//              among the contacts by the least change of equal shares, without those that would have to pull then
//   threads    one caller at a time; allocates only while problems grow
#pragma once

#include <span>
#include <vector>

#include "qp/problem.h"

namespace islet::qp {

class Column {
 public:
  // Impulses, one per contact of a problem without compliance; false if the bodies are no column, or have walls at both ends.
  // tolerance: [velocity] what slides or turns by no more stands. velocities: v0, 6 numbers a body.
  bool Solve(const Problem& problem, double tolerance, std::span<const double> velocities,
             std::vector<Vector3>* impulses);

 private:
  using Vector2 = Eigen::Vector2d;
  static constexpr int kNobody = -2, kWall = -1;

  struct Moments {  // about the bodies of a joint, across the line
    Vector2 below = Vector2::Zero(), above = Vector2::Zero();
  };
  struct Joint {  // of a body and what is below it
    int below = kNobody, above = kNobody;
    int last = -1;      // of its contacts
    double demand = 0;  // what the velocity gained above is to exceed that gained below by
    double impulse = 0;
  };
  struct Touch {      // a contact
    int before = -1;  // contact of the same joint
    double demand = 0;
    Moments moments;  // of a unit impulse
    bool presses = true;
  };
  struct Block {  // bodies that stay together, from chain_[first] up
    int first = 0;
    double mass = 0, momentum = 0;
    double Speed() const { return momentum / mass; }
  };

  bool FindJoints(const Problem& problem, const double* velocities);
  bool FindChain();
  void Pool(const Problem& problem);
  void Load(const Problem& problem);
  bool ShareAll(const Problem& problem, std::vector<Vector3>* impulses);
  bool Share(const Joint& joint, const Vector2& wanted, Moments* moments, std::vector<Vector3>* impulses);

  double tolerance_ = 0;         // [velocity]
  std::vector<Touch> touches_;   // per contact
  std::vector<Joint> joints_;    // per body: the one below it
  std::vector<int> chain_;       // bodies from the bottom up
  std::vector<double> offsets_;  // per place in the chain: sum of the demands up to there
  std::vector<Block> blocks_;
};

}  // namespace islet::qp
