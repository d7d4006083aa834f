#include "core/motion/playback.hpp"

#include <algorithm>
#include <stdexcept>

namespace kbvh {

template <class S>
Playback<S>::Playback(const Scene<S>& scene) {
  std::size_t largest = 0;
  double start = 0;
  for (const auto& body : scene.bodies) {
    BodyState state;
    state.plans = body.plans;
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
  time_ = t;
  if (++epoch_ == 0) {  // after 2^32 frames the stamps start over
    for (auto& state : bodies_) std::fill(state.stamp.begin(), state.stamp.end(), 0);
    epoch_ = 1;
  }
  for (auto& state : bodies_) {
    state.fetched = 0;
    if (state.plans.moving()) state.all_current = false;
  }
}

template <class S>
void Playback<S>::evaluate_all() {
  for (auto& state : bodies_) {
    if (state.all_current) continue;
    state.plans.evaluate(time_, state.positions.data(), &rounding_);
    state.all_current = true;
  }
}

template <class S>
void Playback<S>::fetch_stale(BodyState& state, std::span<const std::uint32_t> vertices) {
  // A static body is evaluated once, for good.
  if (!state.plans.moving() || std::uint64_t(16) * state.fetched > state.plans.vertex_count()) {
    fetch_all(state);
    return;
  }
  stale_.clear();
  for (std::uint32_t v : vertices)
    if (state.stamp[v] != epoch_) {
      state.stamp[v] = epoch_;
      stale_.push_back(v);
    }
  if (stale_.empty()) return;
  // A long list at once may be too many already: one by one, a vertex costs 10 to 40 times as much.
  if (stale_.size() > 64 &&
      std::uint64_t(16) * (state.fetched + stale_.size()) > state.plans.vertex_count()) {
    fetch_all(state);
    return;
  }
  fetched_ += stale_.size();
  state.fetched += std::uint32_t(stale_.size());
  state.plans.evaluate(time_, stale_, state.positions.data(), &rounding_);
}

template <class S>
void Playback<S>::fetch_all(BodyState& state) {
  if (state.plans.moving()) fetched_ += state.plans.vertex_count() - state.fetched;
  state.plans.evaluate(time_, state.positions.data(), &rounding_);
  state.all_current = true;
}

template <class S>
void Playback<S>::change_plans(double t, std::span<const PlanChange<S>> changes) {
  if (t != time_)
    throw std::invalid_argument("plan changes at " + std::to_string(t) + " while the motion stands at " +
                                std::to_string(time_));
  // All or nothing: try every change on copies of the plans it touches (the keyframes are shared), then
  // commit.
  std::vector<std::pair<std::uint32_t, FlightPlans<S>>> changed;
  for (const PlanChange<S>& change : changes) {
    if (change.body >= bodies_.size())
      throw std::invalid_argument("plan change for body " + std::to_string(change.body) + " of " +
                                  std::to_string(bodies_.size()));
    if (change.vertex >= bodies_[change.body].plans.vertex_count())
      throw std::invalid_argument("plan change for vertex " + std::to_string(change.vertex) +
                                  " of a body with " +
                                  std::to_string(bodies_[change.body].plans.vertex_count()) + " vertices");
    auto entry = std::find_if(changed.begin(), changed.end(),
                              [&](const auto& item) { return item.first == change.body; });
    if (entry == changed.end())
      entry = changed.emplace(changed.end(), change.body, bodies_[change.body].plans);
    entry->second.change(t, change, position(change.body, change.vertex));
  }
  for (auto& [body, plans] : changed) bodies_[body].plans = std::move(plans);
}

template class Playback<float>;
template class Playback<double>;

}  // namespace kbvh
