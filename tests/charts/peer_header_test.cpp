// Simbody's headers do not compile as C++20: its adaptor is C++17, and so must be all that bench/peers/peer.h includes. It is
// compiled as such here, since the tests build no adaptor.
#include "bench/peers/peer.h"

#include <gtest/gtest.h>

static_assert(__cplusplus < 202002L);

namespace islet::testing {
namespace {

TEST(PeerHeader, DefaultsAreOfAPeerAtRest) {
  const peers::BodyPlan body;
  EXPECT_EQ(body.start.linear_velocity_W, Vector3::Zero());
  EXPECT_EQ(body.mass, 1);
  EXPECT_EQ(peers::Setting{}.threads, 1);
}

}  // namespace
}  // namespace islet::testing
