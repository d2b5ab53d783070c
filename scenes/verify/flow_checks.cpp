// T38: grains leave a silo through an orifice D wide. The rate does not depend on the height of the fill once that is above
// 2 D, and follows Beverloo's law; a small orifice clogs.
//
//   W = C rho sqrt(g) (D - k d)^(5/2)   circular orifice, C 0.55 to 0.65, k 1 to 2, for spheres mostly 0.58 and 1.4
//                                       Beverloo, Leniger, van de Velde, Chem. Eng. Sci. 15 (1961); the ranges: Mankoc et al.,
//                                       Granular Matter 9 (2007); fill: da Silva et al., arXiv 2512.03698
// Other orifices by their hydraulic diameter, D = 4 area / rim: with A and D of what is left when k d / 2 is taken off along
// the rim, W = (4 / pi) C rho sqrt(g) A sqrt(D). A square of side a is left with A = (a - k d)^2, D = a - k d:
//   W = (4 / pi) C rho sqrt(g) (a - k d)^(5/2)
// and a slot of width b between panes c apart, which bound the grains as well as the slot, with A = c (b - k d), D = 2 (b - k d):
//   W = (4 / pi) sqrt(2) C rho sqrt(g) c (b - k d)^(3/2)     (1.04 for C = 0.58)
// The silos here are 2 to 3 D wide instead of the 2.5 D and D + 30 d from which walls do not matter, and D is 3 to 6 d, where k is
// least certain. So the exponent and C may be as far off as the literature's k and C would make them, and not more.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "scenes/verify/check.h"
#include "scenes/verify/flow_hopper.h"

namespace islet {
namespace {

using verify::Flow;
using verify::Hopper;
using verify::HopperDefinition;

constexpr double kC = 0.58, kLeastC = 0.55, kMostC = 0.65;
constexpr double kK = 1.4, kLeastK = 1, kMostK = 2;
constexpr double kWorstSpread = 0.25;  // a rate known no better than this says nothing

// As grains of 0.1 m on Earth, so that sqrt(d / g) is 6 frames of 1/60 s.
Settings HopperSettings(const CheckSettings& settings) {
  Settings engine = settings.engine;
  engine.gravity = {0, 0, -98.1};
  return engine;
}

Flow Watch(const CheckSettings& settings, double dt, const HopperDefinition& definition, double seconds) {
  return verify::WatchFlow(HopperSettings(settings), definition, dt, seconds);
}

std::string Name(const HopperDefinition& d) {
  std::string size = std::to_string(d.orifice);
  size.erase(size.find_last_not_of('0') + 1);
  if (size.back() == '.') size.pop_back();
  return std::string(d.slab ? "slot " : "square ") + size + " d, " + (d.cubes ? "cubes" : "spheres");
}

double Power(const HopperDefinition& d) { return d.slab ? 1.5 : 2.5; }

// What C would be if this were all there is: rate over the rest of the formula, both per solid volume.
double Coefficient(const HopperDefinition& d, const Flow& flow, double k) {
  const double shape = 4 / std::numbers::pi * (d.slab ? std::numbers::sqrt2 * verify::kSlabDepth : 1);
  return flow.rate * flow.grain_volume /
         (shape * flow.solid_fraction * std::sqrt(98.1) * std::pow(d.orifice - k, Power(d)));
}

// Two rates that should be the same.
void Agree(const std::string& name, const Flow& reference, const Flow& flow, Measurements* out) {
  const double spread = std::hypot(flow.error / flow.rate, reference.error / reference.rate);
  out->Relative(name, "grains/s", reference.rate, flow.rate, std::min(3 * spread, kWorstSpread),
                "three standard errors of the difference, a quarter at most");
}

// Over a range of orifices: the exponent from the ends of it, C from all.
void MeasureBeverloo(const std::vector<HopperDefinition>& hoppers, const std::vector<Flow>& flows, Measurements* out) {
  const HopperDefinition &small = hoppers.front(), &large = hoppers.back();
  const Flow &slow = flows.front(), &fast = flows.back();
  const auto range = [&](double k) { return std::log((large.orifice - k) / (small.orifice - k)); };
  const auto rate_per_density = [](const Flow& flow) { return flow.rate * flow.grain_volume / flow.solid_fraction; };
  const double exponent = std::log(rate_per_density(fast) / rate_per_density(slow)) / range(kK);
  const double error = std::hypot(slow.error / slow.rate, fast.error / fast.rate) / range(kK);
  // Only the side that the error is on: a larger k makes it seem steeper.
  const double by_k =
      Power(small) * (exponent > Power(small) ? range(kMostK) / range(kK) - 1 : 1 - range(kLeastK) / range(kK));
  out->Absolute("exponent of D - 1.4 d, " + Name(small) + " to " + Name(large), "", Power(small), exponent,
                by_k + std::min(3 * error, 0.5), "what k of 1 to 2 would make of it, and three standard errors");
  double log_c = 0, variance = 0, least = 0, most = 0;
  const double count = static_cast<double>(flows.size());
  for (size_t i = 0; i < flows.size(); ++i) {
    const auto by = [&](double k) {
      return Power(hoppers[i]) * std::log((hoppers[i].orifice - k) / (hoppers[i].orifice - kK));
    };
    log_c += std::log(Coefficient(hoppers[i], flows[i], kK)) / count;
    variance += std::pow(flows[i].error / flows[i].rate / count, 2);
    least += by(kMostK) / count;
    most += by(kLeastK) / count;
  }
  const double c = std::exp(log_c);
  const double bound = c > kC ? kMostC / kC * std::exp(most) - 1 : 1 - kLeastC / kC * std::exp(least);
  out->Relative("C with k = 1.4, " + Name(small) + " to " + Name(large), "", kC, c,
                bound + std::min(3 * std::sqrt(variance), kWorstSpread),
                "what k of 1 to 2 and C of 0.55 to 0.65 would make of it, and three standard errors");
}

struct Sizes {
  std::vector<double> orifices;
  double width, height;  // [m]
  double seconds;        // of flow
};

void MeasureSpheres(const CheckSettings& settings, bool slab, const Sizes& sizes, Measurements* out) {
  std::vector<HopperDefinition> hoppers;
  std::vector<Flow> flows;
  for (const double orifice : sizes.orifices) {
    hoppers.push_back({.orifice = orifice, .width = sizes.width, .height = sizes.height, .slab = slab});
    flows.push_back(Watch(settings, settings.dt, hoppers.back(), sizes.seconds));
  }
  MeasureBeverloo(hoppers, flows, out);
  HopperDefinition hopper = hoppers.back();
  const Flow coarse = Watch(settings, 2 * settings.dt, hopper, sizes.seconds);
  Agree("rate against that at twice the step, " + Name(hopper), coarse, flows.back(), out);
  out->AtMost("clogs, " + Name(hopper), "", flows.back().clogs + coarse.clogs, 0);
  if (!slab) return;  // the slab has shown it, at a tenth of the time
  hopper.height *= 1.5;
  Agree("rate against that of a fill 1.5 times as high, " + Name(hopper),
        Watch(settings, 2 * settings.dt, hopper, sizes.seconds), coarse, out);
}

void MeasureCubes(const CheckSettings& settings, Measurements* out) {
  const HopperDefinition hopper{.orifice = 5, .width = 9, .height = 9, .cubes = true};
  const Flow fine = Watch(settings, settings.dt, hopper, 3);
  Agree("rate against that at twice the step, " + Name(hopper), Watch(settings, 2 * settings.dt, hopper, 3), fine, out);
}

// A small orifice clogs, each grain with the same chance q, whatever went before: the numbers that pass between two clogs are
// distributed geometrically, mean (1 - q) / q, and their deviation over their mean is sqrt((mean + 1) / mean).
//                                       Zuriguel et al., Phys. Rev. E 71, 051303 (2005); in two dimensions Perez, arXiv 0705.1744
void MeasureClogs(const CheckSettings& settings, Measurements* out) {
  const int clogs = settings.quick ? 3 : 20;
  double means[2] = {};
  for (const int wide : {0, 1}) {
    const HopperDefinition hopper{.orifice = wide ? 3.0 : 2.0, .width = 6, .height = 7, .slab = true};
    const std::vector<int> passed = verify::WatchClogs(HopperSettings(settings), hopper, settings.dt, clogs, 100);
    double mean = 0, square = 0;
    const double count = static_cast<double>(passed.size());
    for (const int n : passed) mean += n / count;
    for (const int n : passed) square += std::pow(n - mean, 2) / (count - 1);
    means[wide] = mean;
    if (wide == 0) {
      const auto beyond = std::count_if(passed.begin(), passed.end(), [](int n) { return n >= 100; });
      out->Absolute("chance to clog within 100 grains, " + Name(hopper), "", 1, 1 - static_cast<double>(beyond) / count,
                    0);
      if (!settings.quick)
        out->Absolute("deviation over mean of the grains between clogs, " + Name(hopper), "",
                      std::sqrt((mean + 1) / mean), std::sqrt(square) / mean, 3 / std::sqrt(count),
                      "three standard errors of that ratio for an exponential distribution");
    }
  }
  out->Verdict("more grains pass between clogs at 3 d than at 2 d", true, means[1] > means[0]);
}

void MeasureHourglass(const CheckSettings& settings, Measurements* out) {
  if (settings.quick) {
    MeasureSpheres(settings, true, {{4, 5.5}, 12, 15, 2.5}, out);
  } else {
    MeasureSpheres(settings, true, {{3.5, 4.5, 5.5}, 14, 18, 5}, out);
    MeasureSpheres(settings, false, {{3.5, 4.5}, 8.5, 10, 2.5}, out);
    MeasureCubes(settings, out);
  }
  MeasureClogs(settings, out);
}

constexpr Check kChecks[] = {
    {"T38", "hourglass with a flat bottom", Gate::kStatistics,
     "Beverloo: W = (4 / pi) C rho sqrt(g) A sqrt(D), rims k d / 2 narrower, C = 0.58, k = 1.4, at any fill above 2 D",
     MeasureHourglass},
};

}  // namespace

std::span<const Check> FlowChecks() { return kChecks; }

}  // namespace islet
