// Selects the tables of this room's kernels.
#include "core/families/grid/kernels/grid.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(GridKernels, grid_kernels, grid)

}  // namespace kbvh
