// Selects the tables of this room's kernels.
#include "core/families/envelope/kernels/wide_realisers.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

template <>
const WideRealiserKernels<float>& wide_realiser_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_realisers_float);
}
template <>
const WideRealiserKernels<double>& wide_realiser_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_realisers_double);
}

}  // namespace kbvh
