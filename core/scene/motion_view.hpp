#pragma once
#include <array>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/motion/admissible.hpp"
#include "core/scene/playback.hpp"

namespace kbvh {

/// A strategy's knowledge of the future. Undeclared foresight does not exist for the strategy: the motion
/// view that its constructor takes has no such member.
enum class Foresight : std::uint8_t {
  none,           ///< positions of the current frame only
  step_bound,     ///< in addition a bound on every vertex's motion until the next frame
  next_keyframe,  ///< in addition the end of the current segment, with the positions there
  whole_clip,     ///< in addition every flight plan to its end
};

template <class S>
struct NestedStrategies;  // registry.hpp

/// Foresight::none. Positions are truth B at the current frame.
template <class S>
class SampledMotion {
 public:
  explicit SampledMotion(Playback<S>& playback) : playback_(&playback) {}
  double time() const { return playback_->time(); }
  /// Returns the positions [vertex][3] of a body; readable up to one scalar past the end. Current for every
  /// vertex if the strategy declares PositionUse::all, else only for vertices fetched at this frame.
  const S* positions(std::uint32_t body) const { return playback_->positions(body); }
  /// Returns one position (3 scalars), evaluated now if it is not current.
  const S* position(std::uint32_t body, std::uint32_t vertex) const {
    return playback_->position(body, vertex);
  }
  void fetch(std::uint32_t body, std::span<const std::uint32_t> vertices) const {
    playback_->fetch(body, vertices);
  }
  void fetch_all(std::uint32_t body) const { playback_->fetch_all(body); }
  bool all_current(std::uint32_t body) const { return playback_->all_current(body); }
  /// Returns the number of positions evaluated on demand since the playback was created.
  std::uint64_t fetched() const { return playback_->fetched(); }
  /// Returns the driver's threads, which belong to the strategy while it is called. There are several only if
  /// its parameter `threads`, or that of the strategy that contains it, asks for them.
  Workers& workers() const { return playback_->workers(); }

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
  /// Returns an upper bound of every vertex's Euclidean speed between two frames (units per second).
  double speed_bound(std::uint32_t body) const {
    return this->playback_->plans(body).speed_bound(this->time());
  }
  /// Returns an upper bound of every vertex's Euclidean displacement between t0 and t1, over any number of
  /// segments; 0 only if no vertex moves. For steps from frame to frame: t0 must not be before the last
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
  /// Returns the time whose segment this view shows: the current time, or a later one (ClipMotion::from).
  double time() const { return from_.value_or(this->playback_->time()); }
  /// Returns the current linear piece of a coordinate; it ends at `t1`.
  Piece<S> piece(std::uint32_t body, std::uint32_t vertex, int axis) const {
    return this->playback_->plans(body).piece_after(vertex, axis, time());
  }
  /// Return the time from which and the time until which every vertex of the body stays on its current line;
  /// infinite if there is no such limit.
  double lines_begin(std::uint32_t body) const { return this->playback_->plans(body).lines_begin(time()); }
  double lines_end(std::uint32_t body) const { return this->playback_->plans(body).lines_end(time()); }
  /// Returns whether the body rests until `lines_end`.
  bool at_rest(std::uint32_t body) const { return this->playback_->plans(body).at_rest(time()); }
  /// Returns whether vertices of the body move on curves until `lines_end`: `piece` and `positions_on_lines`
  /// are for lines.
  bool on_curves(std::uint32_t body) const { return this->playback_->plans(body).curved_at(time()); }
  /// Returns whether some segment of the body has curves.
  bool has_curves(std::uint32_t body) const { return this->playback_->plans(body).curved(); }
  /// Returns two points for each vertex, [2 * vertices][3], which bound its curve between two times within
  /// `lines_begin` and `lines_end` (FlightPlans::evaluate_hull), evaluated into `room`.
  const S* hull_on_curves(std::uint32_t body, double begin, double end, double t,
                          std::vector<S>& room) const {
    const FlightPlans<S>& plans = this->playback_->plans(body);
    room.resize(std::size_t(6) * plans.vertex_count() + 1);
    plans.evaluate_hull(begin, end, t, room.data());
    return room.data();
  }
  /// Returns the common translation of the body between `lines_begin` and `lines_end`; nothing if there is
  /// none (FlightPlans::translation).
  std::optional<Translation<S>> translation(std::uint32_t body) const {
    return this->playback_->plans(body).translation(time());
  }
  /// Returns whether no vertex of the body has its own plan. A segment then looks the same at every play.
  bool as_in_the_scene(std::uint32_t body) const { return !this->playback_->plans(body).has_own_plans(); }
  /// Returns the positions [vertex][3] at a time from `lines_begin` to `lines_end`, truth B, readable up to
  /// one scalar past the end: the keyframe itself if there is one at that time, else evaluated into `room`.
  /// Throws std::invalid_argument for other times. O(vertices), or O(1) at a keyframe.
  const S* positions_on_lines(std::uint32_t body, double t, std::vector<S>& room) const {
    const FlightPlans<S>& plans = this->playback_->plans(body);
    if (!(t >= plans.lines_begin(time()) && t <= plans.lines_end(time())))
      throw std::invalid_argument("positions at t = " + number_text(t) +
                                  " are not foreseen at t = " + number_text(time()));
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
  /// Returns a view of the segments at a later time, valid if no plan changes; positions are still those of
  /// the current time.
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

/// Selects the motion view of a declared foresight.
template <Foresight F, class S>
using MotionView = typename MotionViewOf<F, S>::type;

}  // namespace kbvh
