// What stands in the scenes of the charts: pure functions that give plans. Which of them make a scene, and what is right
// there: chart_scenes.h.
#pragma once

#include <numbers>
#include <optional>
#include <string_view>

#include "bench/peers/peer.h"

namespace islet::charts {

inline constexpr double kGravity = 9.81;   // [m/s^2]
inline constexpr double kFriction = 0.5;   // where nothing else is said
inline constexpr double kThrownSpeed = 5;  // [m/s] of what slides or rolls
inline constexpr double kThrownAngle = std::numbers::pi / 8;
inline constexpr double kCarrierFriction = 0.4, kCarrierMass = 10, kCarrierPush = 150;  // [kg], [N]
inline constexpr int kCarriedBalls = 25;                                                // 1 kg each
inline constexpr double kArchFriction = 0.7;

peers::WorldPlan FromScene(std::string_view name, std::optional<int> count = {});  // one of the program
peers::WorldPlan Incline();
peers::WorldPlan Slide(double angle);  // [rad]
peers::WorldPlan Rolling();
peers::WorldPlan Heavy();
peers::WorldPlan CradleApart();
peers::WorldPlan CardHouse();
peers::WorldPlan Carrier();
peers::WorldPlan Cloud(double restitution);
peers::WorldPlan Bin(int boxes, int side);  // so many boxes a layer and row
peers::WorldPlan ArchOfWedges();

// Moves every moving body by up to `most` [m] along each axis; another `start`, another way.
void Shift(int start, double most, peers::WorldPlan* plan);

}  // namespace islet::charts
