// Counts the heap allocations of the current thread, to prove that a warmed-up loop makes none.
//
// Counted: malloc and its relatives, therefore operator new, standard containers and Eigen, which takes its memory from
// malloc and would slip past a replaced operator new. Linking this file into a test binary puts counting versions in
// front of those of glibc; under a sanitizer, which owns malloc, its hook is used. No library of the project has it.
//   threads: each counts its own; allocations by workers are not seen by the thread that waits for them
//
//   const AllocationCounter counter;
//   Solve(&workspace);
//   EXPECT_EQ(counter.count(), 0);
#pragma once

namespace islet::testing {

class AllocationCounter {
 public:
  AllocationCounter();
  // Allocations by this thread since construction.
  long count() const;

 private:
  long start_;
};

}  // namespace islet::testing
