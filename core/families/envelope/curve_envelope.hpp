#pragma once
#include <cstdint>
#include <vector>

#include "core/families/envelope/segment_envelope.hpp"
#include "core/motion/curve_roots.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// The curves of one body over one segment (curved_piece.hpp), at places 3 * vertex + axis.
template <class S>
struct SegmentCurves {
  double t0 = 0, t1 = 1;
  const S *x0 = nullptr, *x1 = nullptr;       ///< [place]: stored positions at the ends
  const S *bend = nullptr, *twist = nullptr;  ///< [place]; null: all zero

  CurvedPiece<S> piece(std::uint32_t place) const {
    return {t0,
            t1,
            x0[place],
            x1[place],
            bend == nullptr ? S(0) : bend[place],
            twist == nullptr ? S(0) : twist[place]};
  }
};

/// A view of the current segment that shows its curves.
template <class S>
class CurvedMotion : public SegmentMotion<S> {
 public:
  explicit CurvedMotion(const SegmentMotion<S>& motion) : SegmentMotion<S>(motion) {}
  /// Requires `on_curves(body)`. Valid as long as the body's plans.
  SegmentCurves<S> curves(std::uint32_t body) const {
    const FlightPlans<S>& plans = this->playback_->plans(body);
    const std::size_t k = plans.segment_at(this->time());
    const auto times = plans.keyframe_times();
    return {times[k],       times[k + 1],   plans.keyframe(k), plans.keyframe(k + 1),
            plans.bends(k), plans.twists(k)};
  }
};

/// The realisers of all sides of all boxes over one segment in which the vertices of a body move on curves of
/// degree at most 3: SegmentEnvelope for curves. A side may change hands within the segment even if the same
/// vertex realises it at both ends. Therefore every side is walked from its realiser at the segment's begin.
/// Each step goes to the first candidate that gets ahead, at a root of the difference of two curves, until no
/// candidate does. A bound on the difference, from its Bernstein coefficients, excludes most candidates
/// without a search for roots. Candidates of a leaf's side are its vertices, those of an inner node's side
/// the vertices in the envelopes below. The envelope of n curves of degree s has at most lambda_s(n) pieces
/// (Sharir & Agarwal 1995).
///
/// Exact on truth A: roots, their order and signs at them (curve_roots.hpp), and whether a change is due at a
/// frame. If several candidates get ahead at one instant, the one that is ahead right after it follows.
template <class S>
class CurveEnvelope {
 public:
  /// From root number `root` of the difference of the curves of `realiser` and `before` on, `realiser` takes
  /// the place of `before`.
  struct Store {
    double time, error;  ///< the time of the root, in seconds, is within `error` of `time`
    double key;          ///< the latest `time` among this store and those of the same side before it
    std::uint32_t slot, realiser, before, root;
    std::uint32_t number;  ///< in order of creation
  };

  /// Takes the shape of a hierarchy. Allocates.
  void assign(const WideHierarchy<S>& hierarchy);

  /// Computes the envelopes of a segment. `realisers` are those at its begin. O(candidates) bounds for every
  /// side and every store.
  void make(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, const SegmentCurves<S>& curves);
  /// Brings the realisers from the last requested time (first: the segment's begin) to t, which is in the
  /// segment. O(due stores, and those whose bounds contain t).
  void advance(double t, WideRealisers& realisers);

  /// Returns the stores of the segment in order of creation; those of one side are in order of time.
  const std::vector<Store>& stores() const { return made_; }
  const SegmentCurves<S>& curves() const { return curves_; }

  const EnvelopeCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }
  std::size_t bytes() const;

 private:
  /// An instant of the segment: a root.
  struct Turn {
    CurveMoment<S> moment;
    CurveRoot root;
    std::uint32_t place = 0;  ///< of the vertex that is ahead from then on
  };
  void walk(std::uint32_t slot, std::uint32_t realiser, bool lower);
  bool find_turn(std::uint32_t realiser, bool lower, const Turn* since, Turn& first);
  bool comes_first(const Turn& x, const Turn& y, bool lower);
  static bool stays_behind(const CurvedPiece<S>& x, const CurvedPiece<S>& y);
  bool is_due(const Store& store, double t);

  SegmentCurves<S> curves_;
  std::vector<std::uint32_t> first_store_;  ///< [slot]: index in `made_`
  std::vector<Store> made_, stores_;        ///< in order of creation; of keys
  std::vector<std::uint32_t> candidates_;   ///< of the current side
  std::size_t next_ = 0;                    ///< the first store that was not certainly due
  double largest_error_ = 0;
  EnvelopeCounts counts_;
};

extern template class CurveEnvelope<float>;
extern template class CurveEnvelope<double>;

}  // namespace kbvh
