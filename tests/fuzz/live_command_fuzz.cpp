// Bytes of anybody as a message to a live run: it is read or refused, what is read is within bounds, and a refusal is short.
//   built as fuzz_live (live_fuzz.cpp), which does what these ask; as -dict=tests/fuzz/live.dict -max_len=5000 -malloc_limit_mb=100 -timeout=1
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "scenes/live/command.h"

namespace {

void Require(bool right) {
  if (!right) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const islet::LiveCommand command = islet::ParseCommand({reinterpret_cast<const char*>(data), size});
    Require(size <= islet::kLongestCommand);
    Require(command.from.cwiseAbs().maxCoeff() <= 1e6 && command.vector.cwiseAbs().maxCoeff() <= 1e6);
    Require(command.radius > 0 && command.density > 0 && command.value >= 0 && command.body >= -1);
    Require(std::isfinite(command.radius) && std::isfinite(command.density) && std::isfinite(command.value));
  } catch (const std::invalid_argument& error) {
    Require(std::strlen(error.what()) < 300);  // a few words and what it quotes
  }
  return 0;
}
