#pragma once
#include <map>
#include <memory>
#include <string_view>

#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "core/families/events/any_queue.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

using namespace kbvh::theory;

/// A change notice of a BoxTree as it came, with the numbers of its instant copied.
template <class S>
struct BoxTreeNotice {
  std::uint32_t body, node, side, old_vertex, new_vertex;
  double begin;
  bool at_event;
  Crossing<S> crossing;
};

template <class S>
struct BoxTreeRecorder {
  std::vector<BoxTreeNotice<S>>* log;

  template <class T>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t old_vertex,
                        std::uint32_t new_vertex, const Instant<T>& now) {
    log->push_back({body, node, side, old_vertex, new_vertex, now.begin, now.exact != nullptr,
                    now.exact != nullptr ? *now.exact : Crossing<S>{}});
  }
};

/// The realisers of all bounds a tree stores, [6 * node + side]; `no_bound` elsewhere.
template <class Tree>
std::vector<std::uint32_t> stored_bounds(const Tree& tree) {
  std::vector<std::uint32_t> bounds(std::size_t(6) * tree.topology().size(), no_bound);
  for (std::uint32_t node = 0; node < tree.topology().size(); ++node)
    for (Side side = 0; side < 6; ++side)
      if (node == 0 || tree.own_side(node) == side)
        bounds[std::size_t(6) * node + side] = tree.realiser(node, side);
  return bounds;
}

/// Returns the boxes of all nodes as a query would reconstruct them, at the motion's time.
template <class S, class Tree>
std::vector<Box<S>> reconstructed_boxes(const Tree& tree, const SampledMotion<S>& motion,
                                        std::uint32_t body) {
  BoxCache<S> cache(tree.topology().size());
  InheritedBoxes<S, Tree> boxes(tree, motion, body, cache);
  std::vector<Box<S>> all;
  for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
    boxes.ensure(node);
    all.push_back(boxes(node));
  }
  return all;
}

/// The parameters of a play.
struct BoxTreePlay {
  BuilderConfig builder{.width = 2, .leaf_size = 1};
  std::uint32_t frames_per_keyframe = 1;
  double start_after = 0;          ///< fraction of the clip that is skipped
  std::uint64_t rebuild_seed = 0;  ///< not 0: at every frame, parts chosen at random are rebuilt
  BoxTreeConstruction construction{};
  std::string_view queue = AvlQueue<float>::name;  ///< for an AnyQueue
};

struct BoxTreeReport {
  EnvelopeReport envelope;
  std::uint64_t events = 0, values_written = 0, rebuilt = 0;
  std::uint64_t changes_by_event = 0;  ///< log entries, changes of plans left out
};

/// Plays a scene through a forest of BoxTrees. Proves, from one change of plans or rebuilding to the next,
/// that everything it stores is the exact envelope of the vertices below (check_envelopes). `BoxTree` is the
/// kind of tree: faulty ones derive from KineticBoxTree.
template <class S, template <class> class Queue,
          template <class, class, class> class BoxTree = KineticBoxTree>
class BoxTreeProof {
 public:
  static BoxTreeReport run(const TestScene<S>& test, const BoxTreePlay& play) {
    return BoxTreeProof(test, play).play_all();
  }

 private:
  using Forest = KineticForest<S, Queue<S>, BoxTreeRecorder<S>, BoxTree>;
  using Bounds = std::vector<std::vector<std::uint32_t>>;  // [body][6 * node + side]

  BoxTreeProof(const TestScene<S>& test, const BoxTreePlay& play)
      : test_(test),
        play_(play),
        view_(test.scene),
        playback_(test.scene),
        frames_(test.frames.empty() ? frame_times(test.scene, play.frames_per_keyframe) : test.frames),
        first_(frames_.front() + play.start_after * (frames_.back() - frames_.front())),
        random_(play.rebuild_seed) {
    std::erase_if(frames_, [&](double t) { return t <= first_; });
    frames_.insert(frames_.begin(), first_);
    playback_.seek(first_);
    forest_ = std::make_unique<Forest>(view_, ClipMotion<S>(playback_),
                                       build_topologies(view_, playback_, play.builder), count_,
                                       BoxTreeRecorder<S>{&log_});
    forest_->choose_queue(play.queue);
    for (const auto& body : test.scene.bodies) plans_.push_back(stored_plans(body.plans));
    for (std::uint32_t body = 0; body < view_.body_count(); ++body)
      forest_->tree(body).construct_as(play.construction);
  }

  BoxTreeReport play_all() {
    forest_->reset(first_);
    begin_ = first_;
    start_ = bounds();
    for (std::uint32_t body = 0; body < view_.body_count(); ++body) check_bare(forest_->tree(body));
    auto step = test_.script.steps.begin();
    while (step != test_.script.steps.end() && step->time < first_) ++step;
    double last = first_;
    for (double t : frames_) {
      playback_.seek(t);
      forest_->advance(t);
      last = t;
      if (step != test_.script.steps.end() && step->time == t) change_plans(*step++, t);
      if (play_.rebuild_seed != 0) rebuild(t);
    }
    // Past the last keyframe bodies rest; vertices' own plans continue.
    last += test_.script.steps.empty() ? 1.0 : 3.0;
    forest_->advance(last);
    close(last);
    report_.events = count_[Counter::certificates_failed];
    report_.values_written = count_[Counter::values_written];
    return report_;
  }

  Bounds bounds() const {
    Bounds all;
    for (std::uint32_t body = 0; body < view_.body_count(); ++body)
      all.push_back(stored_bounds(forest_->tree(body)));
    return all;
  }

  /// Expects that exactly the intended nodes own sides.
  template <class Tree>
  void check_bare(const Tree& tree) {
    const std::uint32_t bare = play_.construction.bare_leaves;
    std::vector<std::uint32_t> leaves(tree.topology().size(), 1);
    for (std::uint32_t node = tree.topology().size(); node-- > 0;) {
      const TopologyNode n = tree.topology().nodes[node];
      if (!n.is_leaf()) leaves[node] = leaves[n.first()] + leaves[n.first() + 1];
    }
    for (std::uint32_t node = 1; node < tree.topology().size(); ++node) {
      const bool owns = bare == 0 || (leaves[tree.topology().parents[node]] > bare && leaves[node] > 1);
      if (owns != (tree.own_side(node) != no_side)) fail("a node without a side of its own, or with one");
    }
  }

  void fail(const std::string& what) {
    if (report_.envelope.violation.empty()) report_.envelope.violation = what;
  }

  /// Ends the time between two changes: proves its log.
  void close(double until) {
    const Bounds end = bounds();
    for (std::uint32_t body = 0; body < view_.body_count(); ++body) {
      try {
        const ExactMotion motion(plans_[body], begin_, until);
        EnvelopeReport one =
            check_envelopes(motion, vertices_below(forest_->tree(body).topology(), view_.primitives(body)),
                            start_[body], changes(motion, body), end[body]);
        if (!one.violation.empty())
          one.violation =
              "from " + std::to_string(begin_) + " body " + std::to_string(body) + ": " + one.violation;
        report_.envelope.add(one);
      } catch (const std::logic_error& error) {
        fail(error.what());
      }
    }
    report_.changes_by_event += log_.size();
    log_.clear();
    begin_ = until;
    start_ = end;
  }

  std::vector<BoundChange> changes(const ExactMotion& motion, std::uint32_t body) {
    std::vector<BoundChange> result;
    const BoxTreeNotice<S>* before = nullptr;
    for (const BoxTreeNotice<S>& notice : log_) {
      if (!notice.at_event) fail("an event without an exact time");
      if (notice.body != body) continue;
      BoundChange change{notice.node, notice.side, notice.old_vertex, notice.new_vertex, {}};
      // One event climbs through several nodes.
      const bool same = before != nullptr && before->side == notice.side && before->begin == notice.begin &&
                        before->old_vertex == notice.old_vertex && before->new_vertex == notice.new_vertex;
      change.when = same ? result.back().when : when_of(notice.crossing, motion);
      before = &notice;
      result.push_back(std::move(change));
    }
    return result;
  }

  void change_plans(const typename PlanScript<S>::Step& step, double t) {
    close(t);
    for (const PlanChange<S>& change : step.changes) {
      OwnKnots knots;
      const S* position = playback_.position(change.body, change.vertex);
      knots.times = {t};
      knots.positions.assign(position, position + 3);
      knots.times.insert(knots.times.end(), change.times.begin(), change.times.end());
      knots.positions.insert(knots.positions.end(), change.positions.begin(), change.positions.end());
      std::copy(change.velocity, change.velocity + 3, knots.velocity);
      plans_[change.body].own[change.vertex] = knots;
    }
    playback_.change_plans(t, step.changes);
    forest_->plans_changed(t, step.changes);
    check_notices(t);
    log_.clear();
    start_ = bounds();
  }

  /// Checks the notices at a change of plans: from the state before to the state after, each an immediate
  /// gain.
  void check_notices(double t) {
    Bounds state = start_;
    std::map<std::uint32_t, ExactMotion> motions;
    for (const BoxTreeNotice<S>& notice : log_) {
      const ExactMotion& now = motions.try_emplace(notice.body, plans_[notice.body], t, t + 1).first->second;
      std::uint32_t& realiser = state[notice.body][6 * std::size_t(notice.node) + notice.side];
      const int order = now.compare(std::size_t(0), int(notice.side / 2), notice.new_vertex, realiser);
      if (notice.at_event || notice.begin != t) fail("a change not at its own time");
      if (realiser != notice.old_vertex) fail("a change passes on what it does not have");
      if ((notice.side % 2 == 1 ? order : -order) <= 0) fail("a change gains nothing");
      realiser = notice.new_vertex;
    }
    if (state != bounds()) fail("realisers changed without a notice at a change of plans");
  }

  /// Rebuilds up to three parts of each body: large ones, small ones, one below the other.
  void rebuild(double t) {
    forest_->advance(t);  // new plans may cross immediately
    close(t);
    for (std::uint32_t body = 0; body < view_.body_count(); ++body)
      for (std::uint32_t i = random_.below(4); i > 0; --i) {
        auto& tree = forest_->tree(body);
        if (tree.topology().empty()) continue;
        const std::uint32_t node = random_.below(std::max(1u, tree.topology().size() >> random_.below(8)));
        const ClipMotion<S> motion(playback_);
        const Bounds before = bounds();
        tree.rebuild_below(node, reconstructed_boxes(tree, motion, body)[node], motion,
                           random_.below(2) == 0 ? BuildMethod::median : BuildMethod::sah);
        if (const std::string wrong = check_topology(tree.topology(), view_.primitives(body).count());
            !wrong.empty())
          fail("rebuilt: " + wrong);
        for (std::uint32_t above = node;; above = tree.topology().parents[above]) {
          const auto first = std::ptrdiff_t(6) * above;
          const Bounds after = bounds();
          if (!std::equal(after[body].begin() + first, after[body].begin() + first + 6,
                          before[body].begin() + first))
            fail("rebuilding changed a bound above");
          if (above == 0) break;
        }
        ++report_.rebuilt;
      }
    if (!log_.empty()) fail("a notice of what is still the same");
    start_ = bounds();
  }

  const TestScene<S>& test_;
  const BoxTreePlay& play_;
  SceneView<S> view_;
  Playback<S> playback_;
  std::vector<double> frames_;
  double first_;
  Random random_;
  Counters count_;
  std::vector<BoxTreeNotice<S>> log_;
  std::unique_ptr<Forest> forest_;
  std::vector<StoredPlans> plans_;
  double begin_ = 0;
  Bounds start_;
  BoxTreeReport report_;
};

}  // namespace kbvh::test
