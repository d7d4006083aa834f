#pragma once
#include <cstddef>
#include <cstdint>

#include "core/geometry/span_pair.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Two bounds on how far a frame's positions, and what the kernel computes, are from the linear motion.
template <class S>
struct SpanSlack {
  S gap;        ///< along a direction whose absolute components add up to 1
  S component;  ///< of a difference of two corners
};

/// What is certain of a pair throughout its span.
enum class SpanVerdict : std::uint8_t { open, apart, intersect };

/// Pairs of triangles in linear motion, decided for whole spans of time.
///
/// Apart: one constant direction keeps them apart. The gap along it is a minimum of linear functions less a
/// maximum of such, so it is concave in time, and what it is at both ends it is at least between them. Tried
/// are both normals and all products of two edges, at the middle of the span.
///
/// Intersecting: one edge passes through the inside of the other triangle. The signs that say so are cubics
/// in time; if their Bernstein coefficients have one sign, so has the cubic throughout.
template <class S>
struct SpanTestKernels {
  /// Writes what is certain of `count` pairs. Gaps and coefficients that do not exceed what the slack can
  /// hide leave a pair open. Reads one scalar past each corner.
  void (*decide)(const SpanPair<S>* pairs, std::size_t count, SpanSlack<S> slack, SpanVerdict* verdicts);
};
KBVH_DECLARE_KERNELS(SpanTestKernels<float>, span_tests_float)
KBVH_DECLARE_KERNELS(SpanTestKernels<double>, span_tests_double)

/// Those of one instruction set.
template <class S>
const SpanTestKernels<S>& span_test_kernels(KernelSet set);
template <>
const SpanTestKernels<float>& span_test_kernels(KernelSet set);
template <>
const SpanTestKernels<double>& span_test_kernels(KernelSet set);

}  // namespace kbvh
