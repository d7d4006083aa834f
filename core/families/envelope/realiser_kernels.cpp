// Selects the tables of this room's kernels.
#include "core/families/envelope/kernels/wide_realisers.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(WideRealiserKernels, wide_realiser_kernels, wide_realisers)

}  // namespace kbvh
