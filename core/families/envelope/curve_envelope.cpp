#include "core/families/envelope/curve_envelope.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kbvh {

template <class S>
void CurveEnvelope<S>::assign(const WideHierarchy<S>& hierarchy) {
  first_store_.assign(hierarchy.node_count() * lane_scalars(hierarchy.topology().width), 0);
  made_.clear();
  stores_.clear();
  next_ = 0;
}

template <class S>
void CurveEnvelope<S>::make(WideHierarchy<S>& hierarchy, const WideRealisers& realisers,
                            const SegmentCurves<S>& curves) {
  curves_ = curves;
  made_.clear();
  const WideArrays<S> h = hierarchy.arrays();
  const std::uint32_t width = hierarchy.topology().width;
  const auto scalars = std::uint32_t(lane_scalars(width));
  for (std::uint32_t n = hierarchy.node_count(); n-- > 0;) {
    const WideNode node = h.nodes[n];
    for (std::uint32_t row = 0; row < 6; ++row)
      for (std::uint32_t lane = 0; lane < node.count; ++lane) {
        candidates_.clear();
        if (lane < node.leaf_count) {
          const std::uint32_t* const list = h.vertices + node.list + list_place(lane, width);
          for (std::uint32_t i = 0; i < node.length; ++i) {
            const std::uint32_t place = list[i * width] + row % 3;
            // Lists are filled up with their last vertex.
            if (candidates_.empty() || candidates_.back() != place) candidates_.push_back(place);
          }
        } else {
          const std::uint32_t child = node.first_child + lane - node.leaf_count;
          for (std::uint32_t i = 0; i < h.nodes[child].count; ++i) {
            const std::uint32_t under = child * scalars + row * width + i;
            candidates_.push_back(realisers[under]);
            // A vertex may realise a side several times.
            for (std::size_t s = first_store_[under]; s < made_.size() && made_[s].slot == under; ++s)
              if (std::find(candidates_.begin(), candidates_.end(), made_[s].realiser) == candidates_.end())
                candidates_.push_back(made_[s].realiser);
          }
        }
        const std::uint32_t slot = n * scalars + row * width + lane;
        walk(slot, realisers[slot], row < 3);
      }
  }
  largest_error_ = 0;
  for (const Store& store : made_) largest_error_ = std::max(largest_error_, store.error);
  stores_.assign(made_.begin(), made_.end());
  std::sort(stores_.begin(), stores_.end(), [](const Store& a, const Store& b) {
    return a.key != b.key ? a.key < b.key : a.number < b.number;
  });
  next_ = 0;
}

/// Walks from the vertex that realises a side at the segment's begin to the one that does at its end.
template <class S>
void CurveEnvelope<S>::walk(std::uint32_t slot, std::uint32_t realiser, bool lower) {
  first_store_[slot] = std::uint32_t(made_.size());
  double key = -std::numeric_limits<double>::infinity();
  Turn since, next;
  for (bool first = true; find_turn(realiser, lower, first ? nullptr : &since, next); first = false) {
    counts_.active_sides += first ? 1 : 0;
    const TimeEstimate estimate = moment_estimate(next.moment.first, next.root);
    key = std::max(key, estimate.time);
    made_.push_back({estimate.time, estimate.error, key, slot, next.place, realiser, next.moment.root,
                     std::uint32_t(made_.size())});
    realiser = next.place;
    since = next;
  }
}

/// Finds the first candidate that gets ahead of the realiser at or after `since` (null: the segment's begin).
/// Returns false if none does.
template <class S>
bool CurveEnvelope<S>::find_turn(std::uint32_t realiser, bool lower, const Turn* since, Turn& first) {
  const CurvedPiece<S> winner = curves_.piece(realiser);
  bool found = false;
  for (const std::uint32_t place : candidates_) {
    if (place == realiser) continue;
    const CurvedPiece<S> other = curves_.piece(place);
    const CurvedPiece<S>&ahead = lower ? winner : other, &behind = lower ? other : winner;
    if (stays_behind(ahead, behind)) continue;
    ++counts_.crossings;
    const SegmentRoots roots = segment_roots(ahead, behind);
    for (int i = 0; i < roots.count; ++i) {
      const CurveRoot& root = roots.roots[i];
      if (root.after <= 0) continue;
      const Turn turn{{ahead, behind, std::uint32_t(i)}, root, place};
      if (since != nullptr && root.begin <= since->root.end) {
        if (root.end < since->root.begin) continue;
        ++counts_.exact;
        if (compare_moments(turn.moment, since->moment) < 0) continue;
      }
      if (!found || comes_first(turn, first, lower)) first = turn;
      found = true;
      break;
    }
  }
  return found;
}

/// Returns whether x comes before y; of simultaneous turns the vertex that is ahead right after them.
template <class S>
bool CurveEnvelope<S>::comes_first(const Turn& x, const Turn& y, bool lower) {
  if (x.root.end < y.root.begin) return true;
  if (y.root.end < x.root.begin) return false;
  ++counts_.exact;
  if (const int order = compare_moments(x.moment, y.moment)) return order < 0;
  const int ahead = compare_after_moment(curves_.piece(x.place), curves_.piece(y.place), x.moment);
  return lower ? ahead < 0 : ahead > 0;
}

/// Returns whether x - y is certainly negative throughout the segment: its chord lies further below zero than
/// the curve may lie above the chord (`bulge`). Each difference and the sum have one rounding error.
template <class S>
bool CurveEnvelope<S>::stays_behind(const CurvedPiece<S>& x, const CurvedPiece<S>& y) {
  const double begin = double(x.x0) - double(y.x0), end = double(x.x1) - double(y.x1),
               bend = double(x.bend) - double(y.bend), twist = double(x.twist) - double(y.twist);
  const double above = std::max({0.0, bend, bend + twist}) + 0x1p-50 * (std::fabs(bend) + std::fabs(twist));
  return 4 * std::max(begin, end) < -above * (1 + 0x1p-50);
}

template <class S>
bool CurveEnvelope<S>::is_due(const Store& store, double t) {
  if (store.time + store.error < t) return true;
  if (store.time - store.error > t) return false;
  ++counts_.exact;
  return compare_moment_to<S>({curves_.piece(store.realiser), curves_.piece(store.before), store.root}, t) <=
         0;
}

template <class S>
void CurveEnvelope<S>::advance(double t, WideRealisers& realisers) {
  const std::size_t from = next_;
  for (; next_ < stores_.size() && (t >= curves_.t1 || stores_[next_].key + largest_error_ < t); ++next_)
    realisers[stores_[next_].slot] = stores_[next_].realiser;
  // A handful of stores of about this time; the next frame examines them again. Keys keep the order of a
  // side.
  for (std::size_t i = next_; i < stores_.size() && stores_[i].key - largest_error_ <= t; ++i)
    if (is_due(stores_[i], t)) realisers[stores_[i].slot] = stores_[i].realiser;
  counts_.stores += next_ - from;
}

template <class S>
std::size_t CurveEnvelope<S>::bytes() const {
  return (first_store_.capacity() + candidates_.capacity()) * sizeof(std::uint32_t) +
         (made_.capacity() + stores_.capacity()) * sizeof(Store);
}

template class CurveEnvelope<float>;
template class CurveEnvelope<double>;

}  // namespace kbvh
