#include "scenes/seconds_option.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace islet {
namespace {

double Seconds(const char* text) { return ParseSeconds("--dt", text); }

TEST(SecondsOption, DecimalsAreTheNearestDouble) {
  EXPECT_EQ(Seconds("0.1"), 0.1);
  EXPECT_EQ(Seconds("1e-3"), 1e-3);
  EXPECT_EQ(Seconds(".5"), 0.5);
  EXPECT_EQ(Seconds("2"), 2.0);
  EXPECT_EQ(Seconds("-0.25"), -0.25);
}

TEST(SecondsOption, FractionsAreRoundedOnce) {
  EXPECT_EQ(Seconds("1/30"), 1.0 / 30);
  EXPECT_EQ(Seconds("-1/30"), -1.0 / 30);
  EXPECT_EQ(Seconds("0/5"), 0.0);
  // Rounded once: 0.3 / 0.1 of two rounded doubles is not 3.
  EXPECT_NE(0.3 / 0.1, 3.0);
  EXPECT_EQ(Seconds("0.3/0.1"), 3.0);
  EXPECT_EQ(Seconds("1e-3/3"), 1.0 / 3000);
  EXPECT_EQ(Seconds("1/3e2"), 1.0 / 300);
  EXPECT_EQ(Seconds("1.5e+2/4.50"), 150 / 4.5);
}

TEST(SecondsOption, AnythingElseIsNamed) {
  for (const char* const text : {"",
                                 "nan",
                                 "inf",
                                 "-inf",
                                 "-nan",
                                 "x",
                                 "0.1s",
                                 " 1",
                                 "1 ",
                                 "0x10",
                                 "1/",
                                 "/30",
                                 "1//30",
                                 "1/30/2",
                                 "1/-30",
                                 "1/nan",
                                 "nan/1",
                                 "--1",
                                 "+1",
                                 "1e",
                                 "1e999",
                                 ".",
                                 "-",
                                 "1/0",
                                 "1/0.00",
                                 "-1/0",
                                 "1/1e99999",
                                 "12345678901234567890/7",
                                 "1e300/1e-300"}) {
    try {
      Seconds(text);
      ADD_FAILURE() << "taken: " << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(std::string("--dt: ")), std::string::npos);
      EXPECT_NE(std::string(error.what()).find(std::string("got ") + text), std::string::npos) << error.what();
    }
  }
}

TEST(SecondsOption, DivisionByZeroIsCalledThat) {
  EXPECT_THROW(
      {
        try {
          Seconds("1/0");
        } catch (const std::invalid_argument& error) {
          EXPECT_STREQ(error.what(), "--dt: divides by zero; got 1/0");
          throw;
        }
      },
      std::invalid_argument);
}

}  // namespace
}  // namespace islet
