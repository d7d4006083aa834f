#pragma once
#include <algorithm>
#include <utility>
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/events/event_queue.hpp"
#include "core/families/events/kinetic_tree.hpp"

namespace kbvh {

/// Returns whether a body of the scene moves on curves: its forest then needs an AlgebraicClock.
template <class S>
bool any_on_curves(const SceneView<S>& scene, const ClipMotion<S>& motion) {
  for (std::uint32_t body = 0; body < scene.body_count(); ++body)
    if (motion.plans(body).curved()) return true;
  return false;
}

/// The kinetic trees of all bodies of a scene on one event queue. KineticTree is the kind of tree: AABB
/// trees, k-DOP trees (KineticDop), or others with the same interface.
template <class S, class Queue, class Observer = NoObserver,
          template <class, class, class> class KineticTree = KineticAabbTree>
class KineticForest {
 public:
  using Scalar = S;
  using Tree = KineticTree<S, Queue, Observer>;
  using Clock = typename Queue::ClockType;

  KineticForest(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                Counters& count, Observer observer = {})
      : clock_(plans_of(scene, motion), directions()), queue_(clock_, slots_of(topologies)), count_(&count) {
    if (scene.body_count() > Event::most_bodies)
      throw std::length_error("a scene of " + std::to_string(scene.body_count()) +
                              " bodies, but events number " + std::to_string(Event::most_bodies));
    if constexpr (requires { queue_.split_at(clock_.keyframe_times()); })
      queue_.split_at(clock_.keyframe_times());
    if constexpr (requires { queue_.serve(*this); }) queue_.serve(*this);
    std::uint32_t first_slot = 0;
    trees_.reserve(topologies.size());
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      const auto slots = std::uint32_t(Tree::slot_count(topologies[body]));
      trees_.emplace_back(std::move(topologies[body]), scene.primitives(body), body, first_slot, clock_,
                          queue_, count, observer);
      first_slot += slots;
    }
  }
  KineticForest(const KineticForest&) = delete;  // trees point to the clock and the queue
  KineticForest& operator=(const KineticForest&) = delete;

  /// Chooses the kind of queue, where `Queue` offers a choice; before the first reset.
  void choose_queue(std::string_view name) {
    if constexpr (requires { queue_.choose(name); }) queue_.choose(name);
  }
  /// Restarts at t.
  void reset(double t) {
    queue_.clear();
    clock_.start();
    for (Tree& tree : trees_) tree.initialise(t);
  }
  /// Handles every event up to and including t (Z&W Algorithm 1).
  void advance(double t) {
    while (due(t)) handle_next();
  }
  bool due(double t) const {
    if constexpr (requires { queue_.due(t); })
      return queue_.due(t);
    else
      return !queue_.empty() && clock_.due(queue_.top(), t);
  }
  /// Removes the earliest event from the queue and handles it.
  void handle_next() {
    const Event event = first_event();
    count_->add(Counter::queue_operations);
    trees_[event.body].handle(event);
  }

  /// Prefetches the data that handling the event will read. Each step reads what the step before prefetched.
  template <class StoredEvent>
  void fetch_ahead(const StoredEvent& event, std::uint32_t slot, int step) const {
    if (step == 0)
      for (const std::uint32_t vertex : {event.winner, event.loser}) clock_.fetch_ahead(event, vertex);
    if constexpr (requires { trees_[event.body].fetch_ahead(event, slot, step); })
      trees_[event.body].fetch_ahead(event, slot, step);
  }
  /// Searches the next failure of a certificate that holds at t.
  void review(const Event& event, double t) {
    if constexpr (requires { trees_[event.body].review(event, t); }) trees_[event.body].review(event, t);
  }

  /// Applies changes of plans at t, which the motion contains already; calls each changed tree once.
  void plans_changed(double t, std::span<const PlanChange<S>> changes) {
    changes_.clear();
    for (const PlanChange<S>& change : changes) changes_.emplace_back(change.body, change.vertex);
    std::sort(changes_.begin(), changes_.end());
    changes_.erase(std::unique(changes_.begin(), changes_.end()), changes_.end());
    for (std::size_t i = 0; i < changes_.size();) {
      const std::uint32_t body = changes_[i].first;
      changed_.clear();
      for (; i < changes_.size() && changes_[i].first == body; ++i) changed_.push_back(changes_[i].second);
      trees_[body].plans_changed(t, changed_);
    }
  }

  /// Applies a change of geometry at t, which scene and motion contain already. O(depth) certificates per
  /// primitive, and O(nodes) at the first change.
  void geometry_changed(double t, const SceneView<S>& scene, const SampledMotion<S>& motion,
                        std::span<const BodyChange> changes) {
    for (const BodyChange& change : changes) {
      const Primitives& primitives = scene.primitives(change.body);
      Tree& tree = trees_[change.body];
      for (const std::uint32_t p : change.removed_primitives) tree.remove(t, p, primitives);
      for (std::uint32_t p = change.first_primitive; p < primitives.count(); ++p)
        tree.insert(t, p, primitives, motion);
    }
  }

  std::uint32_t size() const { return std::uint32_t(trees_.size()); }
  Tree& tree(std::uint32_t body) { return trees_[body]; }
  const Tree& tree(std::uint32_t body) const { return trees_[body]; }
  Clock& clock() { return clock_; }
  const Clock& clock() const { return clock_; }
  Queue& queue() { return queue_; }
  const Queue& queue() const { return queue_; }
  std::size_t bytes() const {
    std::size_t total = queue_.bytes() + clock_.bytes() + changes_.capacity() * sizeof(changes_[0]) +
                        changed_.capacity() * sizeof(std::uint32_t);
    for (const Tree& tree : trees_) total += tree.bytes();
    return total;
  }

 private:
  Event first_event() {
    if constexpr (requires { queue_.take(); }) return queue_.take();
    const Event event = queue_.top();
    queue_.pop();
    return event;
  }
  /// Returns the directions of the trees' sides: the axes, for trees that name none.
  static std::span<const SlabDirection> directions() {
    if constexpr (requires { Tree::directions; })
      return Tree::directions;
    else
      return Dop<S, 6>::directions;
  }
  static std::vector<const FlightPlans<S>*> plans_of(const SceneView<S>& scene, const ClipMotion<S>& motion) {
    std::vector<const FlightPlans<S>*> plans;
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) plans.push_back(&motion.plans(body));
    return plans;
  }
  static std::uint32_t slots_of(const Topologies& topologies) {
    std::uint64_t slots = 0;
    for (const Topology& topology : topologies) slots += Tree::slot_count(topology);
    if (slots > std::numeric_limits<std::uint32_t>::max())
      throw std::length_error(std::to_string(slots) + " certificates are more than a queue can number");
    return std::uint32_t(slots);
  }

  Clock clock_;
  Queue queue_;
  Counters* count_;
  std::vector<Tree> trees_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> changes_;  ///< body, vertex
  std::vector<std::uint32_t> changed_;                            ///< vertices of one body
};

}  // namespace kbvh
