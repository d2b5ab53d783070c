// The ladder: the ways to solve an island's problem, cheapest first. A rung is taken where a cheap test says that it can serve,
// and its answer is kept where it meets the law to the tolerance; otherwise the next one is tried. Which one serves depends on
// the problem and the impulses that it starts from alone.
#pragma once

#include <cstdint>

namespace islet::qp {

// A way to an answer, cheapest first.
enum class Rung : std::uint8_t {
  kNothing,        // no contact, or nothing approaches
  kClosedForm,     // one contact: a formula
  kColumn,         // bodies on each other that move along one line: one unknown a body
  kHeld,           // the impulses of the frame before still hold
  kSweeps,         // Gauss-Seidel sweeps first, and alone where they get there
  kNewton,         // exact friction by Newton's method
  kInteriorPoint,  // the interior point, or what began there
  // Of detection:
  kKeptPairs,  // contacts of two bodies that have not moved since they were found
  kReach,      // contacts found with room for the motion that was expected: not found again before it
};
inline constexpr int kNumProblemRungs = static_cast<int>(Rung::kInteriorPoint) + 1;  // without those of detection
inline constexpr int kNumRungs = static_cast<int>(Rung::kReach) + 1;                 // all
// Names of the rungs in options and reports, by Rung.
inline constexpr const char* kRungNames[kNumRungs] = {"nothing", "closed_form",    "column",     "held", "sweeps",
                                                      "newton",  "interior_point", "kept_pairs", "reach"};
static_assert(kRungNames[kNumRungs - 1] != nullptr);

// Which rungs may be used. The interior point always may; a problem without contacts is not asked.
class Ladder {
 public:
  constexpr Ladder() = default;                                                     // all rungs
  static constexpr Ladder Off() { return Ladder(Bit(Rung::kInteriorPoint)); }       // the interior point alone
  constexpr bool Has(Rung rung) const { return (bits_ & Bit(rung)) != 0; }          // whether it may be used
  constexpr Ladder With(Rung rung) const { return Ladder(bits_ | Bit(rung)); }      // this one and that rung
  constexpr Ladder Without(Rung rung) const { return Ladder(bits_ & ~Bit(rung)); }  // this one but that rung

 private:
  static constexpr std::uint32_t Bit(Rung rung) { return 1U << static_cast<int>(rung); }
  constexpr explicit Ladder(std::uint32_t bits) : bits_(bits) {}

  std::uint32_t bits_ = (1U << kNumRungs) - 1;  // all
};

}  // namespace islet::qp
