#include "core/families/restructure/kernels/reinsertion.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

template <class S>
constexpr std::size_t lanes_of = [] {
  constexpr std::size_t fit = native_lanes<S> < 8 ? native_lanes<S> : 8;
  return fit * sizeof(S) < 16 ? std::size_t(1) : fit;  // there are no shorter registers
}();

/// One number for each of eight children, in as many registers as necessary.
template <class S>
struct Eight {
  static constexpr std::size_t lanes = lanes_of<S>, parts = 8 / lanes;
  using V = Vector<S, lanes>;
  V part[parts];

  [[gnu::always_inline]] static Eight load(const S* from) {
    Eight all;
    for (std::size_t i = 0; i < parts; ++i) all.part[i] = load_lanes<V>(from + i * lanes);
    return all;
  }
  [[gnu::always_inline]] void store(S* to) const {
    for (std::size_t i = 0; i < parts; ++i) store_lanes(to + i * lanes, part[i]);
  }
};

template <class S, class Operation>
[[gnu::always_inline]] inline Eight<S> each(const Eight<S>& a, const Eight<S>& b,
                                            const Operation& operation) {
  Eight<S> all;
  for (std::size_t i = 0; i < Eight<S>::parts; ++i) all.part[i] = operation(a.part[i], b.part[i]);
  return all;
}
template <class S>
[[gnu::always_inline]] inline Eight<S> smaller(const Eight<S>& a, const Eight<S>& b) {
  return each(a, b, [](auto x, auto y) { return smaller(x, y); });
}
template <class S>
[[gnu::always_inline]] inline Eight<S> smaller(const Eight<S>& a, S b) {
  Eight<S> all;
  for (std::size_t i = 0; i < Eight<S>::parts; ++i)
    all.part[i] = smaller(a.part[i], typename Eight<S>::V{} + b);
  return all;
}

/// Returns the lanes in another order: lane i comes from lane i ^ distance.
template <std::size_t distance, class S>
[[gnu::always_inline]] inline Eight<S> exchanged(const Eight<S>& a) {
  constexpr std::size_t lanes = Eight<S>::lanes, d = distance;
  Eight<S> all;
  for (std::size_t i = 0; i < Eight<S>::parts; ++i) {
    if constexpr (d >= lanes)
      all.part[i] = a.part[i ^ (d / lanes)];
    else if constexpr (lanes == 2)
      all.part[i] = __builtin_shufflevector(a.part[i], a.part[i], 1, 0);
    else if constexpr (lanes == 4)
      all.part[i] = __builtin_shufflevector(a.part[i], a.part[i], 0 ^ d, 1 ^ d, 2 ^ d, 3 ^ d);
    else
      all.part[i] = __builtin_shufflevector(a.part[i], a.part[i], 0 ^ d, 1 ^ d, 2 ^ d, 3 ^ d, 4 ^ d, 5 ^ d,
                                            6 ^ d, 7 ^ d);
  }
  return all;
}

/// Returns the smallest of all lanes, in all lanes.
template <class S>
[[gnu::always_inline]] inline Eight<S> smallest(Eight<S> a) {
  a = smaller(a, exchanged<1>(a));
  a = smaller(a, exchanged<2>(a));
  return smaller(a, exchanged<4>(a));
}
/// Returns for each lane the smallest of the seven others; `all` is the smallest of all.
template <class S>
[[gnu::always_inline]] inline Eight<S> smallest_others(const Eight<S>& a, Eight<S>& all) {
  const Eight<S> one = exchanged<1>(a), pair = smaller(a, one), other_pair = exchanged<2>(pair),
                 four = smaller(pair, other_pair), other_four = exchanged<4>(four);
  all = smaller(four, other_four);
  return smaller(smaller(one, other_pair), other_four);
}

/// Half the surface of a box whose sides have these negated lengths: the signs cancel.
template <class T>
[[gnu::always_inline]] inline T half_surface(T x, T y, T z) {
  return x * y + y * z + z * x;
}
template <class S>
[[gnu::always_inline]] inline Eight<S> half_surface(const Eight<S> (&rows)[6]) {
  Eight<S> all;
  for (std::size_t i = 0; i < Eight<S>::parts; ++i)
    all.part[i] = half_surface(rows[0].part[i] + rows[3].part[i], rows[1].part[i] + rows[4].part[i],
                               rows[2].part[i] + rows[5].part[i]);
  return all;
}

/// A box as in one lane of a node's rows.
template <class S>
struct Sides {
  S side[6];
  [[gnu::always_inline]] S half_surface() const {
    return kbvh::half_surface(side[0] + side[3], side[1] + side[4], side[2] + side[5]);
  }
};
template <class S>
[[gnu::always_inline]] inline const S* rows_of(const WideArrays<S>& tree, std::uint32_t node) {
  return tree.child_bounds + node * std::size_t(48);
}
template <class S>
[[gnu::always_inline]] inline Sides<S> own_sides(const WideArrays<S>& tree, std::uint32_t node) {
  const S* const own = tree.node_bounds + node * std::size_t(8);
  return {{own[0], own[1], own[2], -own[4], -own[5], -own[6]}};
}

template <class S>
[[gnu::always_inline]] inline Eight<S> surfaces_without(const S* rows, Eight<S>& all_surface) {
  Eight<S> others[6], all[6];
  for (std::size_t row = 0; row < 6; ++row)
    others[row] = smallest_others(Eight<S>::load(rows + row * 8), all[row]);
  all_surface = half_surface(all);
  return half_surface(others);
}

template <class S>
void gains(const WideArrays<S>& tree, std::uint32_t node, S* gains) {
  Eight<S> all;
  const Eight<S> without = surfaces_without(rows_of(tree, node), all);
  each(all, without, [](auto x, auto y) { return x - y; }).store(gains);
}

template <class S>
double growths(const WideArrays<S>& tree, const std::uint32_t* nodes, std::uint32_t count, const S* settled,
               S growth, S* scores) {
  double sum = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const S own = own_sides(tree, nodes[i]).half_surface(), before = settled[nodes[i]];
    scores[i] = own > growth * before ? own - before : S(0);
    sum += double(own);
  }
  return sum;
}

template <class S>
void box(const S* rows, S* box) {
  for (std::size_t row = 0; row < 6; ++row) {
    S all[8];
    smallest(Eight<S>::load(rows + row * 8)).store(all);
    box[row < 3 ? row : row + 1] = row < 3 ? all[0] : -all[0];
  }
}

/// Computes the box of a node's children, one of which is replaced by another box.
template <class S>
[[gnu::always_inline]] inline Sides<S> with_other(const S* rows, std::uint32_t lane, const Sides<S>& other) {
  Sides<S> result;
  for (std::size_t row = 0; row < 6; ++row) {
    S changed[8];
    Eight<S>::load(rows + row * 8).store(changed);
    changed[lane] = other.side[row];
    smallest(Eight<S>::load(changed)).store(changed);
    result.side[row] = changed[0];
  }
  return result;
}

/// One search: the moved box, and the best place found so far.
template <class S>
struct Search {
  ReinsertionSearch<S>& job;
  const WideArrays<S> tree;
  Sides<S> moved;
  S surface;  // half the surface of the moved box
  S saved;    // surface saved by taking it out, below the node where the search starts
  S best;     // gain so far
  std::size_t depth = 0;

  [[gnu::always_inline]] void consider(S cost, std::uint32_t target, std::uint32_t lane) {
    if (saved - cost > best) {
      best = saved - cost;
      job.target = target;
      job.target_lane = lane;
    }
  }

  /// Compares the children of a node, except one, and opens those that may lie above a better place; the
  /// nearest comes last, and is searched first.
  void look_at(std::uint32_t index, S path, std::uint32_t but) {
    ++job.visits;
    const WideNode node = tree.nodes[index];
    const S* const rows = rows_of(tree, index);
    Eight<S> before[6], after[6];
    for (std::size_t row = 0; row < 6; ++row) {
      before[row] = Eight<S>::load(rows + row * 8);
      after[row] = smaller(before[row], moved.side[row]);
    }
    const Eight<S> joined = half_surface(after);
    const Eight<S> grown = each(joined, half_surface(before), [](auto x, auto y) { return x - y; });
    S surfaces[8], growths[8];
    joined.store(surfaces);
    grown.store(growths);
    const std::size_t first = depth;
    for (std::uint32_t lane = 0; lane < node.count; ++lane) {
      if (lane == but) continue;
      consider(path + surfaces[lane] * (1 + 2 * job.lane_price), index, lane);
      if (lane < node.leaf_count) continue;
      const S below = path + growths[lane];
      if (!(saved - (below + job.lane_price * surface) > best)) continue;
      std::size_t at = depth++;
      for (; at > first && job.stack[at - 1].path < below; --at) job.stack[at] = job.stack[at - 1];
      job.stack[at] = {below, surfaces[lane], node.first_child + lane - node.leaf_count};
    }
  }

  /// Searches everything below the children of a node, except one.
  void below(std::uint32_t index, std::uint32_t but) {
    look_at(index, 0, but);
    while (depth != 0) {
      const ReinsertionOpen<S> open = job.stack[--depth];
      if (!(saved - (open.path + job.lane_price * surface) > best)) continue;
      if (job.visits >= job.most_visits) {
        depth = 0;
        return;
      }
      if (tree.nodes[open.node].count < 8)
        consider(open.path + job.lane_price * open.surface, open.node, ReinsertionSearch<S>::into);
      look_at(open.node, open.path, ReinsertionSearch<S>::into);
    }
  }
};

template <class S>
void search(ReinsertionSearch<S>& job) {
  const WideArrays<S>& tree = job.tree.arrays;
  job.visits = 0;
  job.gain = 0;
  const S infinity = S(__builtin_inf());
  const S* const rows = rows_of(tree, job.node);
  Search<S> s{job, tree, {}, 0, 0, 0};
  for (std::size_t row = 0; row < 6; ++row) s.moved.side[row] = rows[row * 8 + job.lane];
  s.surface = s.moved.half_surface();
  const S own = own_sides(tree, job.node).half_surface();
  s.best = job.least * own;
  s.saved = job.lane_price * own;
  Sides<S> rest = with_other(rows, job.lane, {{infinity, infinity, infinity, infinity, infinity, infinity}});
  if (tree.nodes[job.node].count == 2) {
    s.saved += own * (1 + job.lane_price);  // the other child takes the node's place
  } else {
    if (s.saved > s.best) s.below(job.node, job.lane);
    s.saved += own - rest.half_surface();
  }
  S own_path = own;
  for (std::uint32_t path = job.node; path != 0 && job.visits < job.most_visits;) {
    const std::uint32_t above = job.tree.block_parent[path / 8];
    const std::uint32_t lane = path % 8 + tree.nodes[above].leaf_count;
    const S surface = own_sides(tree, above).half_surface();
    if (s.saved > s.best) {
      if (tree.nodes[above].count < 8)
        s.consider(job.lane_price * surface, above, ReinsertionSearch<S>::into);
      if (path != job.node || tree.nodes[path].count > 2)
        s.consider(own_path * (1 + 2 * job.lane_price), above, lane);  // next to the siblings that it leaves
      s.below(above, lane);
    }
    rest = with_other(rows_of(tree, above), lane, rest);
    s.saved += surface - rest.half_surface();
    path = above;
    own_path = surface;
  }
  if (s.best > job.least * own) job.gain = s.best;
}

template <class S>
constexpr ReinsertionKernels<S> table{&search<S>, &gains<S>, &growths<S>, &box<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const ReinsertionKernels<float> reinsertion_float = table<float>;
const ReinsertionKernels<double> reinsertion_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
