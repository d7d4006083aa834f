#pragma once
#include <cstddef>
#include <cstdint>

#include "core/geometry/span_pair.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The certain verdict on a pair throughout its span.
enum class SpanVerdict : std::uint8_t { open, apart, intersect };

/// Decides pairs of triangles in linear motion for whole spans of time.
///
/// Apart: one constant direction separates them. The gap along it is a minimum of linear functions minus a
/// maximum of linear functions. It is therefore concave in time: within the span it is at least as large as
/// the smaller of its end values. The tested directions are both normals and all products of two edges, at
/// the middle of the span.
///
/// Intersecting: one edge passes through the inside of the other triangle. The signs that prove this are
/// cubics in time; if all Bernstein coefficients of a cubic have one sign, the cubic has this sign
/// throughout.
template <class S>
struct SpanTestKernels {
  /// Writes the certain verdicts on `count` pairs. `rounding` bounds the error of a component of a difference
  /// of two corners, at a frame and as computed, against the linear motion, relative to the largest
  /// coordinate of the pair. The error of a gap along a direction whose absolute components add up to 1 is at
  /// most twice as large. Gaps and coefficients within these bounds leave a pair open. Reads one scalar past
  /// each corner.
  void (*decide)(const SpanPair<S>* pairs, std::size_t count, S rounding, SpanVerdict* verdicts);
};
KBVH_DECLARE_KERNELS(SpanTestKernels<float>, span_tests_float)
KBVH_DECLARE_KERNELS(SpanTestKernels<double>, span_tests_double)

/// Returns the kernels of one instruction set.
template <class S>
const SpanTestKernels<S>& span_test_kernels(KernelSet set);
template <>
const SpanTestKernels<float>& span_test_kernels(KernelSet set);
template <>
const SpanTestKernels<double>& span_test_kernels(KernelSet set);

}  // namespace kbvh
