#pragma once
#include <array>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "core/scene/scene.hpp"
#include "tests/support/random.hpp"

namespace kbvh::test {

/// Input of a builder: primitives, and the positions [vertex][3] of their vertices, one scalar past the end.
template <class S>
struct BuilderInput {
  std::string name;
  Primitives primitives;
  std::vector<S> positions;

  /// Adds a polygon with vertices of its own.
  void add(std::initializer_list<std::array<double, 3>> corners) {
    std::vector<std::uint32_t> ids;
    for (const auto& corner : corners) {
      ids.push_back(std::uint32_t(positions.size() / 3));
      for (const double x : corner) positions.push_back(S(x));
    }
    primitives.add(ids);
  }
};

/// Small triangles at random places in a box of the given lengths.
template <class S>
BuilderInput<S> random_triangles(const char* name, std::uint32_t count, double x, double y, double z,
                                 std::uint64_t seed) {
  BuilderInput<S> input{name, {}, {}};
  Random random(seed);
  for (std::uint32_t i = 0; i < count; ++i) {
    const double at[3] = {x * random.unit(), y * random.unit(), z * random.unit()};
    const auto near = [&](int axis) { return at[axis] + 0.01 * random.unit(); };
    input.add({{near(0), near(1), near(2)}, {near(0), near(1), near(2)}, {near(0), near(1), near(2)}});
  }
  return input;
}

}  // namespace kbvh::test
