// Selects the tables of this room's kernels.
#include "core/families/linear/kernels/span_tests.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(SpanTestKernels, span_test_kernels, span_tests)

}  // namespace kbvh
