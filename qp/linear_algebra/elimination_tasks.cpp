#include "qp/linear_algebra/elimination_tasks.h"

#include <algorithm>
#include <numeric>

#include "qp/linear_algebra/elimination.h"

namespace islet::qp {
namespace {

constexpr double kSharedGain = 1.7;  // by how much two threads shorten a front that they share

int ParentOf(const Elimination& e, int s) { return e.below(s) == 0 ? -1 : e.supernode_of[e.rows[e.row_start[s]]]; }

}  // namespace

double EliminationTasks::AddUpSubtrees(const Elimination& e) {
  const int count = e.num_supernodes();
  double total = 0;
  subtree_.assign(count, 0.0);
  for (int s = 0; s < count; ++s) {
    const double time = FrontTime(e.columns(s), e.below(s));
    total += time;
    subtree_[s] += time;
    if (const int parent = ParentOf(e, s); parent >= 0) subtree_[parent] += subtree_[s];
  }
  return total;
}

// The longest time of a subtree that is left whole: the best of the whole halved a few times.
double EliminationTasks::ChooseLimit(double total, Elimination* e) const {
  double limit = total, best = total;
  for (double most = 0.5 * total; most > kTaskTime && most * kMostTasks > 2 * total; most *= 0.5) {
    double longest = 0, tasks = 0, top = 0;
    for (int s = 0; s < e->num_supernodes(); ++s) {
      const double time = FrontTime(e->columns(s), e->below(s));
      if (subtree_[s] > most) {
        top += time > kTaskTime ? time / kSharedGain : time;
      } else {
        tasks += time;
        longest = std::max(longest, subtree_[s]);
      }
    }
    const double both = std::max(longest, tasks / 2) + top;
    if (both < best) best = both, limit = most;
  }
  e->model_time = (total + best) / 2;
  return limit;
}

// Tasks by their time, longest first; small subtrees share one. Returns how many; the top counts as the one behind them.
int EliminationTasks::AssignTasks(const Elimination& e, double total, double limit) {
  const int count = e.num_supernodes();
  const bool cut = limit < total;
  roots_.clear();
  for (int s = 0; s < count; ++s) {
    const int parent = ParentOf(e, s);
    if (subtree_[s] <= limit && (parent < 0 || subtree_[parent] > limit)) roots_.push_back(s);
  }
  std::sort(roots_.begin(), roots_.end(),
            [&](int a, int b) { return subtree_[a] != subtree_[b] ? subtree_[a] > subtree_[b] : a < b; });
  task_of_.assign(count, -1);
  int num_tasks = 0;
  double filled = 0;
  const double worth = std::max(kTaskTime, total / (kMostTasks - 1));  // all but the last take as long
  for (int root : roots_) {
    if (num_tasks == 0 || (cut && filled >= worth)) ++num_tasks, filled = 0;
    filled += subtree_[root];
    task_of_[root] = num_tasks - 1;
  }
  for (int s = count - 1; s >= 0; --s) {
    if (task_of_[s] < 0) task_of_[s] = subtree_[s] > limit ? num_tasks : task_of_[ParentOf(e, s)];
  }
  return num_tasks;
}

// Task by task, then the top; within each as before. Rows stay ascending, for a front's ancestors are in its own task, in
// the same order as before, or in the top.
void EliminationTasks::Renumber(int num_tasks, Elimination* e) {
  const int count = e->num_supernodes();
  e->task_start.assign(num_tasks + 2, 0);
  for (int s = 0; s < count; ++s) ++e->task_start[task_of_[s] + 1];
  std::partial_sum(e->task_start.begin(), e->task_start.end(), e->task_start.begin());
  fill_.assign(e->task_start.begin(), e->task_start.end() - 1);
  e->task_start.pop_back();
  rank_.resize(count);
  for (int s = 0; s < count; ++s) rank_[fill_[task_of_[s]]++] = s;
  old_first_.swap(e->first);
  old_row_start_.swap(e->row_start);
  old_rows_.swap(e->rows);
  old_order_.assign(e->order.begin(), e->order.end());
  moved_.resize(e->num_nodes);
  e->first.assign(1, 0);
  e->row_start.assign(1, 0);
  e->rows.clear();
  for (int s = 0; s < count; ++s) {
    int to = e->first.back();
    for (int k = old_first_[rank_[s]]; k < old_first_[rank_[s] + 1]; ++k, ++to) {
      moved_[k] = to;
      e->order[to] = old_order_[k];
      e->position[e->order[to]] = to;
      e->supernode_of[to] = s;
    }
    e->first.push_back(to);
  }
  for (int s = 0; s < count; ++s) {
    for (int r = old_row_start_[rank_[s]]; r < old_row_start_[rank_[s] + 1]; ++r)
      e->rows.push_back(moved_[old_rows_[r]]);
    e->row_start.push_back(static_cast<int>(e->rows.size()));
  }
}

void EliminationTasks::Cut(Elimination* e) {
  const double total = AddUpSubtrees(*e);
  const double limit = ChooseLimit(total, e);
  Renumber(AssignTasks(*e, total, limit), e);
}

}  // namespace islet::qp
