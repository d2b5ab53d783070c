// What a contact gave halfway, as it lies at the end of a piece.
#include "engine/motion/lever.h"

#include <gtest/gtest.h>

#include "engine/contact.h"
#include "engine/linear_algebra.h"

namespace islet::motion {
namespace {

// On level ground, pressed by 2 N s at mu = 0.3, of a body of 1 kg: friction of 0.6 N s may begin or end a slip of 0.6 m/s.
TEST(TurnedAlong, TurnsWhatSlidAllTheWayAlone) {
  Contact contact;
  contact.normal_W = Vector3::UnitZ();
  contact.friction = 0.3;
  const Vector3 impulse(-0.6, 0, 2);
  for (const double speed : {1e-12, 1e-4, 0.5})
    EXPECT_EQ(TurnedAlong(contact, contact, impulse, speed * Vector3(1, 0.2, 0), 1), impulse) << speed;
  const Vector3 slip(2, 0.4, 0);
  EXPECT_LT((TurnedAlong(contact, contact, impulse, slip, 1) - Vector3(0, 0, 2) + 0.6 * slip.normalized()).norm(),
            1e-15);
  EXPECT_EQ(TurnedAlong(contact, contact, impulse, -slip, 1), impulse);             // it would drive
  EXPECT_EQ(TurnedAlong(contact, contact, impulse, Vector3(1, 1, 0), 1), impulse);  // another direction
  EXPECT_EQ(TurnedAlong(contact, contact, 0.5 * impulse + Vector3(0, 0, 1), slip, 1), 0.5 * impulse + Vector3(0, 0, 1));
}

}  // namespace
}  // namespace islet::motion
