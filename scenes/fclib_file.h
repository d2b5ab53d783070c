// Frictional contact problems in FCLIB's HDF5 format, read and written. The only room that sees HDF5 (in fclib_file.cpp).
//
//   local    u = W r + q                      group /fclib_local:  W, vectors q, mu
//   global   M v = H r + f,  u = H^T v + w    group /fclib_global: M, H, vectors f, w, mu
//   contact blocks of 3, normal first; r in the friction cone; units are the file's
//
// Matrices may be triplets, compressed columns or compressed rows. Triplets: fclib.h says p holds rows, writers in use put
// rows into i; whichever fits the size of the matrix is meant, i if both do. Written are compressed columns.
//   errors: FclibError, whose text names the file and the group or data set; a file with equality constraints (G, V and R),
//           with rolling friction or in two dimensions is refused in the same way
//   threads: one caller at a time (the HDF5 library has global state)
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <stdexcept>
#include <string>

namespace islet {

using SparseMatrix = Eigen::SparseMatrix<double>;  // compressed columns

struct FclibError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct FclibProblem {
  bool global = false;
  SparseMatrix delassus;  // W; local only
  Eigen::VectorXd q;      // local only
  SparseMatrix mass;      // M, H: global only
  SparseMatrix coupling;
  Eigen::VectorXd load, drift;  // f, w: global only
  Eigen::VectorXd friction;     // mu, one per contact, >= 0

  int num_contacts() const { return static_cast<int>(friction.size()); }
};

struct FclibSolution {
  Eigen::VectorXd v;  // global only
  Eigen::VectorXd u, r;
};

std::string Hdf5Version();  // of the library that this process runs on

FclibProblem ReadFclib(const std::string& path);

// Title and description go to the group `info`. solution may be null. The file appears whole or not at all.
void WriteFclib(const std::string& path, const FclibProblem& problem, const FclibSolution* solution,
                const std::string& title, const std::string& description);

}  // namespace islet
