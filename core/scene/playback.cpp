#include "core/scene/playback.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/motion/admissible.hpp"

namespace kbvh {

template <class S>
Playback<S>::Playback(const Scene<S>& scene) {
  std::size_t largest = 0;
  double start = 0;
  for (const auto& body : scene.bodies) {
    BodyState state;
    state.plans = state.scene_plans = body.plans;
    state.positions.assign(std::size_t(3) * body.plans.vertex_count() + 1, S(0));
    state.stamp.assign(body.plans.vertex_count(), 0);
    largest = std::max<std::size_t>(largest, body.plans.vertex_count());
    bodies_.push_back(std::move(state));
  }
  if (!scene.bodies.empty()) start = overlaid_keyframes(scene).front();
  stale_.reserve(largest);
  seek(start);
}

template <class S>
void Playback<S>::seek(double t) {
  check_time(t, "a frame");
  time_ = t;
  if (++epoch_ == 0) {  // after 2^32 frames the stamps start over
    for (auto& state : bodies_) std::fill(state.stamp.begin(), state.stamp.end(), 0);
    epoch_ = 1;
  }
  for (auto& state : bodies_) {
    state.fetched = 0;
    if (state.plans.moving() && !state.plans.is_handed_in()) state.all_current = false;
  }
}

template <class S>
void Playback<S>::evaluate_all() {
  for (auto& state : bodies_) {
    if (state.all_current) continue;
    state.plans.evaluate(time_, state.positions.data());
    state.all_current = true;
  }
}

template <class S>
void Playback<S>::hand_in(std::uint32_t body, const S* positions) {
  if (body >= bodies_.size() || !bodies_[body].plans.is_handed_in())
    throw std::invalid_argument("positions are handed in for body " + std::to_string(body) +
                                ", which does not accept them");
  bodies_[body].given = positions;
}

template <class S>
void Playback<S>::fetch_stale(BodyState& state, std::span<const std::uint32_t> vertices) {
  // A static body is evaluated only once.
  if (!state.plans.moving() || std::uint64_t(16) * state.fetched > state.plans.vertex_count()) {
    fetch_all(state);
    return;
  }
  // A long list may exceed the limit at once: evaluated singly, a vertex costs 10 to 40 times as much.
  const std::size_t most = std::max(64U, state.plans.vertex_count() / 16 - state.fetched);
  stale_.clear();
  for (std::uint32_t v : vertices)
    if (state.stamp[v] != epoch_) {
      state.stamp[v] = epoch_;
      stale_.push_back(v);
      if (stale_.size() > most) {
        fetch_all(state);
        return;
      }
    }
  if (stale_.empty()) return;
  fetched_ += stale_.size();
  state.fetched += std::uint32_t(stale_.size());
  state.plans.evaluate(time_, stale_, state.positions.data());
}

template <class S>
void Playback<S>::fetch_all(BodyState& state) {
  if (state.plans.moving()) fetched_ += state.plans.vertex_count() - state.fetched;
  state.plans.evaluate(time_, state.positions.data());
  state.all_current = true;
}

template <class S>
void Playback<S>::change_plans(double t, std::span<const PlanChange<S>> changes) {
  if (t != time_)
    throw std::invalid_argument("plan changes at " + number_text(t) + " while the motion stands at " +
                                number_text(time_));
  for (const PlanChange<S>& change : changes) {
    if (change.body >= bodies_.size())
      throw std::invalid_argument("plan change for body " + std::to_string(change.body) + " of " +
                                  std::to_string(bodies_.size()));
    const FlightPlans<S>& plans = bodies_[change.body].plans;
    if (plans.is_handed_in())
      throw std::invalid_argument("plan change for body " + std::to_string(change.body) +
                                  ", whose positions are handed in");
    plans.check_vertex(change.vertex);
    plans.check_change(t, change, position(change.body, change.vertex));
  }
  // A vertex's position at t is the same before and after a change, so the order does not matter.
  for (const PlanChange<S>& change : changes)
    bodies_[change.body].plans.change(t, change, position(change.body, change.vertex));
}

template <class S>
void Playback<S>::restore_plans() {
  for (auto& state : bodies_) {
    if (!state.plans.has_own_plans()) continue;
    state.plans = state.scene_plans;
    state.positions.resize(std::size_t(3) * state.plans.vertex_count() + 1);
    state.stamp.resize(state.plans.vertex_count());
    state.all_current = false;
  }
}

template <class S>
void Playback<S>::add_vertex(std::uint32_t body, const PlanChange<S>& plan, const S* position) {
  BodyState& state = bodies_[body];
  state.plans.add_vertex(time_, plan, position);
  // The last scalar is padding.
  for (int axis = 0; axis < 3; ++axis) {
    state.positions.back() = position[axis] == S(0) ? S(0) : position[axis];
    state.positions.push_back(S(0));
  }
  state.stamp.push_back(epoch_);
  if (stale_.capacity() < state.stamp.size()) stale_.reserve(2 * state.stamp.size());
}

template class Playback<float>;
template class Playback<double>;

}  // namespace kbvh
