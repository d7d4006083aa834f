// Selects the tables of this room's kernels.
#include "core/families/blend/kernels/blend_rows.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(BlendKernels, blend_kernels, blend_rows)

}  // namespace kbvh
