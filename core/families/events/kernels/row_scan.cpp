#include "core/families/events/kernels/row_scan.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

template <class S>
std::size_t first_above(const S* a, const S* b, std::size_t from, std::size_t end) {
  constexpr std::size_t lanes = native_lanes<S>;
  static_assert(lanes <= row_padding);
  using V = Vector<S, lanes>;
  for (std::size_t i = from; i < end; i += lanes) {
    const unsigned above = mask_bits(load_lanes<V>(a + i) > load_lanes<V>(b + i));
    if (above == 0) continue;
    const std::size_t found = i + std::size_t(__builtin_ctz(above));
    return found < end ? found : end;
  }
  return end;
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const RowScanKernels<float> row_scan_float{&first_above<float>};
const RowScanKernels<double> row_scan_double{&first_above<double>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
