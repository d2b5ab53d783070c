// All that a ContactSuite remembers from one Resolve to the next: what a later step depends on, and nothing else. A copy of
// it, put back, continues the run bit for bit.
//
//   rule: a new member of the suite that one frame leaves for the next belongs here; what a frame fills anew does not
#pragma once

#include <vector>

#include "engine/contact.h"
#include "engine/freezing/certified_freezing.h"

namespace islet {

struct SuiteMemory {
  std::vector<CertifiedFreezing::Stillness> still;  // per body: how long it has stood still, and where
  std::vector<int> freeze_counters;                 // kPaper, per body

  // Of the last frame, in its order: the contacts, the impulses that held [N s] (n, t1, t2), and in W what was told outside.
  std::vector<Contact> previous_contacts;
  std::vector<Vector3> previous_holding, impulses_W;
  double previous_dt = 0;  // [s]; 0: no frame yet
};

}  // namespace islet
