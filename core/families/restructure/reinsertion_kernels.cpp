// Selects the tables of this room's kernels.
#include "core/families/restructure/kernels/reinsertion.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(ReinsertionKernels, reinsertion_kernels, reinsertion)

}  // namespace kbvh
