// The impulses that take what is left of an island's momentum, so that it stands still by impulses and not by decree.
//
//   D = S P(x) S / f_n, x = (mu f_n, f_t), S = diag(1 / mu, 1, 1), P(x) = 2 x x^T - det(x) diag(1, -1, -1)
//       what a contact presses with may change, what does not press stays out of it; what slides changes along its cone
//   A w = r, A = G D G^T, r: momenta to be given to the bodies (linear; angular over the radius)         [conjugate gradients,
//   impulses D G^T w: of those that give r the least ones, measured by what the contacts press with        a block per body]
//
//   units: SI    threads: one caller at a time    allocation: only while islands grow
#pragma once

#include <span>
#include <vector>

#include "engine/response/suite_frame.h"

namespace islet {

class StopImpulses {
 public:
  using Momentum = Eigen::Matrix<double, 6, 1>;  // [N s] linear; angular about the centre over the radius

  // An island of the frame: its bodies, ascending, and the contacts that hold them with frame.holding.
  void Prepare(const SuiteFrame& frame, std::span<const int> bodies, std::span<const int> contacts);
  // wanted: per body of it. limits: [N s] the same: what may be missed. impulses: [N s] per contact of it, (n, t1, t2). Returns whether
  // every body misses less than its limit; if not, they are as near as a few hundred rounds come.
  bool Find(std::span<const Momentum> wanted, std::span<const double> limits, std::vector<Vector3>* impulses);

 private:
  using Block = Eigen::Matrix<double, 6, 6>;
  struct Side {
    int body = -1;                  // place in the island, -1: it does not move
    Eigen::Matrix<double, 6, 3> g;  // momentum of an impulse in (n, t1, t2)
  };
  struct Term {
    Side sides[2];
    Matrix3 weight;  // D
  };
  static Vector3 ImpulseOf(const Term& term, std::span<const Momentum> x);
  void Multiply(std::span<const Momentum> x, std::vector<Momentum>* ax) const;

  std::vector<Term> terms_;
  std::vector<Block> sums_, inverses_;  // blocks of A, per body, and their inverses as far as contacts reach
  std::vector<Momentum> w_, best_, residual_, preconditioned_, direction_, image_;
};

}  // namespace islet
