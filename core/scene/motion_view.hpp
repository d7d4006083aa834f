#pragma once
#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/scene/playback.hpp"

namespace kbvh {

/// What a strategy knows of the future. What is not declared does not exist for it: the motion view that its
/// constructor takes has no such member.
enum class Foresight : std::uint8_t {
  none,           ///< positions of the current frame only
  step_bound,     ///< and a bound on how far any vertex moves until the next frame
  next_keyframe,  ///< and the end of the current segment, with the positions there
  whole_clip,     ///< and every flight plan to its end
};

template <class S>
struct NestedStrategies;  // registry.hpp

/// Foresight::none. Positions are truth B at the current frame.
template <class S>
class SampledMotion {
 public:
  explicit SampledMotion(Playback<S>& playback) : playback_(&playback) {}
  double time() const { return playback_->time(); }
  /// Positions [vertex][3] of a body; readable up to one scalar past the end. Current for every vertex if the
  /// strategy declares PositionUse::all, else only for vertices fetched at this frame.
  const S* positions(std::uint32_t body) const { return playback_->positions(body); }
  /// One position, evaluated now if it is not current: 3 scalars.
  const S* position(std::uint32_t body, std::uint32_t vertex) const {
    return playback_->position(body, vertex);
  }
  void fetch(std::uint32_t body, std::span<const std::uint32_t> vertices) const {
    playback_->fetch(body, vertices);
  }
  void fetch_all(std::uint32_t body) const { playback_->fetch_all(body); }
  bool all_current(std::uint32_t body) const { return playback_->all_current(body); }
  /// How many positions were evaluated on demand since the playback was made.
  std::uint64_t fetched() const { return playback_->fetched(); }

 protected:
  Playback<S>* playback_;

 private:
  friend struct NestedStrategies<S>;
};

/// Foresight::step_bound.
template <class S>
class SteppedMotion : public SampledMotion<S> {
 public:
  using SampledMotion<S>::SampledMotion;
  /// No vertex of the body moves faster than this (units per second, Euclidean, rounded up) between two
  /// frames.
  double speed_bound(std::uint32_t body) const {
    return this->playback_->plans(body).speed_bound(this->time());
  }
  /// No vertex of the body moves further than this on its way from t0 to t1 (Euclidean, rounded up), however
  /// many segments lie between; 0 only if none moves. For steps from frame to frame: t0 not before the last
  /// change.
  double displacement_bound(std::uint32_t body, double t0, double t1) const {
    return this->playback_->plans(body).displacement_bound(t0, t1);
  }
};

/// Foresight::next_keyframe.
template <class S>
class SegmentMotion : public SteppedMotion<S> {
 public:
  using SteppedMotion<S>::SteppedMotion;
  /// The time whose segment is seen: the present, unless it is a view from a later one (ClipMotion::from).
  double time() const { return from_.value_or(this->playback_->time()); }
  /// The linear piece a coordinate is on now; it ends at `t1`.
  Piece<S> piece(std::uint32_t body, std::uint32_t vertex, int axis) const {
    return this->playback_->plans(body).piece_after(vertex, axis, time());
  }
  /// From when on, and until when, every vertex of the body is on the line that it is on now; infinite where
  /// that is for ever.
  double lines_begin(std::uint32_t body) const { return this->playback_->plans(body).lines_begin(time()); }
  double lines_end(std::uint32_t body) const { return this->playback_->plans(body).lines_end(time()); }
  /// The body does not move before `lines_end`.
  bool at_rest(std::uint32_t body) const { return this->playback_->plans(body).at_rest(time()); }
  /// How the body moves as a whole between `lines_begin` and `lines_end`; nothing if it does not
  /// (FlightPlans::translation).
  std::optional<Translation<S>> translation(std::uint32_t body) const {
    return this->playback_->plans(body).translation(time());
  }
  /// No vertex of the body has a plan of its own: what is seen of a segment is the same whenever it comes by.
  bool as_in_the_scene(std::uint32_t body) const { return !this->playback_->plans(body).has_own_plans(); }
  /// Positions [vertex][3] at a time from `lines_begin` to `lines_end`, truth B, one scalar past the end
  /// readable: the keyframe itself where there is one, else evaluated into `room`. Throws
  /// std::invalid_argument for other times. O(vertices), or O(1).
  const S* positions_on_lines(std::uint32_t body, double t, std::vector<S>& room) const {
    const FlightPlans<S>& plans = this->playback_->plans(body);
    if (!(t >= plans.lines_begin(time()) && t <= plans.lines_end(time())))
      throw std::invalid_argument("positions at t = " + std::to_string(t) +
                                  " are not foreseen at t = " + std::to_string(time()));
    if (!plans.has_own_plans()) {
      const std::size_t k = plans.segment_at(t);
      const auto times = plans.keyframe_times();
      if (t <= times[k] || k + 1 == times.size()) return plans.keyframe(k);
    }
    room.resize(std::size_t(3) * plans.vertex_count() + 1);
    plans.evaluate(t, room.data());
    return room.data();
  }

 protected:
  std::optional<double> from_;
};

/// Foresight::whole_clip.
template <class S>
class ClipMotion : public SegmentMotion<S> {
 public:
  using SegmentMotion<S>::SegmentMotion;
  const FlightPlans<S>& plans(std::uint32_t body) const { return this->playback_->plans(body); }
  /// What will be seen of segments at a later time if no plan changes; positions are still the present's.
  SegmentMotion<S> from(double t) const {
    ClipMotion view = *this;
    view.from_ = t;
    return view;
  }
};

template <Foresight F, class S>
struct MotionViewOf;
template <class S>
struct MotionViewOf<Foresight::none, S> {
  using type = SampledMotion<S>;
};
template <class S>
struct MotionViewOf<Foresight::step_bound, S> {
  using type = SteppedMotion<S>;
};
template <class S>
struct MotionViewOf<Foresight::next_keyframe, S> {
  using type = SegmentMotion<S>;
};
template <class S>
struct MotionViewOf<Foresight::whole_clip, S> {
  using type = ClipMotion<S>;
};

/// The motion view of a declared foresight.
template <Foresight F, class S>
using MotionView = typename MotionViewOf<F, S>::type;

}  // namespace kbvh
