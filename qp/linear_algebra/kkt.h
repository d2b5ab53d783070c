// The Newton matrix of the interior points, and of the other methods that have one: reduced to the bodies.
//
// One field (convex models), unknown v:            Two fields (kinetic model), unknowns v and p = multiplier of momentum:
//   S = M + sum_c J_c^T D_c J_c                       S = [ M + sum_c N_c^T E_c N_c        -M              ]
//                                                         [ -M                   - sum_c J_c^T D_c J_c     ]
//   6x6 blocks, positive definite                     12x12 blocks per pair of bodies, quasi-definite
//
// D_c (3x3) is the scaling of contact c's friction cone, E_c (a number) that of its row u_n >= b, N_c the normal row of
// J_c. Both fields of a body stay together, so the graph is that of the contacts either way.
//   threads: one caller at a time, idle workers help (block_cholesky.h); allocates only in Prepare, while problems grow
#pragma once

#include <array>
#include <vector>

#include "qp/linear_algebra/block_cholesky.h"
#include "qp/problem.h"

namespace islet::qp {

class KktSystem {
 public:
  KktSystem() = default;
  KktSystem(KktSystem&&) = default;
  KktSystem& operator=(KktSystem&&) = default;  // no copies: blocks point into the factor

  // Takes the masses and the Jacobians. The symbolic phase is kept while the graph of the problem is the same.
  // num_fields: 1 or 2.
  void Prepare(const Problem& problem, int num_fields);

  // Of the problem that was prepared. D: one symmetric block per contact. E: one number per contact, unused with one
  // field. Returns the number of pivots that had to be replaced (0 in a healthy factorisation).
  int Factorise(const std::vector<Matrix3>& d, const std::vector<double>& e);

  // x <- S^-1 x by the last factorisation; unknowns body by body, field by field: x[(6 num_fields) body + 6 field + i].
  void Solve(double* x);

  int num_fields() const { return num_fields_; }
  const BlockCholesky& cholesky() const { return cholesky_; }

 private:
  struct BodyMass {
    double mass;
    Matrix3 inertia;
  };
  // A block of S: a body's or a pair's, with the products of the contacts that add to it.
  struct Block {
    BlockPlace place;
    int body;  // -1: a pair's
    int mass;  // into masses_
    int products_begin, products_end;
  };
  void FindPairs(const Problem& problem);
  void PlaceBlocks(int num_bodies);
  void ListProducts(const Problem& problem);
  void Pack(const Problem& problem);
  void AddBlock(const Block& block, const double* d);

  int num_fields_ = 1;
  const FrontKernels* kernels_ = &BestFrontKernels();
  BlockCholesky cholesky_;
  std::vector<std::array<int, 2>> pairs_;  // of bodies in contact, ascending, each once
  std::vector<int> pair_of_;               // per contact: into pairs_, -1 if one side is immovable
  std::vector<Block> blocks_;              // supernode by supernode
  std::vector<int> block_start_;           // per supernode: into blocks_
  std::vector<int> block_of_body_, block_of_pair_;
  std::vector<ContactProduct> products_;
  std::vector<BodyMass> masses_;        // in the order of the blocks that they are added to
  std::vector<double> rows_;            // of the Jacobians, in the order in which the products first need them
  std::vector<Matrix3> normal_blocks_;  // diag(E, 0, 0), two fields only
  std::vector<int> count_, sorted_, sorted_too_;  // scratch
};

}  // namespace islet::qp
