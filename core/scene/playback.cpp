#include "core/scene/playback.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "core/motion/admissible.hpp"
#include "core/scene/cut_polygons.hpp"

namespace kbvh {

namespace {
/// Number of vertices that one thread evaluates at once: 48 KiB of floats read and written, some
/// microseconds.
constexpr std::uint32_t vertices_at_once = 2048, none_gathered = vertices_at_once + 1;
/// The same for vertices of a list: each costs 10 to 40 times as much.
constexpr std::size_t listed_at_once = 256;
}  // namespace

template <class S>
Playback<S>::Playback(const Scene<S>& scene) {
  check_cut(scene);
  std::size_t largest = 0;
  double start = 0;
  for (std::uint32_t b = 0; b < scene.bodies.size(); ++b) {
    const Body<S>& body = scene.bodies[b];
    if (const std::uint32_t first = scene.first_of_set(b); first != b) {
      set_of_.push_back(set_of_[first]);
      continue;
    }
    SetState state;
    state.plans = state.scene_plans = body.plans;
    state.positions.assign(std::size_t(3) * body.plans.vertex_count() + 1, S(0));
    state.stamp.assign(body.plans.vertex_count(), 0);
    largest = std::max<std::size_t>(largest, body.plans.vertex_count());
    set_of_.push_back(std::uint32_t(sets_.size()));
    sets_.push_back(std::move(state));
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
    for (auto& state : sets_) std::fill(state.stamp.begin(), state.stamp.end(), 0);
    epoch_ = 1;
  }
  for (auto& state : sets_) {
    state.fetched = 0;
    if (state.plans.moving() && !state.plans.is_handed_in()) state.all_current = false;
  }
}

template <class S>
void Playback<S>::evaluate_all() {
  if (workers_.several()) return evaluate_shared();
  for (auto& state : sets_) {
    if (state.all_current) continue;
    state.plans.evaluate(time_, state.positions.data());
    state.all_current = true;
  }
}

template <class S>
void Playback<S>::use_threads(std::uint32_t threads) {
  workers_ = Workers(threads);
  if (!workers_.several()) return;
  // Moves the positions to the memory of the threads that will evaluate them.
  std::vector<UnfilledArray<S>> placed(sets_.size());
  for (std::size_t set = 0; set < sets_.size(); ++set) placed[set].resize(sets_[set].positions.size());
  cut_items([](const SetState& state) { return state.plans.moving(); });
  workers_.for_each(items_.size(), [&](std::size_t i, std::uint32_t) {
    const Item item = items_[i];
    for (std::uint32_t set = item.set; set < item.end_set; ++set) {
      const auto from = sets_[set].positions.begin();
      const std::size_t end = item.end == 0 ? placed[set].size() : std::size_t(3) * item.end;
      std::copy(from + std::ptrdiff_t(3) * item.begin, from + std::ptrdiff_t(end),
                placed[set].begin() + std::ptrdiff_t(3) * item.begin);
    }
  });
  for (std::size_t set = 0; set < sets_.size(); ++set) {
    SetState& state = sets_[set];
    if (!state.plans.moving()) continue;
    const std::size_t shared = std::size_t(3) * state.plans.keyframed_count();
    std::copy(state.positions.begin() + std::ptrdiff_t(shared), state.positions.end(),
              placed[set].begin() + std::ptrdiff_t(shared));
    state.positions = std::move(placed[set]);
  }
}

/// Cuts the work on the sets for which `which(state)` is true: large ones in parts, small ones several at a
/// time.
template <class S>
template <class Which>
void Playback<S>::cut_items(const Which& which) {
  items_.clear();
  std::uint32_t gathered = none_gathered;  // vertices of the last item, if sets may be added to it
  for (std::uint32_t set = 0; set < sets_.size(); ++set) {
    const FlightPlans<S>& plans = sets_[set].plans;
    const std::uint32_t vertices = plans.vertex_count();
    if (!which(sets_[set])) {
      gathered = none_gathered;
    } else if (vertices < 2 * vertices_at_once) {
      if (gathered + vertices > vertices_at_once) {
        items_.push_back({set, set, 0, 0});
        gathered = 0;
      }
      items_.back().end_set = set + 1;
      gathered += vertices;
    } else {
      for (std::uint32_t begin = 0; begin < plans.keyframed_count(); begin += vertices_at_once)
        items_.push_back({set, set + 1, begin, std::min(begin + vertices_at_once, plans.keyframed_count())});
      gathered = none_gathered;
    }
  }
}

template <class S>
void Playback<S>::evaluate_shared() {
  cut_items([](const SetState& state) { return !state.all_current; });
  workers_.for_each(items_.size(), [this](std::size_t i, std::uint32_t) {
    const Item item = items_[i];
    for (std::uint32_t set = item.set; set < item.end_set; ++set) {
      SetState& state = sets_[set];
      if (item.end == 0)
        state.plans.evaluate(time_, state.positions.data());
      else
        state.plans.evaluate_keyframed(time_, item.begin, item.end, state.positions.data());
    }
  });
  for (SetState& state : sets_) {
    if (state.all_current) continue;
    if (state.plans.vertex_count() >= 2 * vertices_at_once) evaluate_own(state);
    state.all_current = true;
  }
}

template <class S>
void Playback<S>::evaluate_own(SetState& state) {
  if (!state.plans.has_own_plans()) return;
  const std::size_t parts = std::size_t(8) * workers_.threads();
  workers_.for_each(parts, [&](std::size_t part, std::uint32_t) {
    state.plans.evaluate_own_plans(time_, part, parts, state.positions.data());
  });
}

template <class S>
void Playback<S>::evaluate(SetState& state) {
  const std::uint32_t vertices = state.plans.vertex_count();
  if (!workers_.several() || vertices < 2 * vertices_at_once)
    return state.plans.evaluate(time_, state.positions.data());
  const Parts cut{state.plans.keyframed_count(), vertices_at_once};
  workers_.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    state.plans.evaluate_keyframed(time_, std::uint32_t(cut.begin(part)), std::uint32_t(cut.end(part)),
                                   state.positions.data());
  });
  evaluate_own(state);
}

template <class S>
void Playback<S>::hand_in(std::uint32_t body, const S* positions) {
  if (body >= set_of_.size() || !plans(body).is_handed_in())
    throw std::invalid_argument("positions are handed in for body " + std::to_string(body) +
                                ", which does not accept them");
  state_of(body).given = positions;
}

template <class S>
void Playback<S>::fetch_stale(SetState& state, std::span<const std::uint32_t> vertices) {
  // A static body is evaluated only once.
  if (!state.plans.moving() || std::uint64_t(16) * state.fetched > state.plans.vertex_count()) {
    fetch_all(state);
    return;
  }
  // A single long list may exceed the limit: evaluated one by one, a vertex costs 10 to 40 times as much.
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
  if (!workers_.several() || stale_.size() < 2 * listed_at_once)
    return state.plans.evaluate(time_, stale_, state.positions.data());
  // Neighbours in the list may share a cache line of positions, but no position is written twice.
  const Parts cut{stale_.size(), listed_at_once};
  workers_.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    const std::span<const std::uint32_t> all(stale_);
    state.plans.evaluate(time_, all.subspan(cut.begin(part), cut.end(part) - cut.begin(part)),
                         state.positions.data());
  });
}

template <class S>
void Playback<S>::fetch_all(SetState& state) {
  if (state.plans.moving()) fetched_ += state.plans.vertex_count() - state.fetched;
  evaluate(state);
  state.all_current = true;
}

template <class S>
void Playback<S>::change_plans(double t, std::span<const PlanChange<S>> changes) {
  if (t != time_)
    throw std::invalid_argument("plan changes at " + number_text(t) + " while the motion stands at " +
                                number_text(time_));
  for (const PlanChange<S>& change : changes) {
    if (change.body >= body_count())
      throw std::invalid_argument("plan change for body " + std::to_string(change.body) + " of " +
                                  std::to_string(body_count()));
    const FlightPlans<S>& plans = this->plans(change.body);
    if (plans.is_handed_in())
      throw std::invalid_argument("plan change for body " + std::to_string(change.body) +
                                  ", whose positions are handed in");
    plans.check_vertex(change.vertex);
    plans.check_change(t, change, position(change.body, change.vertex));
  }
  // A vertex's position at t is the same before and after a change, so the order does not matter.
  for (const PlanChange<S>& change : changes)
    state_of(change.body).plans.change(t, change, position(change.body, change.vertex));
}

template <class S>
void Playback<S>::restore_plans() {
  for (auto& state : sets_) {
    // Assigned even if no plan changed: the copy has none of the data that is computed on demand for segments
    // (steps, translations), so no play profits from an earlier one.
    const bool changed = state.plans.has_own_plans();
    state.plans = state.scene_plans;
    if (!changed) continue;
    state.positions.resize(std::size_t(3) * state.plans.vertex_count() + 1);
    state.positions.back() = S(0);
    state.stamp.resize(state.plans.vertex_count());
    state.all_current = false;
  }
}

template <class S>
void Playback<S>::add_vertex(std::uint32_t body, const PlanChange<S>& plan, const S* position) {
  SetState& state = state_of(body);
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
