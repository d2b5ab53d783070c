// Simbody's headers do not compile as C++20, so its adaptor is C++17, and so must be all that bench/peers/peer.h includes. It is
// compiled as such here; in the last change that broke it nothing noticed but the charts, which are not built with the tests.
#include "bench/peers/peer.h"

#include <gtest/gtest.h>

static_assert(__cplusplus < 202002L);

namespace islet::testing {
namespace {

TEST(PeerHeader, IsCxx17) { EXPECT_FALSE(peers::Setting{}.name.size() > 1000); }

}  // namespace
}  // namespace islet::testing
