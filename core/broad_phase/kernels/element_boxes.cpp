#include "core/broad_phase/kernels/element_boxes.hpp"

#include "core/families/wide/kernels/node_fit.hpp"

namespace kbvh {
namespace {

template <class S>
constexpr std::size_t corner_lanes = native_lanes<S> >= 4 ? 4 : 1;
template <class S>
constexpr std::size_t corner_parts = 4 / corner_lanes<S>;
template <class S>
using Part = Vector<S, corner_lanes<S>>;

/// A corner of a box: x, y, z and an unused number, in one register where there are such.
template <class S>
struct Corner {
  Part<S> part[corner_parts<S>];

  [[gnu::always_inline]] static Corner load(const S* from) {
    Corner c;
    for (std::size_t i = 0; i < corner_parts<S>; ++i)
      c.part[i] = load_lanes<Part<S>>(from + i * corner_lanes<S>);
    return c;
  }
  [[gnu::always_inline]] void store(S* to) const {
    for (std::size_t i = 0; i < corner_parts<S>; ++i) store_lanes(to + i * corner_lanes<S>, part[i]);
  }
};

template <class S>
[[gnu::always_inline]] inline Corner<S> smaller(const Corner<S>& a, const Corner<S>& b) {
  Corner<S> c;
  for (std::size_t i = 0; i < corner_parts<S>; ++i) c.part[i] = smaller(a.part[i], b.part[i]);
  return c;
}
template <class S>
[[gnu::always_inline]] inline Corner<S> larger(const Corner<S>& a, const Corner<S>& b) {
  Corner<S> c;
  for (std::size_t i = 0; i < corner_parts<S>; ++i) c.part[i] = larger(a.part[i], b.part[i]);
  return c;
}
template <class S>
[[gnu::always_inline]] inline Corner<S> sum(const Corner<S>& a, const Corner<S>& b) {
  Corner<S> c;
  for (std::size_t i = 0; i < corner_parts<S>; ++i) c.part[i] = a.part[i] + b.part[i];
  return c;
}

template <class S>
struct BitsOf;
template <>
struct BitsOf<float> {
  using type = std::int32_t;
};
template <>
struct BitsOf<double> {
  using type = std::int64_t;
};

/// Returns a - h, rounded towards minus infinity (`down`), or a + h, rounded towards infinity. The rounding
/// error of a sum is a number of the same type (Knuth's two_sum), so its sign decides. A sum of 0 is exact.
template <bool down, class S>
[[gnu::always_inline]] inline Part<S> outward(Part<S> a, S h) {
  using Bits = typename BitsOf<S>::type;
  using Words = Vector<Bits, corner_lanes<S>>;
  const S step = down ? -h : h;
  const Part<S> total = a + step, rest = total - a;
  const Part<S> error = (a - (total - rest)) + (step - rest);
  Words words;
  __builtin_memcpy(&words, &total, sizeof words);
  if constexpr (corner_lanes<S> == 1) {
    if (down ? error < 0 : error > 0) words += (total > 0) == down ? -1 : 1;
  } else {
    const Words off = down ? Words(error < S(0)) : Words(error > S(0));   // -1 where it has to be moved
    const Words away = down ? Words(total > S(0)) : Words(total < S(0));  // ... towards 0
    words += off & ((away & Bits(-2)) + Bits(1));
  }
  Part<S> result;
  __builtin_memcpy(&result, &words, sizeof result);
  return result;
}

template <class S>
[[gnu::always_inline]] inline Corner<S> point(const StridedPoints<S>& points, std::uint32_t vertex,
                                              S* packed) {
  const S* const from = points.data + std::ptrdiff_t(vertex) * points.row_step;
  S* const to = packed + std::size_t(4) * vertex;
  to[0] = from[0];
  to[1] = from[points.column_step];
  to[2] = from[2 * points.column_step];
  to[3] = S(0);
  return Corner<S>{Corner<S>::load(to)};
}

template <class S>
struct Box8 {
  Corner<S> lower, upper;
};
template <class S>
[[gnu::always_inline]] inline Box8<S> grown(const Corner<S>& a, const Corner<S>& b, S by) {
  Box8<S> box{smaller(a, b), larger(a, b)};
  for (std::size_t i = 0; i < corner_parts<S>; ++i) {
    box.lower.part[i] = outward<true, S>(box.lower.part[i], by);
    box.upper.part[i] = outward<false, S>(box.upper.part[i], by);
  }
  return box;
}

/// Returns the smallest of the three differences to[i] - from[i].
template <class S>
[[gnu::always_inline]] inline S least_difference(const Corner<S>& to, const Corner<S>& from) {
  S low[4], high[4];
  from.store(low);
  to.store(high);
  S least = high[0] - low[0];
  for (std::size_t i = 1; i < 3; ++i) least = smaller(high[i] - low[i], least);
  return least;
}

template <class S>
void vertices(VertexBoxesJob<S>& shared) {
  const VertexBoxesJob<S> job = shared;
  bool inside = true;
  S room = infinity<S>;
  for (std::uint32_t k = 0; k < job.count; ++k) {
    const std::uint32_t v = job.vertices == nullptr ? k : job.vertices[k];
    const Corner<S> a = point(job.begin, v, job.begin_points);
    Corner<S> b = a;
    if (job.end_points != nullptr) b = point(job.end, v, job.end_points);
    const Box8<S> box = grown(a, b, job.grown_each == nullptr ? job.grown : job.grown_each[v]);
    if (job.allowed == nullptr) {
      box.lower.store(job.boxes + std::size_t(8) * v);
      box.upper.store(job.boxes + std::size_t(8) * v + 4);
      continue;
    }
    const S* const may = job.allowed + std::size_t(8) * v;
    room = smaller(least_difference(box.lower, Corner<S>::load(may)), room);
    room = smaller(least_difference(Corner<S>::load(may + 4), box.upper), room);
    inside = inside & (room >= S(0));
  }
  shared.inside = inside;
  shared.room = room;
}

template <class S, std::uint32_t each>
[[gnu::always_inline]] inline Box8<S> box_of(const ElementBoxesJob<S>& job, std::uint32_t element) {
  const std::uint32_t* const corner = job.corners + std::size_t(each) * element;
  const S* const first = job.vertex_boxes + std::size_t(8) * corner[0];
  Box8<S> box{Corner<S>::load(first), Corner<S>::load(first + 4)};
  for (std::uint32_t c = 1; c < each; ++c) {
    const S* const next = job.vertex_boxes + std::size_t(8) * corner[c];
    box.lower = smaller(Corner<S>::load(next), box.lower);
    box.upper = larger(Corner<S>::load(next + 4), box.upper);
  }
  return box;
}
template <class S>
[[gnu::always_inline]] inline void store(const Box8<S>& box, S* to) {
  box.lower.store(to);
  box.upper.store(to + 4);
}

template <class S, std::uint32_t each>
[[gnu::always_inline]] inline void boxes_of(const ElementBoxesJob<S>& job) {
  Corner<S> smallest, largest;
  for (std::uint32_t k = 0; k < job.count; ++k) {
    const std::uint32_t e = job.living == nullptr ? k : job.living[k];
    const Box8<S> box = box_of<S, each>(job, e);
    store(box, job.boxes + std::size_t(8) * e);
    const Corner<S> centre = sum(box.lower, box.upper);
    smallest = k == 0 ? centre : smaller(smallest, centre);
    largest = k == 0 ? centre : larger(largest, centre);
    S at[4];
    centre.store(at);
    for (std::size_t axis = 0; axis < 3; ++axis) job.centres[axis * job.stride + k] = at[axis];
  }
  for (std::size_t axis = 0; axis < 3; ++axis)  // readers take whole registers
    for (std::size_t k = job.count; k < job.stride; ++k)
      job.centres[axis * job.stride + k] = job.centres[axis * job.stride + job.count - 1];
  smallest.store(job.extent);
  largest.store(job.extent + 4);
}

template <class S>
void elements(const ElementBoxesJob<S>& shared) {
  const ElementBoxesJob<S> job = shared;
  if (job.corners_each == 1)
    boxes_of<S, 1>(job);
  else if (job.corners_each == 2)
    boxes_of<S, 2>(job);
  else
    boxes_of<S, 3>(job);
}

template <class S, std::uint32_t each, std::uint32_t padded>
[[gnu::always_inline]] inline void leaves_of(const ElementLeafBoxesJob<S>& job) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  for (std::uint32_t leaf = job.begin; leaf < job.end; ++leaf) {
    const std::uint32_t count = job.end_entry[leaf] - job.first_entry[leaf];
    const std::uint32_t* const corners = job.corners + std::size_t(leaf) * each * padded;
    S* const rows = job.rows + std::size_t(leaf) * 6 * padded;
    Pack smallest, largest;
    for (std::uint32_t quad = 0; quad < padded; quad += 4) {
      if (quad != 0 && quad >= count) break;
      Pack lower[4], upper[4];
      for (std::uint32_t j = 0; j < 4; ++j) {
        const S* const first = job.vertex_boxes + std::size_t(8) * corners[quad + j];
        lower[j] = P::load(first, first);
        upper[j] = P::load(first + 4, first + 4);
        for (std::uint32_t c = 1; c < each; ++c) {
          const S* const next = job.vertex_boxes + std::size_t(8) * corners[c * padded + quad + j];
          lower[j] = smaller(P::load(next, next), lower[j]);
          upper[j] = larger(P::load(next + 4, next + 4), upper[j]);
        }
        smallest = quad + j == 0 ? lower[j] : smaller(smallest, lower[j]);
        largest = quad + j == 0 ? upper[j] : larger(largest, upper[j]);
      }
      P::template store_rows<false>(lower, rows + quad, padded, 4);
      P::template store_rows<true>(upper, rows + 3 * padded + quad, padded, 4);
    }
    for (std::size_t row = 0; row < 6; ++row)
      for (std::size_t i = count; i < padded; ++i) rows[row * padded + i] = infinity<S>;
    P::store_smallest(job.leaf_boxes + std::size_t(8) * leaf, smallest);
    P::store_largest(job.leaf_boxes + std::size_t(8) * leaf + 4, largest);
  }
}

template <class S, std::uint32_t padded>
[[gnu::always_inline]] inline void leaves_padded(const ElementLeafBoxesJob<S>& job) {
  if (job.corners_each == 1)
    leaves_of<S, 1, padded>(job);
  else if (job.corners_each == 2)
    leaves_of<S, 2, padded>(job);
  else
    leaves_of<S, 3, padded>(job);
}

template <class S>
void leaves(const ElementLeafBoxesJob<S>& shared) {
  const ElementLeafBoxesJob<S> job = shared;
  if (job.padded == 8)
    leaves_padded<S, 8>(job);
  else
    leaves_padded<S, 16>(job);
}

template <class S>
void nodes(DirtyNodesJob<S>& shared) {
  DirtyNodesJob<S> job = shared;
  const WideArrays<S>& h = job.tree;
  job.remade = 0;
  for (std::size_t word = job.words; word-- > 0;)
    while (job.dirty[word] != 0) {
      const auto bit = std::uint32_t(63 - __builtin_clzll(job.dirty[word]));
      job.dirty[word] &= ~(std::uint64_t(1) << bit);
      const auto n = std::uint32_t(64 * word + bit);
      const WideNode node = h.nodes[n];
      const S* boxes[8];
      for (std::uint32_t lane = 0; lane < 8; ++lane)
        boxes[lane] = lane < node.leaf_count ? job.leaf_boxes + std::size_t(8) * (node.first_leaf + lane)
                      : lane < node.count
                          ? h.node_bounds + std::size_t(8) * (node.first_child + lane - node.leaf_count)
                          : empty_box<S>;
      NodeFit<S, 8> fit;
      fit.from_boxes(boxes, h.child_bounds + n * lane_scalars(8));
      S fresh[8];
      fit.store_own(fresh);
      S* const own = h.node_bounds + std::size_t(8) * n;
      bool changed = false;
      for (std::size_t i = 0; i < 8; ++i) {
        if (i == 3 || i == 7) continue;
        changed |= own[i] != fresh[i];
        own[i] = fresh[i];
      }
      ++job.remade;
      if (!changed || n == 0) continue;
      const std::uint32_t parent = job.parents[n];
      job.dirty[parent / 64] |= std::uint64_t(1) << parent % 64;
    }
  shared.remade = job.remade;
}

template <class S>
constexpr ElementBoxKernels<S> table{&vertices<S>, &elements<S>, &leaves<S>, &nodes<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const ElementBoxKernels<float> element_boxes_float = table<float>;
const ElementBoxKernels<double> element_boxes_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
