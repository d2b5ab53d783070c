#include <array>
#include <bit>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/shape_data.h"
#include "engine/world/world_impl.h"

// Bytes of a snapshot: a header (magic, version, length and checksum of the rest), then every field of WorldState in the order of Visit.
// One function visits a type for both directions, so that what is written is what is read.

namespace islet {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::array<char, 8> kMagic{'i', 's', 'l', 'e', 't', 's', 'n', 'p'};
constexpr std::uint64_t kVersion = 6;
struct Header {
  std::array<char, 8> magic;
  std::uint64_t version, length, checksum;
};

[[noreturn]] void Refuse(const std::string& why) { throw std::invalid_argument("snapshot: " + why); }

// Each step is one to one, so no flip of a bit goes unseen.
std::uint64_t Checksum(std::span<const std::byte> bytes) {
  std::uint64_t state = 0x243f6a8885a308d3u;
  for (size_t i = 0; i < bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, std::min<size_t>(8, bytes.size() - i));
    state = (state ^ word) * 0x9e3779b97f4a7c15u;
    state ^= state >> 32;
  }
  return state;
}

template <typename T>
constexpr bool kPlain = std::is_arithmetic_v<T> || std::is_enum_v<T>;

class Writer {
 public:
  explicit Writer(std::vector<std::byte>* bytes) : bytes_(bytes) {}
  template <typename T>
  requires kPlain<T>
  void operator()(const T& value) {
    const auto* begin = reinterpret_cast<const std::byte*>(&value);
    bytes_->insert(bytes_->end(), begin, begin + sizeof value);
  }
  size_t Size(size_t size) {
    (*this)(static_cast<std::uint64_t>(size));
    return size;
  }

 private:
  std::vector<std::byte>* bytes_;
};

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  template <typename T>
  requires kPlain<T>
  void operator()(T& value) {
    if (bytes_.size() < sizeof value) Refuse("a field is cut off");
    if constexpr (std::is_same_v<T, bool>) {
      value = bytes_[0] != std::byte{0};
    } else {
      std::memcpy(&value, bytes_.data(), sizeof value);
    }
    bytes_ = bytes_.subspan(sizeof value);
  }
  // Of a list. No claim is believed that the bytes cannot hold.
  size_t Size(size_t) {
    std::uint64_t size = 0;
    (*this)(size);
    if (size > bytes_.size()) Refuse("a list of " + std::to_string(size) + " entries is cut off");
    return size;
  }
  bool AtEnd() const { return bytes_.empty(); }

 private:
  std::span<const std::byte> bytes_;
};

template <typename A, typename T>
requires kPlain<T>
void Visit(A& a, T& value) { a(value); }
template <typename A, typename Scalar, int kRows, int kColumns>
void Visit(A& a, Eigen::Matrix<Scalar, kRows, kColumns>& m) {
  for (int i = 0; i < kRows * kColumns; ++i) a(m.data()[i]);
}
template <typename A>
void Visit(A& a, Quaternion& q) {
  for (int i = 0; i < 4; ++i) a(q.coeffs()[i]);
}
template <typename A, typename T, size_t kSize>
void Visit(A& a, std::array<T, kSize>& values) {
  for (T& value : values) Visit(a, value);
}
template <typename A, typename First, typename Second>
void Visit(A& a, std::pair<First, Second>& pair) {
  Visit(a, pair.first);
  Visit(a, pair.second);
}
template <typename A, typename T>
void Visit(A& a, std::vector<T>& list) {
  list.resize(a.Size(list.size()));
  for (T& entry : list) Visit(a, entry);
}
template <typename A>
void Visit(A& a, Contact& c) {
  a(c.body_a), a(c.body_b);
  Visit(a, c.point_W), Visit(a, c.normal_W);
  a(c.gap), a(c.touches), a(c.friction), a(c.restitution), a(c.feature);
  Visit(a, c.surface_W);
}
template <typename A>
void Visit(A& a, Body& b) {
  a(b.kind), a(b.frozen), a(b.removed), a(b.mass);
  Visit(a, b.inertia_B);
  a(b.radius);
  Visit(a, b.position_W), Visit(a, b.rotation_WB), Visit(a, b.linear_velocity_W), Visit(a, b.angular_velocity_W);
  Visit(a, b.force_W), Visit(a, b.torque_W);
  a(b.layers), a(b.collides_with), a(b.sensor), a(b.friction), a(b.restitution);
  Visit(a, b.surface_velocity_B), Visit(a, b.surface_before_B);
  Visit(a, b.linear_before_W), Visit(a, b.angular_before_W), Visit(a, b.beyond_before_W);
  a(b.rides);
}
template <typename A>
void Visit(A& a, MassProperties& mass) {
  a(mass.mass);
  Visit(a, mass.inertia_B);
}
template <typename A>
void Visit(A& a, ContactEvent& e) {
  a(e.kind), a(e.body_a), a(e.body_b), a(e.sensor);
}
template <typename A>
void Visit(A& a, HitEvent& h) {
  a(h.body_a), a(h.body_b);
  Visit(a, h.point_W), Visit(a, h.impulse_W);
  a(h.approach);
}
template <typename A>
void Visit(A& a, Shape::Data& shape) {
  a(shape.kind), a(shape.radius);
  Visit(a, shape.half_extents);
  a(shape.size), a(shape.girth), a(shape.half_length);
  Visit(a, shape.hull_offset);
  Visit(a, shape.polytope.vertices), Visit(a, shape.polytope.faces), Visit(a, shape.polytope.face_normals);
  Visit(a, shape.polytope.edges), Visit(a, shape.polytope.edge_faces);
  a(shape.volume);
  Visit(a, shape.inertia_per_mass);
}
void Visit(Writer& a, std::vector<Shape>& shapes) {
  a.Size(shapes.size());
  for (const Shape& shape : shapes) {
    if (shape.kind() == ShapeKind::kCustom)
      throw std::invalid_argument("a custom shape is a function, which bytes cannot hold");
    Visit(a, const_cast<Shape::Data&>(shape.data()));
  }
}
void CheckPolytope(const Polytope& p, ShapeKind kind) {
  const auto within = [](const auto& numbers, size_t size) {
    return std::all_of(numbers.begin(), numbers.end(), [&](int i) { return i >= 0 && static_cast<size_t>(i) < size; });
  };
  if (p.face_normals.size() != p.faces.size() || p.edge_faces.size() != p.edges.size())
    Refuse("a polytope's lists differ in length");
  for (const std::vector<int>& face : p.faces)
    if (face.empty() || !within(face, p.vertices.size())) Refuse("a face has no such vertex");
  for (const auto& edge : p.edges)
    if (!within(edge, p.vertices.size())) Refuse("an edge has no such vertex");
  for (const auto& faces : p.edge_faces)
    if (!within(faces, p.faces.size())) Refuse("an edge has no such face");
  if (kind == ShapeKind::kBox && (p.vertices.size() != 8 || p.faces.size() != 6 || p.edges.size() != 12))
    Refuse("a box has other corners than eight");
  if (kind == ShapeKind::kConvexHull && p.vertices.empty()) Refuse("a hull has no vertex");
}
void Visit(Reader& a, std::vector<Shape>& shapes) {
  const size_t size = a.Size(0);
  shapes.clear();
  for (size_t i = 0; i < size; ++i) {
    auto data = std::make_shared<Shape::Data>();
    Visit(a, *data);
    if (data->kind > ShapeKind::kCylinder) Refuse("a shape is of no known kind");
    CheckPolytope(data->polytope, data->kind);
    shapes.emplace_back(std::move(data));
  }
}
template <typename A>
void Visit(A& a, motion::Pose& pose) {
  Visit(a, pose.position_W), Visit(a, pose.rotation_WB);
}
template <typename A>
void Visit(A& a, motion::GroupMemory& m) {
  Visit(a, m.still), Visit(a, m.anchor), Visit(a, m.load), Visit(a, m.mark), Visit(a, m.crowded), Visit(a, m.contacts),
      Visit(a, m.forces_W);
}
template <typename A>
void Visit(A& a, CertifiedFreezing::Stillness& s) {
  Visit(a, s.position_W), Visit(a, s.rotation_WB), Visit(a, s.force_W), Visit(a, s.torque_W);
  a(s.seconds);
}
template <typename A>
void Visit(A& a, motion::CrowdMemory& m) {
  Visit(a, m.contacts), Visit(a, m.forces_W), Visit(a, m.lost), Visit(a, m.still), Visit(a, m.freeze_counters);
}
template <typename A>
void Visit(A& a, WorldState& w) {
  Visit(a, w.bodies), Visit(a, w.shapes), Visit(a, w.masses), Visit(a, w.generations), Visit(a, w.user_data);
  Visit(a, w.leaving), Visit(a, w.vacant), Visit(a, w.pairs_apart.pairs()), Visit(a, w.events), Visit(a, w.hits);
  Visit(a, w.near_contacts), Visit(a, w.touching), Visit(a, w.resolved), Visit(a, w.impulses), Visit(a, w.travel),
      Visit(a, w.margins);
  Visit(a, w.groups), Visit(a, w.crowd_memory), Visit(a, w.crowd);
  a(w.stale), a(w.failed);
  Visit(a, w.unchecked);
  a(w.time), a(w.dt_hint), a(w.whole_dt);
}

// The checksum tells of accidents. This keeps what was made up from being read past the end of a list.
void CheckState(const WorldState& w) {
  const size_t n = w.bodies.size();
  const auto require = [](bool holds, const char* what) {
    if (!holds) Refuse(std::string("its ") + what + " do not fit its bodies");
  };
  for (const Body& b : w.bodies) require(b.kind <= BodyKind::kDynamic, "kinds");
  require(w.shapes.size() == n && w.masses.size() == n && w.generations.size() == n && w.user_data.size() == n &&
              w.unchecked.size() == n,
          "lists");
  require(w.travel.size() == w.margins.size() && (w.stale ? w.travel.size() <= n : w.travel.size() == n) &&
              w.crowd.size() <= n,
          "lists");
  const auto in_range = [&](int body) { return body >= 0 && body < static_cast<int>(n); };
  for (const auto* list : {&w.near_contacts, &w.touching, &w.resolved, &w.groups.contacts, &w.crowd_memory.contacts})
    for (const Contact& c : *list) require(in_range(c.body_a) && in_range(c.body_b) && c.body_a < c.body_b, "contacts");
  for (const auto* list : {&w.leaving, &w.vacant})
    for (const int body : *list) require(in_range(body) && w.bodies[body].removed, "free numbers");
  require(w.impulses.size() == w.resolved.size() && w.groups.forces_W.size() == w.groups.contacts.size() &&
              w.crowd_memory.forces_W.size() == w.crowd_memory.contacts.size(),
          "impulses");
  const motion::GroupMemory& g = w.groups;
  require(g.still.size() <= n && g.anchor.size() == g.still.size() && g.load.size() == g.still.size() &&
              g.mark.size() == g.still.size() && g.crowded.size() == g.still.size() &&
              w.crowd_memory.lost.size() <= n && w.crowd_memory.freeze_counters.size() <= n,
          "memories");
}

}  // namespace

std::vector<std::byte> WorldSnapshot::ToBytes() const {
  std::vector<std::byte> body;
  Writer write(&body);
  Visit(write, const_cast<WorldState&>(data_->world));
  Visit(write, const_cast<Vector3&>(data_->gravity));
  const Header header{kMagic, kVersion, body.size(), Checksum(body)};
  std::vector<std::byte> bytes(sizeof header + body.size());
  std::memcpy(bytes.data(), &header, sizeof header);
  std::memcpy(bytes.data() + sizeof header, body.data(), body.size());
  return bytes;
}

WorldSnapshot WorldSnapshot::FromBytes(std::span<const std::byte> bytes) {
  Header header;
  if (bytes.size() < sizeof header) Refuse("of " + std::to_string(bytes.size()) + " bytes is cut off");
  std::memcpy(&header, bytes.data(), sizeof header);
  const std::span<const std::byte> body = bytes.subspan(sizeof header);
  if (header.magic != kMagic) Refuse("these bytes are none of islet's");
  if (header.version != kVersion)
    Refuse("is of version " + std::to_string(header.version) + ", this islet reads " + std::to_string(kVersion));
  if (header.length != body.size())
    Refuse("has " + std::to_string(body.size()) + " bytes after its header, which says " +
           std::to_string(header.length));
  if (header.checksum != Checksum(body)) Refuse("is damaged: its checksum differs");
  auto data = std::make_shared<Data>();
  Reader read(body);
  Visit(read, data->world);
  Visit(read, data->gravity);
  if (!read.AtEnd()) Refuse("goes on after its end");
  CheckState(data->world);
  return WorldSnapshot(std::move(data));
}

}  // namespace islet
