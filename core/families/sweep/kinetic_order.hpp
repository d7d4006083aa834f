#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/base/assert.hpp"
#include "core/motion/exact_piece.hpp"

namespace kbvh {

/// An end of a box on one axis over a segment: a line, by its values at the segment's begin and end.
template <class S>
struct MovingEnd {
  S begin, end;
  bool operator==(const MovingEnd&) const = default;
};

/// How a list stays sorted within a segment.
enum class KeptBy : std::uint8_t {
  events,   ///< certificates
  sorting,  ///< exchanges of neighbours at each frame, without certificates (Baraff 1992): the control
};

/// The order of two ends in a segment. A parameter of KineticOrder, so that tests can seed a fault.
struct EndOrder {
  /// Returns the sign of first - second at the begin of the segment, and right after it if they are equal.
  template <class S>
  static int at_begin(const MovingEnd<S>& first, const MovingEnd<S>& second) {
    if (first.begin != second.begin) return first.begin < second.begin ? -1 : 1;
    return first.end < second.end ? -1 : first.end > second.end ? 1 : 0;
  }
  /// Returns whether `first`, the lower one of two neighbours, overtakes the other one within the segment. It
  /// is not above at the begin, so the values at the end decide: stored data, compared exactly.
  template <class S>
  static bool swaps(const MovingEnd<S>& first, const MovingEnd<S>& second) {
    return first.end > second.end;
  }
};

/// The ends of boxes on one axis, sorted, while each moves on a line (a kinetic sorted list: Basch, Guibas &
/// Hershberger 1999). End 2 i is the lower end of box i, end 2 i + 1 the upper one.
///
/// Each two neighbours have a certificate: the time at which they exchange their places. Two lines meet once,
/// so the certificates are found without a search, and a pair of ends exchanges its places at most once in a
/// segment. The certificates wait in bins of equal spans of time. A frame opens the bins up to its time, and
/// performs the due swaps in any order: the sorted list at a time does not depend on the order of earlier
/// swaps, so no queue sorts events. Whether a swap is due is decided exactly: its time, a fraction of the
/// segment, is known up to 2^-50, and exact arithmetic decides closer cases.
///
/// Every exchange of neighbours is reported as on_swap(low, high): the end `low` was below `high` and is now
/// above. Swaps are reported in the list's order, so ranks are those after the exchange.
template <class S, class Rule = EndOrder>
class KineticOrder {
 public:
  using End = std::uint32_t;

  /// Takes the ends of `boxes` boxes; the list is empty afterwards. Allocates.
  void assign(std::uint32_t boxes) {
    lines_.assign(std::size_t(2) * boxes, {});
    ranks_.assign(lines_.size(), 0);
    list_.clear();
    list_.reserve(lines_.size());
    hints_.assign(lines_.size(), never);
    values_.assign(lines_.size(), 0);
    bins_ = std::uint32_t(std::clamp<std::size_t>(lines_.size() / 8, 16, 4096));
    next_.resize(lines_.size() + bins_);
    previous_.resize(next_.size());
    early_.reserve(lines_.size());
    swaps_ = certificates_ = exact_ = 0;
  }
  /// The line of an end: to be set before `sort` or `repair`.
  MovingEnd<S>& line(End end) { return lines_[end]; }
  /// Returns the index of an end in the list.
  std::uint32_t rank(End end) const { return ranks_[end]; }
  std::span<const End> list() const { return list_; }

  /// Makes a new list from the ends of some boxes, sorted at the begin of the segment and right after it. O(n
  /// log n).
  void sort(std::span<const std::uint32_t> boxes) {
    list_.clear();
    for (const std::uint32_t box : boxes) {
      list_.push_back(2 * box);
      list_.push_back(2 * box + 1);
    }
    std::sort(list_.begin(), list_.end(), [this](End a, End b) { return comes_before(a, b); });
    for (std::uint32_t i = 0; i < list_.size(); ++i) ranks_[list_[i]] = i;
  }
  /// Sorts the list of the same ends, whose lines have changed, by exchanges of neighbours. Returns false if
  /// it gave up after `most` exchanges. O(n + exchanges).
  template <class OnSwap>
  bool repair(std::uint64_t most, OnSwap&& on_swap) {
    for (std::uint32_t i = 1; i < list_.size(); ++i)
      for (std::uint32_t at = i; at > 0 && comes_before(list_[at], list_[at - 1]); --at) {
        if (most-- == 0) return false;
        exchange(at - 1, on_swap);
      }
    return true;
  }

  /// Begins a segment, at whose begin the list is sorted: makes all certificates if events keep the list. In
  /// a segment without a length, or without an end, no end of a box moves. O(n).
  void start_segment(double begin, double end, KeptBy kept) {
    begin_ = begin;
    end_ = end;
    kept_ = kept;
    opened_ = 0;
    if (kept == KeptBy::sorting || !moves()) return;
    for (std::uint32_t i = 0; i < next_.size(); ++i) next_[i] = previous_[i] = i;
    std::fill(hints_.begin(), hints_.end(), never);
    for (std::uint32_t i = 0; i + 1 < list_.size(); ++i) certify(i);
  }
  /// Performs all swaps up to and including t, a time of the segment. O(bins passed + certificates in the
  /// last one + swaps); if the list is kept by sorting, O(n + swaps).
  template <class OnSwap>
  void advance(double t, OnSwap&& on_swap) {
    if (!moves()) return;
    if (kept_ == KeptBy::sorting) return sort_at(t, on_swap);
    const double now = fraction(t);
    const std::uint32_t last = bin_of(now + fraction_error), first_bin = std::uint32_t(lines_.size());
    early_.clear();
    for (;; ++opened_) {
      const std::uint32_t bin = first_bin + opened_;
      while (next_[bin] != bin) {
        const std::uint32_t place = next_[bin];
        unlink(place);
        if (is_due(place, t, now)) {
          exchange(place, on_swap);
          hints_[place] = never;
          if (place > 0) certify(place - 1);
          if (place + 2 < list_.size()) certify(place + 1);
        } else {
          early_.push_back(place);
        }
      }
      if (opened_ >= last) break;
    }
    for (const std::uint32_t place : early_)
      if (hints_[place] != never && next_[place] == place) link(place);
  }
  /// Return the numbers since `assign` of exchanges of neighbours, of certificates that fail within their
  /// segment, and of decisions by exact arithmetic.
  std::uint64_t swaps() const { return swaps_; }
  std::uint64_t certificates() const { return certificates_; }
  std::uint64_t exact_decisions() const { return exact_; }
  std::size_t bytes() const {
    return lines_.capacity() * sizeof(MovingEnd<S>) +
           (hints_.capacity() + values_.capacity()) * sizeof(double) +
           (ranks_.capacity() + list_.capacity() + next_.capacity() + previous_.capacity() +
            early_.capacity()) *
               sizeof(std::uint32_t);
  }

 private:
  static constexpr double never = std::numeric_limits<double>::infinity();
  /// Two differences, their sum and the quotient each have a relative error of 2^-53, and so do the three
  /// operations that compute a frame's fraction.
  static constexpr double fraction_error = 0x1p-49;

  /// A total order, right after the begin of the segment.
  bool comes_before(End a, End b) const {
    if (const int sign = Rule::at_begin(lines_[a], lines_[b]); sign != 0) return sign < 0;
    // Boxes are closed: ends that touch throughout overlap.
    return (a & 1) != (b & 1) ? (a & 1) == 0 : a < b;
  }
  static double magnitude(const MovingEnd<S>& line) {
    return std::max(std::abs(double(line.begin)), std::abs(double(line.end)));
  }
  bool moves() const { return begin_ < end_ && std::isfinite(end_); }
  double fraction(double t) const { return (t - begin_) / (end_ - begin_); }
  std::uint32_t bin_of(double fraction) const {
    return std::uint32_t(std::clamp(fraction * double(bins_), 0.0, double(bins_ - 1)));
  }
  Piece<S> piece(End end) const {
    return {begin_, end_, lines_[end].begin, lines_[end].end, PieceKind::chord};
  }
  Crossing<S> crossing(End first, End second) const { return {piece(second), piece(first)}; }

  template <class OnSwap>
  void sort_at(double t, OnSwap&& on_swap) {
    const double now = fraction(t);
    double largest = 0;
    for (std::size_t i = 0; i < list_.size(); ++i) {
      const MovingEnd<S> line = lines_[list_[i]];
      const double first = double(line.begin), last = double(line.end);
      largest = std::max(largest, magnitude(line));
      values_[i] = first + now * (last - first);
    }
    const double error = 0x1p-48 * largest;
    for (std::uint32_t i = 1; i < list_.size(); ++i)
      for (std::uint32_t at = i; at > 0 && is_behind(at - 1, t, error); --at) {
        std::swap(values_[at - 1], values_[at]);
        exchange(at - 1, on_swap);
      }
  }
  /// Makes the certificate of the neighbours at `place` and after it.
  void certify(std::uint32_t place) {
    unlink(place);
    hints_[place] = never;
    const MovingEnd<S>&first = lines_[list_[place]], &second = lines_[list_[place + 1]];
    if (!Rule::swaps(first, second)) return;
    const double behind = double(second.begin) - double(first.begin),
                 ahead = double(first.end) - double(second.end);
    hints_[place] = behind / (behind + ahead);
    ++certificates_;
    link(place);
  }
  bool is_due(std::uint32_t place, double t, double now) {
    const double hint = hints_[place];
    if (hint + fraction_error < now) return true;
    if (hint - fraction_error > now) return false;
    ++exact_;
    return compare_crossing_to(crossing(list_[place], list_[place + 1]), t) <= 0;
  }
  /// Returns whether the end at `place` has overtaken the next one by t, as `is_due` does.
  bool is_behind(std::uint32_t place, double t, double error) {
    const double difference = values_[place] - values_[place + 1];
    if (difference < -error) return false;
    if (difference > error) return true;
    const End first = list_[place], second = list_[place + 1];
    if (lines_[first] == lines_[second]) return false;
    // `error` is that of the largest end in the list; these two may be much smaller.
    const double own = 0x1p-48 * std::max(magnitude(lines_[first]), magnitude(lines_[second]));
    if (difference < -own) return false;
    if (difference > own) return true;
    ++exact_;
    const int sign = compare_at(piece(first), piece(second), t);
    return sign > 0 || (sign == 0 && Rule::swaps(lines_[first], lines_[second]));
  }
  template <class OnSwap>
  void exchange(std::uint32_t place, OnSwap&& on_swap) {
    const End low = list_[place], high = list_[place + 1];
    list_[place] = high;
    list_[place + 1] = low;
    ranks_[high] = place;
    ranks_[low] = place + 1;
    ++swaps_;
    on_swap(low, high);
  }
  /// The lists of the bins are rings; a place in no bin is a ring of its own.
  void unlink(std::uint32_t place) {
    next_[previous_[place]] = next_[place];
    previous_[next_[place]] = previous_[place];
    next_[place] = previous_[place] = place;
  }
  void link(std::uint32_t place) {
    const std::uint32_t bin =
        std::uint32_t(lines_.size()) + std::max(opened_, bin_of(hints_[place] - fraction_error));
    next_[place] = bin;
    previous_[place] = previous_[bin];
    next_[previous_[bin]] = place;
    previous_[bin] = place;
  }

  std::vector<MovingEnd<S>> lines_;             ///< [end]
  std::vector<std::uint32_t> ranks_;            ///< [end]: place in the list
  std::vector<End> list_;                       ///< [place]
  std::vector<double> hints_;                   ///< [place]: fraction at which it exchanges with the next one
  std::vector<std::uint32_t> next_, previous_;  ///< [place, then bin]
  std::vector<std::uint32_t> early_;            ///< places of the last bin that are not due yet
  std::vector<double> values_;                  ///< [place], of `sort_at`
  std::uint32_t bins_ = 16, opened_ = 0;
  double begin_ = 0, end_ = 0;
  KeptBy kept_ = KeptBy::events;
  std::uint64_t swaps_ = 0, certificates_ = 0, exact_ = 0;
};

}  // namespace kbvh
