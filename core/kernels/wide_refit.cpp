#include "core/kernels/wide_refit.hpp"

#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

/// Boxes of the `width` children of a node, from one point each (lower and upper corners, 8 numbers from one
/// child to the next) or from a list of vertices, into the node's rows and its own box.
template <class S, std::uint32_t width>
struct NodeFit {
  using P = Points<S, width == 8 ? 2 : 1>;
  using Pack = typename P::Pack;
  static constexpr std::uint32_t packs = width < 4 ? width : 4;
  static constexpr std::uint32_t per_pass = packs * std::uint32_t(P::points);

  Pack smallest, largest;

  /// Writes the rows of one pass over the children [first, first + per_pass).
  [[gnu::always_inline]] inline void take(Pack (&lower)[4], Pack (&upper)[4], S* rows, std::uint32_t first) {
    Pack low = lower[0], high = upper[0];
    for (std::uint32_t j = 1; j < packs; ++j) {
      low = smaller(low, lower[j]);
      high = larger(high, upper[j]);
    }
    for (std::uint32_t j = packs; j < 4; ++j) {
      lower[j] = lower[0];
      upper[j] = upper[0];
    }
    smallest = first == 0 ? low : smaller(smallest, low);
    largest = first == 0 ? high : larger(largest, high);
    P::store_rows(lower, rows + first, width, per_pass);
    for (Pack& pack : upper) pack = P::negated(pack);
    P::store_rows(upper, rows + 3 * width + first, width, per_pass);
  }

  [[gnu::always_inline]] inline void from_lists(const std::uint32_t* vertices, std::uint32_t length,
                                                const S* positions, S* rows) {
    for (std::uint32_t first = 0; first < width; first += per_pass) {
      Pack lower[4], upper[4];
      const std::uint32_t* at = vertices + first;
      for (std::uint32_t j = 0; j < packs; ++j)
        lower[j] = upper[j] = P::load(positions + at[j], positions + at[(j + 4) % width]);
      for (std::uint32_t i = 1; i < length; ++i) {
        at += width;
        for (std::uint32_t j = 0; j < packs; ++j) {
          const Pack p = P::load(positions + at[j], positions + at[(j + 4) % width]);
          lower[j] = smaller(lower[j], p);
          upper[j] = larger(upper[j], p);
        }
      }
      take(lower, upper, rows, first);
    }
  }

  [[gnu::always_inline]] inline void from_boxes(const S* boxes, S* rows) {
    for (std::uint32_t first = 0; first < width; first += per_pass) {
      Pack lower[4], upper[4];
      for (std::uint32_t j = 0; j < packs; ++j) {
        const S *one = boxes + 8 * (first + j), *other = boxes + 8 * ((first + j + 4) % width);
        lower[j] = P::load(one, other);
        upper[j] = P::load(one + 4, other + 4);
      }
      take(lower, upper, rows, first);
    }
  }

  [[gnu::always_inline]] inline void store_own(S* own) const {
    P::store_smallest(own, smallest);
    P::store_largest(own + 4, largest);
  }
};

/// Leaves beside nodes, or empty lanes (SAH trees; the root): one box at a time.
template <class S, std::uint32_t width>
[[gnu::noinline]] void gather_boxes(const WideArrays<S>& h, const WideNode& node, const S* positions,
                                    S* boxes) {
  using P = Points<S, 1>;
  for (std::uint32_t lane = 0; lane < width; ++lane) {
    S* box = boxes + 8 * lane;
    if (lane < node.leaf_count) {
      const std::uint32_t* at = h.vertices + node.list + lane;
      auto lower = P::load(positions + *at, positions), upper = lower;
      for (std::uint32_t i = 1; i < node.length; ++i) {
        const auto p = P::load(positions + at[i * width], positions);
        lower = smaller(lower, p);
        upper = larger(upper, p);
      }
      P::store_smallest(box, lower);
      P::store_largest(box + 4, upper);
    } else if (lane < node.count) {
      const S* own = h.own + std::size_t(8) * (node.first_child + lane - node.leaf_count);
      for (int i = 0; i < 8; ++i) box[i] = own[i];
    } else {
      for (int i = 0; i < 8; ++i) box[i] = S(i < 4 ? __builtin_inf() : -__builtin_inf());
    }
  }
}

template <class S, std::uint32_t width>
void refit(WideArrays<S> h, const S* positions, std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t i = end; i-- > begin;) {
    const WideNode node = h.nodes[i];
    S* rows = h.lanes + std::size_t(i) * 6 * width;
    NodeFit<S, width> fit;
    if (node.leaf_count == width) {
      fit.from_lists(h.vertices + node.list, node.length, positions, rows);
    } else if (node.leaf_count == 0 && node.count == width) {
      fit.from_boxes(h.own + std::size_t(8) * node.first_child, rows);
    } else {
      alignas(64) S boxes[8 * width];
      gather_boxes<S, width>(h, node, positions, boxes);
      fit.from_boxes(boxes, rows);
    }
    fit.store_own(h.own + std::size_t(8) * i);
  }
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideRefitKernels<float> wide_refit_float{&refit<float, 2>, &refit<float, 4>, &refit<float, 8>};
const WideRefitKernels<double> wide_refit_double{&refit<double, 2>, &refit<double, 4>, &refit<double, 8>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
