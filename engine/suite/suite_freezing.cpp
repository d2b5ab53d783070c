#include "engine/freezing/paper_freezing.h"
#include "engine/suite/contact_suite_impl.h"

namespace islet {

void ContactSuite::Impl::Freeze(StepReport* report) {
  if (settings.freezing == Freezing::kCertified) certified.EndFrame(frame, was_frozen, errors, still, settings);
  if (settings.freezing == Freezing::kPaper) FreezeLikePaper(frame, settings, &freeze_counters);
  for (size_t i = 0; i < frame.bodies.size(); ++i) {
    report->newly_frozen += frame.bodies[i].frozen && !was_frozen[i];
    report->woken += !frame.bodies[i].frozen && was_frozen[i];
  }
}

}  // namespace islet
