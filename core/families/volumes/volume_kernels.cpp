// Selects the tables of this room's kernels.
#include "core/families/volumes/kernels/dop.hpp"
#include "core/families/volumes/kernels/lane_leaves.hpp"
#include "core/families/volumes/kernels/obb.hpp"
#include "core/families/volumes/kernels/sphere.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(DopKernels, dop_kernels, dop)
KBVH_DEFINE_KERNEL_CHOICE(LaneLeafKernels, lane_leaf_kernels, lane_leaf)
KBVH_DEFINE_KERNEL_CHOICE(ObbKernels, obb_kernels, obb)
KBVH_DEFINE_KERNEL_CHOICE(SphereKernels, sphere_kernels, sphere)

}  // namespace kbvh
