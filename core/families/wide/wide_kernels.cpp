// Selects the tables of this room's kernels.
#include "core/families/wide/kernels/bounds.hpp"
#include "core/families/wide/kernels/leaf_rows.hpp"
#include "core/families/wide/kernels/reduce.hpp"
#include "core/families/wide/kernels/wide_inflate.hpp"
#include "core/families/wide/kernels/wide_linear.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/kernels/wide_rays.hpp"
#include "core/families/wide/kernels/wide_realisers.hpp"
#include "core/families/wide/kernels/wide_refit.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(BoundsKernels, bounds_kernels, bounds)
KBVH_DEFINE_KERNEL_CHOICE(LeafRowsKernels, leaf_rows_kernels, leaf_rows)
KBVH_DEFINE_KERNEL_CHOICE(ReduceKernels, reduce_kernels, reduce)
KBVH_DEFINE_KERNEL_CHOICE(WideInflateKernels, wide_inflate_kernels, wide_inflate)
KBVH_DEFINE_KERNEL_CHOICE(WideLinearKernels, wide_linear_kernels, wide_linear)
KBVH_DEFINE_KERNEL_CHOICE(WideOverlapKernels, wide_overlap_kernels, wide_overlap)
KBVH_DEFINE_KERNEL_CHOICE(WideRayKernels, wide_ray_kernels, wide_rays)
KBVH_DEFINE_KERNEL_CHOICE(WideRealiserKernels, wide_realiser_kernels, wide_realisers)
KBVH_DEFINE_KERNEL_CHOICE(WideRefitKernels, wide_refit_kernels, wide_refit)

}  // namespace kbvh
