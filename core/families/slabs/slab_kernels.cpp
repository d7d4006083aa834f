// Selects the tables of this room's kernels.
#include "core/families/slabs/kernels/slab_spans.hpp"
#include "core/families/slabs/kernels/slabs.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(SlabKernels, slab_kernels, slabs)
KBVH_DEFINE_KERNEL_CHOICE(SlabSpanKernels, slab_span_kernels, slab_spans)

}  // namespace kbvh
