#include "core/kinetic/segment_envelope.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/motion/exact_piece.hpp"

namespace kbvh {

namespace {

/// Nodes that are checked before their active sides are looked at: few enough to stay in the cache.
constexpr std::uint32_t block = 128;
/// Stores of a bucket, on average.
constexpr std::size_t bucket_stores = 32;
/// A computed fraction of the segment at which two lines meet is off by less: two differences, their sum, and
/// the quotient are each off by a relative 2^-53, and it is at most 1.
constexpr double fraction_error = 0x1p-50;
constexpr double key_steps = 0x1p32;

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
void SegmentEnvelope<S>::assign(const WideHierarchy<S>& hierarchy) {
  width_ = hierarchy.topology().width;
  const std::size_t nodes = hierarchy.node_count();
  own_.assign(8 * nodes, S(0));
  lost_.assign(nodes, 0);
  first_store_.assign(nodes * lane_scalars(width_), 0);
  made_.clear();
  stores_.clear();
  bucket_.assign(2, 0);
  next_ = ordered_ = 0;
  t0_ = t1_ = 0;
}

template <class S>
void SegmentEnvelope<S>::make(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, const S* p0,
                              const S* p1, double t0, double t1) {
  p0_ = p0;
  p1_ = p1;
  t0_ = t0;
  t1_ = t1;
  made_.clear();
  const auto check = wide_realiser_kernels<S>(hierarchy.kernels()).check(width_);
  WideArrays<S> arrays = hierarchy.arrays();
  arrays.lanes = nullptr;
  arrays.own = own_.data();
  for (std::uint32_t end = hierarchy.node_count(); end > 0;) {
    const std::uint32_t begin = end > block ? end - block : 0;
    check(arrays, realisers.data(), p1, lost_.data(), begin, end);
    for (std::uint32_t node = end; node-- > begin;)
      if (lost_[node] != 0) walk_node(hierarchy, realisers, node);
    end = begin;
  }
  fill_buckets();
}

template <class S>
void SegmentEnvelope<S>::walk_node(WideHierarchy<S>& hierarchy, const WideRealisers& realisers,
                                   std::uint32_t index) {
  const WideArrays<S> h = hierarchy.arrays();
  const WideNode node = h.nodes[index];
  const auto scalars = std::uint32_t(lane_scalars(width_));
  counts_.active_sides += std::uint64_t(std::popcount(lost_[index]));
  for (std::uint64_t left = lost_[index]; left != 0; left &= left - 1) {
    const auto bit = std::uint32_t(std::countr_zero(left));
    const std::uint32_t row = bit / width_, lane = bit % width_, axis = row % 3, slot = index * scalars + bit;
    const double sign = row < 3 ? -1.0 : 1.0;
    const std::uint32_t place = realisers[slot];
    const Line now{sign * double(p0_[place]), sign * double(p1_[place]), place};
    lines_.clear();
    const auto consider = [&](std::uint32_t other) {
      const double end = sign * double(p1_[other]);
      if (end > now.end) lines_.push_back({sign * double(p0_[other]), end, other});
    };
    if (lane < node.leaf_count) {
      const std::uint32_t* list = h.vertices + node.list + list_place(lane, width_);
      for (std::uint32_t i = 0; i < node.length; ++i) consider(list[i * width_] + axis);
    } else {
      const std::uint32_t child = node.first_child + lane - node.leaf_count, first = row * width_;
      for (std::uint32_t i = 0; i < h.nodes[child].count; ++i) {
        const std::uint32_t below = child * scalars + first + i;
        consider(realisers[below]);
        if ((lost_[child] >> (first + i) & 1) == 0) continue;
        for (std::size_t s = first_store_[below]; s < made_.size() && made_[s].slot == below; ++s)
          consider(made_[s].realiser);
      }
    }
    first_store_[slot] = std::uint32_t(made_.size());
    walk(slot, now);
  }
}

/// From the line that is ahead at the begin to the one that is ahead at the end; `lines_` are those that end
/// further out than it.
template <class S>
void SegmentEnvelope<S>::walk(std::uint32_t slot, Line now) {
  double since = 0;
  while (!lines_.empty()) {
    const Line* first = nullptr;
    double earliest = 0;
    for (const Line& line : lines_) {
      // Nobody was ahead of `now` at the begin, or before it took over.
      const double behind = std::max(0.0, now.begin - line.begin);
      const double fraction = behind / (behind + (line.end - now.end));
      if (first != nullptr) {
        if (fraction > earliest + 2 * fraction_error) continue;
        if (fraction >= earliest - 2 * fraction_error) {
          if (line.begin == first->begin && line.end == first->end) continue;
          ++counts_.exact;
          if (!comes_first(line, *first, now)) continue;
        }
      }
      first = &line;
      earliest = fraction;
    }
    counts_.crossings += lines_.size();
    since = std::max(since, earliest);
    now = *first;
    made_.push_back({std::uint32_t(std::min(since * key_steps, key_steps - 1)), slot, now.place});
    std::erase_if(lines_, [&](const Line& line) { return !(line.end > now.end); });
  }
}

/// Does x overtake the winner before y does? Of two that do at one instant the one that stays ahead counts.
template <class S>
bool SegmentEnvelope<S>::comes_first(const Line& x, const Line& y, const Line& winner) const {
  if (x.begin == y.begin && x.begin == winner.begin) return x.end > y.end;
  const int order =
      compare_crossings<S>({piece(winner.place), piece(x.place)}, {piece(winner.place), piece(y.place)});
  return order != 0 ? order < 0 : x.end > y.end;
}

template <class S>
Piece<S> SegmentEnvelope<S>::piece(std::uint32_t place) const {
  return {t0_, t1_, p0_[place], p1_[place], PieceKind::chord};
}

/// A counting sort by time: a bucket's stores keep the order in which they were made, which is that of time
/// for the stores of one side.
template <class S>
void SegmentEnvelope<S>::fill_buckets() {
  const auto bits = std::uint32_t(std::bit_width(made_.size() / bucket_stores));
  bucket_shift_ = 32 - std::min(bits, 16u);
  const std::size_t buckets = std::size_t(1) << (32 - bucket_shift_);
  bucket_.assign(buckets + 1, 0);
  const auto of = [&](const Store& store) { return std::size_t(std::uint64_t(store.key) >> bucket_shift_); };
  for (const Store& store : made_) ++bucket_[of(store) + 1];
  for (std::size_t b = 1; b <= buckets; ++b) bucket_[b] += bucket_[b - 1];
  stores_.resize(made_.size());
  for (const Store& store : made_) stores_[bucket_[of(store)]++] = store;
  for (std::size_t b = buckets; b > 0; --b) bucket_[b] = bucket_[b - 1];
  bucket_[0] = 0;
  next_ = ordered_ = 0;
}

template <class S>
bool SegmentEnvelope<S>::is_due(const Store& store, std::uint32_t before, double t) {
  ++counts_.exact;
  const int ahead = compare_at(piece(store.realiser), piece(before), t);
  return (is_lower(store.slot) ? -ahead : ahead) >= 0;
}

template <class S>
void SegmentEnvelope<S>::advance(double t, WideRealisers& realisers) {
  if (next_ == stores_.size()) return;
  const std::size_t from = next_;
  if (t >= t1_) {  // in any order that keeps those of one side in turn
    for (; next_ < stores_.size(); ++next_) realisers[stores_[next_].slot] = stores_[next_].realiser;
    counts_.stores += next_ - from;
    return;
  }
  // Steps of the key; the division is off by less than a thousandth of one, and so are the keys.
  const auto now = std::int64_t((t - t0_) / (t1_ - t0_) * key_steps);
  const std::int64_t past = now - 1, future = now + 2;  // keys below, and from there on, are surely so
  // Whole buckets come in the order in which they were made; the last one needs that of time.
  const auto whole = std::size_t(std::max<std::int64_t>(past, 0) >> bucket_shift_);
  for (; next_ < bucket_[whole]; ++next_) realisers[stores_[next_].slot] = stores_[next_].realiser;
  const std::size_t last =
      std::min<std::size_t>((std::size_t(future) >> bucket_shift_) + 1, bucket_.size() - 1);
  if (ordered_ < bucket_[last]) {
    const auto start = stores_.begin() + std::ptrdiff_t(std::max(next_, ordered_));
    std::sort(start, stores_.begin() + bucket_[last], [this](const Store& a, const Store& b) {
      if (a.key != b.key) return a.key < b.key;
      if (a.slot != b.slot) return a.slot < b.slot;
      // Of one side's realisers a later one ends further out.
      return is_lower(a.slot) ? p1_[a.realiser] > p1_[b.realiser] : p1_[a.realiser] < p1_[b.realiser];
    });
    ordered_ = bucket_[last];
  }
  while (next_ < bucket_[last] && stores_[next_].key < past) {
    realisers[stores_[next_].slot] = stores_[next_].realiser;
    ++next_;
  }
  // A handful, of this very instant; they are looked at again by the next frame.
  for (std::size_t i = next_; i < bucket_[last] && stores_[i].key < future; ++i)
    if (is_due(stores_[i], realisers[stores_[i].slot], t)) realisers[stores_[i].slot] = stores_[i].realiser;
  counts_.stores += next_ - from;
}

template <class S>
std::size_t SegmentEnvelope<S>::bytes() const {
  return own_.size() * sizeof(S) + lost_.size() * sizeof(std::uint64_t) +
         (first_store_.size() + bucket_.capacity()) * sizeof(std::uint32_t) +
         (made_.capacity() + stores_.capacity()) * sizeof(Store) + lines_.capacity() * sizeof(Line);
}

template void find_realisers(WideHierarchy<float>&, const float*, WideRealisers&);
template void find_realisers(WideHierarchy<double>&, const double*, WideRealisers&);
template class SegmentEnvelope<float>;
template class SegmentEnvelope<double>;

}  // namespace kbvh
