// k-DOPs, a node at a time: the lanes of a vector are slabs of one node.
#include "core/families/volumes/kernels/dop.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

/// The lanes of a vector that processes `count` sides: as many as fit into a register and divide the count.
template <class S, std::size_t count>
constexpr std::size_t lanes_over = [] {
  std::size_t lanes = native_lanes<S>;
  while (lanes > 1 && count % lanes != 0) lanes /= 2;
  return lanes * sizeof(S) < 16 ? std::size_t(1) : lanes;  // there are no shorter registers
}();

/// Returns the largest absolute value of many numbers.
template <class S>
S reach(const S* numbers, std::size_t count) {
  constexpr std::size_t lanes = native_lanes<S>;
  using V = Vector<S, lanes>;
  V most[4] = {};
  std::size_t i = 0;
  for (; i + 4 * lanes <= count; i += 4 * lanes)
    for (std::size_t j = 0; j < 4; ++j) {
      const V x = load_lanes<V>(numbers + i + lanes * j);
      most[j] = larger(larger(x, -x), most[j]);
    }
  S each[4 * lanes];
  for (std::size_t j = 0; j < 4; ++j) store_lanes(each + lanes * j, most[j]);
  S result = 0;
  for (const S x : each) result = larger(x, result);
  for (; i < count; ++i) result = larger(larger(numbers[i], -numbers[i]), result);
  return result;
}

template <class S, std::size_t padded>
void fit_leaf(const DopRefit<S>& job, const DopNode& leaf, S* sides) {
  constexpr std::size_t half = padded / 2, lanes = lanes_over<S, half>, vectors = half / lanes;
  using V = Vector<S, lanes>;
  V least[vectors], most[vectors];
  const auto along = [&](const S* p, std::size_t i) {
    const S* const n = job.directions + lanes * i;
    return load_lanes<V>(n) * p[0] + load_lanes<V>(n + half) * p[1] + load_lanes<V>(n + 2 * half) * p[2];
  };
  const S* p = job.positions + std::size_t(3) * job.points[leaf.first];
  for (std::size_t i = 0; i < vectors; ++i) least[i] = most[i] = along(p, i);
  for (std::uint32_t k = leaf.first + 1; k < leaf.end; ++k) {
    p = job.positions + std::size_t(3) * job.points[k];
    for (std::size_t i = 0; i < vectors; ++i) {
      const V at = along(p, i);
      least[i] = smaller(at, least[i]);
      most[i] = larger(at, most[i]);
    }
  }
  for (std::size_t i = 0; i < vectors; ++i) {
    const V margin = load_lanes<V>(job.margins + lanes * i);
    store_lanes(sides + lanes * i, most[i] + margin);
    store_lanes(sides + half + lanes * i, margin - least[i]);
  }
}

template <class S, std::size_t padded>
void refit(const DopRefit<S>& job) {
  constexpr std::size_t lanes = lanes_over<S, padded>;
  using V = Vector<S, lanes>;
  for (std::uint32_t node = job.node_count; node-- > 0;) {
    const DopNode content = job.nodes[node];
    S* const sides = job.sides + padded * node;
    if (content.leaf) {
      fit_leaf<S, padded>(job, content, sides);
      continue;
    }
    const S* const children = job.sides + padded * content.first;
    for (std::size_t i = 0; i < padded; i += lanes) {
      V best = load_lanes<V>(children + i);
      for (std::size_t child = 1; child < content.end - content.first; ++child)
        best = larger(load_lanes<V>(children + padded * child + i), best);
      store_lanes(sides + i, best);
    }
  }
}

/// Returns bits of the slabs, among `lanes` consecutive ones, in which b lies entirely below a.
template <class S, std::size_t lanes>
[[gnu::always_inline]] inline unsigned apart(const S* negated_lower_a, const S* upper_b) {
  using V = Vector<S, lanes>;
  return mask_bits(-load_lanes<V>(negated_lower_a) > load_lanes<V>(upper_b));
}

template <class S, std::size_t padded>
bool overlap(const S* a, const S* b) {
  constexpr std::size_t half = padded / 2, lanes = lanes_over<S, half>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < half; i += lanes)
    bits |= apart<S, lanes>(a + half + i, b + i) | apart<S, lanes>(b + half + i, a + i);
  return bits == 0;
}

/// Returns the sum of the extents along the axes.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline S extent(const S* sides) {
  const S* const lower = sides + padded / 2;
  return (sides[0] + lower[0]) + (sides[1] + lower[1]) + (sides[2] + lower[2]);
}

template <class S, std::size_t padded>
void search(DopSearch<S>& job) {
  const auto sides_a = [&](std::uint32_t node) { return job.sides_a + padded * node; };
  const auto sides_b = [&](std::uint32_t node) { return job.sides_b + padded * node; };
  while (job.depth > 0 && job.found_count < job.found_room && job.depth + dop_search_step <= job.stack_room &&
         job.tests < job.most_tests) {
    const DopPair pair = job.stack[--job.depth];
    const DopNode a = job.nodes_a[pair.a], b = job.nodes_b[pair.b];
    if (a.leaf && b.leaf) {
      job.found[job.found_count++] = pair;
      continue;
    }
    if (job.within && pair.a == pair.b) {
      for (std::uint32_t i = a.first; i < a.end; ++i) {
        job.stack[job.depth++] = {i, i};
        for (std::uint32_t j = i + 1; j < a.end; ++j, ++job.tests)
          if (overlap<S, padded>(sides_a(i), sides_a(j))) job.stack[job.depth++] = {i, j};
      }
      continue;
    }
    const bool into_a =
        b.leaf || (!a.leaf && extent<S, padded>(sides_a(pair.a)) >= extent<S, padded>(sides_b(pair.b)));
    if (into_a) {
      for (std::uint32_t i = a.first; i < a.end; ++i)
        if (overlap<S, padded>(sides_a(i), sides_b(pair.b))) job.stack[job.depth++] = {i, pair.b};
      job.tests += a.end - a.first;
    } else {
      for (std::uint32_t i = b.first; i < b.end; ++i)
        if (overlap<S, padded>(sides_a(pair.a), sides_b(i))) job.stack[job.depth++] = {pair.a, i};
      job.tests += b.end - b.first;
    }
  }
}

template <class S>
constexpr DopKernels<S> table{{&refit<S, 16>, &refit<S, 32>},
                              {&search<S, 16>, &search<S, 32>},
                              {&overlap<S, 16>, &overlap<S, 32>},
                              &reach<S>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const DopKernels<float> dop_float = table<float>;
const DopKernels<double> dop_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
