#include "core/families/envelope/calendar_tree.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/motion/exact_piece.hpp"

namespace kbvh {

template <class S>
CalendarTree<S>::CalendarTree(WideHierarchy<S>& hierarchy, const SegmentMotion<S>& motion, std::uint32_t body)
    : motion_(motion),
      body_(body),
      width_(hierarchy.topology().width),
      width_shift_(std::uint32_t(std::countr_zero(width_))),
      scalars_(std::uint32_t(lane_scalars(width_))),
      heads_(buckets, none) {
  const WideArrays<S> layout = hierarchy.arrays();
  const std::uint32_t nodes = hierarchy.node_count();
  above_.assign(nodes, none);
  depth_.assign(nodes, 0);
  std::size_t longest = width_;
  std::uint32_t vertices = 0;
  for (std::uint32_t n = 0; n < nodes; ++n) {
    const WideNode& node = layout.nodes[n];
    longest = std::max<std::size_t>(longest, node.leaf_count > 0 ? node.length : 0);
    for (std::uint32_t lane = node.leaf_count; lane < node.count; ++lane) {
      const std::uint32_t child = node.first_child + lane - node.leaf_count;
      above_[child] = n * scalars_ + lane;
      depth_[child] = std::uint8_t(std::min(depth_[n] + 1, 255));
    }
    for (std::uint32_t i = 0; node.leaf_count > 0 && i < node.length * width_; ++i)
      vertices = std::max(vertices, layout.vertices[node.list + i] / 3 + 1);
  }
  candidates_.resize(longest);
  lines_.resize(std::size_t(3) * vertices);
  new_plan_.assign(vertices, 0);
  entries_.resize(std::size_t(nodes) * scalars_);
  due_.assign(entries_.size(), 0);
  levels_.resize(depth_.empty() ? 0 : 1u + *std::max_element(depth_.begin(), depth_.end()));
  // The leaves of each vertex; a list is filled up with its last vertex.
  first_leaf_.assign(vertices + 1, 0);
  const auto each = [&](const auto& visit) {
    for (std::uint32_t n = 0; n < nodes; ++n)
      for (std::uint32_t lane = 0; lane < layout.nodes[n].leaf_count; ++lane) {
        const std::uint32_t* list = layout.vertices + layout.nodes[n].list + list_place(lane, width_);
        for (std::uint32_t i = 0; i < layout.nodes[n].length; ++i)
          if (i == 0 || list[i * width_] != list[(i - 1) * width_])
            visit(list[i * width_] / 3, n * scalars_ + lane);
      }
  };
  each([&](std::uint32_t v, std::uint32_t) { ++first_leaf_[v + 1]; });
  for (std::uint32_t v = 0; v < vertices; ++v) first_leaf_[v + 1] += first_leaf_[v];
  leaves_.resize(first_leaf_.back());
  std::vector<std::uint32_t> next(first_leaf_.begin(), first_leaf_.end() - 1);
  each([&](std::uint32_t v, std::uint32_t slot) { leaves_[next[v]++] = slot; });
}

template <class S>
void CalendarTree<S>::choose_end(double t) {
  begin_ = now_ = t;
  end_ = motion_.lines_end(body_);
  if (end_ == never) {
    end_ = t + horizon_;
    horizon_ = std::min(2 * horizon_, 0x1p20);
  }
  scale_ = buckets / (end_ - begin_);
}

/// Each of the few operations is off by at most 2^-53 of the sum of the magnitudes; the bound allows 32 times
/// as much.
template <class S>
void CalendarTree<S>::read_line(std::uint32_t vertex) {
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const Piece<S> p = motion_.piece(body_, vertex, int(axis));
    const double start = double(p.x0);
    const double slope = p.kind == PieceKind::chord ? (double(p.x1) - start) / (p.t1 - p.t0) : double(p.x1);
    lines_[std::size_t(3) * vertex + axis] = {start + slope * (begin_ - p.t0), slope};
    const double reach = std::abs(start) + std::abs(slope) * (std::abs(begin_ - p.t0) + (end_ - begin_));
    error_ = std::max(error_, reach * 0x1p-48 + std::numeric_limits<double>::min());
  }
}

template <class S>
void CalendarTree<S>::reset(WideHierarchy<S>& hierarchy, WideRealisers& realisers) {
  horizon_ = 1;
  start(hierarchy, realisers);
}

template <class S>
void CalendarTree<S>::start(WideHierarchy<S>& hierarchy, WideRealisers& realisers) {
  const double t = motion_.time();
  std::fill(entries_.begin(), entries_.end(), Entry{});
  std::fill(heads_.begin(), heads_.end(), none);
  bucket_ = 0;
  error_ = 0;
  realisers.assign(entries_.size(), 0);
  at_rest_ = hierarchy.empty() || motion_.at_rest(body_);
  choose_end(t);
  if (hierarchy.empty()) {
    end_ = never;
    return;
  }
  if (at_rest_) {
    end_ = motion_.lines_end(body_);
    std::vector<S> room;
    find_realisers(hierarchy, motion_.positions_on_lines(body_, t, room), realisers);
    return;
  }
  for (std::uint32_t v = 0; v + 1 < first_leaf_.size(); ++v)
    if (first_leaf_[v] != first_leaf_[v + 1]) read_line(v);
  const WideArrays<S> h = hierarchy.arrays();
  for (std::uint32_t n = hierarchy.node_count(); n-- > 0;)
    for (std::uint32_t row = 0; row < 6; ++row)
      for (std::uint32_t lane = 0; lane < h.nodes[n].count; ++lane)
        determine(h, realisers, n * scalars_ + row * width_ + lane);
}

template <class S>
typename CalendarTree<S>::Candidate CalendarTree<S>::candidate(std::uint32_t place, bool lower) const {
  const Line& line = lines_[place];
  const double now = line.first + line.slope * (now_ - begin_);
  const double end = line.first + line.slope * (end_ - begin_);
  return lower ? Candidate{-now, -end, place} : Candidate{now, end, place};
}

template <class S>
int CalendarTree<S>::ahead(std::uint32_t x, std::uint32_t y, bool lower, double t) {
  ++counts_.exact;
  const int sign = compare_at(piece(x), piece(y), t);
  return lower ? -sign : sign;
}

/// Returns the time at which `other` can first be ahead of the winner: a lower bound; `never` if not before
/// the end of the segment; the current time if it is already ahead.
template <class S>
double CalendarTree<S>::failure(const Candidate& winner, const Candidate& other, bool lower) {
  const double gap = winner.now - other.now, left = winner.end - other.end, error = 2.01 * error_;
  if (gap > error && left > error) return never;
  if (gap > error && left < -error) {
    const double time = now_ + (end_ - now_) * ((gap - error) / (gap - left));
    return time - 0x1p-50 * (std::abs(now_) + std::abs(end_));
  }
  if (winner.place == other.place) return never;
  const int now = ahead(winner.place, other.place, lower, now_);
  if (now < 0) return now_;
  if (ahead(winner.place, other.place, lower, end_) >= 0) return never;
  if (now == 0) return now_;
  const TimeEstimate estimate = crossing_estimate<S>({piece(winner.place), piece(other.place)});
  return std::isfinite(estimate.error) ? estimate.time - estimate.error : now_;
}

/// Determines the current realiser of a side, and a time until which it certainly stays the realiser.
template <class S>
void CalendarTree<S>::determine(const WideArrays<S>& h, WideRealisers& realisers, std::uint32_t slot) {
  const auto [index, row, lane] = place_of(slot);
  const WideNode& node = h.nodes[index];
  const bool lower = row < 3;
  Candidate* list = candidates_.data();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double reached = -infinity, second = -infinity;
  std::uint32_t count = 0, best = 0;
  const auto take = [&](std::uint32_t place) {
    list[count] = candidate(place, lower);
    const double now = list[count].now;
    const bool further = now > reached;
    const double behind = further ? reached : now;
    second = behind > second ? behind : second;
    reached = further ? now : reached;
    best = further ? count : best;
    ++count;
  };
  if (lane < node.leaf_count) {
    const std::uint32_t* places = h.vertices + node.list + list_place(lane, width_);
    for (std::uint32_t i = 0; i < node.length; ++i) take(places[i * width_] + row % 3);
  } else {
    const std::uint32_t child = node.first_child + lane - node.leaf_count;
    const std::uint32_t* places = realisers.data() + std::size_t(child) * scalars_ + row * width_;
    for (std::uint32_t i = 0; i < h.nodes[child].count; ++i) take(places[i]);
  }
  counts_.reads += count;
  ++counts_.sides;
  // Vertices that may be equally far out: among them the one that ends furthest out wins.
  reached -= 4.02 * error_;
  if (!(second < reached))
    for (std::uint32_t i = 0; i < count; ++i) {
      if (list[i].now < reached || list[i].place == list[best].place) continue;
      const int now = ahead(list[i].place, list[best].place, lower, now_);
      if (now > 0 || (now == 0 && ahead(list[i].place, list[best].place, lower, end_) > 0)) best = i;
    }
  double time = never;
  const Candidate winner = list[best];
  const double error = 2.01 * error_;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (winner.now - list[i].now > error && winner.end - list[i].end > error) continue;
    if (i != best) time = std::min(time, failure(winner, list[i], lower));
  }
  counts_.certificates += count - 1;
  realisers[slot] = winner.place;
  schedule(slot, time);
}

template <class S>
std::uint32_t CalendarTree<S>::bucket_of(double time) const {
  const double place = (time - begin_) * scale_;
  return place >= double(buckets) ? buckets - 1 : place > 0 ? std::uint32_t(place) : 0;
}

template <class S>
void CalendarTree<S>::unschedule(std::uint32_t slot) {
  Entry& entry = entries_[slot];
  if (entry.bucket == none) return;
  if (entry.next != none) entries_[entry.next].before = entry.before;
  if (entry.before != none)
    entries_[entry.before].next = entry.next;
  else
    heads_[entry.bucket] = entry.next;
  entry = {};
}

template <class S>
void CalendarTree<S>::schedule(std::uint32_t slot, double time) {
  unschedule(slot);
  if (time >= end_) return;  // the whole body restarts then
  Entry& entry = entries_[slot];
  entry.time = time;
  entry.bucket = std::max(bucket_of(time), bucket_);
  entry.next = heads_[entry.bucket];
  heads_[entry.bucket] = slot;
  if (entry.next != none) entries_[entry.next].before = slot;
}

template <class S>
void CalendarTree<S>::make_due(std::uint32_t slot) {
  if (due_[slot] != 0) return;
  due_[slot] = 1;
  levels_[depth_[place_of(slot).node]].push_back(slot);
}

/// Prefetches the data that `determine` reads for some sides: most of it is not in the cache.
template <class S>
void CalendarTree<S>::fetch_ahead(const WideArrays<S>& h, const WideRealisers& realisers,
                                  std::span<const std::uint32_t> slots) const {
  const auto each_place = [&](std::uint32_t slot, const auto& visit) {
    const auto [index, row, lane] = place_of(slot);
    const WideNode& node = h.nodes[index];
    if (lane < node.leaf_count) {
      const std::uint32_t* places = h.vertices + node.list + list_place(lane, width_);
      for (std::uint32_t i = 0; i < node.length; ++i) visit(places + i * width_, row % 3);
    } else {
      const std::uint32_t child = node.first_child + lane - node.leaf_count;
      const std::uint32_t* places = realisers.data() + std::size_t(child) * scalars_ + row * width_;
      for (std::uint32_t i = 0; i < h.nodes[child].count; ++i) visit(places + i, 0u);
    }
  };
  for (const std::uint32_t slot : slots) {
    each_place(slot, [](const std::uint32_t* place, std::uint32_t) { __builtin_prefetch(place); });
    __builtin_prefetch(&realisers[slot]);
    __builtin_prefetch(&entries_[slot]);
  }
  for (const std::uint32_t slot : slots)
    each_place(slot, [this](const std::uint32_t* place, std::uint32_t axis) {
      __builtin_prefetch(&lines_[*place + axis]);
    });
}

/// Determines all sides in `levels_` again, deepest first, and the sides above that depend on them.
template <class S>
void CalendarTree<S>::process(const WideArrays<S>& h, WideRealisers& realisers) {
  for (std::size_t depth = levels_.size(); depth-- > 0;) {
    std::size_t fetched = 0;
    for (std::size_t i = 0; i < levels_[depth].size(); ++i) {  // depths saturate: the list may grow
      if (i == fetched) {
        fetched = std::min(levels_[depth].size(), i + together);
        fetch_ahead(h, realisers, {levels_[depth].data() + i, fetched - i});
      }
      const std::uint32_t slot = levels_[depth][i];
      due_[slot] = 0;
      const std::uint32_t before = realisers[slot];
      determine(h, realisers, slot);
      const auto [node, row, lane] = place_of(slot);
      if (realisers[slot] == before && !has_new_plan(before)) {
        ++counts_.idle;
        continue;
      }
      counts_.changes += realisers[slot] != before ? 1 : 0;
      // The same side of this node's own box.
      if (node != 0) make_due(above_[node] + row * width_);
    }
    levels_[depth].clear();
  }
}

template <class S>
bool CalendarTree<S>::advance(WideHierarchy<S>& hierarchy, WideRealisers& realisers) {
  const double t = motion_.time();
  if (!(t < end_)) {
    start(hierarchy, realisers);
    return true;
  }
  if (at_rest_) return false;
  now_ = t;
  const std::uint32_t last = bucket_of(t);
  for (; bucket_ < last; ++bucket_)
    while (heads_[bucket_] != none) {
      ++counts_.failed;
      make_due(heads_[bucket_]);
      unschedule(heads_[bucket_]);
    }
  for (std::uint32_t slot = heads_[bucket_]; slot != none;) {
    const std::uint32_t next = entries_[slot].next;
    if (entries_[slot].time <= t) {
      ++counts_.failed;
      make_due(slot);
      unschedule(slot);
    }
    slot = next;
  }
  ++change_;
  process(hierarchy.arrays(), realisers);
  return true;
}

template <class S>
void CalendarTree<S>::plans_changed(WideHierarchy<S>& hierarchy, WideRealisers& realisers,
                                    std::span<const PlanChange<S>> changes) {
  ++change_;
  bool affected = false;
  double end = end_;
  for (const PlanChange<S>& change : changes) {
    if (change.body != body_) continue;
    affected = true;
    if (!change.times.empty()) end = std::min(end, change.times.front());
  }
  if (!affected || hierarchy.empty()) return;
  if (at_rest_ || end < end_) {
    start(hierarchy, realisers);
    return;
  }
  for (const PlanChange<S>& change : changes) {
    if (change.body != body_ || change.vertex >= new_plan_.size()) continue;
    new_plan_[change.vertex] = change_;
    read_line(change.vertex);
  }
  const auto each_leaf = [&](const auto& visit) {
    for (const PlanChange<S>& change : changes) {
      const std::uint32_t v = change.vertex;
      if (change.body != body_ || v >= new_plan_.size()) continue;
      for (std::uint32_t k = first_leaf_[v]; k < first_leaf_[v + 1]; ++k) visit(v, leaves_[k]);
    }
  };
  // Prefetches first: the data read is not in the cache.
  each_leaf([&](std::uint32_t, std::uint32_t leaf) {
    for (std::uint32_t row = 0; row < 6; ++row) {
      __builtin_prefetch(&realisers[leaf + row * width_]);
      __builtin_prefetch(&entries_[leaf + row * width_]);
    }
  });
  each_leaf([&](std::uint32_t, std::uint32_t leaf) {
    for (std::uint32_t row = 0; row < 6; ++row) __builtin_prefetch(&lines_[realisers[leaf + row * width_]]);
  });
  each_leaf([&](std::uint32_t v, std::uint32_t leaf) {
    for (std::uint32_t row = 0; row < 6; ++row) {
      const std::uint32_t slot = leaf + row * width_, realiser = realisers[slot];
      if (has_new_plan(realiser)) {
        make_due(slot);
        continue;
      }
      ++counts_.certificates;
      const bool lower = row < 3;
      const double time = failure(candidate(realiser, lower), candidate(3 * v + row % 3, lower), lower);
      if (time < std::min(entries_[slot].time, end_)) schedule(slot, time);
      if (time <= now_) make_due(slot);
    }
  });
  process(hierarchy.arrays(), realisers);
}

template <class S>
std::size_t CalendarTree<S>::bytes() const {
  std::size_t total = lines_.size() * sizeof(Line) + entries_.size() * (sizeof(Entry) + 1) +
                      candidates_.size() * sizeof(Candidate) + depth_.size();
  for (const auto* words : {&heads_, &above_, &first_leaf_, &leaves_, &new_plan_})
    total += words->size() * sizeof(std::uint32_t);
  for (const auto& level : levels_) total += level.capacity() * sizeof(std::uint32_t);
  return total;
}

template class CalendarTree<float>;
template class CalendarTree<double>;

}  // namespace kbvh
