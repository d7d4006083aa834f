#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/unfilled_array.hpp"
#include "core/parallel/workers.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// Plays a scene's motion for one strategy: holds the current time, the current positions (truth B), and the
/// plans with their run-time changes. The driver owns it; a strategy sees it through the view of its declared
/// foresight (motion_view.hpp). The driver evaluates all positions at once, or single vertices are evaluated
/// on demand; each vertex at most once per frame. Bodies over one vertex set have one state: positions are
/// evaluated and stored once, and what is done for one of these bodies is done for all. After construction
/// only plan changes and added vertices allocate.
template <class S>
class Playback {
 public:
  /// Throws std::invalid_argument if a polygon has not been cut into triangles (`cut_polygons`).
  explicit Playback(const Scene<S>& scene);

  double time() const { return time_; }
  /// Sets the current time to t without evaluating any position. Throws std::invalid_argument if t is not
  /// finite.
  void seek(double t);
  /// Evaluates every vertex of every moving body at the current time.
  void evaluate_all();
  /// Evaluates those of the listed vertices of one body that are not current.
  void fetch(std::uint32_t body, std::span<const std::uint32_t> vertices) {
    SetState& state = state_of(body);
    if (state.all_current) return;
    fetch_stale(state, vertices);
  }
  /// Evaluates all vertices of one body, unless they are current.
  void fetch_all(std::uint32_t body) {
    if (!state_of(body).all_current) fetch_all(state_of(body));
  }
  /// Returns the position of one vertex at the current time: 3 scalars.
  const S* position(std::uint32_t body, std::uint32_t vertex) {
    SetState& state = state_of(body);
    if (!state.all_current && state.stamp[vertex] != epoch_) fetch_stale(state, {&vertex, 1});
    return state.data() + std::size_t(3) * vertex;
  }
  /// Returns the positions [vertex][3] of a body, followed by one scalar of padding, so that a fourth lane
  /// may be read. Only vertices evaluated or fetched for the current time are valid.
  const S* positions(std::uint32_t body) const { return state_of(body).data(); }
  bool all_current(std::uint32_t body) const { return state_of(body).all_current; }

  /// Uses the caller's array for the positions of a body from now on: [vertex][3] and one scalar of padding,
  /// not copied; it must stay unchanged until another array is handed in. Only for bodies made by
  /// FlightPlans::handed_in; their positions are current at every time. Throws std::invalid_argument for
  /// other bodies. O(1).
  void hand_in(std::uint32_t body, const S* positions);

  /// Starts the new plan of each changed vertex at the current time from its stored position. Of several
  /// changes of one vertex the last counts. Throws std::invalid_argument and changes nothing if t is not the
  /// current time, a change is not valid, or a body's positions are handed in.
  void change_plans(double t, std::span<const PlanChange<S>> changes);
  /// Restores the scene's original plans; positions must be evaluated again after the next `seek`.
  void restore_plans();

  /// Adds a vertex to a body, and to all bodies over its vertex set, at the current time; see
  /// FlightPlans::add_vertex. Its position is current.
  /// Amortised O(1); `positions` may move.
  void add_vertex(std::uint32_t body, const PlanChange<S>& plan, const S* position);

  const FlightPlans<S>& plans(std::uint32_t body) const { return state_of(body).plans; }
  std::uint32_t body_count() const { return std::uint32_t(set_of_.size()); }
  /// Returns the number of positions evaluated on demand so far.
  std::uint64_t fetched() const { return fetched_; }

  /// From now on evaluates positions on this many threads. The strategy may use them, too, while it is called
  /// (Workers). Throws std::invalid_argument like Workers.
  void use_threads(std::uint32_t threads);
  Workers& workers() { return workers_; }

 private:
  /// The vertices of a body, or of all bodies over one vertex set.
  struct SetState {
    FlightPlans<S> plans, scene_plans;  ///< with changes, and as in the scene
    UnfilledArray<S> positions;         ///< [vertex][3] and one for reads of four
    const S* given = nullptr;           ///< the caller's array, if positions were handed in
    std::vector<std::uint32_t> stamp;
    std::uint32_t fetched = 0;  ///< at the current time
    bool all_current = false;

    const S* data() const { return given != nullptr ? given : positions.data(); }
  };
  /// Work of one thread: the vertices [begin, end) of one set, or all vertices of sets.
  struct Item {
    std::uint32_t set, end_set, begin, end;
  };
  SetState& state_of(std::uint32_t body) { return sets_[set_of_[body]]; }
  const SetState& state_of(std::uint32_t body) const { return sets_[set_of_[body]]; }
  void fetch_stale(SetState& state, std::span<const std::uint32_t> vertices);
  void fetch_all(SetState& state);
  void evaluate(SetState& state);
  void evaluate_own(SetState& state);
  void evaluate_shared();
  template <class Which>
  void cut_items(const Which& which);

  double time_ = 0;
  std::uint32_t epoch_ = 0;
  std::uint64_t fetched_ = 0;
  std::vector<SetState> sets_;
  std::vector<std::uint32_t> set_of_;  ///< [body], an index into `sets_`
  std::vector<std::uint32_t> stale_;
  Workers workers_;
  std::vector<Item> items_;
};

extern template class Playback<float>;
extern template class Playback<double>;

}  // namespace kbvh
