// A frame of a film as bytes, for recordings: without loss, and so that a compressor finds what repeats.
//
//   layout  little endian: number, count of contacts, count of bodies (u32), time (f64), state_hash (u64);
//           contacts, islands, awake, frozen, sides_changed, overlapping, missed, failed (i32); step_seconds, detect, islands, pq,
//           collision_qp, static_qp, freeze, move, kinetic, potential, coulomb_map, penetration, energy_created, momentum_unexplained,
//           angular_momentum_unexplained (f64); then columns
//           failed: 0 or 1, and twice one more than the problems without an answer; without those two, 0 or 1, they are not told
//   column  one 32-bit word of each body or contact: first all lowest bytes, at last all highest ones
//   bodies  x, y, z, rotation x, y, z, w, island, accuracy: the bits, exclusive-or those of the frame before (of the first: 0); frozen (0
//           or 1): no column but a byte each
//   contacts  body_a, less that of the contact before in the list; body_b, the same (both modulo 2^32); point, normal, impulse: the bits,
//           exclusive-or those of the contact in the frame before that has the same bodies, and as many before it with them (without
//           such a one: 0). A normal: those of the contact before in the list, if it has the same bodies, since flat faces share theirs.
//   errors  std::invalid_argument that names what is wrong; numbers that are not finite are
//   threads pure functions
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "scenes/film/film.h"

namespace islet {

inline constexpr std::size_t kMostFrameContacts = 1 << 19;

std::uint64_t FrameBytes(std::size_t bodies, std::size_t contacts);  // of a frame

// before: the frame before it, none for the first. Both check that the frame has so many bodies, comes after that, and is finite.
std::string EncodeFrame(const FilmFrame& frame, const FilmFrame* before, std::size_t bodies);
FilmFrame DecodeFrame(std::string_view bytes, const FilmFrame* before, std::size_t bodies);

}  // namespace islet
