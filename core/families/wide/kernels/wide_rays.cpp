#include "core/families/wide/kernels/wide_rays.hpp"

#include "core/kernels/point_lanes.hpp"

namespace kbvh {
namespace {

/// The parameter at which a ray crosses a plane has three roundings, which keep its sign. The parameters of
/// two planes may be in the wrong order only if they differ by less than `grow`, or by less than `least` if
/// they underflow. Parameters that overflow count as `largest`.
template <class S>
struct Slack;
template <>
struct Slack<float> {
  static constexpr float grow = 1 + 0x1p-20F, least = 0x1p-125F, largest = 0x1p126F;
};
template <>
struct Slack<double> {
  static constexpr double grow = 1 + 0x1p-49, least = 0x1p-1021, largest = 0x1p1022;
};

template <class S>
KBVH_INLINE S reach_of(const WideRay<S>& ray) {
  return ray.limit * Slack<S>::grow + Slack<S>::least;
}

/// Returns a mask: bit i is set unless the ray certainly misses the box of lane i. Stores where the ray
/// enters. Comparisons with NaN leave the other operand.
template <class S, std::size_t width>
KBVH_INLINE unsigned entered(const S* rows, const WideRay<S>& ray, S* near) {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;  // there are no shorter registers
  using V = Vector<S, lanes>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < width; i += lanes) {
    V first = V{} + S(0), last = V{} + ray.limit;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const S add = ray.add[axis], scale = ray.scale[axis];
      const V enter = (load_lanes<V>(rows + ray.enter_row[axis] * width + i) + add) * scale;
      const V leave = (load_lanes<V>(rows + ray.leave_row[axis] * width + i) - add) * -scale;
      first = larger(enter, first);
      last = smaller(leave, last);
    }
    first = smaller(first, V{} + Slack<S>::largest);
    store_lanes<V>(near + i, first);
    const auto meets = first <= last * Slack<S>::grow + Slack<S>::least;
    if constexpr (lanes == 1)
      bits |= unsigned(meets) << i;
    else
      bits |= mask_bits(meets) << i;
  }
  return bits;
}

template <class S>
std::uint64_t screen(const WideRayBlock<S>& rays, const S* child_bounds, std::uint32_t count) {
  using V = Values<S>;
  std::uint64_t met = 0;
  for (std::size_t i = 0; i < rays.size; i += lanes<S>) {
    V origin[3], inverse[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const V direction = load_lanes<V>(rays.direction[axis] + i), exact = 1 / direction;
      origin[axis] = load_lanes<V>(rays.origin[axis] + i);
      // Too small to be inverted, but not zero: NaN.
      inverse[axis] = direction == 0 ? exact : exact + (exact - exact);
    }
    const V limit = load_lanes<V>(rays.length + i);
    for (std::uint32_t child = 0; child < count; ++child) {
      V first{}, last = limit;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const V lower = V{} + child_bounds[axis * 8 + child] - origin[axis];
        const V upper = V{} - child_bounds[(axis + 3) * 8 + child] - origin[axis];
        const V to_lower = lower * inverse[axis], to_upper = upper * inverse[axis];
        first = larger(inverse[axis] < 0 ? to_upper : to_lower, first);
        last = smaller(inverse[axis] < 0 ? to_lower : to_upper, last);
      }
      first = smaller(first, V{} + Slack<S>::largest);
      met |= std::uint64_t(mask_bits(first <= last * Slack<S>::grow + Slack<S>::least)) << i;
    }
  }
  return met;
}

// ---- Filter of triangles ----------------------------------------------------------------------------------
//
// Seen along the ray, a triangle is missed if the origin lies strictly on different sides of two of its
// edges. Let a corner P relative to the ray's origin be (X, Y, Z), with Z along an axis in which the
// direction (p, q, r) is largest. Its place in that view is x = X - Z p/r, y = Y - Z q/r, and the three sides
// are u = x1 y2 - x2 y1, v = x2 y0 - x0 y2, w = x0 y1 - x1 y0: the volumes of core/geometry/ray_triangle.cpp
// over r. There are four products of places in a side, and no product of three differences.
//
// Error. Let e be the unit roundoff, m the largest computed |x| or |y| of the corners, d the largest computed
// |Z|. The quotient, its product with Z, the difference P - o and the last subtraction round once each, and
// |p/r| <= 1, |X| <= |x| + |Z|: a computed place is wrong by at most f = (2 m + 4 d) e (1 + 16 e). A side is
// then wrong by at most 4 m f + 2 f^2, and by 4 m^2 e (1 + 2 e) from its own roundings. Together these are
// (12 m^2 + 16 m d) e + 32 d^2 e^2, but for terms that are smaller by 2^-15. `bound_of` computes
// 14 m^2 e + 18 m d e + 36 d^2 e^2, whose surplus exceeds its own six roundings.
// Underflow: a product is wrong by at most the smallest denormal, which m and d multiply at most once. Where
// m (1 + d) is below 2^27 (in float), `tiny` exceeds this; above, the surplus does.
// Overflow: if m^2 is finite, so are all products; if it is not, the bound is infinite and nothing is missed.

template <class S>
struct FilterBound;
template <>
struct FilterBound<float> {
  static constexpr float unit = 0x1p-24F, grow = 1 + 0x1p-20F, tiny = 0x1p-120F;
};
template <>
struct FilterBound<double> {
  static constexpr double unit = 0x1p-53, grow = 1 + 0x1p-49, tiny = 0x1p-1000;
};

template <class S, std::size_t n>
KBVH_INLINE Vector<S, n> magnitude(Vector<S, n> x) {
  using W = Vector<Word<S>, n>;
  return __builtin_bit_cast(Vector<S, n>, __builtin_bit_cast(W, x) & (~Word<S>(0) >> 1));
}

template <class S, std::size_t n>
KBVH_INLINE Vector<S, n> bound_of(Vector<S, n> m, Vector<S, n> d) {
  using B = FilterBound<S>;
  const Vector<S, n> far = d * (6 * B::unit);
  return m * m * (14 * B::unit) + (m * S(3) + far) * far + B::tiny;
}

/// Returns bit i if x > y in lane i.
template <class V>
KBVH_INLINE unsigned above(V x, V y) {
#if defined(KBVH_KERNELS_avx512)
  // GCC 12 makes a vector of a comparison, and a mask of that vector.
  if constexpr (sizeof(V) == 64) {
    if constexpr (sizeof(x[0]) == 4)
      return unsigned(_mm512_cmp_ps_mask((__m512)x, (__m512)y, _CMP_GT_OQ)) & 0xffffU;
    else
      return unsigned(_mm512_cmp_pd_mask((__m512d)x, (__m512d)y, _CMP_GT_OQ)) & 0xffU;
  }
#endif
  return mask_bits(x > y);
}

/// Returns a mask of n triangles that the ray may meet within its limit; row[corner][axis][0 .. n) are
/// their corners.
template <class S, std::size_t n>
KBVH_INLINE unsigned may_meet(const WideRay<S>& ray, const S* corners, std::size_t row) {
  using V = Vector<S, n>;
  V x[3], y[3], z[3];
  for (std::size_t c = 0; c < 3; ++c) {
    const S* const corner = corners + 3 * c * row;
    const V along = load_lanes<V>(corner + ray.axes[2] * row) - ray.origin[2];
    x[c] = load_lanes<V>(corner + ray.axes[0] * row) - ray.origin[0] - along * ray.shear[0];
    y[c] = load_lanes<V>(corner + ray.axes[1] * row) - ray.origin[1] - along * ray.shear[1];
    z[c] = along * ray.sign;
  }
  const V u = x[1] * y[2] - x[2] * y[1], v = x[2] * y[0] - x[0] * y[2], w = x[0] * y[1] - x[1] * y[0];
  V m = larger(magnitude<S, n>(x[0]), magnitude<S, n>(y[0]));
  for (std::size_t c = 1; c < 3; ++c) {
    m = larger(magnitude<S, n>(x[c]), m);
    m = larger(magnitude<S, n>(y[c]), m);
  }
  const V nearest = smaller(smaller(z[0], z[1]), z[2]), farthest = larger(larger(z[0], z[1]), z[2]);
  const V bound = bound_of<S, n>(m, larger(-nearest, farthest));
  const unsigned aside =
      above<V>(-smaller(smaller(u, v), w), bound) & above<V>(larger(larger(u, v), w), bound);
  // The point in which the ray meets the triangle lies between its corners along the axis, too. A difference
  // has the sign of the exact one.
  const S limit = ray.limit * ray.steepness * FilterBound<S>::grow + FilterBound<S>::tiny;
  const unsigned beyond = above<V>(nearest, V{} + limit), behind = above<V>(V{}, farthest);
  return ~(aside | beyond | behind);
}

/// Copies the corners of a leaf's entries to rows; returns a mask of the entries that are no triangles, whose
/// copy is of their first corner only. Lanes past the end repeat the first entry of their register.
template <class S>
[[gnu::noinline]] unsigned copy_corners(const WideRayJob<S>& job, std::uint32_t begin, std::uint32_t end,
                                        S* to) {
  const std::uint32_t row = job.row;
  unsigned unusual = 0;
  for (std::uint32_t first = 0; first < end - begin; first += lanes<S>) {
    const std::uint32_t left = end - begin - first, count = left < lanes<S> ? left : lanes<S>;
    const S* rows[3][lanes<S>];
    if (job.triangle_corners != nullptr) {
      const std::uint32_t* const corners = job.triangle_corners + std::size_t(3) * (begin + first);
      for (std::uint32_t k = 0; k < lanes<S>; ++k)
        for (std::uint32_t c = 0; c < 3; ++c)
          rows[c][k] = job.positions + corners[3 * (k < count ? k : 0) + c];
    } else {
      for (std::uint32_t k = 0; k < lanes<S>; ++k) {
        const std::uint32_t primitive = job.entries[begin + first + (k < count ? k : 0)];
        const std::uint32_t corner = job.offsets[primitive];
        const bool triangle = job.offsets[primitive + 1] - corner == 3;
        unusual |= k < count ? unsigned(!triangle) << (first + k) : 0U;
        for (std::uint32_t c = 0; c < 3; ++c)
          rows[c][k] = job.positions + std::size_t(3) * job.vertices[corner + (triangle ? c : 0)];
      }
    }
    const auto store = [&](std::size_t place, const Values<S>& values) {
      constexpr std::size_t n = lanes<S>;
      S* const at = to + place * row + first;
      if (row >= n) {
        store_lanes(at, values);
        return;
      }
      if constexpr (n > 4) {
        if (row == 4) __builtin_memcpy(at, &values, 4 * sizeof(S));
      }
      if constexpr (n > 8) {
        if (row == 8) __builtin_memcpy(at, &values, 8 * sizeof(S));
      }
    };
    for (std::size_t c = 0; c < 3; ++c) {
      const Point<S> corner = load_points(rows[c]);
      store(3 * c, corner.x);
      store(3 * c + 1, corner.y);
      store(3 * c + 2, corner.z);
    }
  }
  return unusual;
}

/// Decides those of a leaf's `count` entries from `begin` that the ray may meet. Returns whether the search
/// has ended.
template <class S, std::size_t row>
KBVH_INLINE bool decide_copied(WideRayJob<S>& job, std::uint32_t begin, std::uint32_t count, const S* corners,
                               unsigned unusual) {
  constexpr std::uint32_t n = lanes<S> < row ? lanes<S> : row;
  for (std::uint32_t first = 0; first < count; first += n) {
    const std::uint32_t here = count - first < n ? count - first : n;
    unsigned open =
        (may_meet<S, n>(*job.ray, corners + first, row) | unusual >> first) & ((2U << (here - 1)) - 1);
    for (; open != 0; open &= open - 1) {
      const std::uint32_t k = first + unsigned(__builtin_ctz(open));
      S own[9];
      for (std::size_t place = 0; place < 9; ++place) own[place] = corners[place * row + k];
      const bool triangle = (unusual >> k & 1) == 0;
      if (job.decide(job.context, job.entries[begin + k], triangle ? own : nullptr)) return true;
    }
  }
  return false;
}

/// The corners of a leaf, copied side by side.
template <class S>
struct LeafCorners {
  const S* rows;
  unsigned unusual;  ///< as in WideLeafCopy
};

template <class S>
KBVH_INLINE bool is_copied(const WideRayJob<S>& job, std::uint32_t leaf) {
  return job.copied != nullptr && job.copies[leaf].stamp == job.stamp;
}
template <class S>
KBVH_INLINE S* place_of_copy(const WideRayJob<S>& job, std::uint32_t leaf) {
  return job.copied + std::size_t(9) * job.row * leaf;
}

/// Returns the corners of a leaf: those that are kept for the rays of the call, or copied to `own`.
template <class S>
KBVH_INLINE LeafCorners<S> corners_of(const WideRayJob<S>& job, std::uint32_t leaf, S* own) {
  if (is_copied(job, leaf)) return {place_of_copy(job, leaf), job.copies[leaf].unusual};
  return {own, copy_corners(job, job.first_entry[leaf], job.end_entry[leaf], own)};
}
/// Keeps a copy of a leaf's corners for the other rays of the call.
template <class S>
KBVH_INLINE void keep_corners(const WideRayJob<S>& job, std::uint32_t leaf) {
  if (job.copied == nullptr || is_copied(job, leaf)) return;
  job.copies[leaf] = {
      job.stamp, copy_corners(job, job.first_entry[leaf], job.end_entry[leaf], place_of_copy(job, leaf))};
}

/// Returns whether the entries of a leaf are decided without a filter: there is only one, or it is a body.
template <class S>
KBVH_INLINE bool unfiltered(const WideRayJob<S>& job, std::uint32_t leaf) {
  return job.offsets == nullptr || job.end_entry[leaf] - job.first_entry[leaf] < 2;
}

/// Decides the entries of a leaf that the ray may meet; without corners, all of them. Returns whether the
/// search has ended.
template <class S>
[[gnu::noinline]] bool decide_leaf(WideRayJob<S>& job, std::uint32_t leaf, LeafCorners<S> corners) {
  const std::uint32_t begin = job.first_entry[leaf], count = job.end_entry[leaf] - begin;
  if (corners.rows == nullptr || job.ray->steepness == 0) {
    for (std::uint32_t entry = begin; entry < begin + count; ++entry)
      if (job.decide(job.context, job.entries[entry], nullptr)) return true;
    return false;
  }
  job.tests += count;  // added at once: the same with registers of any width
  switch (job.row) {
    case 4:
      return decide_copied<S, 4>(job, begin, count, corners.rows, corners.unusual);
    case 8:
      return decide_copied<S, 8>(job, begin, count, corners.rows, corners.unusual);
    default:
      return decide_copied<S, 16>(job, begin, count, corners.rows, corners.unusual);
  }
}

template <class S, std::uint32_t width>
void follow(WideRayJob<S>& job) {
  const WideRay<S>& ray = *job.ray;
  S reach = reach_of(ray);
  while (job.depth > 0 && job.depth + max_items_per_step <= job.room) {
    const WideRayItem<S> top = job.stack[--job.depth];
    if (!(top.near <= reach)) continue;
    std::uint32_t item = top.item;
    for (;;) {  // down, as long as there is one child that is nearest
      if ((item & WidePair::leaf_bit) != 0) {
        const std::uint32_t leaf = item & ~WidePair::leaf_bit;
        alignas(64) S own[9 * 16];
        LeafCorners<S> corners{nullptr, 0};
        if (!unfiltered(job, leaf)) {
          keep_corners(job, leaf);
          corners = corners_of(job, leaf, own);
        }
        job.over = decide_leaf(job, leaf, corners);
        if (job.over) return;
        reach = reach_of(ray);
        break;
      }
      if (job.stale != nullptr && job.stale[item] != 0) job.make(job.context, item);
      const WideNode node = job.tree.nodes[item];
      alignas(64) S near[width];
      unsigned hit = entered<S, width>(job.tree.child_bounds + item * std::size_t(6) * width, ray, near) &
                     ((1U << node.count) - 1);
      job.tests += node.count;
      const auto child = [&](std::uint32_t lane) {
        return lane < node.leaf_count ? WidePair::leaf_bit | (node.first_leaf + lane)
                                      : node.first_child + lane - node.leaf_count;
      };
      if (hit == 0) break;
      const auto first = std::uint32_t(__builtin_ctz(hit));
      hit &= hit - 1;
      if (hit == 0) {
        item = child(first);
        continue;
      }
      const auto second = std::uint32_t(__builtin_ctz(hit));
      hit &= hit - 1;
      if (hit == 0 && job.depth + 2 * max_items_per_step <= job.room) {
        const bool swap = near[second] < near[first];
        const std::uint32_t far = swap ? first : second;
        job.stack[job.depth++] = {near[far], child(far)};
        item = child(swap ? second : first);
        continue;
      }
      WideRayItem<S>* const bottom = job.stack + job.depth;
      const auto push = [&](std::uint32_t lane) {
        WideRayItem<S>* place = job.stack + job.depth++;
        for (; place > bottom && place[-1].near < near[lane]; --place) *place = place[-1];
        *place = {near[lane], child(lane)};
      };
      push(first);
      push(second);
      for (; hit != 0; hit &= hit - 1) push(std::uint32_t(__builtin_ctz(hit)));
      break;
    }
  }
}

// ---- Packets
// -----------------------------------------------------------------------------------------------

/// Rays go on alone from a node that no more of them enter.
constexpr int most_alone = 8;

/// Returns the largest limit of a packet's rays.
template <class S>
KBVH_INLINE S largest_limit(const WideRayPacket<S>& packet) {
  using V = Values<S>;
  V most = load_lanes<V>(packet.limit);
  for (std::size_t i = lanes<S>; i < packet.size; i += lanes<S>)
    most = larger(load_lanes<V>(packet.limit + i), most);
  S one[lanes<S>];
  store_lanes<V>(one, most);
  for (std::size_t i = 1; i < lanes<S>; ++i) one[0] = larger(one[i], one[0]);
  return one[0];
}

/// Does the same as `entered` for all rays of a packet: bit i is set unless each ray certainly misses the box
/// of lane i. Sums, differences and products of numbers are monotone, rounded or not, so that those of the
/// smallest and largest numbers bound those of all rays.
template <class S, std::size_t width>
KBVH_INLINE unsigned entered_by_any(const S* rows, const WideRayPacket<S>& packet, S* near) {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;
  using V = Vector<S, lanes>;
  const S limit = largest_limit(packet);
  unsigned missed = 0;
  for (std::size_t i = 0; i < width; i += lanes) {
    V first = V{} + S(0), last = V{} + limit;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const V to = load_lanes<V>(rows + packet.enter_row[axis] * width + i) + packet.least_add[axis];
      const V past = packet.most_add[axis] - load_lanes<V>(rows + packet.leave_row[axis] * width + i);
      first = larger(smaller(to * packet.least_scale[axis], to * packet.most_scale[axis]), first);
      last = smaller(larger(past * packet.least_scale[axis], past * packet.most_scale[axis]), last);
    }
    first = smaller(first, V{} + Slack<S>::largest);
    store_lanes<V>(near + i, first);
    missed |= above<V>(first, last * Slack<S>::grow + Slack<S>::least) << i;
  }
  return ~missed;
}

/// Returns bit i unless ray i of a packet certainly misses a box, or is not followed.
template <class S>
KBVH_INLINE std::uint64_t entering(const WideRayPacket<S>& packet, const S* rows, std::size_t width) {
  using V = Values<S>;
  std::uint64_t missed = 0;
  for (std::size_t i = 0; i < packet.size; i += lanes<S>) {
    V first{}, last = load_lanes<V>(packet.limit + i);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const V add = load_lanes<V>(packet.add[axis] + i), scale = load_lanes<V>(packet.scale[axis] + i);
      first = larger((add + rows[packet.enter_row[axis] * width]) * scale, first);
      last = smaller((add - rows[packet.leave_row[axis] * width]) * scale, last);
    }
    first = smaller(first, V{} + Slack<S>::largest);
    missed |= std::uint64_t(above<V>(first, last * Slack<S>::grow + Slack<S>::least)) << i;
  }
  return ~missed;
}

template <class S, std::uint32_t width>
void together(WidePacketJob<S>& job) {
  WideRayJob<S>& single = *job.single;
  WideRayPacket<S>& packet = *job.packet;
  const S* const bounds = single.tree.child_bounds;
  job.alone = 0;
  while (job.depth > 0 && job.depth + max_items_per_step <= job.room) {
    const WidePacketItem<S> top = job.stack[--job.depth];
    const std::size_t parent = top.box == top.no_box ? 0 : top.box / 8;
    const S* const box = bounds + parent * lane_scalars(width) + top.box % 8;
    std::uint64_t active = 0;
    if (top.box != top.no_box) {
      active = entering(packet, box, width);
      single.tests += packet.searching;
    } else {
      for (std::size_t i = 0; i < packet.size; ++i) active |= std::uint64_t(packet.limit[i] >= 0) << i;
    }
    if (active == 0) continue;
    if ((top.item & WidePair::leaf_bit) != 0) {
      // The rays of the packet share the leaf: the next packet seldom returns to it.
      const std::uint32_t leaf = top.item & ~WidePair::leaf_bit;
      alignas(64) S own[9 * 16];
      const LeafCorners<S> corners =
          unfiltered(single, leaf) ? LeafCorners<S>{nullptr, 0} : corners_of(single, leaf, own);
      for (; active != 0; active &= active - 1) {
        const auto i = unsigned(__builtin_ctzll(active));
        single.ray = packet.rays + i;
        const bool over = decide_leaf(single, leaf, corners);
        packet.limit[i] = over ? S(-1) : single.ray->limit;
        packet.searching -= over ? 1U : 0U;
      }
      continue;
    }
    if (__builtin_popcountll(active) <= most_alone) {
      job.alone = active;
      job.item = top.item;
      return;
    }
    if (single.stale != nullptr && single.stale[top.item] != 0) single.make(single.context, top.item);
    const WideNode node = single.tree.nodes[top.item];
    alignas(64) S near[width];
    unsigned hit = entered_by_any<S, width>(bounds + top.item * lane_scalars(width), packet, near) &
                   ((1U << node.count) - 1);
    single.tests += node.count;
    WidePacketItem<S>* const bottom = job.stack + job.depth;
    for (; hit != 0; hit &= hit - 1) {
      const auto lane = std::uint32_t(__builtin_ctz(hit));
      WidePacketItem<S>* place = job.stack + job.depth++;
      for (; place > bottom && place[-1].near < near[lane]; --place) *place = place[-1];
      *place = {near[lane],
                lane < node.leaf_count ? WidePair::leaf_bit | (node.first_leaf + lane)
                                       : node.first_child + lane - node.leaf_count,
                top.item * 8 + lane};
    }
  }
}

template <class S>
constexpr WideRayKernels<S> table{&follow<S, 2>,   &follow<S, 4>,   &follow<S, 8>, &together<S, 2>,
                                  &together<S, 4>, &together<S, 8>, &screen<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideRayKernels<float> wide_rays_float = table<float>;
const WideRayKernels<double> wide_rays_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
