#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/events/event.hpp"

namespace kbvh {

/// The form in which a queue stores events: the clock's short form if it has one, else the event itself.
template <class Clock>
struct StoredEvent {
  using type = typename Clock::Event;
};
template <class Clock>
requires requires {
  typename Clock::Packed;
}
struct StoredEvent<Clock> {
  using type = typename Clock::Packed;
};

/// An event queue (event_queue.hpp) in three parts. Each event waits in the last part that its time allows:
///   segments  unsorted lists, one per span between the times of `split_at`
///   bins      the current segment, divided into equal spans of about 24 events, unsorted
///   heap      the current bin: a 4-ary heap by time and error bound; overlapping bounds are compared exactly
/// Segments and bins order events by the earliest time that their error bounds allow. An event whose latest
/// possible time lies before the next bin is therefore earlier than all waiting events, and only such an
/// event is returned as the first. The span after the last of the times is divided repeatedly, at the median
/// of the events that wait there.
///
/// `schedule` and `cancel` are O(1), except for events of the current bin, which are O(log bin). A cancelled
/// event stays in its list until the list is opened, or until half of all entries are cancelled ones.
template <class Clock>
class SegmentHeapEventQueue {
  using Event = typename Clock::Event;
  using Stored = typename StoredEvent<Clock>::type;
  static constexpr bool packed = !std::is_same_v<Stored, Event>;
  /// Returned by value where events are unpacked on demand.
  using Returned = std::conditional_t<packed, Event, const Event&>;

 public:
  using ClockType = Clock;
  static constexpr const char* name = "segment_heap";
  /// The number of keyframes of one search. Certificates seldom last to the clip's end. 64 keyframes of one
  /// vertex fill a few cache lines.
  static constexpr std::size_t look_ahead() { return 64; }
  SegmentHeapEventQueue(const Clock& clock, std::uint32_t slots)
      : clock_(&clock), records_(slots), segments_(1) {}

  /// Divides time at `times` (ascending). Requires an empty queue.
  void split_at(std::span<const double> times) {
    KBVH_ASSERT(size() == 0);
    cuts_.assign(times.begin(), times.end());
    cuts_per_second_ = times.size() < 2 ? 0 : double(times.size() - 1) / (times.back() - times.front());
    segments_.resize(times.size() + 1);
    clear();
  }

  /// Calls owner.fetch_ahead(stored event, slot, step) for batches of upcoming events, with steps 0, 1 and 2
  /// in turn, and owner.review(event, time) for the certificates passed to `review`.
  template <class Owner>
  void serve(Owner& owner) {
    owner_ = &owner;
    fetch_ahead_ = [](void* self, const Stored& event, std::uint32_t slot, int step) {
      static_cast<Owner*>(self)->fetch_ahead(event, slot, step);
    };
    review_ = [](void* self, const Event& event, double t) { static_cast<Owner*>(self)->review(event, t); };
  }

  void schedule(const Event& event) {
    Record& record = replaced(event);
    const float error = error_above(event.error);
    const double begin = event.hint - double(error);
    if (const std::int32_t number = number_of(begin); number > opened_) {
      wait(event.slot, record, number);
    } else {
      push({event.hint, error, event.slot});
    }
  }
  /// Schedules a review of a certificate that is known to hold until `time`, one of the times of `split_at`.
  /// The review comes before any event from `time` on, and replaces the slot's event. Returns false, and does
  /// nothing, if later events have been compared already.
  bool review(const Event& event, double time) {
    const std::size_t segment = segment_of(time);
    if (segment <= segment_) return false;
    Record& record = replaced(event);
    wait(event.slot, record, most_bins + std::int32_t(segment), reviewed);
    return true;
  }
  bool cancel(std::uint32_t slot) { return withdraw(records_[slot]); }
  bool scheduled(std::uint32_t slot) const {
    return records_[slot].place != nowhere &&
           (records_[slot].place & (waits | reviewed)) != (waits | reviewed);
  }
  /// Returns whether the slot has a review instead of an event.
  bool reviewing(std::uint32_t slot) const { return records_[slot].place != nowhere && !scheduled(slot); }
  Returned event(std::uint32_t slot) const {
    if constexpr (packed)
      return clock_->unpack(records_[slot].event, slot);
    else
      return records_[slot].event;
  }
  Returned top() const {
    find_first();
    return event(heap_.front().slot);
  }
  void pop() {
    find_first();
    withdraw(records_[heap_.front().slot]);
  }
  /// Removes and returns the earliest event.
  Event take() {
    find_first();
    const std::uint32_t slot = heap_.front().slot;
    const Event first = event(slot);
    withdraw(records_[slot]);
    return first;
  }
  /// Returns whether the earliest event happens at or before t.
  bool due(double t) const {
    if (empty()) return false;
    const Entry& first = heap_.front();
    if (first.hint + double(first.error) < t) return true;
    if (first.hint - double(first.error) > t) return false;
    return clock_->due(event(first.slot), t);
  }
  bool empty() const {
    find_first();
    return heap_.empty();
  }
  /// Counts reviews, too.
  std::size_t size() const { return heap_.size() + waiting_; }
  void clear() {
    for (auto& list : segments_) list.clear();
    for (auto& list : bins_) list.clear();
    for (Record& record : records_) record.place = nowhere;
    heap_.clear();
    waiting_ = entries_ = 0;
    segment_ = 0;
    bin_count_ = 0;
    opened_ = -1;
    limit_ = -infinity;
  }
  /// Prefetches the record of a slot.
  void prefetch(std::uint32_t slot) const { __builtin_prefetch(&records_[slot]); }
  std::uint32_t slots() const { return std::uint32_t(records_.size()); }
  void grow(std::uint32_t slots) {
    if (slots > records_.size()) records_.resize(slots);
  }
  std::uint64_t steps() const { return steps_; }
  std::size_t bytes() const {
    std::size_t total = records_.capacity() * sizeof(Record) + heap_.capacity() * sizeof(Entry) +
                        cuts_.capacity() * sizeof(double) + reviews_.capacity() * sizeof(std::uint32_t);
    for (const auto& list : segments_) total += list.capacity() * sizeof(std::uint32_t);
    for (const auto& list : bins_) total += list.capacity() * sizeof(std::uint32_t);
    return total + (segments_.capacity() + bins_.capacity()) * sizeof(std::vector<std::uint32_t>) +
           (keys_.capacity() + sorted_.capacity()) * sizeof(double);
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr std::uint32_t nowhere = std::numeric_limits<std::uint32_t>::max();
  static constexpr std::uint32_t waits = 1U << 31;     ///< in `place`: it is in a list, not in the heap
  static constexpr std::uint32_t seen = 1U << 30;      ///< in `place`: met already by tidy_up or cut_segment
  static constexpr std::uint32_t reviewed = 1U << 29;  ///< in `place`, with `waits`: a review
  static constexpr std::int32_t most_bins = 1 << 14;
  static constexpr std::size_t events_per_bin = 24;

  struct Record {
    Stored event{};
    std::uint32_t place = nowhere;
  };
  struct Entry {
    double hint;
    float error;
    std::uint32_t slot;
  };

  static float error_above(double error) {
    const auto rounded = float(error);
    return double(rounded) >= error ? rounded
                                    : std::nextafter(rounded, std::numeric_limits<float>::infinity());
  }

  Entry entry(std::uint32_t slot) const {
    const Stored& stored = records_[slot].event;
    if constexpr (packed)
      return {stored.hint, error_above(clock_->error_of(stored, slot)), slot};
    else
      return {stored.hint, error_above(stored.error), slot};
  }

  // ---- Lists of waiting events

  /// Returns the number of the list for a time. Bins are numbered from 0, segments from most_bins; numbers
  /// rise with time.
  std::int32_t number_of(double time) const {
    if (time < limit_) {
      // Error bounds beyond the range of float make infinite times, whose differences are not numbers: the
      // first bin.
      const double share = (time - bins_begin_) * bins_per_second_;
      return !(share > 0) ? 0 : share >= double(bin_count_ - 1) ? bin_count_ - 1 : std::int32_t(share);
    }
    return most_bins + std::int32_t(std::max(segment_of(time), segment_));
  }
  std::size_t segment_of(double time) const {
    if (cuts_.empty() || time < cuts_.front()) return 0;
    if (time >= cuts_.back()) return cuts_.size();
    auto guess = std::size_t((time - cuts_.front()) * cuts_per_second_);
    guess = std::min(guess, cuts_.size() - 2);
    if (time < cuts_[guess] && guess > 0) --guess;
    if (time >= cuts_[guess + 1]) ++guess;
    if (time >= cuts_[guess] && time < cuts_[guess + 1]) return guess + 1;
    return std::size_t(std::upper_bound(cuts_.begin(), cuts_.end(), time) - cuts_.begin());
  }
  std::vector<std::uint32_t>& list(std::int32_t number) const {
    return number < most_bins ? bins_[std::size_t(number)] : segments_[std::size_t(number - most_bins)];
  }
  void wait(std::uint32_t slot, Record& record, std::int32_t number, std::uint32_t kind = 0) {
    record.place = waits | kind | std::uint32_t(number);
    list(number).push_back(slot);
    ++waiting_;
    if (++entries_ > 2 * waiting_ + 4096) tidy_up();
  }
  /// Removes outdated and duplicate entries from all lists.
  void tidy_up() {
    entries_ = 0;
    for (std::int32_t number = 0; number < most_bins + std::int32_t(segments_.size()); ++number) {
      if (number == bin_count_) number = most_bins;
      auto& entries = list(number);
      std::erase_if(entries, [&](std::uint32_t slot) {
        if ((records_[slot].place & ~reviewed) != (waits | std::uint32_t(number))) return true;
        records_[slot].place |= seen;
        return false;
      });
      for (const std::uint32_t slot : entries) records_[slot].place &= ~seen;
      entries_ += entries.size();
    }
  }

  /// Stores an event in its slot's record; removes the slot's former event from its list or the heap.
  Record& replaced(const Event& event) {
    Record& record = records_[event.slot];
    withdraw(record);
    if constexpr (packed)
      record.event = clock_->pack(event);
    else
      record.event = event;
    return record;
  }
  /// Removes the event or review of a record. Returns whether it was an event.
  bool withdraw(Record& record) {
    const std::uint32_t place = record.place;
    if (place == nowhere) return false;
    record.place = nowhere;
    if ((place & waits) == 0) {
      erase(place);
      return true;
    }
    --waiting_;
    return (place & reviewed) == 0;
  }

  /// Opens bins until the first event of the heap is the earliest of all, or no event is left.
  void find_first() const {
    while (waiting_ > 0) {
      if (!heap_.empty()) {
        const Entry& first = heap_.front();
        if (number_of(first.hint + double(first.error)) <= opened_) return;
      }
      open_next();
    }
  }
  void open_next() const {
    while (++opened_ < bin_count_) {
      auto& entries = bins_[std::size_t(opened_)];
      if (entries.empty()) continue;
      for (const std::uint32_t slot : entries) prefetch(slot);
      for (const std::uint32_t slot : entries)
        if (records_[slot].place == (waits | std::uint32_t(opened_))) {
          --waiting_;
          if (fetch_ahead_ != nullptr) fetch_ahead_(owner_, records_[slot].event, slot, 0);
          push(entry(slot));
        }
      if (fetch_ahead_ != nullptr)
        for (const int step : {1, 2})
          for (const std::uint32_t slot : entries)
            if (records_[slot].place < waits) fetch_ahead_(owner_, records_[slot].event, slot, step);
      entries_ -= entries.size();
      entries.clear();
      return;
    }
    cut_segment();
  }
  /// Performs the reviews of the segment that begins; some of them schedule events.
  void review_segment(std::uint32_t here) const {
    reviews_.clear();
    for (const std::uint32_t slot : segments_[segment_]) {
      if (records_[slot].place != (here | reviewed)) continue;
      records_[slot].place = nowhere;
      --waiting_;
      reviews_.push_back(slot);
    }
    constexpr std::size_t ahead = 8;
    for (std::size_t i = 0; i < reviews_.size(); ++i) {
      if (i + ahead < reviews_.size())
        fetch_ahead_(owner_, records_[reviews_[i + ahead]].event, reviews_[i + ahead], 0);
      review_(owner_, event(reviews_[i]), cuts_[segment_ - 1]);
    }
  }
  /// Divides the first non-empty segment into bins. Requires that no bin is open.
  void cut_segment() const {
    while (segments_[segment_].empty()) ++segment_;
    const std::uint32_t here = waits | std::uint32_t(most_bins + std::int32_t(segment_));
    review_segment(here);
    auto& entries = segments_[segment_];
    keys_.clear();
    std::size_t kept = 0;
    constexpr std::size_t ahead = 16;
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (i + ahead < entries.size()) prefetch(entries[i + ahead]);
      const std::uint32_t slot = entries[i];
      if (records_[slot].place != here) continue;
      records_[slot].place |= seen;
      const Entry next = entry(slot);
      keys_.push_back(next.hint - double(next.error));
      entries[kept++] = slot;
    }
    entries_ -= entries.size() - kept;
    entries.resize(kept);
    const auto [least, largest] = std::minmax_element(keys_.begin(), keys_.end());
    double begin = kept == 0 ? 0 : *least, end = kept == 0 ? 0 : *largest;
    opened_ = -1;
    if (segment_ < cuts_.size()) {
      limit_ = cuts_[segment_];
    } else if (kept <= events_per_bin || begin == end) {
      limit_ = std::nextafter(end, infinity);
    } else {
      // The first half, or all but the largest if many are equal.
      sorted_ = keys_;
      const auto middle = sorted_.begin() + std::ptrdiff_t(kept / 2);
      std::nth_element(sorted_.begin(), middle, sorted_.end());
      end = *middle > begin ? *middle : end;
      limit_ = end;
    }
    bin_count_ = std::int32_t(std::min(kept / events_per_bin + 1, std::size_t(most_bins)));
    if (bins_.size() < std::size_t(bin_count_)) bins_.resize(std::size_t(bin_count_));
    bins_begin_ = begin;
    bins_per_second_ = end > begin ? double(bin_count_) / (end - begin) : 0;
    if (!std::isfinite(bins_per_second_)) bins_per_second_ = 0;
    std::size_t rest = 0;
    for (std::size_t i = 0; i < kept; ++i) {
      const std::uint32_t slot = entries[i];
      const std::int32_t number = number_of(keys_[i]);
      records_[slot].place = waits | std::uint32_t(number);
      if (number < most_bins)
        bins_[std::size_t(number)].push_back(slot);
      else
        entries[rest++] = slot;
    }
    entries.resize(rest);
  }
  // ---- The heap

  bool earlier(const Entry& a, const Entry& b) const {
    ++steps_;
    const double error = double(a.error) + double(b.error);
    if (a.hint + error < b.hint) return true;
    if (b.hint + error < a.hint) return false;
    if constexpr (packed)
      return clock_->earlier(records_[a.slot].event, a.slot, records_[b.slot].event, b.slot);
    else
      return clock_->earlier(event(a.slot), event(b.slot));
  }
  void put(const Entry& entry, std::size_t at) const {
    heap_[at] = entry;
    records_[entry.slot].place = std::uint32_t(at);
  }
  void push(const Entry& entry) const {
    heap_.push_back(entry);
    sift_up(entry, heap_.size() - 1);
  }
  void erase(std::size_t at) {
    const Entry last = heap_.back();
    heap_.pop_back();
    if (at == heap_.size()) return;
    if (at > 0 && earlier(last, heap_[(at - 1) / 4]))
      sift_up(last, at);
    else
      sift_down(last, at);
  }
  void sift_up(const Entry& entry, std::size_t at) const {
    while (at > 0) {
      const std::size_t parent = (at - 1) / 4;
      if (!earlier(entry, heap_[parent])) break;
      put(heap_[parent], at);
      at = parent;
    }
    put(entry, at);
  }
  void sift_down(const Entry& entry, std::size_t at) const {
    for (;;) {
      const std::size_t begin = 4 * at + 1, end = std::min(begin + 4, heap_.size());
      if (begin >= end) break;
      std::size_t first = begin;
      for (std::size_t child = begin + 1; child < end; ++child)
        if (earlier(heap_[child], heap_[first])) first = child;
      if (!earlier(heap_[first], entry)) break;
      put(heap_[first], at);
      at = first;
    }
    put(entry, at);
  }

  const Clock* clock_;
  void* owner_ = nullptr;
  void (*fetch_ahead_)(void* owner, const Stored& event, std::uint32_t slot, int step) = nullptr;
  void (*review_)(void* owner, const Event& event, double time) = nullptr;
  // Finding the earliest event moves events between the parts, but leaves the contents of the queue
  // unchanged.
  mutable std::vector<Record> records_;                       ///< [slot]
  mutable std::vector<std::vector<std::uint32_t>> segments_;  ///< slots; one more than cuts
  mutable std::vector<std::vector<std::uint32_t>> bins_;      ///< slots
  mutable std::vector<Entry> heap_;
  mutable std::vector<std::uint32_t> reviews_;
  mutable std::vector<double> keys_, sorted_;
  mutable std::size_t waiting_ = 0, entries_ = 0;  ///< events in lists, and entries
  mutable std::size_t segment_ = 0;                ///< the segment that is divided into bins
  mutable std::int32_t bin_count_ = 0, opened_ = -1;
  mutable double limit_ = -infinity;  ///< bins hold events before this time
  mutable double bins_begin_ = 0, bins_per_second_ = 0;
  std::vector<double> cuts_;
  double cuts_per_second_ = 0;
  mutable std::uint64_t steps_ = 0;
};

}  // namespace kbvh
