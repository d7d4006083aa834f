#pragma once
#include <cstdint>
#include <vector>

#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/kernels/span_tests.hpp"
#include "core/geometry/span_pair.hpp"

namespace kbvh {

/// Returns the rounding for SpanTestKernels when lines differ from the positions at the ends of a segment by
/// this share (WideEnds). Each of two corners has this error, half a unit at a frame, and as interpolated one
/// unit for the difference of its two ends, one for a product and half a unit for the sum. The difference of
/// the corners adds one, and products of roundings one more. A unit is two `unit_rounding`.
template <class S>
constexpr S span_rounding(S rounding) {
  return 2 * rounding + 16 * unit_rounding<S>;
}

/// Decides the triangle tests of an interval join for spans of time where a proof exists. When a pair begins,
/// or when a proof expires, it retries the remaining span, then its first quarter, and so on while several
/// frames lie in the next quarter. A pair proved apart is not examined again before its span ends; a pair
/// proved intersecting is only reported; any other pair is a candidate at each frame for the length of the
/// last quarter.
///
/// All bodies of the join must consist of triangles only, with the corners of primitive p at 3 p, 3 p + 1 and
/// 3 p + 2 of `Primitives::vertices` (`all_triangles`).
template <class S>
class TriangleSpanFilter {
 public:
  /// Starts with the join of a new segment.
  void start(const IntervalJoin<S>& join);
  /// Starts ahead of time: `step` attempts the given number of pairs that overlap at the start of the
  /// segment. It returns true when none are left; only then may the filter be read.
  void start_ahead(const IntervalJoin<S>& join);
  bool step(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
            std::size_t pairs);

  /// Appends the pairs that certainly intersect at a fraction of the segment, and after them the pairs that
  /// may intersect; returns the number of the latter. Fractions must not decrease within a segment.
  std::size_t read(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
                   float fraction, PairBuffer& out);
  /// Does the same without the list: O(pairs whose state changes or is open). Afterwards the functions below
  /// return the states.
  void move_to(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
               float fraction);
  /// Follows a repair of the join.
  void repair(const IntervalJoin<S>& join);
  bool intersects(std::uint32_t pair) const { return state_[pair] == State::intersecting; }
  /// Returns whether the pair is a candidate.
  bool may_intersect(std::uint32_t pair) const { return state_[pair] != State::apart; }
  /// Calls use(pair) for every pair whose triangles have to be tested at the frame.
  template <class Use>
  void for_open(const Use& use) const {
    for (const Item item : open_) use(item.pair);
  }
  /// Touches these marks whenever the state of a pair changes, until the next start.
  void follow(const FollowingMarks& marks) { following_ = marks; }

  /// From now on decides pairs on these threads, with the same verdicts.
  void use(Workers& workers) { workers_ = &workers; }

  /// Return the number of attempts to decide a pair for a span, and of the pairs that frames reported as
  /// decided, since `start_over`, which also forgets the step between frames.
  std::uint64_t attempts() const { return attempts_; }
  std::uint64_t decided() const { return decided_; }
  void start_over() {
    attempts_ = decided_ = 0;
    step_ = 0;
  }
  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// An open pair by its index in the join, and the time until which it is not attempted again.
  struct Item {
    std::uint32_t pair;
    float until;
  };
  /// The state of a pair until its proof expires. A pair that has not begun counts as apart.
  enum class State : std::uint8_t { apart, intersecting, open };
  void set_state(std::uint32_t pair, State state) {
    state_[pair] = state;
    following_.touch(pair);
  }
  void intersect(std::uint32_t pair, float until);
  void cease_to_intersect(std::uint32_t pair);
  void leave_open(std::uint32_t pair, float until);
  bool is_due(std::uint32_t pair, float fraction) const {
    // A proof that a pair intersects holds to the end of its span, including that instant: the span may end
    // with the segment, at a frame.
    return state_[pair] == State::intersecting ? time_[pair] < fraction : time_[pair] <= fraction;
  }
  void wait(std::uint32_t pair, float until);
  void collect_due(const IntervalJoin<S>& join, float fraction);
  enum class When : std::uint8_t { now, ahead };
  void begin(const IntervalJoin<S>& join, When when);
  void attempt(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
               float fraction, float share);
  void decide(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
              float fraction, float share, S rounding, std::size_t begin, std::size_t end);
  void attempt_all(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
                   float fraction);

  Workers* workers_ = nullptr;
  std::size_t asked_ = 0;                            ///< pairs attempted ahead of time
  std::vector<std::uint32_t> intersecting_, place_;  ///< pairs by index in the join, and the inverse map
  std::vector<Item> open_;
  std::vector<State> state_;  ///< [pair]
  FollowingMarks following_;
  /// Pairs that are not open, in lists by the bucket of their next time.
  std::vector<std::uint32_t> next_;
  std::vector<float> time_;
  std::uint32_t head_[FractionBuckets::count] = {}, bucket_ = 0;
  float last_ = -1, step_ = 0;
  std::vector<std::uint32_t> due_;
  std::vector<SpanPair<S>> tries_;
  std::vector<SpanVerdict> verdicts_;
  std::uint64_t attempts_ = 0, decided_ = 0;
};

/// Returns whether TriangleSpanFilter accepts the primitives. O(primitives).
bool all_triangles(const Primitives& primitives);

extern template class TriangleSpanFilter<float>;
extern template class TriangleSpanFilter<double>;

}  // namespace kbvh
