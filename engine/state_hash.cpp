#include "engine/state_hash.h"

#include <bit>

namespace islet {
namespace {

// FNV-1a over 64-bit words with a final mix [FNV; splitmix64].
struct Hasher {
  std::uint64_t state = 0xcbf29ce484222325u;
  void Add(std::uint64_t word) {
    state = (state ^ word) * 0x100000001b3u;
    state ^= state >> 29;
  }
  void Add(double value) { Add(std::bit_cast<std::uint64_t>(value)); }
  void Add(const Vector3& v) { Add(v.x()), Add(v.y()), Add(v.z()); }
};

}  // namespace

std::uint64_t HashBodies(std::span<const Body> bodies) {
  Hasher hash;
  for (const Body& body : bodies) {
    hash.Add(static_cast<std::uint64_t>(body.kind) | (body.frozen ? 256u : 0u) | (body.removed ? 512u : 0u));
    hash.Add(body.position_W);
    for (int i = 0; i < 4; ++i) hash.Add(body.rotation_WB.coeffs()[i]);
    hash.Add(body.linear_velocity_W);
    hash.Add(body.angular_velocity_W);
  }
  std::uint64_t z = hash.state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

}  // namespace islet
