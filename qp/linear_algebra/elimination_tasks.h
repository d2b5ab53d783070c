// Cuts an elimination into tasks: subtrees below a certain time, none of which touches columns of another, and the top above
// them. Of a few such times the one that promises most for two threads is taken, from a model of the time alone, so that the
// cut does not depend on the number of threads.
//
//   in:  supernodes in postorder with their rows      out: the same renumbered, task by task, then the top; task_start, model_time
//   threads: one caller at a time; allocates only while graphs grow
#pragma once

#include <vector>

namespace islet::qp {

struct Elimination;

inline constexpr int kMostTasks = 64;  // bits of the word that marks which regions are in use
// [ns] of a task: smaller subtrees share one, longer fronts of the top are shared by two threads.
inline constexpr double kTaskTime = 20e3;

class EliminationTasks {
 public:
  void Cut(Elimination* e);

 private:
  double AddUpSubtrees(const Elimination& e);
  double ChooseLimit(double total, Elimination* e) const;
  int AssignTasks(const Elimination& e, double total, double limit);
  void Renumber(int num_tasks, Elimination* e);

  std::vector<double> subtree_;  // [ns] per supernode
  std::vector<int> roots_;       // of the subtrees, longest first
  std::vector<int> task_of_;     // per supernode
  std::vector<int> fill_, rank_, moved_;
  std::vector<int> old_first_, old_row_start_, old_rows_, old_order_;
};

}  // namespace islet::qp
