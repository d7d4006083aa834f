// The approximations of positions and boxes, with every set of kernels, against plain arithmetic.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/families/wide/kernels/reduce.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {
namespace {

/// Rounds through the mantissa as an integer: to nearest, ties to even, or down.
template <class S>
S with_digits(S x, int digits, bool down) {
  if (x == 0 || !std::isfinite(x)) return x;
  int exponent = 0;
  const S scaled = std::ldexp(std::frexp(x, &exponent), digits);
  return std::ldexp(down ? std::floor(scaled) : std::nearbyint(scaled), exponent - digits);
}

template <class S>
std::vector<S> numbers() {
  std::vector<S> found{S(0),
                       S(-0.0),
                       S(1),
                       S(-1),
                       std::nextafter(S(2), S(0)),
                       std::nextafter(S(-2), S(0)),
                       S(1.5),
                       S(1) + S(1) / 256,  // ties of 8 digits
                       S(1) + S(3) / 256,
                       -S(1) - S(1) / 256,
                       S(1e30),
                       S(-1e30),
                       std::numeric_limits<S>::infinity()};
  std::uint64_t state = 3;
  for (int i = 0; i < 200; ++i) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    const double unit = double(state >> 11) / 9007199254740992.0 - 0.5;
    found.push_back(S(std::ldexp(unit, int(state % 60) - 30)));
  }
  return found;
}

template <class S>
void expect_roundings(KernelSet set) {
  constexpr int all = std::numeric_limits<S>::digits;
  const std::vector<S> values = numbers<S>();
  for (const int digits : {8, 24, all - 1}) {
    if (digits >= all) continue;
    // Every remainder of a register, and no number beyond the count.
    for (const std::size_t count : {values.size() - 1, std::size_t(1), std::size_t(3), std::size_t(17)}) {
      std::vector<S> nearest = values, down = values;
      reduce_kernels<S>(set).nearest(nearest.data(), count, unsigned(all - digits));
      reduce_kernels<S>(set).down(down.data(), count, unsigned(all - digits));
      for (std::size_t i = 0; i < values.size(); ++i) {
        const S x = values[i];
        EXPECT_EQ(nearest[i], i < count ? with_digits(x, digits, false) : x)
            << x << ", " << digits << " digits";
        EXPECT_EQ(down[i], i < count ? with_digits(x, digits, true) : x) << x << ", " << digits << " digits";
        EXPECT_LE(down[i], x);
        EXPECT_EQ(std::signbit(nearest[i]), std::signbit(x));
      }
    }
  }
}

template <class S>
void expect_arithmetic(KernelSet set) {
  std::vector<S> from = numbers<S>();
  std::erase_if(from, [](S x) { return !std::isfinite(x); });
  std::vector<S> to = from, out(from.size(), S(7)), rows = from;
  std::reverse(to.begin(), to.end());
  const std::size_t count = from.size() - 1;
  const S u = S(0.3);
  reduce_kernels<S>(set).interpolate(from.data(), to.data(), u, out.data(), count);
  reduce_kernels<S>(set).widen(rows.data(), count, S(0.1));
  EXPECT_EQ(out.back(), S(7));
  EXPECT_EQ(rows.back(), from.back());
  for (std::size_t i = 0; i < count; ++i) {
    const S step = u * (to[i] - from[i]);
    EXPECT_EQ(out[i], from[i] + step);
    EXPECT_EQ(rows[i], from[i] - S(0.1));
  }
}

TEST(Reduce, RoundsAsItSays) {
  for (const KernelSet set : supported_kernel_sets()) {
    SCOPED_TRACE(name(set));
    expect_roundings<float>(set);
    expect_roundings<double>(set);
  }
}
TEST(Reduce, ComputesAsItSays) {
  for (const KernelSet set : supported_kernel_sets()) {
    SCOPED_TRACE(name(set));
    expect_arithmetic<float>(set);
    expect_arithmetic<double>(set);
  }
}

}  // namespace
}  // namespace kbvh
