// Takes a page apart again, by code of its own: what scenes/viewer/page_chunk.cpp kept, and the head.
#pragma once

#include <zlib.h>

#include <array>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace islet::page_reader {

inline std::string Between(const std::string& text, const std::string& begin, const std::string& end) {
  const size_t from = text.find(begin);
  if (from == std::string::npos) throw std::runtime_error("no " + begin);
  return text.substr(from + begin.size(), text.find(end, from + begin.size()) - from - begin.size());
}

inline std::string FromBase64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    const size_t digit = digits.find(c);
    if (digit == std::string::npos) throw std::runtime_error("no base64");
    bits = bits << 6 | static_cast<unsigned>(digit);
    if ((count += 6) < 8) continue;
    bytes.push_back(static_cast<char>(bits >> (count -= 8) & 255));
  }
  return bytes;
}

inline std::string Inflate(const std::string& packed) {
  for (size_t room = 1 << 16;; room *= 4) {
    std::string bytes(room, '\0');
    uLongf size = room;
    const int status = uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size,
                                  reinterpret_cast<const Bytef*>(packed.data()), packed.size());
    if (status == Z_BUF_ERROR) continue;
    if (status != Z_OK) throw std::runtime_error("no deflate");
    bytes.resize(size);
    return bytes;
  }
}

inline std::string Block(const std::string& page, const std::string& id) {
  return Inflate(FromBase64(Between(page, "<script type=\"text/plain\" id=\"" + id + "\">", "</script>")));
}

inline nlohmann::json Head(const std::string& page) {
  return nlohmann::json::parse(Between(page, "<script type=\"application/json\" id=\"head\">", "</script>"));
}

struct Contact {
  int a, b;
  std::array<double, 3> point, normal, impulse;
};

struct Frame {
  std::vector<std::array<double, 7>> poses;
  std::vector<bool> frozen;
  std::vector<int> island;
  std::vector<double> accuracy;
  size_t contacts_all = 0;
  std::vector<Contact> contacts;
  std::vector<double> press;  // if not all contacts are kept
};

class Reader {
 public:
  explicit Reader(std::string bytes) : bytes_(std::move(bytes)) {}
  std::uint64_t Whole() {
    std::uint64_t value = 0;
    for (int shift = 0;; shift += 7) {
      const auto byte = static_cast<unsigned char>(bytes_.at(at_++));
      value |= std::uint64_t{byte & 127u} << shift;
      if (byte < 128) return value;
    }
  }
  std::int64_t Signed() {
    const std::uint64_t value = Whole();
    return value & 1 ? -static_cast<std::int64_t>(value >> 1) - 1 : static_cast<std::int64_t>(value >> 1);
  }
  float Float() {
    float value;
    std::memcpy(&value, bytes_.substr(at_, 4).data(), 4);
    at_ += 4;
    return value;
  }
  unsigned char Byte() { return static_cast<unsigned char>(bytes_.at(at_++)); }
  bool AtEnd() const { return at_ == bytes_.size(); }

 private:
  std::string bytes_;
  size_t at_ = 0;
};

inline std::array<double, 3> Direction(double u, double v) {
  double x = u / 1023, y = v / 1023;
  const double z = 1 - std::abs(x) - std::abs(y);
  if (z < 0) {
    const double folded = (1 - std::abs(y)) * (x < 0 ? -1 : 1);
    y = (1 - std::abs(x)) * (y < 0 ? -1 : 1);
    x = folded;
  }
  const double length = std::sqrt(x * x + y * y + z * z);
  return {x / length, y / length, z / length};
}

inline double FromLog(std::int64_t code, double decade) {
  return code == 0 ? 0 : std::pow(10, static_cast<double>(code - 1) / decade - 20);
}

// A line through the last two numbers.
struct Line {
  double last = 0, before = 0;
  int seen = 0;
  double Next(std::int64_t difference) {
    const double expected = seen == 0 ? 0 : seen == 1 ? last : 2 * last - before;
    before = last;
    ++seen;
    return last = expected + static_cast<double>(difference);
  }
};

inline std::vector<Frame> ReadChunk(const std::string& page, const nlohmann::json& head, int chunk) {
  const double position_step = head["steps"]["position"], rotation_step = head["steps"]["rotation"];
  Reader in(Block(page, "bodies" + std::to_string(chunk)));
  std::vector<Frame> frames(in.Whole());
  const size_t n = in.Whole();
  std::vector<bool> still;
  for (size_t k = 0; k < (n + 7) / 8; ++k)
    for (int bits = in.Byte(), i = 0; i < 8; ++i) still.push_back(bits >> i & 1);
  std::vector<std::array<double, 7>> rest(n);
  std::vector<size_t> moving;
  for (size_t i = 0; i < n; ++i) {
    if (!still[i]) moving.push_back(i);
    for (double& part : rest[i]) part = still[i] ? double{in.Float()} : 0;
  }
  std::vector<std::array<Line, 6>> lines(n);
  std::vector<int> left_out(n, -1), island(n, -1);
  std::vector<bool> frozen(n, false);
  for (Frame& frame : frames) {
    frame.poses = rest;
    for (int axis = 0; axis < 3; ++axis)
      for (const size_t i : moving) frame.poses[i][axis] = lines[i][axis].Next(in.Signed()) * position_step;
    for (const size_t i : moving) {
      const int left = in.Byte();
      if (left != left_out[i])
        for (int k = 3; k < 6; ++k) lines[i][k].seen = 0;
      left_out[i] = left;
    }
    for (int k = 0; k < 3; ++k)
      for (const size_t i : moving)
        frame.poses[i][3 + k + (k >= left_out[i])] = lines[i][3 + k].Next(in.Signed()) * rotation_step;
    for (const size_t i : moving) {
      double square = 1;
      for (int k = 0; k < 4; ++k)
        if (k != left_out[i]) square -= frame.poses[i][3 + k] * frame.poses[i][3 + k];
      frame.poses[i][3 + left_out[i]] = std::sqrt(std::max(square, 0.0));
    }
    for (size_t k = 0; k < (n + 7) / 8; ++k)
      for (int bits = in.Byte(), i = 0; i < 8; ++i)
        if (8 * k + i < n && (bits >> i & 1)) frozen[8 * k + i] = !frozen[8 * k + i];
    frame.frozen = frozen;
    for (int& of_body : island) of_body += static_cast<int>(in.Signed());
    frame.island = island;
    std::vector<std::int64_t> codes(n);
    for (size_t i = 0; i < n; ++i) {
      const bool told = island[i] >= 0 && island[i] < static_cast<int>(i);
      codes[i] = in.Signed() + (told ? codes[island[i]] : 0);
      frame.accuracy.push_back(FromLog(codes[i], 1000));
    }
  }
  if (!in.AtEnd()) throw std::runtime_error("bytes are left over behind the bodies");

  Reader touching(Block(page, "contacts" + std::to_string(chunk)));
  std::vector<std::int64_t> press(n);
  std::vector<std::pair<std::pair<int, int>, std::array<double, 8>>> before, now;
  for (Frame& frame : frames) {
    frame.contacts_all = touching.Whole();
    frame.contacts.resize(touching.Whole());
    if (frame.contacts.size() < frame.contacts_all)
      for (std::int64_t& code : press) frame.press.push_back(FromLog(code += touching.Signed(), 40));
    now.assign(frame.contacts.size(), {});
    int last = 0;
    for (auto& [pair, values] : now) pair.first = last += static_cast<int>(touching.Whole());
    for (auto& [pair, values] : now) pair.second = pair.first + static_cast<int>(touching.Signed());
    for (int k = 0; k < 8; ++k) {
      size_t p = 0;
      for (auto& [pair, values] : now) {
        while (p < before.size() && before[p].first < pair) ++p;
        const bool known = p < before.size() && before[p].first == pair;
        values[k] = static_cast<double>(touching.Signed()) + (known ? before[p++].second[k] : 0);
      }
    }
    before = now;
    for (size_t c = 0; c < now.size(); ++c) {
      const auto& [pair, v] = now[c];
      Contact& contact = frame.contacts[c];
      contact.a = pair.first, contact.b = pair.second;
      const int anchor = head["bodies"]["kind"][contact.a] == "dynamic" ? contact.a : contact.b;
      for (int k = 0; k < 3; ++k)
        contact.point[k] = (std::floor(frame.poses[anchor][k] / position_step + 0.5) + v[k]) * position_step;
      contact.normal = Direction(v[3], v[4]);
      contact.impulse = Direction(v[3] + v[6], v[4] + v[7]);
      for (double& part : contact.impulse) part *= FromLog(static_cast<std::int64_t>(v[5]), 400);
    }
  }
  if (!touching.AtEnd()) throw std::runtime_error("bytes are left over behind the contacts");
  return frames;
}

}  // namespace islet::page_reader
