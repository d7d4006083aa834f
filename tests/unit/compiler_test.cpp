// Optimisations that would change results (core/adr/0003-compiler-traps.md). Compiled at -O3 with the flags
// of the library.

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

namespace kbvh::test::compiler_test {
namespace {

struct Rounded {
  float centre[3];
};

/// Rounds a point to float, and measures from the rounded point.
[[gnu::noinline]] void measure(Rounded& rounded, const double* sum, const float* points, std::size_t count,
                               double* ways) {
  double centre[3];
  for (std::size_t d = 0; d < 3; ++d) centre[d] = 0.5 * sum[d] + sum[d + 3];
  for (std::size_t d = 0; d < 3; ++d) rounded.centre[d] = float(centre[d]);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t d = 0; d < 3; ++d)
      ways[3 * i + d] = double(points[3 * i + d]) - double(rounded.centre[d]);
}

TEST(Compiler, KeepsRoundingToFloatBetweenDoubles) {
  const double sum[6] = {1e-9, 2e-9, 3e-9, 1, 2, 3};
  const std::vector<float> points(6, 1);
  std::vector<double> ways(6);
  Rounded rounded;
  measure(rounded, sum, points.data(), 2, ways.data());
  for (std::size_t i = 0; i < ways.size(); ++i) EXPECT_EQ(ways[i], 0.0 - double(i % 3)) << i;
}

}  // namespace
}  // namespace kbvh::test::compiler_test
