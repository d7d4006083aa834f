// Selects the tables of this room's kernels.
#include "core/families/sweep/kernels/sweep.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(SweepKernels, sweep_kernels, sweep)

}  // namespace kbvh
