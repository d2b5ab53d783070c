#include "scenes/film/frame_code.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <unordered_map>
#include <vector>

namespace islet {
namespace {

static_assert(std::endian::native == std::endian::little);

using Word = std::uint32_t;

constexpr int kPoseWords = 7, kBodyWords = 9, kContactWords = 11;
constexpr int kMostUnsolved = (1 << 30) - 2;  // that a frame can tell
constexpr size_t kFixedBytes = 3 * 4 + 8 + 8 + 8 * 4 + 15 * 8;

[[noreturn]] void Refuse(const std::string& what, const std::string& rule) {
  throw std::invalid_argument(what + " " + rule);
}

void RequireFinite(const char* what, double value) {
  if (!std::isfinite(value)) Refuse(what, std::isnan(value) ? "is not a number" : "is infinite");
}

// Numbers of the frame as a whole, in the order of the layout.
template <typename Numbers, typename Integer, typename Real>
void VisitNumbers(Numbers& n, const Integer& integer, const Real& real) {
  integer("contacts", n.contacts), integer("islands", n.islands), integer("awake", n.awake);
  integer("frozen", n.frozen), integer("sides_changed", n.sides_changed), integer("overlapping", n.overlapping);
  integer("missed", n.missed);
  real("step_seconds", n.step_seconds);
  real("detect", n.stages.detect), real("islands", n.stages.islands), real("pq", n.stages.pq);
  real("collision_qp", n.stages.collision_qp), real("static_qp", n.stages.static_qp);
  real("freeze", n.stages.freeze), real("move", n.stages.move);
  real("kinetic", n.kinetic), real("potential", n.potential), real("coulomb_map", n.coulomb_map);
  real("penetration", n.penetration), real("energy_created", n.energy_created);
  real("momentum_unexplained", n.momentum_unexplained);
  real("angular_momentum_unexplained", n.angular_momentum_unexplained);
}

class Writer {
 public:
  explicit Writer(size_t size) { bytes_.reserve(size); }
  template <typename T>
  void Put(const T& value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void Column(const std::vector<Word>& words) {
    bytes_.resize(bytes_.size() + 4 * words.size());
    char* at = bytes_.data() + bytes_.size() - 4 * words.size();
    for (int shift = 0; shift < 32; shift += 8)
      for (const Word word : words) *at++ = static_cast<char>(word >> shift);
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class Reader {  // the size was checked before
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  template <typename T>
  T Get() {
    T value;
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return value;
  }
  void Column(std::vector<Word>* words) {
    std::fill(words->begin(), words->end(), 0);
    for (int shift = 0; shift < 32; shift += 8) {
      for (size_t i = 0; i < words->size(); ++i)
        (*words)[i] |= static_cast<Word>(static_cast<unsigned char>(bytes_[i])) << shift;
      bytes_.remove_prefix(words->size());
    }
  }

 private:
  std::string_view bytes_;
};

void Check(const FilmFrame& frame, const FilmFrame* before, size_t bodies) {
  if (frame.poses.size() != bodies || frame.frozen.size() != bodies || frame.island.size() != bodies ||
      frame.accuracy.size() != bodies)
    Refuse("the frame", "does not have the " + std::to_string(bodies) + " bodies of the head");
  if (frame.number < 0 || (before && frame.number <= before->number))
    Refuse("number", "must grow from frame to frame, got " + std::to_string(frame.number));
  RequireFinite("time", frame.time);
  if (before && !(frame.time > before->time))
    Refuse("time", "must grow from frame to frame, got " + std::to_string(frame.time));
  const auto integer = [](const char* what, int value) {
    if (value < 0) Refuse(what, "must not be negative, got " + std::to_string(value));
  };
  VisitNumbers(frame.numbers, integer, RequireFinite);
  if (frame.numbers.unsolved < -1 || frame.numbers.unsolved > kMostUnsolved)
    Refuse("unsolved", "is out of range, got " + std::to_string(frame.numbers.unsolved));
  for (const std::array<float, 7>& pose : frame.poses) {
    for (const float value : pose) RequireFinite("a pose", value);
    if (pose[3] == 0 && pose[4] == 0 && pose[5] == 0 && pose[6] == 0) Refuse("a rotation", "is zero");
  }
  const int count = static_cast<int>(bodies);
  for (const std::uint8_t frozen : frame.frozen)
    if (frozen > 1) Refuse("frozen", "must be 0 or 1, got " + std::to_string(frozen));
  for (const int island : frame.island)
    if (island < -1 || island >= count) Refuse("island", "must be a body or -1, got " + std::to_string(island));
  for (const float accuracy : frame.accuracy) RequireFinite("accuracy", accuracy);
  if (frame.contacts.size() > kMostFrameContacts)
    Refuse("contacts", "must be at most " + std::to_string(kMostFrameContacts));
  for (const FilmContact& c : frame.contacts) {
    if (c.body_a < 0 || c.body_a >= count || c.body_b < 0 || c.body_b >= count)
      Refuse("a contact",
             "is of bodies that are not there: " + std::to_string(c.body_a) + ", " + std::to_string(c.body_b));
    for (int k = 0; k < 3; ++k) {
      RequireFinite("the point of a contact", c.point_W[k]);
      RequireFinite("the normal of a contact", c.normal_W[k]);
      RequireFinite("the impulse of a contact", c.impulse_W[k]);
    }
  }
}

std::uint64_t PairOf(const FilmContact& c) {
  return std::uint64_t{static_cast<Word>(c.body_a)} << 32 | static_cast<Word>(c.body_b);
}

// For each contact the one of the same bodies in the frame before, and as many before it with them; or one of zeros.
std::vector<const FilmContact*> SameBefore(const std::vector<FilmContact>& contacts, const FilmFrame* frame_before) {
  static const FilmContact kNone;
  static const std::vector<FilmContact> kNothing;
  const std::vector<FilmContact>& before = frame_before ? frame_before->contacts : kNothing;
  std::unordered_map<std::uint64_t, size_t> next;  // of a pair: where its next contact is
  next.reserve(before.size());
  for (size_t i = before.size(); i-- > 0;) next[PairOf(before[i])] = i;  // the first stays
  std::vector<const FilmContact*> same(contacts.size(), &kNone);
  for (size_t i = 0; i < contacts.size(); ++i) {
    const auto place = next.find(PairOf(contacts[i]));
    if (place == next.end() || place->second >= before.size() || PairOf(before[place->second]) != place->first)
      continue;
    same[i] = &before[place->second++];
  }
  return same;
}

constexpr int kNormal = 3, kImpulse = 6, kContactParts = 9;

template <typename Contact>
auto& PartOf(Contact& c, int part) {
  return part < kNormal ? c.point_W[part] : part < kImpulse ? c.normal_W[part - kNormal] : c.impulse_W[part - kImpulse];
}

// What a part is told against.
Word Expected(const std::vector<FilmContact>& contacts, const std::vector<const FilmContact*>& same, size_t i,
              int part) {
  const bool of_face = part >= kNormal && part < kImpulse && i > 0 && PairOf(contacts[i]) == PairOf(contacts[i - 1]);
  return std::bit_cast<Word>(PartOf(of_face ? contacts[i - 1] : *same[i], part));
}

// Of a body, by column: pose, island, accuracy.
Word BodyWord(const FilmFrame* frame, int column, size_t body) {
  if (!frame) return 0;
  if (column < kPoseWords) return std::bit_cast<Word>(frame->poses[body][column]);
  return column == kPoseWords ? static_cast<Word>(frame->island[body]) : std::bit_cast<Word>(frame->accuracy[body]);
}

void SetBodyWord(FilmFrame* frame, int column, size_t body, Word word) {
  if (column < kPoseWords) frame->poses[body][column] = std::bit_cast<float>(word);
  if (column == kPoseWords) frame->island[body] = static_cast<int>(word);
  if (column > kPoseWords) frame->accuracy[body] = std::bit_cast<float>(word);
}

}  // namespace

std::uint64_t FrameBytes(size_t bodies, size_t contacts) {
  return kFixedBytes + bodies * (4 * kBodyWords + 1) + contacts * 4 * kContactWords;
}

std::string EncodeFrame(const FilmFrame& frame, const FilmFrame* before, size_t bodies) {
  Check(frame, before, bodies);
  Writer writer(FrameBytes(bodies, frame.contacts.size()));
  writer.Put(static_cast<Word>(frame.number));
  writer.Put(static_cast<Word>(frame.contacts.size()));
  writer.Put(static_cast<Word>(bodies));
  writer.Put(frame.time);
  writer.Put(frame.state_hash);
  VisitNumbers(
      frame.numbers, [&](const char*, int value) { writer.Put(value); }, [](const char*, double) {});
  writer.Put(2 * (frame.numbers.unsolved + 1) + static_cast<int>(frame.numbers.failed));
  VisitNumbers(
      frame.numbers, [](const char*, int) {}, [&](const char*, double value) { writer.Put(value); });

  std::vector<Word> words(bodies);
  for (int column = 0; column < kBodyWords; ++column) {
    for (size_t i = 0; i < bodies; ++i) words[i] = BodyWord(&frame, column, i) ^ BodyWord(before, column, i);
    writer.Column(words);
  }
  for (const std::uint8_t frozen : frame.frozen) writer.Put(frozen);

  const std::vector<FilmContact>& contacts = frame.contacts;
  words.resize(contacts.size());
  for (size_t i = 0; i < contacts.size(); ++i)
    words[i] = static_cast<Word>(contacts[i].body_a) - static_cast<Word>(i ? contacts[i - 1].body_a : 0);
  writer.Column(words);
  for (size_t i = 0; i < contacts.size(); ++i)
    words[i] = static_cast<Word>(contacts[i].body_b) - static_cast<Word>(i ? contacts[i - 1].body_b : 0);
  writer.Column(words);
  const std::vector<const FilmContact*> same = SameBefore(contacts, before);
  for (int part = 0; part < kContactParts; ++part) {
    for (size_t i = 0; i < contacts.size(); ++i)
      words[i] = std::bit_cast<Word>(PartOf(contacts[i], part)) ^ Expected(contacts, same, i, part);
    writer.Column(words);
  }
  return writer.Take();
}

FilmFrame DecodeFrame(std::string_view bytes, const FilmFrame* before, size_t bodies) {
  if (bytes.size() < kFixedBytes) Refuse("the frame", "has only " + std::to_string(bytes.size()) + " bytes");
  Reader reader(bytes);
  FilmFrame frame;
  const Word number = reader.Get<Word>(), num_contacts = reader.Get<Word>(), num_bodies = reader.Get<Word>();
  if (number > static_cast<Word>(std::numeric_limits<int>::max())) Refuse("number", "is too large");
  if (num_bodies != bodies)
    Refuse("the frame", "has " + std::to_string(num_bodies) + " bodies, the head has " + std::to_string(bodies));
  if (bytes.size() != FrameBytes(bodies, num_contacts))
    Refuse("the frame", "has " + std::to_string(bytes.size()) + " bytes, which " + std::to_string(num_contacts) +
                            " contacts of " + std::to_string(bodies) + " bodies do not make");
  frame.number = static_cast<int>(number);
  frame.time = reader.Get<double>();
  frame.state_hash = reader.Get<std::uint64_t>();
  VisitNumbers(
      frame.numbers, [&](const char*, int& value) { value = reader.Get<int>(); }, [](const char*, double&) {});
  const int failed = reader.Get<int>();
  if (failed < 0) Refuse("failed", "must not be negative, got " + std::to_string(failed));
  frame.numbers.failed = failed % 2 == 1;
  frame.numbers.unsolved = failed / 2 - 1;
  VisitNumbers(
      frame.numbers, [](const char*, int&) {}, [&](const char*, double& value) { value = reader.Get<double>(); });

  frame.poses.resize(bodies);
  frame.island.resize(bodies);
  frame.accuracy.resize(bodies);
  std::vector<Word> words(bodies);
  for (int column = 0; column < kBodyWords; ++column) {
    reader.Column(&words);
    for (size_t i = 0; i < bodies; ++i) SetBodyWord(&frame, column, i, words[i] ^ BodyWord(before, column, i));
  }
  for (size_t i = 0; i < bodies; ++i) frame.frozen.push_back(reader.Get<std::uint8_t>());

  std::vector<FilmContact>& contacts = frame.contacts;
  contacts.resize(num_contacts);
  words.resize(num_contacts);
  reader.Column(&words);
  for (Word i = 0, body = 0; i < num_contacts; ++i) contacts[i].body_a = static_cast<int>(body += words[i]);
  reader.Column(&words);
  for (Word i = 0, body = 0; i < num_contacts; ++i) contacts[i].body_b = static_cast<int>(body += words[i]);
  const std::vector<const FilmContact*> same = SameBefore(contacts, before);
  for (int part = 0; part < kContactParts; ++part) {
    reader.Column(&words);
    for (size_t i = 0; i < contacts.size(); ++i)
      PartOf(contacts[i], part) = std::bit_cast<float>(words[i] ^ Expected(contacts, same, i, part));
  }
  Check(frame, before, bodies);
  return frame;
}

}  // namespace islet
