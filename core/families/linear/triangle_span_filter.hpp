#pragma once
#include <cstdint>
#include <vector>

#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/kernels/span_tests.hpp"
#include "core/geometry/span_pair.hpp"

namespace kbvh {

/// Triangle tests of the pairs of an interval join, answered for spans of time where that can be proved. When
/// a pair begins, or what was proved of it ends, the rest of its span is asked about, then a quarter of that.
/// What is apart is not looked at again before its span is over, what intersects is only read out, and the
/// rest is a candidate at each frame for as long as a quarter would have lasted.
///
/// All bodies of the join must consist of triangles only, the corners of primitive p at 3 p, 3 p + 1 and 3 p
/// + 2 of `Primitives::vertices` (`all_triangles`).
template <class S>
class TriangleSpanFilter {
 public:
  /// The join is that of a new segment.
  void start(const IntervalJoin<S>& join);
  /// The same ahead of time: `step` asks about so many more of the pairs that overlap at the begin of the
  /// segment. Returns whether there are no more of them; only then it may be read.
  void start_ahead(const IntervalJoin<S>& join);
  bool step(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
            std::size_t pairs);

  /// Appends the pairs that intersect at a fraction of the segment for certain, and after them those that
  /// may; returns how many these are. Fractions never decrease within a segment.
  std::size_t read(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
                   float fraction, PairBuffer& out);

  /// Since they were cleared: attempts to decide a pair for a span, and pairs that frames read as decided.
  std::uint64_t attempts() const { return attempts_; }
  std::uint64_t decided() const { return decided_; }
  void clear_counts() { attempts_ = decided_ = 0; }
  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// A pair by its place in the join, and until when it stays where it is.
  struct Item {
    std::uint32_t pair;
    float until;
  };
  void wait(std::uint32_t pair, float until);
  void collect_due(const IntervalJoin<S>& join, float fraction);
  enum class When : std::uint8_t { now, ahead };
  void begin(const IntervalJoin<S>& join, When when);
  void attempt(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
               float fraction, float share);
  void attempt_all(const LinearSegment<S>& segment, const SceneView<S>& scene, const IntervalJoin<S>& join,
                   float fraction);

  std::size_t asked_ = 0;  ///< pairs, ahead of time
  std::vector<Item> intersecting_, open_;
  /// Pairs that wait for their time: lists by bucket of it.
  std::vector<std::uint32_t> next_;
  std::vector<float> time_;
  std::uint32_t head_[FractionBuckets::count] = {}, bucket_ = 0;
  float last_ = -1, step_ = 0;
  std::vector<std::uint32_t> due_;
  std::vector<SpanPair<S>> tries_;
  std::vector<SpanVerdict> verdicts_;
  std::uint64_t attempts_ = 0, decided_ = 0;
};

/// Whether TriangleSpanFilter can take the primitives. O(primitives).
bool all_triangles(const Primitives& primitives);

extern template class TriangleSpanFilter<float>;
extern template class TriangleSpanFilter<double>;

}  // namespace kbvh
