// The Newton matrix of the interior-point method, reduced to the bodies.
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
#include "qp/linear_algebra/precision.h"
#include "qp/problem.h"

namespace islet::qp {

class KktSystem {
 public:
  // Takes the masses and the Jacobians. The symbolic phase is kept while the graph of the problem is the same.
  // num_fields: 1 or 2.
  void Prepare(const Problem& problem, int num_fields);

  // problem: the one that was prepared. D: one symmetric block per contact. E: one number per contact, unused with one
  // field. precision: of the factors; single costs about two thirds and is offered with one field (CanBeSingle).
  // Returns the number of pivots that had to be replaced (0 in a healthy factorisation).
  int Factorise(const Problem& problem, const std::vector<Matrix3>& d, const std::vector<double>& e,
                Precision precision = Precision::kDouble);
  bool CanBeSingle() const { return num_fields_ == 1; }

  // x <- S^-1 x by the last factorisation; unknowns body by body, field by field: x[(6 num_fields) body + 6 field + i].
  void Solve(double* x);

  int num_fields() const { return num_fields_; }
  const BlockCholesky& cholesky() const { return full_.cholesky; }

 private:
  struct BodyMass {
    double mass;
    Matrix3 inertia;
  };
  // A block of S: a body's or a pair's, with the products of the contacts that add to it.
  struct Block {
    int body;  // -1: a pair's
    bool transposed;
    int mass;  // into masses_
    int products_begin, products_end;
  };
  // The matrix in numbers of one precision.
  template <typename Number>
  struct Matrix {
    BlockCholeskyOf<Number> cholesky;
    std::vector<BlockPlaceOf<Number>> places;  // per block
    std::vector<Number> rows;                  // of the Jacobians, in the order in which the products first need them
    const FrontKernelsOf<Number>* kernels = &BestFrontKernelsOf<Number>().For(6);
  };
  void FindPairs(const Problem& problem);
  void PlaceBlocks(int num_bodies);
  void ListProducts(const Problem& problem);
  void Pack(const Problem& problem);
  template <typename Number>
  void PlaceIn(Matrix<Number>* matrix);
  template <typename Number>
  void AddBlock(Matrix<Number>& matrix, int block, const Number* d);
  void PrepareSingle();

  int num_fields_ = 1;
  Matrix<double> full_;
  Matrix<float> single_;
  bool single_placed_ = false, single_packed_ = false;  // of this graph, of this problem
  bool by_single_ = false;                              // the last factorisation
  std::vector<float> single_d_;                         // D, 9 numbers a contact
  std::vector<std::array<int, 2>> pairs_;               // of bodies in contact, ascending, each once
  std::vector<int> pair_of_;                            // per contact: into pairs_, -1 if one side is immovable
  std::vector<Block> blocks_;                           // supernode by supernode
  std::vector<int> block_start_;                        // per supernode: into blocks_
  std::vector<int> block_of_body_, block_of_pair_;
  std::vector<ContactProduct> products_;
  std::vector<BodyMass> masses_;                  // in the order of the blocks that they are added to
  std::vector<Matrix3> normal_blocks_;            // diag(E, 0, 0), two fields only
  std::vector<int> count_, sorted_, sorted_too_;  // scratch
};

}  // namespace islet::qp
