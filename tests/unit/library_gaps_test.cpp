// The replacements for missing parts of the library behave like the originals.

#include "core/base/library_gaps.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace kbvh::test {
namespace {

template <class T>
void expect_the_same_number(const std::string& text) {
  const char *first = text.data(), *last = first + text.size();
  T expected = 77, found = 77;
  const auto std_result = std::from_chars(first, last, expected);
  const auto own_result = detail::from_chars_by_c(first, last, found);
  EXPECT_EQ(own_result.ptr - first, std_result.ptr - first) << "'" << text << "'";
  EXPECT_EQ(own_result.ec, std_result.ec) << "'" << text << "'";
  EXPECT_TRUE(found == expected || (found != found && expected != expected)) << "'" << text << "'";
}

double any_double(std::mt19937_64& random) {
  const std::uint64_t bits = random();
  double number;
  std::memcpy(&number, &bits, sizeof number);
  return number;
}

TEST(LibraryGaps, NumbersAreReadAsByFromChars) {
  for (const char* text : {"0",
                           "-0",
                           "1",
                           "-1.5",
                           "1e3",
                           "1e",
                           "1e+",
                           "1.e2",
                           ".5",
                           "-.5",
                           ".",
                           "-",
                           "",
                           "+1",
                           " 1",
                           "1 ",
                           "0x10",
                           "-0x1p3",
                           "0X",
                           "00012",
                           "1e400",
                           "-1e400",
                           "1e-400",
                           "4.9e-324",
                           "2.2250738585072011e-308",
                           "1e-320",
                           "inf",
                           "-inf",
                           "infinity",
                           "INF",
                           "nan",
                           "-nan",
                           "nano",
                           "i",
                           "n",
                           "--1",
                           "1.7976931348623157e308",
                           "1,5",
                           "12abc",
                           "0.1000000000000000055511151231257827021181583404541015625"}) {
    expect_the_same_number<double>(text);
    expect_the_same_number<long double>(text);
    expect_the_same_number<float>(text);
  }
  std::mt19937_64 random(3);
  for (int i = 0; i < 5000; ++i) {
    char text[64];
    std::snprintf(text, sizeof text, "%.*g", 1 + i % 25, any_double(random));
    expect_the_same_number<double>(text);
  }
}

TEST(LibraryGaps, NumbersAreWrittenAsByToChars) {
  std::mt19937_64 random(4);
  std::vector<double> numbers{0.0,
                              -0.0,
                              1,
                              -1,
                              0.1,
                              1000,
                              10000,
                              100000,
                              1e15,
                              1e21,
                              1e22,
                              123456,
                              1e-4,
                              1e-5,
                              0.00012345,
                              std::numeric_limits<double>::max(),
                              std::numeric_limits<double>::denorm_min(),
                              1.0 / 3,
                              std::numeric_limits<double>::infinity(),
                              65536.5,
                              299792458,
                              1.5e300,
                              9007199254740993.0};
  for (int i = 0; i < 3000; ++i) {
    numbers.push_back(any_double(random));
    numbers.push_back(double(std::int64_t(random()) >> (i % 60)) / double(1 + i % 17));
  }
  for (const double number : numbers) {
    char text[64];
    const std::string expected(text, std::to_chars(text, text + sizeof text, number).ptr);
    EXPECT_EQ(detail::to_chars_by_c(number), expected);
  }
}

TEST(LibraryGaps, BitsAreKept) {
  static_assert(bit_cast<std::uint64_t>(1.0) == 0x3ff0000000000000);
  EXPECT_EQ(bit_cast<float>(0x40490fdbU), 3.14159274F);
}

}  // namespace
}  // namespace kbvh::test
