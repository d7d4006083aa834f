// Selects the tables of this room's kernels.
#include "core/families/drift/kernels/near_pairs.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(NearKernels, near_kernels, near)

}  // namespace kbvh
