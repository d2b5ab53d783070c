// Bodies that may meet in a step and go from blow to blow together, and what became of them.
#pragma once

#include <functional>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/ledger.h"
#include "engine/motion/path.h"
#include "engine/motion/tuning.h"
#include "engine/problem_record.h"
#include "engine/response/response.h"
#include "engine/shape.h"

namespace islet::motion {

struct GroupPair {
  int a, b;  // places in the group, a < b
};

// Fills friction and restitution of a contact.
using MixMaterial = std::function<void(Contact* contact, const Body& a, const Body& b)>;

struct Group {
  std::vector<Body> bodies;  // ascending by their number in the world
  std::vector<int> numbers;  // in the world
  std::vector<const Shape*> shapes;
  std::vector<GroupPair> pairs;     // ascending
  std::vector<Contact> remembered;  // of the step before, with the forces [N] that held: where solves start
  std::vector<Vector3> remembered_force_W;
  // Of a step: looks at pairs, contacts solved, which are much dearer, pairs passed over, which are cheap. With more it is given up.
  int most_work = MostWork(20);
};

struct GroupOutcome {
  int pieces = 0, bounces = 0, passes = 0;
  int work = 0;          // counted as for Group::most_work
  double unstepped = 0;  // [s] of the step that the bodies stood still, since no way on was found; 0: all is well
  double overlap = 0;    // [m] deepest at the end
  int overlapping = 0;   // pairs that are inside of each other at the end
  bool restitution_lowered = false;
  std::vector<LedgerImpulse> impulses;
  std::vector<Contact> touching;  // near contacts at the end pose, and the forces [N] that held there
  std::vector<Vector3> touching_force_W;
  std::vector<ResponseOutcome> carried, settled, struck;  // answers of the contact problems
  bool record = false;                                    // in: whether records are wanted
  std::vector<double> ends;                               // [s] of the pieces that were done
  std::vector<Path> paths;                                // of all bodies in the first of them, then in the next
  std::vector<ProblemRecord> records;
  void Clear();  // keeps the memory of its vectors
};

}  // namespace islet::motion
