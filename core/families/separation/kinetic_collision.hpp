#pragma once
#include "core/families/separation/separation_list.hpp"

namespace kbvh {

/// Kinetic incremental collision detection (Z&W s.7): the kinetic AABB trees of a scene, and the separation
/// lists of its body pairs on top, advanced together in the exact order of their events. `Queue` is a queue
/// over a clock (event_queue.hpp); trees and lists have one each, whose tops are compared exactly.
template <class S, template <class> class Queue, class Count>
class KineticCollision {
 public:
  using Forest = KineticForest<S, Queue<EventClock<S>>, Count, ChangedBoxes>;
  using List = SeparationList<S, Queue, Count>;

  KineticCollision(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                   Count& count, int look_ahead = OverlapClock<S>::usual_look_ahead)
      : forest_(scene, motion, std::move(topologies), count, ChangedBoxes{&changed_, &nodes_}),
        list_(scene, forest_, count, look_ahead) {}
  KineticCollision(const KineticCollision&) = delete;  // the trees point to `changed_` and `nodes_`
  KineticCollision& operator=(const KineticCollision&) = delete;

  void reset(double t) {
    forest_.reset(t);
    changed_.clear();
    list_.reset(t);
  }
  /// Handles every event up to and including t.
  void advance(double t) {
    while (due(t)) handle_next();
  }
  bool due(double t) const { return forest_.due(t) || list_.due(t); }
  /// Is the first event of all one of a tree? At one instant trees come first: the list is then decided with
  /// their new realisers.
  bool tree_is_first() const {
    if (list_.empty()) return true;
    if (forest_.queue().empty()) return false;
    const Event& tree = forest_.queue().top();
    const OverlapEvent<S>& pair = list_.top();
    const double error = tree.error + pair.error;
    if (tree.hint + error < pair.hint) return true;
    if (pair.hint + error < tree.hint) return false;
    return compare_crossings(forest_.clock().crossing(tree), pair.crossing) <= 0;
  }

  /// A double after the first event of all, if by little.
  double after_next() const {
    if (!tree_is_first()) return list_.top().not_before();
    const Event& event = forest_.queue().top();
    return std::nextafter(event.hint + event.error, std::numeric_limits<double>::infinity());
  }
  /// Handles the first event of all; `due` for some time.
  void handle_next() {
    if (!tree_is_first()) {
      list_.handle_next();
      return;
    }
    const Event event = forest_.queue().top();
    const Crossing<S> crossing = forest_.clock().crossing(event);
    changed_.clear();
    forest_.handle_next();
    list_.boxes_changed(changed_, {event.begin, event.end, &crossing});
  }

  /// Follows changes of plans at t that the motion shows already.
  void plans_changed(double t, std::span<const PlanChange<S>> changes) {
    changed_.clear();
    forest_.plans_changed(t, changes);
    list_.boxes_changed(changed_, Instant<S>::at(t));
  }

  /// Follows a change of geometry at t that scene and motion show already: first the trees, each edit as it
  /// comes, then the lists at once. Says what the lists had to do.
  ListEdit geometry_changed(double t, const SceneView<S>& scene, const SampledMotion<S>& motion,
                            std::span<const BodyChange> changes) {
    changed_.clear();
    nodes_.clear();
    forest_.geometry_changed(t, scene, motion, changes);
    return list_.geometry_changed(t, forest_, nodes_, changed_);
  }

  Forest& forest() { return forest_; }
  const Forest& forest() const { return forest_; }
  List& list() { return list_; }
  const List& list() const { return list_; }
  std::uint64_t queue_steps() const { return forest_.queue().steps() + list_.steps(); }
  std::size_t bytes() const { return forest_.bytes() + list_.bytes(); }

 private:
  std::vector<ChangedBoxes::Box> changed_;
  std::vector<ChangedBoxes::Node> nodes_;
  Forest forest_;
  List list_;
};

}  // namespace kbvh
