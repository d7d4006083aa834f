#include "core/families/events/kernels/row_scan.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

template <class S>
[[gnu::always_inline]] inline std::size_t scan(const S* above, const S* below, std::size_t from,
                                               std::size_t end) {
  constexpr std::size_t lanes = native_lanes<S>;
  static_assert(lanes <= row_padding);
  using V = Vector<S, lanes>;
  for (std::size_t i = from; i < end; i += lanes) {
    const unsigned bits = mask_bits(load_lanes<V>(above + i) > load_lanes<V>(below + i));
    if (bits == 0) continue;
    const std::size_t found = i + std::size_t(__builtin_ctz(bits));
    return found < end ? found : end;
  }
  return end;
}

template <class S>
std::size_t first_above(const S* a, const S* b, std::size_t from, std::size_t end) {
  return scan(a, b, from, end);
}

template <class S, int upper>
RowAhead next_ahead(RowTable<S> rows, const std::uint32_t* vertices, std::size_t first, std::size_t count,
                    const S* winner, std::size_t from, std::size_t end) {
  constexpr std::size_t fetched_ahead = 6;
  for (std::size_t i = first; i < count; ++i) {
    if (i + fetched_ahead < count)
      __builtin_prefetch(rows.values + vertices[i + fetched_ahead] * rows.stride + from);
    const S* const row = rows.values + vertices[i] * rows.stride;
    const std::size_t at = upper == 1 ? scan(row, winner, from, end) : scan(winner, row, from, end);
    if (at < end) return {i, at};
  }
  return {count, end};
}

std::uint32_t occurrences(const std::uint32_t* vertices, std::size_t count, std::uint32_t vertex) {
  std::uint32_t found = 0;
  for (std::size_t i = 0; i < count; ++i) found += vertices[i] == vertex ? 1U : 0U;
  return found;
}

template <class S>
constexpr RowScanKernels<S> table{&first_above<S>, {&next_ahead<S, 0>, &next_ahead<S, 1>}, &occurrences};

}  // namespace

namespace kernels::KBVH_KERNELS {
const RowScanKernels<float> row_scan_float = table<float>;
const RowScanKernels<double> row_scan_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
