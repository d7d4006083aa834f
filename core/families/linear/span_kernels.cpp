// Selects the tables of this room's kernels.
#include "core/families/linear/kernels/span_tests.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

template <>
const SpanTestKernels<float>& span_test_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, span_tests_float);
}
template <>
const SpanTestKernels<double>& span_test_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, span_tests_double);
}

}  // namespace kbvh
