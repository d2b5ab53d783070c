// CHOLMOD's supernodal factorisation, with OpenBLAS, of the Newton matrix of a problem, in one thread. Its time is the unit in
// which whole solves are stated, because it moves with the machine. Without CHOLMOD there is none.
//
//   ISLET_HAVE_CHOLMOD   defined where both libraries were found
//   threads: one; sets the number of threads of OpenBLAS and of OpenMP for the whole program
#pragma once

#include <memory>

#include "qp/problem.h"

namespace islet::qp {

class CholmodFactor {
 public:
  explicit CholmodFactor(const Problem& problem);  // analyses, and factorises once
  ~CholmodFactor();
  CholmodFactor(const CholmodFactor&) = delete;
  CholmodFactor& operator=(const CholmodFactor&) = delete;

  static bool Available();
  bool Turn();  // one numeric factorisation; false without CHOLMOD, or if it failed

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet::qp
