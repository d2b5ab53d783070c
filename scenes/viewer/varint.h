// Whole numbers as bytes: seven bits a byte, the lowest first; signed ones with the sign in the lowest bit.
//
//   in: numbers up to 2^53 in size, which the page's reader holds exactly     out: bytes at the end of a string
//   threads: pure functions of their arguments
#pragma once

#include <cstdint>
#include <string>

namespace islet {

inline void PutVarint(std::uint64_t value, std::string* bytes) {
  for (; value >= 128; value >>= 7) bytes->push_back(static_cast<char>((value & 127) | 128));
  bytes->push_back(static_cast<char>(value));
}

inline void PutSigned(std::int64_t value, std::string* bytes) {
  PutVarint(value < 0 ? ~(static_cast<std::uint64_t>(value) << 1) : static_cast<std::uint64_t>(value) << 1, bytes);
}

}  // namespace islet
