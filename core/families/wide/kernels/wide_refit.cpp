#include "core/families/wide/kernels/wide_refit.hpp"

#include "core/families/wide/kernels/node_fit.hpp"

namespace kbvh {
namespace {

template <class S, std::uint32_t width>
void refit(WideArrays<S> h, const S* positions, std::uint32_t begin, std::uint32_t end) {
  // Nodes with leaves only do not depend on other nodes. They are processed in ascending order, which suits
  // the prefetcher (1.1 to 1.25 times faster on Zen 3). The others follow, children first.
  for (std::uint32_t i = begin; i < end; ++i) {
    const WideNode& node = h.nodes[i];
    if (node.leaf_count != node.count) continue;
    fit_leaves<S, width>(h, node, positions, h.child_bounds + std::size_t(i) * 6 * width,
                         h.node_bounds + std::size_t(8) * i);
  }
  for (std::uint32_t i = end; i-- > begin;) {
    const WideNode& node = h.nodes[i];
    if (node.leaf_count == node.count) continue;
    fit_above<S, width>(h, node, positions, h.child_bounds + std::size_t(i) * 6 * width,
                        h.node_bounds + std::size_t(8) * i);
  }
}

/// Prefetches what `refit_listed` will read and write for a node: listed nodes lie anywhere, and no hardware
/// prefetcher guesses where.
template <class S, std::uint32_t width>
[[gnu::always_inline]] inline void fetch_ahead(const WideArrays<S>& h, std::uint32_t i) {
  const char* const rows = reinterpret_cast<const char*>(h.child_bounds + std::size_t(i) * 6 * width);
  for (std::size_t byte = 0; byte < 6 * width * sizeof(S); byte += 64) __builtin_prefetch(rows + byte, 1);
  __builtin_prefetch(h.node_bounds + std::size_t(8) * i, 1);
  const char* const list = reinterpret_cast<const char*>(h.vertices + h.nodes[i].list);
  __builtin_prefetch(list);
  __builtin_prefetch(list + 64);
}

template <class S, std::uint32_t width>
void refit_listed(WideArrays<S> h, const S* positions, const std::uint32_t* order, std::uint32_t count) {
  constexpr std::uint32_t ahead = 6;
  for (std::uint32_t k = 0; k < count; ++k) {
    if (k + 2 * ahead < count) __builtin_prefetch(h.nodes + order[k + 2 * ahead]);
    if (k + ahead < count) fetch_ahead<S, width>(h, order[k + ahead]);
    const std::uint32_t i = order[k];
    const WideNode& node = h.nodes[i];
    S* const rows = h.child_bounds + std::size_t(i) * 6 * width;
    S* const node_bounds = h.node_bounds + std::size_t(8) * i;
    if (node.leaf_count == node.count)
      fit_leaves<S, width>(h, node, positions, rows, node_bounds);
    else
      fit_above<S, width>(h, node, positions, rows, node_bounds);
  }
}

template <class S>
constexpr WideRefitKernels<S> table{&refit<S, 2>,        &refit<S, 4>,        &refit<S, 8>,
                                    &refit_listed<S, 2>, &refit_listed<S, 4>, &refit_listed<S, 8>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideRefitKernels<float> wide_refit_float = table<float>;
const WideRefitKernels<double> wide_refit_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
