#include "core/families/wide/kernels/leaf_rows.hpp"

#include "core/families/wide/kernels/leaf_fit.hpp"

namespace kbvh {
namespace {

template <class S, std::size_t padded>
void fit_listed(const WideLeaves<S>& leaves, const std::uint32_t* list, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    fit_leaf<S, padded>(leaves.lists, list[i], leaves.positions,
                        leaves.rows + std::size_t(list[i]) * 6 * padded);
}

template <class S>
constexpr LeafRowsKernels<S> table{{&fit_listed<S, 4>, &fit_listed<S, 8>, &fit_listed<S, 16>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const LeafRowsKernels<float> leaf_rows_float = table<float>;
const LeafRowsKernels<double> leaf_rows_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
