// Selects the tables of this room's kernels.
#include "core/families/volumes/kernels/dop.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(DopKernels, dop_kernels, dop)

}  // namespace kbvh
