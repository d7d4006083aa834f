// Selects the tables of this room's kernels.
#include "core/families/front/kernels/front.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(FrontKernels, front_kernels, front)

}  // namespace kbvh
