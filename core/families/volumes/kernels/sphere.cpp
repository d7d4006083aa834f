// Spheres in rows of eight lanes. u is half a unit in the last place of 1: the relative error of a rounding.
#include "core/families/volumes/kernels/sphere.hpp"

#include "core/families/volumes/kernels/lane_points.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

template <class S>
constexpr S unit = sizeof(S) == 4 ? S(0x1p-24) : S(0x1p-53);
/// The relative error of a squared distance is 5 roundings (a difference counts twice), of its root 3.5, and
/// of the product with this number 1 more.
template <class S>
constexpr S upward = S(1) + 8 * unit<S>;
/// A sum of a radius and an upper bound: one rounding, and one for this product.
template <class S>
constexpr S upward_sum = S(1) + 4 * unit<S>;

template <class S, class V>
[[gnu::always_inline]] inline V squared(V x, V y, V z) {
  return x * x + y * y + z * z;
}

enum class Reach { wrapped, layered };

/// Fits the leaves of a node: the rows of their spheres, and the box around all. Their points remain in the
/// scratch.
template <class S>
[[gnu::always_inline]] inline void fit_leaves(const SphereRefit<S>& job, const WideNode& node, S* rows,
                                              S* box) {
  using V = Eighth<S>;
  load_lists<S>(job.lists + node.list, node.length, job.positions, job.scratch);
  S sides[6][8];
  for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
    V low[3], high[3], centre[3];
    const S* const points = job.scratch + lane;
    for (std::size_t d = 0; d < 3; ++d) low[d] = high[d] = load_lanes<V>(points + 8 * d);
    for (std::size_t i = 1; i < node.length; ++i)
      for (std::size_t d = 0; d < 3; ++d) {
        const V x = load_lanes<V>(points + 24 * i + 8 * d);
        low[d] = smaller(low[d], x);
        high[d] = larger(high[d], x);
      }
    for (std::size_t d = 0; d < 3; ++d) {
      centre[d] = low[d] * S(0.5) + high[d] * S(0.5);
      store_lanes(rows + 8 * d + lane, centre[d]);
      store_lanes(sides[d] + lane, low[d]);
      store_lanes(sides[3 + d] + lane, high[d]);
    }
    V most = {};
    for (std::size_t i = 0; i < node.length; ++i) {
      const S* const p = points + 24 * i;
      most = larger(squared<S>(load_lanes<V>(p) - centre[0], load_lanes<V>(p + 8) - centre[1],
                               load_lanes<V>(p + 16) - centre[2]),
                    most);
    }
    store_lanes(rows + 24 + lane, root(most) * upward<S> + job.least);
  }
  for (std::size_t d = 0; d < 3; ++d) {
    S low = sides[d][0], high = sides[3 + d][0];
    for (std::size_t lane = 1; lane < 8; ++lane) {
      low = smaller(sides[d][lane], low);
      high = larger(sides[3 + d][lane], high);
    }
    box[d] = low;
    box[4 + d] = high;
  }
}

/// Returns the radius around a centre that reaches all points of a node's leaves, which the scratch holds.
template <class S>
[[gnu::always_inline]] inline S radius_of_leaves(const SphereRefit<S>& job, const WideNode& node,
                                                 const S* centre) {
  using V = Eighth<S>;
  V most = {};
  for (std::size_t i = 0; i < node.length; ++i)
    for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
      const S* const p = job.scratch + 24 * i + lane;
      most = larger(squared<S>(load_lanes<V>(p) - centre[0], load_lanes<V>(p + 8) - centre[1],
                               load_lanes<V>(p + 16) - centre[2]),
                    most);
    }
  return root_of(largest_of<S>(most)) * upward<S> + job.least;
}

/// Does the same for all points below a node, from the rows of coordinates.
template <class S>
[[gnu::always_inline]] inline S radius_of_points(const SphereRefit<S>& job, std::uint32_t node,
                                                 const S* centre) {
  const S *const x = job.coordinates, *const y = x + job.point_count, *const z = y + job.point_count;
  S most = 0;
  Vector<S, lanes_up_to<S, 16>> wide = {};
  Vector<S, lanes_up_to<S, 4>> narrow = {};
  in_vectors<S>(job.ranges[2 * node], job.ranges[2 * node + 1], [&]<class V>(std::size_t i, V) {
    const V at = squared<S>(load_lanes<V>(x + i) - centre[0], load_lanes<V>(y + i) - centre[1],
                            load_lanes<V>(z + i) - centre[2]);
    if constexpr (sizeof(V) == sizeof wide)
      wide = larger(at, wide);
    else if constexpr (sizeof(V) == sizeof narrow)
      narrow = larger(at, narrow);
    else
      most = larger(at, most);
  });
  most = larger(largest_of<S>(wide), larger(largest_of<S>(narrow), most));
  return root_of(most) * upward<S> + job.least;
}

/// Returns the radius that reaches all children's spheres, but not beyond the furthest corner of the node's
/// box.
template <class S>
[[gnu::always_inline]] inline S radius_of_children(const SphereRefit<S>& job, const S* rows, const S* box,
                                                   const S* centre) {
  using V = Eighth<S>;
  V most = {};
  for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
    const S* const at = rows + lane;
    const V distance = root(squared<S>(load_lanes<V>(at) - centre[0], load_lanes<V>(at + 8) - centre[1],
                                       load_lanes<V>(at + 16) - centre[2])) *
                           upward<S> +
                       job.least;
    most = larger((distance + load_lanes<V>(at + 24)) * upward_sum<S>, most);
  }
  S corner[3];
  for (std::size_t d = 0; d < 3; ++d)
    corner[d] = larger(magnitude(box[d] - centre[d]), magnitude(box[4 + d] - centre[d]));
  return smaller(root_of(squared<S>(corner[0], corner[1], corner[2])) * upward<S> + job.least,
                 largest_of<S>(most));
}

template <class S, Reach reach>
[[gnu::always_inline]] inline void fit_node(const SphereRefit<S>& job, std::uint32_t index) {
  const WideNode node = job.nodes[index];
  S *const rows = job.rows + std::size_t(32) * index, *const own = job.own + std::size_t(4) * index,
           *const box = job.boxes + std::size_t(8) * index;
  if (node.leaf_count != 0) fit_leaves<S>(job, node, rows, box);
  if (node.leaf_count != node.count) {
    for (std::size_t lane = node.leaf_count; lane < 8; ++lane) {
      const std::size_t child =
          node.first_child + (lane < node.count ? std::uint32_t(lane) - node.leaf_count : 0);
      for (std::size_t row = 0; row < 4; ++row) rows[8 * row + lane] = job.own[4 * child + row];
      if (lane >= node.count) continue;
      const S* const child_box = job.boxes + 8 * child;
      const bool first = lane == 0;
      for (std::size_t d = 0; d < 3; ++d) {
        box[d] = first ? child_box[d] : smaller(child_box[d], box[d]);
        box[4 + d] = first ? child_box[4 + d] : larger(child_box[4 + d], box[4 + d]);
      }
    }
  }
  for (std::size_t d = 0; d < 3; ++d) own[d] = box[d] * S(0.5) + box[4 + d] * S(0.5);
  if constexpr (reach == Reach::layered)
    own[3] = radius_of_children<S>(job, rows, box, own);
  else
    own[3] = node.leaf_count == node.count ? radius_of_leaves<S>(job, node, own)
                                           : radius_of_points<S>(job, index, own);
}

template <class S, Reach reach>
void refit(const SphereRefit<S>& job) {
  if constexpr (reach == Reach::wrapped)
    load_points<S>(job.points, job.point_count, job.positions, job.coordinates);
  // Nodes with leaves only come first, in ascending order, which suits the prefetcher; then the others,
  // children before parents.
  for (std::uint32_t i = 0; i < job.node_count; ++i)
    if (job.nodes[i].leaf_count == job.nodes[i].count) fit_node<S, reach>(job, i);
  for (std::uint32_t i = job.node_count; i-- > 0;)
    if (job.nodes[i].leaf_count != job.nodes[i].count) fit_node<S, reach>(job, i);
}

template <class S>
struct Ball {
  S x, y, z, radius;
};
/// Relative to the square of two radii: 5 roundings of the squared distance, 3 of the squared sum, 2 of the
/// comparison. Underflow of squares loses less than the absolute number; if they overflow, spheres overlap.
template <class S>
constexpr S square_margin = S(1) + 16 * unit<S>;
template <class S>
constexpr S square_loss = sizeof(S) == 4 ? S(0x1p-144) : S(0x1p-1070);

/// Returns bits of the lanes of rows that do not overlap a ball.
template <class S>
[[gnu::always_inline]] inline unsigned apart(const S* rows, const Ball<S>& ball) {
  using V = Eighth<S>;
  unsigned bits = 0;
  for (std::size_t lane = 0; lane < 8; lane += eighth<S>) {
    const S* const at = rows + lane;
    const V distance = squared<S>(load_lanes<V>(at) - ball.x, load_lanes<V>(at + 8) - ball.y,
                                  load_lanes<V>(at + 16) - ball.z);
    const V both = load_lanes<V>(at + 24) + ball.radius;
    bits |= mask_bits(distance > both * both * square_margin<S> + square_loss<S>) << lane;
  }
  return bits;
}

template <class S, bool within>
struct SphereView {
  static constexpr bool within_one = within, selects = false;
  const LanePair<S>& pair;

  [[gnu::always_inline]] static bool waits(const WideTraversal&) { return false; }
  [[gnu::always_inline]] static void enter(std::uint32_t, std::uint32_t) {}
  [[gnu::always_inline]] Ball<S> own_b(std::uint32_t node) const {
    const S* const own = pair.own_b + std::size_t(4) * node;
    return {own[0], own[1], own[2], own[3]};
  }
  [[gnu::always_inline]] static Ball<S> lane_of(const S* rows, std::uint32_t node, std::uint32_t lane) {
    rows += std::size_t(32) * node + lane;
    return {rows[0], rows[8], rows[16], rows[24]};
  }
  [[gnu::always_inline]] Ball<S> lane_a(std::uint32_t node, std::uint32_t lane) const {
    return lane_of(pair.rows_a, node, lane);
  }
  [[gnu::always_inline]] Ball<S> lane_b(std::uint32_t node, std::uint32_t lane) const {
    return lane_of(pair.rows_b, node, lane);
  }
  [[gnu::always_inline]] static unsigned meeting(const WideNode& node, const S* rows, const Ball<S>& ball) {
    return ~apart<S>(rows, ball) & ((1U << node.count) - 1);
  }
  [[gnu::always_inline]] unsigned meeting_a(std::uint32_t node, const Ball<S>& ball) const {
    return meeting(pair.nodes_a[node], pair.rows_a + std::size_t(32) * node, ball);
  }
  [[gnu::always_inline]] unsigned meeting_b(std::uint32_t node, const Ball<S>& ball) const {
    return meeting(pair.nodes_b[node], pair.rows_b + std::size_t(32) * node, ball);
  }
};

template <class S, bool within>
void traverse(const LanePair<S>& pair, WideTraversal& state) {
  SphereView<S, within> view{pair};
  const WideArrays<S> a{pair.nodes_a, nullptr, nullptr, nullptr}, b{pair.nodes_b, nullptr, nullptr, nullptr};
  traverse_pairs<S>(a, b, view, state);
}

template <class S>
bool overlap(const S* a, const S* b) {
  const S distance = squared<S>(a[0] - b[0], a[1] - b[1], a[2] - b[2]), both = a[3] + b[3];
  return !(distance > both * both * square_margin<S> + square_loss<S>);
}

template <class S>
constexpr SphereKernels<S> table{&refit<S, Reach::wrapped>, &refit<S, Reach::layered>, &traverse<S, false>,
                                 &traverse<S, true>, &overlap<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const SphereKernels<float> sphere_float = table<float>;
const SphereKernels<double> sphere_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
