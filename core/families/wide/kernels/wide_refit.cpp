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

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideRefitKernels<float> wide_refit_float{&refit<float, 2>, &refit<float, 4>, &refit<float, 8>};
const WideRefitKernels<double> wide_refit_double{&refit<double, 2>, &refit<double, 4>, &refit<double, 8>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
