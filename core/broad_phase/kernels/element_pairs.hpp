#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The leaves of an 8-wide tree over elements: boxes and vertices of a leaf's elements side by side.
template <class S>
struct ElementLeaves {
  WideArrays<S> tree;
  const std::uint32_t *first_entry, *end_entry;  ///< [leaf]
  const std::uint32_t* ids;                      ///< [entry]
  const S* rows;                 ///< [leaf][6][padded]: lower x, y, z, -upper x, y, z; unused lanes are empty
  const std::uint32_t* corners;  ///< [leaf][corners of an element][padded]: vertices
};

/// Turns pairs of leaves into pairs of elements whose boxes overlap and that have no common vertex.
template <class S>
struct ElementPairsJob {
  ElementLeaves<S> a, b;
  const LeafSlot* pairs;  ///< first, second, ...; a leaf with itself gives each two of its elements once
  std::size_t next, count;
  std::uint32_t* out;           ///< [pair][2]: ids; of one tree, the smaller first
  std::size_t found, out_room;  ///< in pairs
  std::uint64_t tests;
};
/// The free space for pairs that a pair of leaves may need.
inline constexpr std::size_t element_pairs_step = 256 + 16;

template <class S>
struct ElementPairKernels {
  /// Continues until all pairs of leaves are done or the next one might exceed the free space.
  using Pairs = void (*)(ElementPairsJob<S>& job);
  /// [leaf size up to 8, 16][CandidateKind]
  Pairs of[2][6];
};
KBVH_DECLARE_KERNELS(ElementPairKernels<float>, element_pairs_float)
KBVH_DECLARE_KERNELS(ElementPairKernels<double>, element_pairs_double)

/// Returns the kernels of one instruction set.
template <class S>
const ElementPairKernels<S>& element_pair_kernels(KernelSet set);
template <>
const ElementPairKernels<float>& element_pair_kernels(KernelSet set);
template <>
const ElementPairKernels<double>& element_pair_kernels(KernelSet set);

}  // namespace kbvh
