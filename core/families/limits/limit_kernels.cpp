// Selects the table of this room's kernels.
#include "core/families/limits/kernels/limits.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

const LimitKernels& limit_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, limits);
}

}  // namespace kbvh
