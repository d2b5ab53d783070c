// A silo with a flat bottom and an orifice in its middle (T38). What leaves is put back on top, so that the flow
// goes on at the same fill for as long as it is watched.
//
//   units: lengths in mean diameters or sides of the grains (1 m), time in seconds, under Settings::gravity
//   in:  sizes, friction, seed     out: what left, when; the solid fraction     threads: as World
#pragma once

#include <cstdint>
#include <vector>

#include "engine/world.h"
#include "scenes/random.h"

namespace islet::verify {

inline constexpr double kSlabDepth = 1.15;  // [m] from pane to pane

struct HopperDefinition {
  double orifice = 4;  // [m] side of the square, or width of the slot
  double width = 8;    // [m] inner, of the silo
  double height = 8;   // [m] of the grid that the silo is filled from
  bool slab = false;   // one grain deep, between smooth panes; the slot goes from pane to pane
  bool cubes = false;  // else spheres of 0.9 to 1.1 m
  double friction = 0.5;
  std::uint64_t seed = 38;
};

class Hopper {
 public:
  Hopper(const Settings& settings, const HopperDefinition& definition);

  // Steps once, and puts back what is out of the orifice. Returns the number of grains that left.
  int Step(double dt);
  // Puts back the grains around the orifice, as if the clog were blown away.
  void BreakClog();

  double SolidFraction() const;  // of the fill between 1 m above the orifice and three quarters of its height
  double GrainVolume() const;    // [m^3] mean
  double FillHeight() const;     // [m] twice the mean height of the grains in the silo
  double Depth() const;          // [m] of the silo, its width if it is square
  const World& world() const { return world_; }

 private:
  void PutOnTop(int grain);

  HopperDefinition definition_;
  World world_;
  SplitMix64 random_;
  std::vector<int> grains_;
};

struct Flow {
  double rate = 0;            // [grains/s] while it flows
  double error = 0;           // [grains/s] standard error of that, from eight stretches of time
  int clogs = 0;              // broken, their time left out
  double solid_fraction = 0;  // mean
  double grain_volume = 0;    // [m^3] mean
};
// Until it has flowed for so long, or three times that is over.
Flow WatchFlow(const Settings& settings, const HopperDefinition& definition, double dt, double seconds);

// The numbers of grains that pass between clogs; a number that reaches `most` ends there.
std::vector<int> WatchClogs(const Settings& settings, const HopperDefinition& definition, double dt, int clogs,
                            int most);

}  // namespace islet::verify
