#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/sweep/box_pair_set.hpp"
#include "core/families/sweep/kinetic_order.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// The pairs of boxes that overlap on all three axes, while the ends of the boxes move on lines: three
/// kinetic sorted lists, and the set of pairs that their swaps change (sweep and prune: Baraff 1992; kinetic:
/// Coming & Staadt 2006).
///
/// Two boxes overlap on an axis if each begins before the other one ends, by their ranks in the list of that
/// axis. So a swap changes the set by at most one pair, and ranks alone decide whether it does. The set
/// matches the three lists at any time; the lists may be advanced one after the other. Ends that touch have
/// the order that holds right after the touch; if a touch must count, the caller widens boxes.
template <class S, class Rule = EndOrder>
class KineticOverlaps {
 public:
  using Order = KineticOrder<S, Rule>;

  /// Takes boxes of bodies, `body_of[box]` ascending, and the pairs of bodies to report. Allocates.
  void assign(std::vector<std::uint32_t> body_of, std::uint32_t bodies, std::span<const BodyPair> pairs) {
    body_of_ = std::move(body_of);
    for (Order& order : orders_) order.assign(std::uint32_t(body_of_.size()));
    first_partner_.assign(std::size_t(bodies) + 1, 0);
    for (const BodyPair& pair : pairs) ++first_partner_[pair.first + 1];
    for (std::size_t body = 0; body < bodies; ++body) first_partner_[body + 1] += first_partner_[body];
    partners_.resize(pairs.size());
    std::vector<std::uint32_t> next(first_partner_.begin(), first_partner_.end() - 1);
    for (std::uint32_t i = 0; i < pairs.size(); ++i) partners_[next[pairs[i].first]++] = {pairs[i].second, i};
    within_.assign(bodies, 0);
    for (std::uint32_t body = 0; body < bodies; ++body) {
      std::sort(partners_.begin() + first_partner_[body], partners_.begin() + first_partner_[body + 1],
                [](const Partner& a, const Partner& b) { return a.body < b.body; });
      within_[body] = find_pair(body, body) != none;
    }
    active_place_.assign(body_of_.size(), 0);
    active_.reserve(body_of_.size());
  }

  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// Returns the index of the pair of bodies of two boxes, a < b, or `none`.
  std::uint32_t body_pair(BoxPairSet::Pair boxes) const {
    return find_pair(body_of_[boxes.a], body_of_[boxes.b]);
  }
  /// Returns the list of an axis; set its lines before `start` and `renew`.
  Order& order(std::size_t axis) { return orders_[axis]; }
  const Order& order(std::size_t axis) const { return orders_[axis]; }
  /// Returns the overlapping pairs, a < b, of the pairs of bodies to report.
  const BoxPairSet& set() const { return set_; }

  /// Starts over with some boxes, at the begin of a segment: sorts, and sweeps over the axis on which the
  /// fewest boxes overlap. Returns the number of tests of two boxes.
  std::uint64_t start(std::span<const std::uint32_t> boxes) {
    set_.clear();
    for (Order& order : orders_) order.sort(boxes);
    return sweep(best_axis());
  }
  /// Continues with the same boxes in a new segment. Returns false if the order has changed too much; then
  /// call `start`.
  bool renew() {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!orders_[axis].repair(16 * std::uint64_t(orders_[axis].list().size()), swapped(axis))) return false;
    return true;
  }
  void start_segment(double begin, double end, KeptBy kept) {
    for (Order& order : orders_) order.start_segment(begin, end, kept);
  }
  /// Brings lists and set to t, a time of the segment.
  void advance(double t) {
    for (std::size_t axis = 0; axis < 3; ++axis) orders_[axis].advance(t, swapped(axis));
  }

  /// Processes one exchange of neighbours on an axis, which the lists contain already.
  void take_swap(std::size_t axis, std::uint32_t low, std::uint32_t high) {
    if (((low ^ high) & 1) == 0) return;
    const std::uint32_t a = low >> 1, b = high >> 1;
    if (body_of_[a] == body_of_[b] && within_[body_of_[a]] == 0) return;
    ++exchanges_;
    if (!overlap_on((axis + 1) % 3, a, b) || !overlap_on((axis + 2) % 3, a, b)) return;
    const BoxPairSet::Pair pair{std::min(a, b), std::max(a, b)};
    if ((low & 1) == 0) {
      separations_ += set_.erase(pair) ? 1 : 0;
    } else if (body_pair(pair) != none) {
      meetings_ += set_.insert(pair) ? 1 : 0;
    }
  }

  /// Counts since `assign`: swaps of a lower with an upper end, of two boxes whose bodies are to be reported;
  /// pairs that began to overlap, and pairs that ceased.
  std::uint64_t exchanges() const { return exchanges_; }
  std::uint64_t meetings() const { return meetings_; }
  std::uint64_t separations() const { return separations_; }
  std::size_t bytes() const {
    std::size_t total =
        set_.bytes() + within_.capacity() + partners_.capacity() * sizeof(Partner) +
        (body_of_.capacity() + first_partner_.capacity() + active_.capacity() + active_place_.capacity()) *
            sizeof(std::uint32_t);
    for (const Order& order : orders_) total += order.bytes();
    return total;
  }

 private:
  struct Partner {
    std::uint32_t body, pair;
  };
  auto swapped(std::size_t axis) {
    return [this, axis](std::uint32_t low, std::uint32_t high) { take_swap(axis, low, high); };
  }
  std::uint32_t find_pair(std::uint32_t first, std::uint32_t second) const {
    const auto begin = partners_.begin() + first_partner_[first],
               end = partners_.begin() + first_partner_[first + 1];
    const auto found = std::lower_bound(
        begin, end, second, [](const Partner& partner, std::uint32_t body) { return partner.body < body; });
    return found == end || found->body != second ? none : found->pair;
  }
  bool overlap_on(std::size_t axis, std::uint32_t a, std::uint32_t b) const {
    const Order& order = orders_[axis];
    return order.rank(2 * a) < order.rank(2 * b + 1) && order.rank(2 * b) < order.rank(2 * a + 1);
  }
  /// For each box, sums the number of ends between its own ends.
  std::size_t best_axis() const {
    std::size_t best = 0;
    std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::uint64_t total = 0;
      for (const std::uint32_t end : orders_[axis].list())
        if ((end & 1) == 0) total += orders_[axis].rank(end + 1) - orders_[axis].rank(end);
      if (total < least) least = total, best = axis;
    }
    return best;
  }
  std::uint64_t sweep(std::size_t axis) {
    std::uint64_t tests = 0;
    const std::size_t other = (axis + 1) % 3, third = (axis + 2) % 3;
    active_.clear();
    for (const std::uint32_t end : orders_[axis].list()) {
      const std::uint32_t box = end >> 1, body = body_of_[box];
      if ((end & 1) != 0) {
        active_[active_place_[box]] = active_.back();
        active_place_[active_.back()] = active_place_[box];
        active_.pop_back();
        continue;
      }
      for (const std::uint32_t open : active_) {
        if (body_of_[open] == body && within_[body] == 0) continue;
        ++tests;
        if (!overlap_on(other, box, open) || !overlap_on(third, box, open)) continue;
        const BoxPairSet::Pair pair{std::min(box, open), std::max(box, open)};
        if (body_pair(pair) != none) set_.insert(pair);
      }
      active_place_[box] = std::uint32_t(active_.size());
      active_.push_back(box);
    }
    return tests;
  }

  std::array<Order, 3> orders_;
  BoxPairSet set_;
  std::vector<std::uint32_t> body_of_;        ///< [box]
  std::vector<std::uint32_t> first_partner_;  ///< [body, and one more]
  std::vector<Partner> partners_;             ///< of the first body of a pair, by the second
  std::vector<std::uint8_t> within_;          ///< [body]: whether pairs within it count
  std::vector<std::uint32_t> active_, active_place_;
  std::uint64_t exchanges_ = 0, meetings_ = 0, separations_ = 0;
};

}  // namespace kbvh
