#include "scenes/viewer/page_chunk.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>

#include "scenes/viewer/varint.h"

namespace islet {
namespace {

constexpr double kFarthest = 1099511627776;  // 2^40 steps: what is farther away stays there
constexpr double kSmallestPart = 0.4;        // of the component that is left out, before another one is
constexpr int kImpulseDecade = 400, kAccuracyDecade = 1000, kPressDecade = 40;
constexpr double kOctahedron = 1023;

// The reader rounds in the same way.
std::int64_t Round(double x) { return static_cast<std::int64_t>(std::floor(x + 0.5)); }

std::int64_t Steps(double x, double step) { return Round(std::clamp(x / step, -kFarthest, kFarthest)); }

// 0 of nothing; else 1 at 1e-20, counting up.
int LogCode(double x, int decade) {
  if (!(x > 1e-20)) return 0;
  return static_cast<int>(1 + Round(decade * (std::min(std::log10(x), 20.0) + 20)));
}

struct Direction {
  std::int64_t u = 0, v = 0;
};

Direction OnOctahedron(double x, double y, double z) {
  const double sum = std::abs(x) + std::abs(y) + std::abs(z);
  if (!(sum > 0)) return {};
  double u = x / sum, v = y / sum;
  if (z < 0) {
    const double folded = (1 - std::abs(v)) * (u < 0 ? -1 : 1);
    v = (1 - std::abs(u)) * (v < 0 ? -1 : 1);
    u = folded;
  }
  return {Round(u * kOctahedron), Round(v * kOctahedron)};
}

std::array<double, 4> Unit(const std::array<float, 7>& pose) {
  std::array<double, 4> q{pose[3], pose[4], pose[5], pose[6]};
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& part : q) part /= length;
  return q;
}

// Where a number goes, judged by the two frames before.
class Track {
 public:
  std::int64_t Difference(std::int64_t value) {
    const std::int64_t expected = seen_ == 0 ? 0 : seen_ == 1 ? last_ : 2 * last_ - before_;
    before_ = last_;
    last_ = value;
    seen_ = std::min(seen_ + 1, 2);
    return value - expected;
  }
  void Forget() { seen_ = 0; }

 private:
  std::int64_t last_ = 0, before_ = 0;
  int seen_ = 0;
};

// The rotation without one component, which the others tell.
struct RotationTrack {
  int left_out = -1;
  std::array<Track, 3> parts;
};

void PutFloat(float value, std::string* bytes) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, 4);
  for (int shift = 0; shift < 32; shift += 8) bytes->push_back(static_cast<char>(bits >> shift & 255));
}

double Press(const FilmContact& c) {
  return std::abs(double{c.impulse_W[0]} * c.normal_W[0] + double{c.impulse_W[1]} * c.normal_W[1] +
                  double{c.impulse_W[2]} * c.normal_W[2]);
}

bool Finite(std::span<const float> numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](float x) { return std::isfinite(x); });
}

class BodyBlock {
 public:
  BodyBlock(std::span<const FilmFrame> frames, double step, PageChunk* chunk) : step_(step), chunk_(*chunk) {
    const size_t n = frames[0].poses.size();
    PutVarint(frames.size(), &chunk_.bodies);
    PutVarint(n, &chunk_.bodies);
    std::string still((n + 7) / 8, '\0');
    std::vector<int> resting;
    for (size_t i = 0; i < n; ++i) {
      const bool rests = std::all_of(frames.begin(), frames.end(),
                                     [&](const FilmFrame& f) { return f.poses[i] == frames[0].poses[i]; });
      (rests ? resting : moving_).push_back(static_cast<int>(i));
      if (rests) still[i / 8] = static_cast<char>(still[i / 8] | 1 << i % 8);
    }
    chunk_.bodies += still;
    for (const int i : resting)
      for (const float part : frames[0].poses[i]) PutFloat(part, &chunk_.bodies);
    positions_.resize(3 * moving_.size());
    rotations_.resize(moving_.size());
    frozen_.assign((n + 7) / 8, 0);
    island_.assign(n, -1);
  }

  void Add(const FilmFrame& frame) {
    PutPositions(frame);
    PutRotations(frame);
    std::vector<char> frozen(frozen_.size(), 0);
    for (size_t i = 0; i < frame.frozen.size(); ++i)
      if (frame.frozen[i]) frozen[i / 8] = static_cast<char>(frozen[i / 8] | 1 << i % 8);
    for (size_t k = 0; k < frozen.size(); ++k) chunk_.bodies.push_back(static_cast<char>(frozen[k] ^ frozen_[k]));
    frozen_ = frozen;
    for (size_t i = 0; i < frame.island.size(); ++i) PutSigned(frame.island[i] - island_[i], &chunk_.bodies);
    island_ = frame.island;
    std::vector<int> accuracy;
    for (size_t i = 0; i < frame.accuracy.size(); ++i) {
      accuracy.push_back(LogCode(frame.accuracy[i], kAccuracyDecade));
      const int first = frame.island[i];
      const bool told = first >= 0 && static_cast<size_t>(first) < i;
      PutSigned(accuracy[i] - (told ? accuracy[first] : 0), &chunk_.bodies);
    }
  }

 private:
  void PutPositions(const FilmFrame& frame) {
    for (int axis = 0; axis < 3; ++axis) {
      for (size_t m = 0; m < moving_.size(); ++m) {
        const double x = frame.poses[moving_[m]][axis];
        const std::int64_t steps = Steps(x, step_);
        chunk_.position_error = std::max(chunk_.position_error, std::abs(static_cast<double>(steps) * step_ - x));
        PutSigned(positions_[3 * m + axis].Difference(steps), &chunk_.bodies);
      }
    }
  }

  void PutRotations(const FilmFrame& frame) {
    std::array<std::string, 3> parts;
    for (size_t m = 0; m < moving_.size(); ++m) {
      std::array<double, 4> q = Unit(frame.poses[moving_[m]]);
      RotationTrack& track = rotations_[m];
      if (track.left_out < 0 || std::abs(q[track.left_out]) < kSmallestPart) {
        const auto larger = [&](double a, double b) { return std::abs(a) < std::abs(b); };
        track.left_out = static_cast<int>(std::max_element(q.begin(), q.end(), larger) - q.begin());
        for (Track& part : track.parts) part.Forget();
      }
      chunk_.bodies.push_back(static_cast<char>(track.left_out));
      if (q[track.left_out] < 0)
        for (double& part : q) part = -part;
      double rest = 1, product = 0;
      for (int k = 0; k < 3; ++k) {
        const int component = k + (k >= track.left_out);
        const std::int64_t steps = Steps(q[component], kRotationStep);
        const double kept = static_cast<double>(steps) * kRotationStep;
        PutSigned(track.parts[k].Difference(steps), &parts[k]);
        rest -= kept * kept;
        product += kept * q[component];
      }
      product += std::sqrt(std::max(rest, 0.0)) * q[track.left_out];
      chunk_.rotation_error = std::max(chunk_.rotation_error, 2 * std::acos(std::min(product, 1.0)));
    }
    for (const std::string& part : parts) chunk_.bodies += part;
  }

  double step_;
  PageChunk& chunk_;
  std::vector<int> moving_;
  std::vector<Track> positions_;
  std::vector<RotationTrack> rotations_;
  std::vector<char> frozen_;
  std::vector<int> island_;
};

class ContactBlock {
 public:
  ContactBlock(const FilmHead& head, double step, size_t most, PageChunk* chunk)
      : head_(head), step_(step), most_(most), chunk_(*chunk), press_(head.bodies.size(), 0) {}

  void Add(const FilmFrame& frame) {
    const std::vector<FilmContact> kept = Choose(frame.contacts);
    PutVarint(frame.contacts.size(), &chunk_.contacts);
    PutVarint(kept.size(), &chunk_.contacts);
    if (kept.size() < frame.contacts.size()) {
      ++chunk_.frames_cut;
      PutPresses(frame);
    }
    chunk_.contacts_all += frame.contacts.size();
    chunk_.contacts_kept += kept.size();
    PutContacts(frame, kept);
  }

 private:
  // What is known of a contact, as whole numbers: point x y z, normal u v, impulse, its direction u v against the normal's.
  struct Numbers {
    int a, b;
    std::array<std::int64_t, 8> values;
  };

  std::vector<FilmContact> Choose(const std::vector<FilmContact>& contacts) const {
    std::vector<int> order(contacts.size());
    std::iota(order.begin(), order.end(), 0);
    if (order.size() > most_) {
      std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(most_), order.end(),
                       [&](int i, int j) {
                         const double pi = Press(contacts[i]), pj = Press(contacts[j]);
                         return pi != pj ? pi > pj : i < j;
                       });
      order.resize(most_);
    }
    std::sort(order.begin(), order.end(), [&](int i, int j) {
      const FilmContact &c = contacts[i], &d = contacts[j];
      return std::tie(c.body_a, c.body_b, i) < std::tie(d.body_a, d.body_b, j);
    });
    std::vector<FilmContact> chosen;
    for (const int i : order) chosen.push_back(contacts[i]);
    return chosen;
  }

  void PutPresses(const FilmFrame& frame) {
    std::vector<double> most(press_.size(), 0);
    for (const FilmContact& c : frame.contacts)
      for (const int body : {c.body_a, c.body_b}) most[body] = std::max(most[body], Press(c));
    for (size_t i = 0; i < most.size(); ++i) {
      const int code = LogCode(most[i], kPressDecade);
      PutSigned(code - press_[i], &chunk_.contacts);
      press_[i] = code;
    }
  }

  Numbers NumbersOf(const FilmFrame& frame, const FilmContact& c) const {
    const int anchor = head_.bodies[c.body_a].kind == BodyKind::kDynamic ? c.body_a : c.body_b;
    Numbers n{c.body_a, c.body_b, {}};
    for (int axis = 0; axis < 3; ++axis)
      n.values[axis] = Steps(c.point_W[axis], step_) - Steps(frame.poses[anchor][axis], step_);
    const Direction normal = OnOctahedron(c.normal_W[0], c.normal_W[1], c.normal_W[2]);
    const double x = c.impulse_W[0], y = c.impulse_W[1], z = c.impulse_W[2];
    const int size = LogCode(std::sqrt(x * x + y * y + z * z), kImpulseDecade);
    const Direction impulse = size == 0 ? normal : OnOctahedron(x, y, z);
    n.values[3] = normal.u, n.values[4] = normal.v;
    n.values[5] = size;
    n.values[6] = impulse.u - normal.u, n.values[7] = impulse.v - normal.v;
    return n;
  }

  // Differences to the contact of the same two bodies, and the same place among them, in the frame before.
  void PutContacts(const FilmFrame& frame, const std::vector<FilmContact>& kept) {
    std::array<std::string, 10> planes;
    std::vector<Numbers> numbers;
    size_t before = 0;
    int last_a = 0;
    for (const FilmContact& c : kept) {
      const Numbers n = NumbersOf(frame, c);
      while (before < before_.size() && std::tie(before_[before].a, before_[before].b) < std::tie(n.a, n.b)) ++before;
      const bool known = before < before_.size() && before_[before].a == n.a && before_[before].b == n.b;
      PutVarint(n.a - last_a, &planes[0]);
      PutSigned(n.b - n.a, &planes[1]);
      for (size_t k = 0; k < 8; ++k) PutSigned(n.values[k] - (known ? before_[before].values[k] : 0), &planes[k + 2]);
      before += known;
      last_a = n.a;
      numbers.push_back(n);
    }
    for (const std::string& plane : planes) chunk_.contacts += plane;
    before_ = std::move(numbers);
  }

  const FilmHead& head_;
  double step_;
  size_t most_;
  PageChunk& chunk_;
  std::vector<int> press_;
  std::vector<Numbers> before_;
};

}  // namespace

double PositionStep(const FilmHead& head) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const FilmBody& body : head.bodies)
    if (body.kind != BodyKind::kFixed) smallest = std::min(smallest, head.shapes[body.shape].size());
  if (!std::isfinite(smallest)) smallest = 1;
  return std::exp2(std::floor(std::log2(smallest / 4096)));
}

void CheckPageFrame(const FilmHead& head, const FilmFrame& frame) {
  const size_t n = head.bodies.size();
  const auto fail = [&](const std::string& what) {
    throw std::invalid_argument("frame " + std::to_string(frame.number) + ": " + what);
  };
  if (frame.poses.size() != n || frame.frozen.size() != n || frame.island.size() != n || frame.accuracy.size() != n)
    fail("it has not the " + std::to_string(n) + " bodies of the film");
  for (size_t i = 0; i < n; ++i) {
    const std::array<float, 7>& p = frame.poses[i];
    const bool turned = p[3] != 0 || p[4] != 0 || p[5] != 0 || p[6] != 0;
    if (!Finite(p) || !turned) fail("the pose of body " + std::to_string(i) + " is no position and rotation");
    if (frame.island[i] < -1 || frame.island[i] >= static_cast<int>(n))
      fail("the island of body " + std::to_string(i) + " is " + std::to_string(frame.island[i]));
  }
  for (const FilmContact& c : frame.contacts) {
    const auto known = [&](int body) { return body >= 0 && body < static_cast<int>(n); };
    const std::string pair = "the contact of bodies " + std::to_string(c.body_a) + " and " + std::to_string(c.body_b);
    if (!known(c.body_a) || !known(c.body_b)) fail(pair + " names a body that is not there");
    if (!Finite(c.point_W) || !Finite(c.normal_W) || !Finite(c.impulse_W))
      fail(pair + " has a number that is not finite");
  }
}

PageChunk EncodePageChunk(const FilmHead& head, std::span<const FilmFrame> frames, double position_step,
                          size_t most_contacts) {
  PageChunk chunk;
  chunk.frames = static_cast<int>(frames.size());
  BodyBlock bodies(frames, position_step, &chunk);
  ContactBlock contacts(head, position_step, most_contacts, &chunk);
  for (const FilmFrame& frame : frames) {
    bodies.Add(frame);
    contacts.Add(frame);
  }
  return chunk;
}

}  // namespace islet
