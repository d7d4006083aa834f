// Selects the tables of this room's kernels.
#include "core/broad_phase/kernels/element_boxes.hpp"
#include "core/broad_phase/kernels/element_pairs.hpp"
#include "core/broad_phase/kernels/group_traversal.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(ElementBoxKernels, element_box_kernels, element_boxes)
KBVH_DEFINE_KERNEL_CHOICE(ElementPairKernels, element_pair_kernels, element_pairs)
KBVH_DEFINE_KERNEL_CHOICE(GroupTraversalKernels, group_traversal_kernels, group_traversal)

}  // namespace kbvh
