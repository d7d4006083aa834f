#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace kbvh {

/// Every counter that any strategy may use: X(name in code and in result files, meaning).
#define KBVH_COUNTERS(X)                                                                             \
  X(nodes_visited, "nodes whose bounds an update visited")                                           \
  X(values_written, "bound values stored (6 per AABB written; 1 per realiser changed)")              \
  X(vertex_reads, "vertex positions read by updates")                                                \
  X(positions_fetched, "positions that a lazy strategy had evaluated on demand")                     \
  X(certificates_made, "certificates computed, with or without a failure inside the clip")           \
  X(certificates_failed, "events processed")                                                         \
  X(certificates_discarded, "scheduled failures removed before they happened")                       \
  X(internal_events, "events that changed no bound")                                                 \
  X(overlap_events, "boxes of a separation list that began to overlap")                              \
  X(parents_apart_events, "inner pairs above a separation list whose boxes ceased to overlap")       \
  X(leaves_apart_events, "overlapping pairs of leaves that ceased to overlap")                       \
  X(bound_change_events, "changes of a box that occurs in a separation list")                        \
  X(list_peak, "largest number of pairs in the separation list (a maximum, not a sum)")              \
  X(queue_operations, "insert, erase, pop and re-key on the event queue")                            \
  X(queue_steps, "comparisons made by the queue")                                                    \
  X(queue_peak, "largest number of events scheduled at once (a maximum, not a sum)")                 \
  X(box_tests, "box-box overlap tests of the query, primitive pre-tests included")                   \
  X(triangle_tests, "exact triangle tests")                                                          \
  X(triangle_tests_exact, "exact triangle tests that the filter left to exact arithmetic")           \
  X(ray_decisions_exact,                                                                             \
    "exact decisions of rays: tests left to exact arithmetic, and exact comparisons of hits")        \
  X(span_tests, "attempts to decide a pair of triangles for a span of time")                         \
  X(span_verdicts, "pairs that a frame reported as intersecting by the verdict of an earlier frame") \
  X(bodies_skipped, "bodies for which a frame read at most one box")                                 \
  X(nodes_skipped, "nodes that an update skipped because no query of the frame could read them")     \
  X(bodies_translated, "bodies whose boxes were translated for a whole segment instead of refitted") \
  X(bytes, "memory held by the strategy's own structures, in bytes (a level, not a sum)")

/// The shared counters of strategies; reports and theory checks loop over them.
enum class Counter : std::uint8_t {
#define KBVH_COUNTER(name, meaning) name,
  KBVH_COUNTERS(KBVH_COUNTER)
#undef KBVH_COUNTER
      count
};

/// Returns the name of a counter in result files.
const char* name(Counter counter);
/// Returns the meaning of a counter in one line.
const char* meaning(Counter counter);

/// The counter table of one strategy instance; cleared by `reset`. Instances also count while they are timed:
/// inner loops count in local variables, and add their sums here once.
struct Counters {
  std::array<std::uint64_t, std::size_t(Counter::count)> values{};
  /// Counts bound events by the depth of the node at which they occur (0: root); the last entry sums all
  /// deeper levels.
  std::array<std::uint64_t, 64> events_at_depth{};
  std::uint64_t& operator[](Counter c) { return values[std::size_t(c)]; }
  std::uint64_t operator[](Counter c) const { return values[std::size_t(c)]; }
  void add(Counter c, std::uint64_t n = 1) { (*this)[c] += n; }
  void peak(Counter c, std::uint64_t n) { (*this)[c] = std::max((*this)[c], n); }
  void event_at(std::size_t depth) { ++events_at_depth[std::min(depth, events_at_depth.size() - 1)]; }

  /// A strategy's own counter.
  struct Named {
    std::string_view name;  ///< snake_case; must outlive the table: a string literal
    std::uint64_t value = 0;
  };
  /// A list without memory of its own, so that tables can be read in a frame: no allocation.
  class NamedList {
   public:
    static constexpr std::size_t most = 32;
    /// Throws std::length_error beyond `most`.
    void push_back(const Named& counter);
    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    Named* begin() { return counters_.data(); }
    Named* end() { return counters_.data() + size_; }
    const Named* begin() const { return counters_.data(); }
    const Named* end() const { return counters_.data() + size_; }
    const Named& operator[](std::size_t i) const { return counters_[i]; }

   private:
    std::array<Named, most> counters_{};
    std::size_t size_ = 0;
  };
  NamedList named{};
  /// Adds n to a strategy's own counter, which starts at 0. Throws std::logic_error if a counter of the enum
  /// has that name, std::length_error if there are too many. O(named counters).
  void add(std::string_view own_name, std::uint64_t n);
};

}  // namespace kbvh
