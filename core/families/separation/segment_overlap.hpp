#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/families/separation/segment_boxes.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace kbvh {

/// An instant and a double near it: |instant - hint| <= error.
template <class S>
struct Moment {
  Instant<S> instant;
  double hint, error;

  static Moment at(double t) { return {Instant<S>::at(t), t, 0}; }
};

/// Decides when two boxes overlap within one segment. Each of the six gaps is linear there. The boxes
/// therefore overlap during one interval, from the closing of the last gap until the opening of the first
/// one, or never. In most cases the signs at the segment's begin and end show that the boxes always or never
/// overlap. Decisions are exact and agree with OverlapClock. A gap that is zero at an end of the segment is
/// left to OverlapClock.
template <class S>
class SegmentOverlap {
 public:
  enum class Kind : std::uint8_t { apart, overlapping, changes, unsure };
  static constexpr std::uint8_t all_gaps = 0x3f;

  /// The kind of two boxes, and the gaps that decide it (one bit each): the boxes keep their events in the
  /// segment while no other gap than these shrinks. `apart`: one gap that separates them throughout. All
  /// other kinds: the gaps that are not far above zero at both ends (`far`).
  struct Decision {
    Kind kind;
    std::uint8_t gaps;
  };

  /// Classifies two boxes by the signs of their gaps at the ends of the segment. `apart`: one gap is negative
  /// at both ends. `overlapping`: all gaps are positive at both ends. `unsure`: a gap is zero or NaN at an
  /// end. `changes`: all other cases.
  static Decision decide(const SegmentBox<S>& a, const SegmentBox<S>& b) {
    std::uint8_t separating = 0, positive = 0, sure = 0, clear = 0;
    for (std::size_t lane = 0; lane < SegmentBox<S>::lanes; lane += width) {
      const Lanes a0 = load(a.at[0] + lane), a1 = load(a.at[1] + lane);
      const Lanes first = a0 + load(b.at[0] + lane), last = a1 + load(b.at[1] + lane);
      const Lanes zero{};
      const Mask negative_first = first < zero, negative_last = last < zero;
      const Mask positive_first = first > zero, positive_last = last > zero;
      const Lanes margin = (absolute(a0) + absolute(a1)) * far + least;
      separating |= bits(negative_first & negative_last, lane);
      positive |= bits(positive_first & positive_last, lane);
      sure |= bits((negative_first | positive_first) & (negative_last | positive_last), lane);
      clear |= bits((first > margin) & (last > margin), lane);
    }
    separating &= all_gaps;
    if (separating != 0) return {Kind::apart, std::uint8_t(separating & -separating)};
    const auto near = std::uint8_t(~clear & all_gaps);
    if ((positive & all_gaps) == all_gaps) return {Kind::overlapping, near};
    return (sure & all_gaps) == all_gaps ? Decision{Kind::changes, near} : Decision{Kind::unsure, all_gaps};
  }

  /// Takes two boxes of the kind `changes`.
  SegmentOverlap(const SegmentBoxes<S>& boxes, std::uint32_t body_a, const SegmentBox<S>& a,
                 std::uint32_t body_b, const SegmentBox<S>& b)
      : boxes_(&boxes),
        body_a_(body_a),
        body_b_(body_b),
        a_(&a),
        b_(&b),
        error_(16 * std::numeric_limits<double>::epsilon() *
               std::max(std::abs(boxes.begin()), std::abs(boxes.end()))) {
    for (std::size_t side = 0; side < 6; ++side) {
      // The sums are exact in float, and rounded once in double; their signs are exact.
      const double first = double(a.at[0][side]) + double(b.at[0][side]),
                   last = double(a.at[1][side]) + double(b.at[1][side]);
      if (first > 0 && last > 0) continue;
      const Root root{boxes.begin() + (boxes.end() - boxes.begin()) * (first / (first - last)),
                      std::uint8_t(side)};
      // Of several gaps at one instant the first side counts.
      if (first < 0) {
        if (closing_.side == no_side || compare(root, closing_) > 0) closing_ = root;
      } else if (opening_.side == no_side || compare(root, opening_) < 0) {
        opening_ = root;
      }
    }
    never_ = closing_.side != no_side && opening_.side != no_side && compare(closing_, opening_) >= 0;
  }

  /// Returns whether the boxes overlap right after an instant of the segment.
  bool overlap_after(const Moment<S>& now) const {
    return !never_ && (closing_.side == no_side || compare(closing_, now) <= 0) &&
           (opening_.side == no_side || compare(opening_, now) > 0);
  }
  /// Finds when boxes that are apart right after `now` begin to overlap. Returns false if they do not within
  /// the segment.
  bool next_overlap(const Moment<S>& now, OverlapEvent<S>& event) const {
    if (never_ || closing_.side == no_side || compare(closing_, now) <= 0) return false;
    return OverlapClock<S>::set(event, crossing(closing_.side, Turn::closes));
  }
  /// Finds when boxes that overlap now separate. Returns false if they do not within the segment.
  bool next_separation(OverlapEvent<S>& event) const {
    if (opening_.side == no_side) return false;
    return OverlapClock<S>::set(event, crossing(opening_.side, Turn::opens));
  }

 private:
  static constexpr std::size_t width = 16 / sizeof(S);
  using Lanes [[gnu::vector_size(16)]] = S;
  using Mask = decltype(Lanes{} < Lanes{});
  static constexpr std::uint8_t no_side = 6;
  /// A gap is far above zero if it exceeds this share of the first box's bounds: some 16 times the largest
  /// inflation (Widening).
  static constexpr S far = sizeof(S) == 4 ? S(0x1p-16) : S(0x1p-45);
  static constexpr S least = 64 * std::numeric_limits<S>::min();
  enum class Turn : std::uint8_t { closes, opens };

  /// The approximate time at which a gap is zero.
  struct Root {
    double time = 0;
    std::uint8_t side = no_side;
  };

  static Lanes load(const S* from) {
    Lanes lanes;
    std::memcpy(&lanes, from, sizeof lanes);
    return lanes;
  }
  static Lanes absolute(Lanes x) { return x < 0 ? -x : x; }
  /// Returns one bit per lane, shifted to the lane's number.
  static std::uint8_t bits(Mask mask, std::size_t lane) {
#if defined(__SSE2__)
    int found;
    if constexpr (sizeof(S) == 4)
      found = _mm_movemask_ps(__m128(mask));
    else
      found = _mm_movemask_pd(__m128d(mask));
    return std::uint8_t(found << lane);
#else
    unsigned found = 0;
    for (std::size_t i = 0; i < width; ++i) found |= mask[i] != 0 ? 1U << i : 0U;
    return std::uint8_t(found << lane);
#endif
  }

  Crossing<S> crossing(std::uint8_t side, Turn turn) const {
    const S a0 = a_->at[0][side], a1 = a_->at[1][side], b0 = b_->at[0][side], b1 = b_->at[1][side];
    // The gap of an even side is a's upper bound minus b's lower bound; of an odd side, b's upper bound minus
    // a's lower bound.
    const bool even = side % 2 == 0;
    const Piece<S> of_a = even ? boxes_->piece(body_a_, a0, a1) : boxes_->piece(body_a_, -a0, -a1);
    const Piece<S> of_b = even ? boxes_->piece(body_b_, -b0, -b1) : boxes_->piece(body_b_, b0, b1);
    const Piece<S>&upper = even ? of_a : of_b, &lower = even ? of_b : of_a;
    return turn == Turn::closes ? Crossing<S>{lower, upper} : Crossing<S>{upper, lower};
  }
  /// Return the exact sign of x - y, or of x - now.
  int compare(const Root& x, const Root& y) const {
    if (x.time + 3 * error_ < y.time) return -1;
    if (y.time + 3 * error_ < x.time) return 1;
    return compare_crossings(crossing(x.side, Turn::closes), crossing(y.side, Turn::closes));
  }
  int compare(const Root& x, const Moment<S>& now) const {
    const double error = 2 * error_ + now.error;
    if (x.time + error < now.hint) return -1;
    if (now.hint + error < x.time) return 1;
    const Crossing<S> root = crossing(x.side, Turn::closes);
    if (now.instant.exact == nullptr) return compare_crossing_to(root, now.instant.begin);
    const Crossing<S>& exact = *now.instant.exact;
    if (root == exact || (root.winner == exact.loser && root.loser == exact.winner)) return 0;
    return compare_crossings(root, exact);
  }

  const SegmentBoxes<S>* boxes_;
  std::uint32_t body_a_, body_b_;
  const SegmentBox<S>*a_, *b_;
  double error_;  ///< of a root: differences, sum, quotient, product and final sum are each rounded once
  Root closing_, opening_;  ///< of the last gap to close, and of the first gap to open
  bool never_ = false;
};

}  // namespace kbvh
