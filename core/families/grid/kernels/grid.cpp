#include "core/families/grid/kernels/grid.hpp"

#include "core/kernels/lanes.hpp"

namespace kbvh {
namespace {

template <class S>
constexpr bool in_registers = native_lanes<S> >= 4;

/// Three numbers where no register is suitable.
template <class S>
struct Plain {
  S v[4];
  [[gnu::always_inline]] S operator[](int i) const { return v[i]; }
};
template <class S, class Operation>
[[gnu::always_inline]] inline Plain<S> each(Plain<S> a, Plain<S> b, Operation operation) {
  return {{operation(a.v[0], b.v[0]), operation(a.v[1], b.v[1]), operation(a.v[2], b.v[2]), S(0)}};
}
template <class S>
[[gnu::always_inline]] inline Plain<S> smaller(Plain<S> a, Plain<S> b) {
  return each(a, b, [](S x, S y) { return x < y ? x : y; });
}
template <class S>
[[gnu::always_inline]] inline Plain<S> larger(Plain<S> a, Plain<S> b) {
  return each(a, b, [](S x, S y) { return x > y ? x : y; });
}
template <class S>
[[gnu::always_inline]] inline Plain<S> operator-(Plain<S> a, Plain<S> b) {
  return each(a, b, [](S x, S y) { return x - y; });
}

template <class S>
struct PointOf {
  using type = Plain<S>;
};
template <class S>
requires(in_registers<S>) struct PointOf<S> {
  using type = Vector<S, 4>;
};
/// A point in four lanes; the last lane is unused.
template <class S>
using Point = typename PointOf<S>::type;

template <class S>
[[gnu::always_inline]] inline Point<S> load(const S* from) {
  if constexpr (in_registers<S>)
    return load_lanes<Point<S>>(from);
  else
    return {{from[0], from[1], from[2], S(0)}};
}
template <class S>
[[gnu::always_inline]] inline void store(S* to, Point<S> p) {
  for (int axis = 0; axis < 3; ++axis) to[axis] = p[axis];
}
/// Returns whether a <= b along all axes.
template <class S>
[[gnu::always_inline]] inline bool below(Point<S> a, Point<S> b) {
  if constexpr (in_registers<S>)
    return (mask_bits(a <= b) & 7U) == 7U;
  else
    return (a[0] <= b[0]) & (a[1] <= b[1]) & (a[2] <= b[2]);
}
template <class S>
[[gnu::always_inline]] inline S longest(Point<S> p) {
  const S xy = p[0] > p[1] ? p[0] : p[1];
  return xy > p[2] ? xy : p[2];
}

struct Cell {
  std::int32_t at[3];
};
/// Returns the cell of a point; for a point outside of the region, the cell of the nearest point inside. With
/// any rounding, cells never decrease along an axis.
template <class S>
[[gnu::always_inline]] inline Cell cell_of(Point<S> p, Point<S> lower, Point<S> upper, S scale) {
  const Point<S> way = smaller(larger(p, lower), upper) - lower;
  if constexpr (in_registers<S>) {
    const auto cells = __builtin_convertvector(way * scale, Vector<std::int32_t, 4>);
    return {{cells[0], cells[1], cells[2]}};
  } else {
    return {{std::int32_t(way[0] * scale), std::int32_t(way[1] * scale), std::int32_t(way[2] * scale)}};
  }
}
[[gnu::always_inline]] inline std::uint32_t wrapped(std::int32_t cell, std::uint32_t bits) {
  return std::uint32_t(cell) & ((1U << bits) - 1);
}

template <class S>
void bound(const S* boxes, const std::uint32_t* ids, std::uint32_t count, S* box) {
  const auto at = [&](std::uint32_t k) { return boxes + std::size_t(8) * (ids == nullptr ? k : ids[k]); };
  Point<S> lower = load(at(0)), upper = load(at(0) + 4);
  for (std::uint32_t k = 1; k < count; ++k) {
    lower = smaller(lower, load(at(k)));
    upper = larger(upper, load(at(k) + 4));
  }
  store(box, lower);
  store(box + 4, upper);
}

template <class S>
void select(GridSelectJob<S>& shared) {
  GridSelectJob<S> job = shared;
  const Point<S> lower = load(job.region.lower), upper = load(job.region.upper);
  job.found = 0;
  job.size_sum = 0;
  for (std::uint32_t k = 0; k < job.count; ++k) {
    const std::uint32_t primitive = job.ids == nullptr ? k : job.ids[k];
    const S* const box = job.boxes + std::size_t(8) * primitive;
    const Point<S> own_lower = load(box), own_upper = load(box + 4);
    const bool inside = below<S>(own_lower, upper) & below<S>(lower, own_upper);
    const S size = longest<S>(own_upper - own_lower);
    job.selected[job.found] = primitive;
    job.sizes[job.found] = size;
    job.found += inside ? 1 : 0;
    job.size_sum += inside ? double(size) : 0;
  }
  shared = job;
}

template <class S>
void measure(const GridCellsJob<S>& shared) {
  const GridCellsJob<S> job = shared;
  GridLevel<S>* const levels = job.levels;
  const S most = levels[0].most_size;
  Point<S> reach = load(levels[0].reach);
  std::uint32_t finest = 0;
  for (std::uint32_t k = 0; k < job.count; ++k) {
    const S* const box = job.boxes + std::size_t(8) * job.selected[k];
    const Point<S> size = load(box + 4) - load(box);
    if (job.sizes[k] <= most) {
      job.level[k] = 0;
      reach = larger(reach, size);
      ++finest;
      continue;
    }
    std::uint8_t level = 1;
    while (job.sizes[k] > levels[level].most_size) ++level;
    job.level[k] = level;
    store(levels[level].reach, larger(load(levels[level].reach), size));
    ++levels[level].count;
  }
  store(levels[0].reach, reach);
  levels[0].count += finest;
}

template <class S>
void cells(const GridCellsJob<S>& shared) {
  const GridCellsJob<S> job = shared;
  const Point<S> lower = load(job.region.lower), upper = load(job.region.upper);
  for (std::uint32_t k = 0; k < job.count; ++k) {
    const GridLevel<S>& level = job.levels[job.level[k]];
    const Cell at = cell_of(load(job.boxes + std::size_t(8) * job.selected[k]), lower, upper, level.scale);
    const std::uint32_t row =
        wrapped(at.at[2], level.bits[2]) << level.bits[1] | wrapped(at.at[1], level.bits[1]);
    const std::uint32_t cell = level.first_cell + (row << level.bits[0] | wrapped(at.at[0], level.bits[0]));
    job.cell[k] = cell;
    ++job.counts[cell];
  }
}

/// Compares the boxes at places [begin, end) with one box, as many as a register holds at a time.
template <class S>
[[gnu::always_inline]] inline void scan(GridLookUpJob<S>& job, std::uint32_t begin, std::uint32_t end,
                                        std::uint32_t own, const S* box) {
  constexpr std::size_t lanes = native_lanes<S>;
  using V = Vector<S, lanes>;
  job.tests += end - begin;
  const S *const x = job.rows, *const y = x + job.stride, *const z = y + job.stride;
  const S *const to_x = z + job.stride, *const to_y = to_x + job.stride, *const to_z = to_y + job.stride;
  for (std::uint32_t i = begin; i < end; i += lanes) {
    const auto meets = (load_lanes<V>(x + i) <= box[4]) & (load_lanes<V>(y + i) <= box[5]) &
                       (load_lanes<V>(z + i) <= box[6]) & (load_lanes<V>(to_x + i) >= box[0]) &
                       (load_lanes<V>(to_y + i) >= box[1]) & (load_lanes<V>(to_z + i) >= box[2]);
    unsigned bits;
    if constexpr (lanes == 1)
      bits = unsigned(meets);
    else
      bits = mask_bits(meets);
    if (end - i < lanes) bits &= (1U << (end - i)) - 1;
    for (; bits != 0; bits &= bits - 1)
      job.out[job.found++] = {own, job.entries[i + std::uint32_t(__builtin_ctz(bits))]};
  }
}

template <class S, bool within_one>
void look_up(GridLookUpJob<S>& shared) {
  GridLookUpJob<S> job = shared;
  const Point<S> lower = load(job.region.lower), upper = load(job.region.upper);
  std::uint32_t first_level = 0;
  for (; job.next < job.count; ++job.next) {
    if (job.out_room - job.found < job.levels[job.level_count - 1].end) break;
    const std::uint32_t own = job.ids[job.next];
    const S* const box = job.boxes + std::size_t(8) * own;
    const std::uint32_t after = within_one ? job.next + 1 : 0;
    while (within_one && job.levels[first_level].end <= job.next) ++first_level;
    for (std::uint32_t l = first_level; l < job.level_count; ++l) {
      const GridLevel<S>& level = job.levels[l];
      if (level.count == 0) continue;
      const Cell from = cell_of<S>(load(box) - load(level.reach), lower, upper, level.scale);
      const Cell to = cell_of<S>(load(box + 4), lower, upper, level.scale);
      std::uint32_t cells[3];  // along each axis; each cell at most once
      for (int axis = 0; axis < 3; ++axis) {
        const std::uint32_t all = 1U << level.bits[axis],
                            span = std::uint32_t(to.at[axis] - from.at[axis]) + 1;
        cells[axis] = span < all ? span : all;
      }
      const std::uint32_t x = wrapped(from.at[0], level.bits[0]);
      const std::uint32_t before_end = (1U << level.bits[0]) - x;
      const std::uint32_t straight = cells[0] < before_end ? cells[0] : before_end;
      const std::uint32_t wrapping = cells[0] - straight;
      for (std::uint32_t k = 0; k < cells[2]; ++k) {
        const std::uint32_t z = wrapped(from.at[2] + std::int32_t(k), level.bits[2]);
        for (std::uint32_t j = 0; j < cells[1]; ++j) {
          const std::uint32_t y = wrapped(from.at[1] + std::int32_t(j), level.bits[1]);
          const std::uint32_t* const row =
              job.begins + level.first_cell + ((z << level.bits[1] | y) << level.bits[0]);
          const auto run = [&](std::uint32_t first, std::uint32_t length) {
            std::uint32_t begin = row[first];
            const std::uint32_t end = row[first + length];
            if (within_one && begin < after) begin = after;
            if (begin < end) scan(job, begin, end, own, box);
          };
          run(x, straight);
          if (wrapping != 0) run(0, wrapping);
        }
      }
    }
  }
  shared = job;
}

template <class S>
constexpr GridKernels<S> table{&bound<S>, &select<S>,         &measure<S>,
                               &cells<S>, &look_up<S, false>, &look_up<S, true>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const GridKernels<float> grid_float = table<float>;
const GridKernels<double> grid_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
