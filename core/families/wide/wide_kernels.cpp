// Selects the tables of this room's kernels.
#include "core/families/wide/kernels/bounds.hpp"
#include "core/families/wide/kernels/wide_inflate.hpp"
#include "core/families/wide/kernels/wide_linear.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/kernels/wide_refit.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

template <>
const BoundsKernels<float>& bounds_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, bounds_float);
}
template <>
const BoundsKernels<double>& bounds_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, bounds_double);
}

template <>
const WideInflateKernels<float>& wide_inflate_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_inflate_float);
}
template <>
const WideInflateKernels<double>& wide_inflate_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_inflate_double);
}

template <>
const WideLinearKernels<float>& wide_linear_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_linear_float);
}
template <>
const WideLinearKernels<double>& wide_linear_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_linear_double);
}

template <>
const WideOverlapKernels<float>& wide_overlap_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_overlap_float);
}
template <>
const WideOverlapKernels<double>& wide_overlap_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_overlap_double);
}

template <>
const WideRefitKernels<float>& wide_refit_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_refit_float);
}
template <>
const WideRefitKernels<double>& wide_refit_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, wide_refit_double);
}

}  // namespace kbvh
