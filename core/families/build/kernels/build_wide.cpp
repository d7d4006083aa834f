#include "core/families/build/kernels/build_wide.hpp"

#include "core/families/wide/kernels/node_fit.hpp"

namespace kbvh {
namespace {

template <class S>
[[gnu::always_inline]] inline PlainPoint<S> sum(PlainPoint<S> a, PlainPoint<S> b) {
  return {{a.v[0] + b.v[0], a.v[1] + b.v[1], a.v[2] + b.v[2]}};
}
template <class V>
[[gnu::always_inline]] inline V sum(V a, V b) {
  return a + b;
}

/// `each` is the number of corners of every primitive, or 0.
template <class S, std::uint32_t each>
[[gnu::always_inline]] inline void boxes_of(const PrimitiveBoxesJob<S>& job) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  Pack smallest, largest;
  for (std::uint32_t k = 0; k < job.count; k += 4) {
    Pack lower[4], upper[4], centre[4];
    for (std::uint32_t j = 0; j < 4; ++j) {
      const std::uint32_t index = k + j < job.count ? k + j : job.count - 1;  // the last one repeats
      const std::uint32_t primitive = job.living == nullptr ? index : job.living[index];
      const std::uint32_t* corner = job.vertices + (each == 0 ? job.offsets[primitive] : each * primitive);
      const std::uint32_t corners = each == 0 ? job.offsets[primitive + 1] - job.offsets[primitive] : each;
      const S* const first = job.positions + std::size_t(3) * corner[0];
      lower[j] = upper[j] = P::load(first, first);
      for (std::uint32_t c = 1; c < corners; ++c) {
        const S* const next = job.positions + std::size_t(3) * corner[c];
        const Pack p = P::load(next, next);
        lower[j] = smaller(lower[j], p);
        upper[j] = larger(upper[j], p);
      }
      S* const box = job.boxes + std::size_t(8) * primitive;
      P::store_smallest(box, lower[j]);
      P::store_largest(box + 4, upper[j]);
      centre[j] = sum(lower[j], upper[j]);
      smallest = k + j == 0 ? centre[j] : smaller(smallest, centre[j]);
      largest = k + j == 0 ? centre[j] : larger(largest, centre[j]);
    }
    P::template store_rows<false>(centre, job.centres + k, job.stride, 4);
  }
  P::store_smallest(job.extent, smallest);
  P::store_largest(job.extent + 4, largest);
}

template <class S>
void primitive_boxes(const PrimitiveBoxesJob<S>& job) {
  const PrimitiveBoxesJob<S> local = job;
  if (job.corners_each == 3)
    boxes_of<S, 3>(local);
  else if (job.corners_each == 1)
    boxes_of<S, 1>(local);
  else
    boxes_of<S, 0>(local);
}

/// Cells and codes: as many as there are values of S in a register.
template <class S>
constexpr std::size_t key_lanes = native_lanes<S>;
template <class S>
using Values = Vector<S, key_lanes<S>>;
template <class S>
using Cells = Vector<std::uint32_t, key_lanes<S>>;

/// Returns the cells of centres on one axis, clamped to the grid.
template <class S>
[[gnu::always_inline]] inline Cells<S> cells(const S* centres, S lower, S scale) {
  constexpr S last = S((1U << curve_bits) - 1);
  const Values<S> zero = Values<S>{} + S(0), most = Values<S>{} + last;
  Values<S> place = (load_lanes<Values<S>>(centres) - lower) * scale;
  place = smaller(larger(place, zero), most);
  if constexpr (key_lanes<S> == 1) {
    return std::uint32_t(std::int32_t(place));
  } else {
    return (Cells<S>)__builtin_convertvector(place, Vector<std::int32_t, key_lanes<S>>);
  }
}

/// Puts two zero bits between the bits of a cell's number.
template <class C>
[[gnu::always_inline]] inline C spread(C x) {
  x = (x | (x << 16)) & 0x030000ffU;
  x = (x | (x << 8)) & 0x0300f00fU;
  x = (x | (x << 4)) & 0x030c30c3U;
  return (x | (x << 2)) & 0x09249249U;
}

/// Turns a cell's coordinates into the digits of its place on the Hilbert curve (Skilling 2004).
template <class C>
[[gnu::always_inline]] inline void along_hilbert_curve(C (&x)[3]) {
  for (std::uint32_t bit = curve_bits; bit-- > 1;) {
    const std::uint32_t below = (1U << bit) - 1;
    for (C& axis : x) {
      const C set = C{} - ((axis >> bit) & 1U);  // all ones where the bit is set
      const C swap = (x[0] ^ axis) & below & ~set;
      axis ^= swap;
      x[0] ^= swap | (set & below);
    }
  }
  x[1] ^= x[0];
  x[2] ^= x[1];
  C turn{};
  for (std::uint32_t bit = curve_bits; bit-- > 1;) turn ^= (C{} - ((x[2] >> bit) & 1U)) & ((1U << bit) - 1);
  for (C& axis : x) axis ^= turn;
}

template <class S, Curve curve>
[[gnu::always_inline]] inline void keys_along(const CurveKeysJob<S>& job) {
  constexpr std::size_t lanes = key_lanes<S>;
  constexpr std::uint32_t bins = 1U << code_digit_bits;
  for (std::uint32_t k = 0; k < job.count; k += lanes) {
    Cells<S> cell[3];
    for (std::size_t axis = 0; axis < 3; ++axis)
      cell[axis] = cells<S>(job.centres + axis * job.stride + k, job.lower[axis], job.scale[axis]);
    if constexpr (curve == Curve::hilbert) along_hilbert_curve(cell);
    const Cells<S> code =
        ((spread(cell[0]) << 2) | (spread(cell[1]) << 1) | spread(cell[2])) >> job.dropped_bits;
    std::uint32_t codes[lanes];
    __builtin_memcpy(codes, &code, sizeof codes);
    const auto many = std::uint32_t(lanes < job.count - k ? lanes : job.count - k);
    for (std::uint32_t j = 0; j < many; ++j) {
      const std::uint32_t primitive = job.living == nullptr ? k + j : job.living[k + j];
      job.keys[k + j] = std::uint64_t(codes[j]) << 32 | primitive;
    }
    if (job.histogram == nullptr) continue;
    for (std::uint32_t j = 0; j < many; ++j) {
      std::uint32_t* const counts = job.histogram + ((k + j) % 2) * code_digits * bins;
      ++counts[codes[j] & (bins - 1)];
      ++counts[bins + (codes[j] >> code_digit_bits & (bins - 1))];
      if (job.dropped_bits == 0) ++counts[2 * bins + (codes[j] >> 2 * code_digit_bits)];
    }
  }
  // A code without its lowest bits has two digits.
  if (job.histogram != nullptr && job.dropped_bits != 0) job.histogram[2 * bins] += job.count;
}

template <class S>
void curve_keys(const CurveKeysJob<S>& job) {
  const CurveKeysJob<S> local = job;
  if (job.curve == Curve::hilbert)
    keys_along<S, Curve::hilbert>(local);
  else
    keys_along<S, Curve::morton>(local);
}

template <class S, std::size_t padded>
void leaf_rows(const LeafRowsJob<S>& shared) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  const LeafRowsJob<S> job = shared;
  for (std::uint32_t leaf = 0; leaf < job.leaves; ++leaf) {
    const std::uint32_t begin = job.first_entry[leaf], end = job.end_entry[leaf];
    S* const rows = job.rows + std::size_t(leaf) * 6 * padded;
    Pack smallest, largest;
    for (std::uint32_t quad = 0; quad < padded; quad += 4) {
      if (quad != 0 && begin + quad >= end) break;
      Pack lower[4], upper[4];
      for (std::uint32_t j = 0; j < (padded == 1 ? 1 : 4); ++j) {
        const std::uint32_t entry = begin + quad + j < end ? begin + quad + j : end - 1;
        const S* const box = job.boxes + std::size_t(8) * job.entries[entry];
        lower[j] = P::load(box, box);
        upper[j] = P::load(box + 4, box + 4);
        smallest = quad + j == 0 ? lower[j] : smaller(smallest, lower[j]);
        largest = quad + j == 0 ? upper[j] : larger(largest, upper[j]);
      }
      if constexpr (padded > 1) {
        P::template store_rows<false>(lower, rows + quad, padded, 4);
        P::template store_rows<true>(upper, rows + 3 * padded + quad, padded, 4);
      }
    }
    if constexpr (padded > 1)
      for (std::size_t row = 0; row < 6; ++row)
        for (std::size_t i = end - begin; i < padded; ++i) rows[row * padded + i] = infinity<S>;
    P::store_smallest(job.leaf_boxes + std::size_t(8) * leaf, smallest);
    P::store_largest(job.leaf_boxes + std::size_t(8) * leaf + 4, largest);
  }
}

template <class S>
void nodes(WideArrays<S> h, const S* leaf_boxes, std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t n = end; n-- > begin;) {
    const WideNode node = h.nodes[n];
    const S* boxes[8];
    for (std::uint32_t lane = 0; lane < 8; ++lane)
      boxes[lane] = lane < node.leaf_count ? leaf_boxes + std::size_t(8) * (node.first_leaf + lane)
                    : lane < node.count
                        ? h.node_bounds + std::size_t(8) * (node.first_child + lane - node.leaf_count)
                        : empty_box<S>;
    NodeFit<S, 8> fit;
    fit.from_boxes(boxes, h.child_bounds + n * lane_scalars(8));
    fit.store_own(h.node_bounds + std::size_t(8) * n);
  }
}

template <class S>
constexpr BuildKernels<S> table{&primitive_boxes<S>,
                                &curve_keys<S>,
                                {&leaf_rows<S, 1>, &leaf_rows<S, 4>, &leaf_rows<S, 8>, &leaf_rows<S, 16>},
                                &nodes<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const BuildKernels<float> build_float = table<float>;
const BuildKernels<double> build_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
