#include "core/families/wide/kernels/bounds.hpp"

#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

/// Smallest and largest of three registers of coordinates, x, y, z, x, y, z, ... in memory order. Processes
/// as many vertices at a time as a register has lanes, without gathers.
template <class S>
struct Stride {
  static constexpr std::size_t lanes = native_lanes<S>;
  using V = Vector<S, lanes>;
  V lower[3], upper[3];

  [[gnu::always_inline]] inline void take(const S* from) {
    for (std::size_t j = 0; j < 3; ++j) {
      const V v = load_lanes<V>(from + j * lanes);
      lower[j] = smaller(v, lower[j]);
      upper[j] = larger(v, upper[j]);
    }
  }
};

template <class S>
void of_runs(const VertexRun* runs, std::size_t count, const S* positions, S* box) {
  using Long = Stride<S>;
  using P = Points<S, 1>;
  constexpr std::size_t lanes = Long::lanes;
  const S infinity = S(__builtin_inf());
  Long all;
  for (std::size_t j = 0; j < 3; ++j) {
    all.lower[j] = typename Long::V{} + infinity;
    all.upper[j] = -all.lower[j];
  }
  // Runs that are too short for a stride are processed point by point.
  auto lower = P::load(positions + std::size_t(3) * runs[0].first, positions), upper = lower;
  for (std::size_t r = 0; r < count; ++r) {
    const S* at = positions + std::size_t(3) * runs[r].first;
    const std::size_t n = runs[r].count;
    if (n < lanes) {
      for (std::size_t i = 0; i < n; ++i) {
        const auto p = P::load(at + 3 * i, positions);
        lower = smaller(lower, p);
        upper = larger(upper, p);
      }
      continue;
    }
    std::size_t i = 0;
    for (; i + lanes <= n; i += lanes) all.take(at + 3 * i);
    if (i != n) all.take(at + 3 * (n - lanes));  // the last ones again
  }
  P::store_smallest(box, lower);
  P::store_largest(box + 4, upper);
  S low[3 * lanes], high[3 * lanes];
  for (std::size_t j = 0; j < 3; ++j) {
    store_lanes(low + j * lanes, all.lower[j]);
    store_lanes(high + j * lanes, all.upper[j]);
  }
  for (std::size_t i = 0; i < 3 * lanes; ++i) {
    box[i % 3] = smaller(low[i], box[i % 3]);
    box[4 + i % 3] = larger(high[i], box[4 + i % 3]);
  }
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const BoundsKernels<float> bounds_float{&of_runs<float>};
const BoundsKernels<double> bounds_double{&of_runs<double>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
