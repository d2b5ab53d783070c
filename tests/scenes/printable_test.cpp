// Text of others in messages: nothing of it steers a terminal, and it is UTF-8.
#include "scenes/printable.h"

#include <gtest/gtest.h>

namespace islet {
namespace {

TEST(Printable, LeavesText) {
  for (const char* const text : {"", "a scene", "Tür", "日本語", "\U0001f600", "\xc2\xa0"})
    EXPECT_EQ(Printable(text), text);
}

TEST(Printable, ControlCharactersAreGone) {
  EXPECT_EQ(Printable("a\x1b[2J\r\n\tb\x7f"), "a?[2J???b?");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m\xc2\x80"),
            "?31m?");
  EXPECT_EQ(Printable(std::string("a\0b", 3)), "a?b");
}

TEST(Printable, WhatIsNoUtf8IsGone) {
  EXPECT_EQ(Printable("\x9b"
                      "31m\xff"),
            "?31m?");
  EXPECT_EQ(Printable("a\xc3"), "a?");
  EXPECT_EQ(Printable("a\xe6\x97"), "a??");
  EXPECT_EQ(Printable("\xc1\x9b \xe0\x82\x9b"), "?? ???");  // longer than they need be
  EXPECT_EQ(Printable("\xed\xa0\x80"), "???");
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "????");
  EXPECT_EQ(Printable("\xc3\xc3\xa4"), "?ä");
}

}  // namespace
}  // namespace islet
