// Selects the tables of this room's kernels.
#include "core/families/drift/kernels/near_pairs.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

template <>
const NearKernels<float>& near_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, near_float);
}
template <>
const NearKernels<double>& near_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, near_double);
}

}  // namespace kbvh
