// Bytes made small and made text: deflate as in RFC 1950 (zlib's format), base64 as in RFC 4648. The only file that knows zlib.
//
//   errors: std::runtime_error if memory runs out     threads: pure functions
#pragma once

#include <string>
#include <string_view>

namespace islet {

std::string Deflate(std::string_view bytes);
std::string Base64(std::string_view bytes);

}  // namespace islet
