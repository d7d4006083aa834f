#include "core/families/grid/hash_grid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/assert.hpp"

namespace kbvh {

namespace {
/// Up to this number, all boxes are in one cell and compared at once.
constexpr std::uint32_t few = 16;
/// At most this many cells for each box; the next power of two.
constexpr std::uint32_t cells_per_box = 2;
/// Boxes of a level are at most this many times as large as those of the level before.
constexpr int level_ratio = 4;
/// Cells along one axis before they are numbered modulo a smaller number.
constexpr double most_cells = 1 << 20;
/// Pairs that a batch has room for, beyond those of one box.
constexpr std::size_t batch = 4096;
/// Scalars that kernels may read past the end of a row.
constexpr std::size_t over_read = 16;

template <class T>
void grow(std::vector<T>& array, std::size_t size) {
  if (array.size() < size) array.resize(size);
}
}  // namespace

template <class S>
void GridBody<S>::update(const Primitives& primitives, const PrimitiveList& list, const S* positions,
                         KernelSet kernels) {
  boxes_.take(primitives, list, positions, kernels);
  if (list.count != 0) grid_kernels<S>(kernels).bound(boxes_.boxes(), list.ids(), list.count, bound_);
}

template <class S>
Box<double> GridBody<S>::box() const {
  Box<double> box;
  if (count() == 0) return box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = bound_[axis];
    box.upper[axis] = bound_[axis + 4];
  }
  return box;
}

template <class S>
void HashGrid<S>::select(const GridBody<S>& body, const PrimitiveList& list, Selection& selection) {
  grow(selection.primitives, list.count + 1);
  grow(selection.sizes, list.count + 1);
  GridSelectJob<S> job{body.boxes(),           list.ids(), list.count, region_, selection.primitives.data(),
                       selection.sizes.data(), 0,          0};
  grid_kernels<S>(kernels_).select(job);
  selection.boxes = body.boxes();
  selection.count = job.found;
  selection.size_sum = job.size_sum;
}

template <class S>
void HashGrid<S>::plan_sizes(double mean_size) {
  S longest = 0;
  for (int axis = 0; axis < 3; ++axis) longest = std::max(longest, region_.upper[axis] - region_.lower[axis]);
  if (!std::isfinite(longest)) {  // the number of cells is undefined: all boxes are in one
    std::copy_n(region_.lower, 3, region_.upper);
    longest = 0;
  }
  S size = S(std::max(cell_ * mean_size, double(longest) / most_cells));
  for (std::uint32_t l = 0; l < grid_levels; ++l, size *= S(level_ratio)) {
    const S scale = 1 / size;
    levels_[l] = {};
    levels_[l].most_size = l + 1 < grid_levels ? size : std::numeric_limits<S>::infinity();
    levels_[l].scale = std::isfinite(scale) ? scale : S(0);
  }
}

template <class S>
std::uint32_t HashGrid<S>::plan_cells() {
  std::uint32_t cells = 0, end = 0;
  for (GridLevel<S>& level : levels_) {
    level.first_cell = cells;
    level.end = end += level.count;
    if (level.count == 0) continue;
    // A rounded side must not make a box begin before the cells that are looked up.
    for (int axis = 0; axis < 3; ++axis)
      level.reach[axis] = std::nextafter(level.reach[axis], std::numeric_limits<S>::infinity());
    int bits = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const S extent = region_.upper[axis] - region_.lower[axis];
      level.bits[axis] = std::uint32_t(std::bit_width(std::uint32_t(extent * level.scale)));
      bits += int(level.bits[axis]);
    }
    const int most = level.count <= few ? 0 : std::bit_width(cells_per_box * level.count - 1);
    for (; bits > most; --bits) --*std::max_element(level.bits, level.bits + 3);
    cells += 1U << bits;
  }
  return cells;
}

template <class S>
void HashGrid<S>::fill(const Selection& entered) {
  const GridKernels<S>& kernels = grid_kernels<S>(kernels_);
  const std::uint32_t count = entered.count;
  grow(level_, count);
  grow(cell_of_, count);
  GridCellsJob<S> job{entered.boxes,
                      entered.primitives.data(),
                      entered.sizes.data(),
                      count,
                      region_,
                      levels_,
                      level_.data(),
                      cell_of_.data(),
                      nullptr};
  kernels.measure(job);
  const std::uint32_t cells = plan_cells();
  grow(begins_, std::size_t(cells) + 1);
  std::fill_n(begins_.begin(), cells + 1, 0U);
  job.region = region_;
  job.counts = begins_.data() + 1;
  kernels.cells(job);
  // Turns counts into begins, one place to the right; the scatter below turns these into the ends of the
  // cells, which are the begins of the next ones.
  std::uint32_t sum = 0;
  for (std::uint32_t cell = 1; cell <= cells; ++cell) {
    const std::uint32_t in_cell = begins_[cell];
    begins_[cell] = sum;
    sum += in_cell;
  }
  KBVH_ASSERT(sum == count);
  grow(entries_, count);
  job_.stride = count + over_read;
  if (rows_.size() < 6 * job_.stride) rows_.resize(6 * job_.stride);
  for (std::uint32_t k = 0; k < count; ++k) {
    const std::uint32_t primitive = entered.primitives[k], place = begins_[cell_of_[k] + 1]++;
    const S* const box = entered.boxes + std::size_t(8) * primitive;
    entries_[place] = primitive;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      rows_[axis * job_.stride + place] = box[axis];
      rows_[(axis + 3) * job_.stride + place] = box[axis + 4];
    }
  }
}

template <class S>
bool HashGrid<S>::enter(const GridBody<S>& a, const PrimitiveList& list_a, const GridBody<S>& b,
                        const PrimitiveList& list_b) {
  within_ = &a == &b;
  if (list_a.count == 0 || list_b.count == 0) return false;
  bool meet = true;
  for (int axis = 0; axis < 3; ++axis) {
    region_.lower[axis] = std::max(a.bound()[axis], b.bound()[axis]);
    region_.upper[axis] = std::min(a.bound()[axis + 4], b.bound()[axis + 4]);
    meet &= region_.lower[axis] <= region_.upper[axis];
  }
  if (!meet) return false;
  select(a, list_a, selections_[0]);
  if (!within_) select(b, list_b, selections_[1]);
  const Selection &first = selections_[0], &second = selections_[within_ ? 0 : 1];
  if (first.count == 0 || second.count == 0) return false;
  plan_sizes((first.size_sum + second.size_sum) / (double(first.count) + double(second.count)));
  // Entering costs less than looking up, so the larger set is entered, unless the smaller one is so small
  // that entering it costs nothing.
  a_is_entered_ =
      std::min(first.count, second.count) <= few ? first.count <= second.count : first.count >= second.count;
  const Selection &entered = a_is_entered_ ? first : second, &own = a_is_entered_ ? second : first;
  fill(entered);
  grow(pairs_, batch + entered.count);
  job_.boxes = own.boxes;
  job_.ids = within_ ? entries_.data() : own.primitives.data();
  job_.count = own.count;
  job_.next = 0;
  job_.region = region_;
  job_.levels = levels_;
  job_.level_count = grid_levels;
  while (levels_[job_.level_count - 1].count == 0) --job_.level_count;
  job_.begins = begins_.data();
  job_.entries = entries_.data();
  job_.rows = rows_.data();
  job_.out = pairs_.data();
  job_.out_room = pairs_.size();
  return true;
}

template <class S>
bool HashGrid<S>::look_up(std::uint64_t& tests) {
  if (job_.next == job_.count) return false;
  job_.found = 0;
  job_.tests = 0;
  const GridKernels<S>& kernels = grid_kernels<S>(kernels_);
  within_ ? kernels.within(job_) : kernels.between(job_);
  tests += job_.tests;
  return true;
}

template <class S>
std::size_t HashGrid<S>::bytes() const {
  return selections_[0].bytes() + selections_[1].bytes() + level_.capacity() +
         (cell_of_.capacity() + begins_.capacity() + entries_.capacity()) * sizeof(std::uint32_t) +
         rows_.capacity() * sizeof(S) + pairs_.capacity() * sizeof(GridPair);
}

template class GridBody<float>;
template class GridBody<double>;
template class HashGrid<float>;
template class HashGrid<double>;

}  // namespace kbvh
