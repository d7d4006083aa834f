#pragma once
#include <cstdint>
#include <vector>

#include "core/families/events/event.hpp"
#include "core/families/events/projected_plan.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// Computes the k-DOP whose sides are realised by K vertices: [lower of direction 0, upper, lower of
/// direction 1, ...]. Sides along the axes are those of the vertices' positions, exactly; the other sides are
/// at most `margin` (ProjectionMargin::at) and an ulp further out, so that they contain the positions of all
/// vertices that the realisers stand for.
template <class S, int K, class Clock>
Dop<S, K> dop_of_realisers(const std::uint32_t* realisers, const Clock& clock, std::uint32_t body, double t,
                           double margin) {
  S values[K];
  clock.values_at(body, realisers, K, t, values);
  Dop<S, K> dop;
  for (std::size_t direction = 0; direction < dop.slabs; ++direction) {
    const S lower = values[2 * direction], upper = values[2 * direction + 1];
    const bool exact = direction < 3;
    dop.lower[direction] = exact ? lower : outward::down<S>(outward::two_sum(double(lower), -margin));
    dop.upper[direction] = exact ? upper : outward::up<S>(outward::two_sum(double(upper), margin));
  }
  return dop;
}

/// The k-DOPs of one body's kinetic tree as queries read them: computed from the realisers on demand, each at
/// most once per frame. The clock is an EventClock or an AlgebraicClock.
template <class S, int K, class Clock = EventClock<S>>
class RealiserDops {
 public:
  RealiserDops(const Clock& clock, std::uint32_t body, std::uint32_t nodes)
      : clock_(&clock), body_(body), cache_(nodes) {}

  /// Begins a clip: measures the keyframes, and forgets the vertices' own plans.
  void start_over() { margin_.start_over(clock_->plans(body_)); }
  /// Includes the plan that a vertex follows from t on.
  void include(std::uint32_t vertex, double t) { margin_.include(clock_->plans(body_), vertex, t); }
  void resize(std::uint32_t nodes) { cache_.resize(nodes); }
  /// Enters the frame at t, with `realisers` as [node][K].
  void new_frame(double t, const std::uint32_t* realisers) {
    cache_.new_frame();
    time_ = t;
    margin_now_ = margin_.at(t);
    realisers_ = realisers;
  }

  // A bounds view (traversal.hpp).
  void ensure(std::uint32_t node) {
    if (!cache_.current(node)) cache_.store(node, computed(node));
  }
  const Dop<S, K>& operator()(std::uint32_t node) const { return cache_.volume(node); }

  Dop<S, K> current_or_computed(std::uint32_t node) const {
    return cache_.current(node) ? cache_.volume(node) : computed(node);
  }
  std::size_t bytes() const { return cache_.bytes(); }

 private:
  Dop<S, K> computed(std::uint32_t node) const {
    return dop_of_realisers<S, K>(realisers_ + std::size_t(K) * node, *clock_, body_, time_, margin_now_);
  }

  const Clock* clock_;
  std::uint32_t body_;
  ProjectionMargin<S> margin_;
  VolumeCache<Dop<S, K>> cache_;
  const std::uint32_t* realisers_ = nullptr;
  double time_ = 0, margin_now_ = 0;
};

/// A bounds view of the k-DOPs that reads only the sides along the axes: tight boxes, for pairs of primitives
/// that are answered by their boxes.
template <class S, int K, class Clock>
class BoxesOfDops {
 public:
  explicit BoxesOfDops(RealiserDops<S, K, Clock>& dops) : dops_(&dops) {}
  void ensure(std::uint32_t node) { dops_->ensure(node); }
  Box<S> operator()(std::uint32_t node) const {
    const Dop<S, K>& dop = (*dops_)(node);
    Box<S> box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.lower[axis] = dop.lower[axis];
      box.upper[axis] = dop.upper[axis];
    }
    return box;
  }

 private:
  RealiserDops<S, K, Clock>* dops_;
};

}  // namespace kbvh
