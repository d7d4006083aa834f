#include "core/families/wide/kernels/wide_rays.hpp"

#include "core/geometry/filter_bounds.hpp"
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

template <class S>
KBVH_INLINE Point<S> cross(const Point<S>& p, const Point<S>& q) {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}
/// Returns the sums of absolute products of a cross product, and the underflow term for float.
template <class S>
KBVH_INLINE Point<S> cross_magnitude(const Point<S>& p, const Point<S>& q) {
  constexpr S minor = sizeof(S) == sizeof(float) ? S(filter::minor3f) : S(0);
  return {p.y * q.z + p.z * q.y + minor, p.z * q.x + p.x * q.z + minor, p.x * q.y + p.y * q.x + minor};
}
template <class S>
KBVH_INLINE Values<S> error_bound(Values<S> permanent) {
  if constexpr (sizeof(S) == sizeof(float))
    return permanent * filter::relative3f + filter::absolute3f;
  else
    return permanent * filter::relative3d + filter::absolute3d;
}

/// Returns a mask of the triangles that the ray may meet within its limit; rows[c][k] is corner c of triangle
/// k. Uses the volumes of core/geometry/ray_triangle.cpp with one error bound for all three, computed from
/// the largest edges and distances.
template <class S>
KBVH_INLINE unsigned may_meet(const WideRay<S>& ray, const S* const (&rows)[3][lanes<S>]) {
  const Point<S> corner[3] = {load_points(rows[0]), load_points(rows[1]), load_points(rows[2])};
  const Values<S> zero{};
  const Point<S> origin{zero + ray.origin[0], zero + ray.origin[1], zero + ray.origin[2]};
  const Point<S> direction{zero + ray.direction[0], zero + ray.direction[1], zero + ray.direction[2]};
  const Point<S> to[3] = {corner[0] - origin, corner[1] - origin, corner[2] - origin};
  const Point<S> edge[3] = {corner[1] - corner[0], corner[2] - corner[1], corner[0] - corner[2]};
  const Values<S> v0 = dot(cross(to[0], edge[0]), direction), v1 = dot(cross(to[1], edge[1]), direction),
                  v2 = dot(cross(to[2], edge[2]), direction);
  const Point<S> reach = larger(larger(absolute(to[0]), absolute(to[1])), absolute(to[2]));
  const Point<S> size = larger(larger(absolute(edge[0]), absolute(edge[1])), absolute(edge[2]));
  const Point<S> steepness = absolute(direction);
  const Values<S> bound = error_bound<S>(dot(cross_magnitude(reach, size), steepness));
  const Values<S> lowest = smaller(smaller(v0, v1), v2);
  const Values<S> highest = larger(larger(v0, v1), v2);
  Words<S> missed = greater<S>(-lowest, bound) & greater<S>(highest, bound);
  // Beyond the limit: |height| > limit |slope|; or behind the origin: height and slope have different signs.
  const Point<S> normal = cross(edge[2], edge[0]), magnitude = cross_magnitude(size, size);
  const Values<S> height = dot(normal, to[0]), slope = dot(normal, direction);
  const Values<S> height_bound = error_bound<S>(dot(magnitude, reach)),
                  slope_bound = error_bound<S>(dot(magnitude, steepness));
  const Values<S> far = (absolute<S>(slope) + slope_bound) * ray.limit * S(1 + 0x1p-20);
  missed |= greater<S>(absolute<S>(height) - height_bound, far);
  const Words<S> differ = bits<S>(height) ^ bits<S>(slope);
  const unsigned behind = high_bits<S>(differ) & high_bits<S>(greater<S>(absolute<S>(height), height_bound)) &
                          high_bits<S>(greater<S>(absolute<S>(slope), slope_bound));
  return ~(high_bits<S>(missed) | behind);
}

/// Decides the primitives of a leaf that the ray may meet. Returns whether the search has ended.
template <class S>
KBVH_INLINE bool decide_leaf(WideRayJob<S>& job, std::uint32_t begin, std::uint32_t end) {
  if (job.offsets == nullptr || end - begin < 2) {
    for (; begin < end; ++begin)
      if (job.decide(job.context, job.entries[begin])) return true;
    return false;
  }
  job.tests += end - begin;  // added at once: the same with registers of any width
  for (; begin < end; begin += lanes<S>) {
    const std::uint32_t count = end - begin < lanes<S> ? end - begin : lanes<S>;
    const S* rows[3][lanes<S>];
    unsigned unusual = 0;
    if (job.triangle_corners != nullptr) {
      const std::uint32_t* const corners = job.triangle_corners + std::size_t(3) * begin;
      for (std::uint32_t k = 0; k < lanes<S>; ++k)
        for (std::uint32_t c = 0; c < 3; ++c)
          rows[c][k] = job.positions + corners[3 * (k < count ? k : 0) + c];
    } else {
      for (std::uint32_t k = 0; k < lanes<S>; ++k) {
        const std::uint32_t primitive = job.entries[begin + (k < count ? k : 0)];
        const std::uint32_t corner = job.offsets[primitive];
        const bool triangle = job.offsets[primitive + 1] - corner == 3;
        unusual |= unsigned(!triangle) << k;
        for (std::uint32_t c = 0; c < 3; ++c)
          rows[c][k] = job.positions + std::size_t(3) * job.vertices[corner + (triangle ? c : 0)];
      }
    }
    unsigned open = (may_meet<S>(*job.ray, rows) | unusual) & ((2U << (count - 1)) - 1);
    for (; open != 0; open &= open - 1)
      if (job.decide(job.context, job.entries[begin + unsigned(__builtin_ctz(open))])) return true;
  }
  return false;
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
        const LeafSlot slot{item & ~WidePair::leaf_bit};
        const std::uint32_t leaf = job.tree.nodes[slot.node()].first_leaf + slot.lane();
        job.over = decide_leaf(job, job.first_entry[leaf], job.end_entry[leaf]);
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
        return lane < node.leaf_count ? WidePair::leaf_bit | LeafSlot::of(item, lane)
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

template <class S>
constexpr WideRayKernels<S> table{&follow<S, 2>, &follow<S, 4>, &follow<S, 8>, &screen<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideRayKernels<float> wide_rays_float = table<float>;
const WideRayKernels<double> wide_rays_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
