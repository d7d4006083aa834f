#include "core/families/envelope/segment_envelope.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/assert.hpp"
#include "core/motion/exact_piece.hpp"

namespace kbvh {

namespace {

/// The number of nodes that are checked before their active sides are processed: few enough to stay in the
/// cache. Smaller blocks cost several percent more.
constexpr std::uint32_t largest_block = 128, smallest_block = 4;
/// The mean number of stores per bucket.
constexpr std::size_t bucket_stores = 32;
/// The error bound of a computed fraction of the segment at which two lines meet: two differences, their sum,
/// and the quotient are each off by a relative 2^-53, and the fraction is at most 1.
constexpr double fraction_error = 0x1p-50;
constexpr double key_steps = 0x1p32;
/// The share of the nodes in the work on a segment that is made in slices. The rest sorts stores.
constexpr double nodes_part = 15.0 / 16;

}  // namespace

template <class S>
void find_realisers(WideHierarchy<S>& hierarchy, const S* positions, WideRealisers& realisers) {
  const std::uint32_t width = hierarchy.topology().width;
  const WideArrays<S> h = hierarchy.arrays();
  realisers.assign(hierarchy.node_count() * lane_scalars(width), 0);
  for (std::uint32_t n = hierarchy.node_count(); n-- > 0;) {
    const WideNode node = h.nodes[n];
    for (std::uint32_t row = 0; row < 6; ++row) {
      const std::uint32_t axis = row % 3;
      const auto behind = [&](std::uint32_t a, std::uint32_t b) {
        return row < 3 ? positions[a] > positions[b] : positions[a] < positions[b];
      };
      for (std::uint32_t lane = 0; lane < node.count; ++lane) {
        std::uint32_t& best = realisers[n * lane_scalars(width) + row * width + lane];
        if (lane < node.leaf_count) {
          const std::uint32_t* list = h.vertices + node.list + list_place(lane, width);
          best = *list + axis;
          for (std::uint32_t i = 1; i < node.length; ++i)
            if (behind(best, list[i * width] + axis)) best = list[i * width] + axis;
        } else {
          const std::uint32_t child = node.first_child + lane - node.leaf_count;
          const std::uint32_t* below = realisers.data() + child * lane_scalars(width) + row * width;
          best = below[0];
          for (std::uint32_t i = 1; i < h.nodes[child].count; ++i)
            if (behind(best, below[i])) best = below[i];
        }
      }
    }
  }
}

template <class S>
void SegmentEnvelope<S>::assign(const WideHierarchy<S>& hierarchy, std::uint32_t slices) {
  width_ = hierarchy.topology().width;
  const std::size_t nodes = hierarchy.node_count();
  block_ = std::clamp(hierarchy.node_count() / slices, smallest_block, largest_block);
  node_bounds_.assign(8 * nodes, S(0));
  lost_.assign(nodes, 0);
  first_store_.assign(nodes * lane_scalars(width_), 0);
  now_ = making_ = 0;
  make_empty(0, 0);
}

template <class S>
void SegmentEnvelope<S>::make(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, const S* p0,
                              const S* p1, double t0, double t1) {
  start(now_, hierarchy, p0, p1, t0, t1);
  while (nodes_left_ > 0) make_block(hierarchy, realisers);
  fill_buckets(2 * segments_[now_].made.size());
}

template <class S>
void SegmentEnvelope<S>::make_empty(double t0, double t1) {
  making_ = now_;
  Segment& segment = segments_[now_];
  segment.p0 = segment.p1 = nullptr;
  segment.t0 = t0;
  segment.t1 = t1;
  segment.made.clear();
  segment.stores.clear();
  segment.next = segment.ordered = 0;
}

template <class S>
void SegmentEnvelope<S>::start_next(const WideHierarchy<S>& hierarchy, const S* p0, const S* p1, double t1) {
  start(1 - now_, hierarchy, p0, p1, end(), t1);
  carried_ = 0;
}

template <class S>
void SegmentEnvelope<S>::start(std::uint32_t which, const WideHierarchy<S>& hierarchy, const S* p0,
                               const S* p1, double t0, double t1) {
  making_ = which;
  Segment& segment = segments_[which];
  segment.p0 = p0;
  segment.p1 = p1;
  segment.t0 = t0;
  segment.t1 = t1;
  segment.made.clear();
  nodes_left_ = hierarchy.node_count();
  sorted_ = 0;
}

template <class S>
void SegmentEnvelope<S>::step(WideHierarchy<S>& hierarchy, const WideRealisers& realisers,
                              WideRealisers& at_end, double share) {
  const std::uint32_t nodes = hierarchy.node_count();
  const auto nodes_due = std::uint32_t(std::min(1.0, share / nodes_part) * nodes);
  while (nodes_left_ > nodes - nodes_due) {
    carry_over(realisers, at_end);
    make_block(hierarchy, at_end);
  }
  const std::size_t steps = 2 * segments_[making_].made.size();
  const double part = (share - nodes_part) / (1 - nodes_part);
  if (nodes_left_ == 0 && part > 0) fill_buckets(part < 1 ? std::size_t(part * double(steps)) : steps);
}

/// Computes the rows of the next block at the end of the current segment, whose stores were made in the same
/// order: block by block, and for one side in order of time.
template <class S>
void SegmentEnvelope<S>::carry_over(const WideRealisers& realisers, WideRealisers& at_end) {
  const std::size_t scalars = lane_scalars(width_), begin = next_block();
  std::copy_n(realisers.data() + begin * scalars, (nodes_left_ - begin) * scalars,
              at_end.data() + begin * scalars);
  const std::vector<Store>& made = segments_[now_].made;
  for (; carried_ < made.size() && made[carried_].slot >= begin * scalars; ++carried_)
    at_end[made[carried_].slot] = made[carried_].realiser;
}

template <class S>
void SegmentEnvelope<S>::take_next() {
  KBVH_ASSERT(nodes_left_ == 0 && sorted_ == 2 * segments_[making_].made.size());
  now_ = making_;
}

template <class S>
std::uint32_t SegmentEnvelope<S>::next_block() const {
  return nodes_left_ > block_ ? nodes_left_ - block_ : 0;
}

/// Makes one block; nodes after this block are done.
template <class S>
void SegmentEnvelope<S>::make_block(WideHierarchy<S>& hierarchy, const WideRealisers& realisers) {
  const std::uint32_t begin = next_block(), end = nodes_left_;
  WideArrays<S> arrays = hierarchy.arrays();
  arrays.child_bounds = nullptr;
  arrays.node_bounds = node_bounds_.data();
  wide_realiser_kernels<S>(hierarchy.kernels())
      .check(width_)(arrays, realisers.data(), segments_[making_].p1, lost_.data(), begin, end);
  walk_leaves(hierarchy, realisers, begin, end);
  for (std::uint32_t node = end; node-- > begin;) walk_above(hierarchy, realisers, node);
  nodes_left_ = begin;
}

/// Processes the active sides that are boxes of leaves, for a range of nodes. It first looks up all their
/// lines and then walks them: the cache misses of some overlap with the computation of others.
template <class S>
void SegmentEnvelope<S>::walk_leaves(WideHierarchy<S>& hierarchy, const WideRealisers& realisers,
                                     std::uint32_t begin, std::uint32_t end) {
  const WideArrays<S> h = hierarchy.arrays();
  const S *p0 = segments_[making_].p0, *p1 = segments_[making_].p1;
  const auto scalars = std::uint32_t(lane_scalars(width_));
  std::uint64_t first_lanes = 0;  // lane 0 of every row
  for (std::uint32_t row = 0; row < 6; ++row) first_lanes |= std::uint64_t(1) << (row * width_);
  walks_.clear();
  std::size_t total = 0;
  for (std::uint32_t index = begin; index < end; ++index) {
    if (lost_[index] == 0) continue;
    counts_.active_sides += std::uint64_t(std::popcount(lost_[index]));
    const WideNode node = h.nodes[index];
    std::uint64_t left = lost_[index] & first_lanes * ((std::uint64_t(1) << node.leaf_count) - 1);
    for (; left != 0; left &= left - 1) {
      const auto bit = std::uint32_t(std::countr_zero(left));
      const std::uint32_t row = bit / width_, axis = row % 3, slot = index * scalars + bit;
      const std::uint32_t* list = h.vertices + node.list + list_place(bit % width_, width_);
      Line* lines = room_for(total + node.length) + total;
      const S sign = row < 3 ? S(-1) : S(1);
      const std::uint32_t realiser = realisers[slot];
      const S reached = sign * p1[realiser];
      // Branchless: which lines end further out is unpredictable. Lists are filled up with their last vertex.
      std::uint32_t count = 0, last = realiser;
      for (std::uint32_t i = 0; i < node.length; ++i) {
        const std::uint32_t place = list[i * width_] + axis;
        const S further = sign * p1[place];
        lines[count].end = further;
        lines[count].place = place;
        count += std::uint32_t(further > reached) & std::uint32_t(place != last);
        last = place;
      }
      for (std::uint32_t i = 0; i < count; ++i) __builtin_prefetch(p0 + lines[i].place);
      __builtin_prefetch(p0 + realiser);
      walks_.push_back({slot, realiser, count});
      total += count;
    }
  }
  std::size_t first = 0;
  for (const Walk& one : walks_) {
    const S sign = is_lower(one.slot) ? S(-1) : S(1);
    Line* lines = lines_.data() + first;
    for (std::uint32_t i = 0; i < one.count; ++i) lines[i].begin = sign * p0[lines[i].place];
    walk(one.slot, {sign * p0[one.realiser], sign * p1[one.realiser], one.realiser}, lines, one.count);
    first += one.count;
  }
}

/// Processes the active sides of one node that are boxes of nodes whose envelopes are complete.
template <class S>
void SegmentEnvelope<S>::walk_above(WideHierarchy<S>& hierarchy, const WideRealisers& realisers,
                                    std::uint32_t index) {
  const WideArrays<S> h = hierarchy.arrays();
  const WideNode node = h.nodes[index];
  if (node.leaf_count == node.count) return;
  const S *p0 = segments_[making_].p0, *p1 = segments_[making_].p1;
  const std::vector<Store>& made = segments_[making_].made;
  const auto scalars = std::uint32_t(lane_scalars(width_));
  for (std::uint64_t left = lost_[index]; left != 0; left &= left - 1) {
    const auto bit = std::uint32_t(std::countr_zero(left));
    const std::uint32_t row = bit / width_, lane = bit % width_, slot = index * scalars + bit;
    if (lane < node.leaf_count) continue;
    const S sign = row < 3 ? S(-1) : S(1);
    const auto line_of = [&](std::uint32_t place) { return Line{sign * p0[place], sign * p1[place], place}; };
    const Line now = line_of(realisers[slot]);
    const std::uint32_t child = node.first_child + lane - node.leaf_count, first = row * width_;
    const std::uint32_t* below = realisers.data() + child * scalars + first;
    const std::uint32_t children = h.nodes[child].count;
    std::size_t count = 0;
    Line* lines = room_for(width_);
    for (std::uint32_t i = 0; i < children; ++i) {
      lines[count] = line_of(below[i]);
      count += lines[count].end > now.end ? 1 : 0;
    }
    std::uint64_t others = lost_[child] >> first & ((std::uint64_t(1) << width_) - 1);
    for (; others != 0; others &= others - 1) {
      const std::uint32_t under = child * scalars + first + std::uint32_t(std::countr_zero(others));
      for (std::size_t s = first_store_[under]; s < made.size() && made[s].slot == under; ++s) {
        lines = room_for(count + 1);
        lines[count] = line_of(made[s].realiser);
        count += lines[count].end > now.end ? 1 : 0;
      }
    }
    walk(slot, now, lines, count);
  }
}

template <class S>
typename SegmentEnvelope<S>::Line* SegmentEnvelope<S>::room_for(std::size_t lines) {
  if (lines > lines_.size()) lines_.resize(2 * lines);
  return lines_.data();
}

/// Returns the fraction of the segment at which `later`, which is not ahead at the start but at the end,
/// meets `now`.
template <class S>
double SegmentEnvelope<S>::meeting(const Line& now, const Line& later) {
  const double behind = double(now.begin) - double(later.begin);
  return behind / (behind + (double(later.end) - double(now.end)));
}

/// Walks from the line that is ahead at the start to the line that is ahead at the end; `lines` are those
/// that end further out than the first.
template <class S>
void SegmentEnvelope<S>::walk(std::uint32_t slot, Line now, Line* lines, std::size_t count) {
  std::vector<Store>& made = segments_[making_].made;
  first_store_[slot] = std::uint32_t(made.size());
  double since = 0;
  while (count > 0) {
    counts_.crossings += count;
    std::size_t first = 0;
    double earliest = meeting(now, lines[0]), next = 2;
    for (std::size_t i = 1; i < count; ++i) {
      const double fraction = meeting(now, lines[i]);
      const bool earlier = fraction < earliest;
      const double later = earlier ? earliest : fraction;
      next = next < later ? next : later;
      earliest = earlier ? fraction : earliest;
      first = earlier ? i : first;
    }
    if (next <= earliest + 2 * fraction_error) first = first_exactly(now, lines, count);
    since = since < earliest ? earliest : since;
    now = lines[first];
    made.push_back({std::uint32_t(std::min(since * key_steps, key_steps - 1)), slot, now.place});
    if (count == 1) return;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      lines[kept] = lines[i];
      kept += lines[i].end > now.end ? 1 : 0;
    }
    count = kept;
  }
}

/// Returns the line that takes over first, where times are too close for double arithmetic.
template <class S>
std::size_t SegmentEnvelope<S>::first_exactly(const Line& now, const Line* lines, std::size_t count) {
  std::size_t first = 0;
  double earliest = meeting(now, lines[0]);
  for (std::size_t i = 1; i < count; ++i) {
    const double fraction = meeting(now, lines[i]);
    if (fraction > earliest + 2 * fraction_error) continue;
    if (fraction >= earliest - 2 * fraction_error) {
      if (lines[i].begin == lines[first].begin && lines[i].end == lines[first].end) continue;
      ++counts_.exact;
      if (!comes_first(lines[i], lines[first], now)) continue;
    }
    first = i;
    earliest = fraction;
  }
  return first;
}

/// Returns whether x overtakes the winner before y does. If both do at one instant, the line that stays ahead
/// counts.
template <class S>
bool SegmentEnvelope<S>::comes_first(const Line& x, const Line& y, const Line& winner) const {
  if (x.begin == y.begin && x.begin == winner.begin) return x.end > y.end;
  const Segment& segment = segments_[making_];
  const int order = compare_crossings<S>({segment.piece(winner.place), segment.piece(x.place)},
                                         {segment.piece(winner.place), segment.piece(y.place)});
  return order != 0 ? order < 0 : x.end > y.end;
}

/// Performs a counting sort by time: a bucket's stores keep their order of creation, which for one side is
/// the order of time. Continues up to a number of steps; each store takes one step to be counted and one to
/// be placed.
template <class S>
void SegmentEnvelope<S>::fill_buckets(std::size_t steps) {
  Segment& segment = segments_[making_];
  const std::vector<Store>& made = segment.made;
  std::vector<std::uint32_t>& bucket = segment.bucket;
  const std::size_t count = made.size();
  if (sorted_ == 0) {
    const auto bits = std::uint32_t(std::bit_width(count / bucket_stores));
    segment.bucket_shift = 32 - std::min(bits, 16u);
    bucket.assign((std::size_t(1) << (32 - segment.bucket_shift)) + 1, 0);
    segment.stores.resize(count);
    segment.next = segment.ordered = 0;
  }
  if (sorted_ >= steps) return;
  const std::uint32_t shift = segment.bucket_shift;
  const auto of = [shift](const Store& store) { return std::size_t(std::uint64_t(store.key) >> shift); };
  if (sorted_ < count) {
    for (const std::size_t end = std::min(steps, count); sorted_ < end; ++sorted_)
      ++bucket[of(made[sorted_]) + 1];
    if (sorted_ == count)
      for (std::size_t b = 1; b < bucket.size(); ++b) bucket[b] += bucket[b - 1];
  }
  for (; sorted_ < steps; ++sorted_) {
    const Store& store = made[sorted_ - count];
    segment.stores[bucket[of(store)]++] = store;
  }
  if (sorted_ < 2 * count) return;
  for (std::size_t b = bucket.size() - 1; b > 0; --b) bucket[b] = bucket[b - 1];
  bucket[0] = 0;
}

template <class S>
bool SegmentEnvelope<S>::is_due(const Store& store, std::uint32_t before, double t) {
  ++counts_.exact;
  const Segment& segment = segments_[now_];
  const int ahead = compare_at(segment.piece(store.realiser), segment.piece(before), t);
  return (is_lower(store.slot) ? -ahead : ahead) >= 0;
}

template <class S>
void SegmentEnvelope<S>::advance(double t, WideRealisers& realisers) {
  Segment& segment = segments_[now_];
  std::vector<Store>& stores = segment.stores;
  const std::vector<std::uint32_t>& bucket = segment.bucket;
  std::size_t& next = segment.next;
  if (next == stores.size()) return;
  const std::size_t from = next;
  if (t >= segment.t1) {  // in any order that preserves the order of each side
    for (; next < stores.size(); ++next) realisers[stores[next].slot] = stores[next].realiser;
    counts_.stores += next - from;
    return;
  }
  // Steps of the key; the division is off by less than a thousandth of a step, and so are the keys.
  const auto now = std::int64_t((t - segment.t0) / (segment.t1 - segment.t0) * key_steps);
  const std::int64_t past = now - 1, future = now + 2;  // keys below `past` are certainly past, keys from
                                                        // `future` on certainly in the future
  // Whole buckets are applied in order of creation; the last one needs the order of time.
  const auto whole = std::size_t(std::max<std::int64_t>(past, 0) >> segment.bucket_shift);
  for (; next < bucket[whole]; ++next) realisers[stores[next].slot] = stores[next].realiser;
  const std::size_t last =
      std::min<std::size_t>((std::size_t(future) >> segment.bucket_shift) + 1, bucket.size() - 1);
  if (segment.ordered < bucket[last]) {
    const auto start = stores.begin() + std::ptrdiff_t(std::max(next, segment.ordered));
    std::sort(start, stores.begin() + bucket[last], [this, p1 = segment.p1](const Store& a, const Store& b) {
      if (a.key != b.key) return a.key < b.key;
      if (a.slot != b.slot) return a.slot < b.slot;
      // Among the realisers of one side the later one ends further out.
      return is_lower(a.slot) ? p1[a.realiser] > p1[b.realiser] : p1[a.realiser] < p1[b.realiser];
    });
    segment.ordered = bucket[last];
  }
  while (next < bucket[last] && stores[next].key < past) {
    realisers[stores[next].slot] = stores[next].realiser;
    ++next;
  }
  // A handful of stores of this very instant; the next frame examines them again.
  for (std::size_t i = next; i < bucket[last] && stores[i].key < future; ++i)
    if (is_due(stores[i], realisers[stores[i].slot], t)) realisers[stores[i].slot] = stores[i].realiser;
  counts_.stores += next - from;
}

template <class S>
std::size_t SegmentEnvelope<S>::bytes() const {
  std::size_t total = node_bounds_.size() * sizeof(S) + lost_.size() * sizeof(std::uint64_t) +
                      first_store_.size() * sizeof(std::uint32_t) + lines_.capacity() * sizeof(Line) +
                      walks_.capacity() * sizeof(Walk);
  for (const Segment& segment : segments_)
    total += (segment.made.capacity() + segment.stores.capacity()) * sizeof(Store) +
             segment.bucket.capacity() * sizeof(std::uint32_t);
  return total;
}

template void find_realisers(WideHierarchy<float>&, const float*, WideRealisers&);
template void find_realisers(WideHierarchy<double>&, const double*, WideRealisers&);
template class SegmentEnvelope<float>;
template class SegmentEnvelope<double>;

}  // namespace kbvh
