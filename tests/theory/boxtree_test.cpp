// The kinetic BoxTree's log of realiser changes against independently computed exact envelopes; validity
// between events; the cost of its certificate searches (claims T11, T12).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "core/families/boxtree/boxtree_rows.hpp"
#include "core/judge/audit.hpp"
#include "core/kernels/kernel_set.hpp"
#include "tests/theory/boxtree_log.hpp"
#include "tests/theory/lossy_queue.hpp"

namespace kbvh::test::boxtree_test {
namespace {

std::string summary(const BoxTreeReport& r) {
  return std::to_string(r.envelope.bounds) + " bounds, " + std::to_string(r.events) + " events, " +
         std::to_string(r.envelope.net) + " net changes = " + std::to_string(r.envelope.envelope) +
         " envelope breakpoints; several steps " + std::to_string(r.envelope.several_steps) + ", choices " +
         std::to_string(r.envelope.choices) + ", rebuilt " + std::to_string(r.rebuilt);
}

template <class S>
BoxTreeReport prove(const TestScene<S>& test, const BoxTreePlay& play) {
  const BoxTreeReport report = BoxTreeProof<S, AnyQueue>::run(test, play);
  EXPECT_EQ(report.envelope.violation, "");
  EXPECT_EQ(report.envelope.net, report.envelope.envelope);
  return report;
}
/// The other queues must lead to the same events.
template <class S>
BoxTreeReport prove_with_all_queues(const TestScene<S>& test, const BoxTreePlay& play) {
  const BoxTreeReport report = prove(test, play);
  for (const std::string& queue : AnyQueue<S>::names()) {
    if (queue == play.queue) continue;
    BoxTreePlay on_other = play;
    on_other.queue = queue;
    const BoxTreeReport other = BoxTreeProof<S, AnyQueue>::run(test, on_other);
    EXPECT_EQ(other.envelope.violation, "");
    EXPECT_EQ(report.events, other.events);
    EXPECT_EQ(report.values_written, other.values_written);
    EXPECT_EQ(report.envelope.net, other.envelope.net);
  }
  return report;
}

/// The defaults of `kinetic_boxtree`, except that small trees have bare parts, too.
constexpr BoxTreeConstruction for_the_clip{
    .planes = PlaneChoice::clip, .candidates = Candidates::listed, .bare_leaves = 4};

// ---- All synthetic scenes ------------------------------------------------------------------------------

class BoxTreeEnvelopes : public testing::TestWithParam<std::string> {};

template <class S>
void prove_synthetic(const std::string& name) {
  BoxTreePlay play{.builder = {.width = 2, .leaf_size = 1}, .frames_per_keyframe = 2};
  const auto test = synthetic_scene<S>(name, play.frames_per_keyframe);
  const BoxTreeReport report = prove_with_all_queues(test, play);
  std::printf("%s %s: %s\n", name.c_str(), sizeof(S) == 4 ? "float" : "double", summary(report).c_str());
  play.rebuild_seed = 6;
  const BoxTreeReport rebuilt = prove(test, play);
  std::printf("  with rebuilding: %s\n", summary(rebuilt).c_str());
  for (const BuildMethod method : {BuildMethod::sah, BuildMethod::morton}) {
    SCOPED_TRACE(kbvh::name(method));
    prove(test, {.builder = {.method = method, .width = 2, .leaf_size = 3}, .frames_per_keyframe = 2});
  }
  prove(test, {.builder = {.method = BuildMethod::sah, .width = 2, .leaf_size = 2}, .rebuild_seed = 7});
  {
    SCOPED_TRACE("planes for the clip");
    play.rebuild_seed = 0;
    play.construction = for_the_clip;
    std::printf("  with planes for the clip: %s\n", summary(prove_with_all_queues(test, play)).c_str());
    play.construction.candidates = Candidates::searched;
    prove(test, play);
    play.construction = {.planes = PlaneChoice::clip, .candidates = Candidates::listed};
    prove(test, play);
    play.construction = {.candidates = Candidates::listed};
    prove(test, play);
    play.construction = for_the_clip;
    play.rebuild_seed = 8;
    play.builder = {.method = BuildMethod::sah, .width = 2, .leaf_size = 2};
    prove(test, play);
    play = {.frames_per_keyframe = 2};
  }
  if (!test.script.steps.empty()) return;
  play.rebuild_seed = 0;
  play.start_after = 0.37;  // between keyframes
  prove(test, play);
}

TEST_P(BoxTreeEnvelopes, Float) {
  prove_synthetic<float>(GetParam());
}
TEST_P(BoxTreeEnvelopes, Double) {
  prove_synthetic<double>(GetParam());
}
INSTANTIATE_TEST_SUITE_P(Scenes, BoxTreeEnvelopes, testing::ValuesIn(synthetic_scene_names()),
                         [](const auto& param_info) { return param_info.param; });

TEST(BoxTree, LogIsTheEnvelopeEntryByEntryInGeneralPosition) {
  const BoxTreeReport report = prove(synthetic_scene<double>("soups"), {});
  EXPECT_EQ(report.envelope.several_steps + report.envelope.choices, 0u) << summary(report);
  EXPECT_EQ(report.envelope.logged, report.envelope.envelope);
  EXPECT_EQ(report.changes_by_event, report.values_written);  // no internal events
  EXPECT_GT(report.envelope.net, 300u);
}

TEST(BoxTree, ListedCandidatesAreThoseThatASearchFinds) {
  for (const PlaneChoice planes : {PlaneChoice::start, PlaneChoice::clip}) {
    const auto test = synthetic_scene<double>("soups");
    BoxTreePlay play{.construction = {.planes = planes}};
    const BoxTreeReport searched = prove(test, play);
    play.construction.candidates = Candidates::listed;
    const BoxTreeReport listed = prove(test, play);
    EXPECT_EQ(searched.events, listed.events);
    EXPECT_EQ(searched.values_written, listed.values_written);
    EXPECT_EQ(searched.envelope.net, listed.envelope.net);
    EXPECT_GT(listed.events, 200u);
  }
}

TEST(BoxTree, EventsDoNotDependOnTheNumberOfFrames) {
  for (const char* name : {"soups", "integer_ties", "keyframes_a_millionth_apart"}) {
    const auto test = synthetic_scene<float>(name);
    const BoxTreeReport coarse = prove(test, {.frames_per_keyframe = 1});
    for (const std::uint32_t l : {7u, 100u}) {
      const BoxTreeReport fine = prove(test, {.frames_per_keyframe = l});
      EXPECT_EQ(coarse.events, fine.events) << name;
      EXPECT_EQ(coarse.values_written, fine.values_written) << name;
    }
  }
}

// ---- Seeded faults that the proof must catch -------------------------------------------------------------

/// A tree whose lists of candidates lack the vertices of leaves, as if the search had not descended to the
/// leaves below other sides.
template <class S, class Queue, class Observer>
class ForgetsLeaves : public KineticBoxTree<S, Queue, Observer> {
 public:
  using KineticBoxTree<S, Queue, Observer>::KineticBoxTree;
  void initialise(double t) {
    KineticBoxTree<S, Queue, Observer>::initialise(t);
    for (auto& bound : this->bounds_) bound.last = bound.vertices;
  }
};
/// A tree whose lists of candidates lack one bound below, as if the search had skipped one child.
template <class S, class Queue, class Observer>
class ForgetsAChild : public KineticBoxTree<S, Queue, Observer> {
 public:
  using KineticBoxTree<S, Queue, Observer>::KineticBoxTree;
  void initialise(double t) {
    KineticBoxTree<S, Queue, Observer>::initialise(t);
    for (auto& bound : this->bounds_) bound.first = std::min(bound.first + 1, bound.vertices);
  }
};
TEST(BoxTreeFaults, AreCaught) {
  for (const char* name : {"soups", "sheets", "integer_ties"}) {
    const auto test = synthetic_scene<float>(name);
    const BoxTreePlay listed{.construction = {.candidates = Candidates::listed}};
    EXPECT_TRUE((BoxTreeProof<float, AnyQueue>::run(test, {}).envelope.holds())) << name;
    EXPECT_TRUE((BoxTreeProof<float, AnyQueue>::run(test, listed).envelope.holds())) << name;
    EXPECT_FALSE((BoxTreeProof<float, AvlQueue, ForgetsLeaves>::run(test, listed).envelope.holds())) << name;
    EXPECT_FALSE((BoxTreeProof<float, AvlQueue, ForgetsAChild>::run(test, listed).envelope.holds())) << name;
    EXPECT_FALSE((BoxTreeProof<float, LossyQueue>::run(test, {}).envelope.holds())) << name;
  }
}

// ---- Between events --------------------------------------------------------------------------------------

/// Brings a forest to times that are not frames, right before, at and after events, and audits the boxes that
/// a query would read there.
template <class S>
std::uint64_t audit_between_events(const std::string& name) {
  const auto test = synthetic_scene<S>(name);
  const SceneView<S> view(test.scene);
  Playback<S> playback(test.scene);
  const double first = frame_times(test.scene, 1).front(), last = frame_times(test.scene, 1).back();
  playback.seek(first);
  const Topologies topologies = build_topologies(view, playback, {.width = 2, .leaf_size = 1});
  Counters count;
  KineticBoxForest<S, AvlQueue<S>> forest(view, ClipMotion<S>(playback), topologies, count);
  forest.reset(first);
  std::uint64_t audits = 0;
  const auto audit_at = [&](double t) {
    forest.advance(t);
    playback.seek(t);
    playback.evaluate_all();
    for (std::uint32_t body = 0; body < view.body_count(); ++body) {
      AuditView seen{forest.tree(body).topology(), {}, {}};
      for (const Box<S>& box : reconstructed_boxes(forest.tree(body), ClipMotion<S>(playback), body))
        seen.boxes.push_back(to_double(box));
      const Audit found = audit(seen, view.primitives(body), playback.positions(body));
      EXPECT_EQ(found.first_fault + found.topology_error, "") << name << " at " << t;
      EXPECT_EQ(found.protrusion, 0);
      ++audits;
    }
  };
  audit_at(first);
  double before = first;
  const auto& queue = forest.queue();
  while (!queue.empty() && forest.due(last)) {
    const double event = queue.top().hint, error = queue.top().error;
    if (event > before) {
      const double between = before + 0.5 * (event - before);
      audit_at(between);
      // The hint has an error of one or two roundings: this time is before, at or after the event.
      if (event > between) audit_at(event);
      before = std::max(between, event);
    } else {
      // After what happens now, no earlier time may be audited.
      before = std::max(before, std::nextafter(event + error, last + 1));
      forest.handle_next();
    }
  }
  audit_at(last);
  return audits;
}

TEST(BoxTree, IsValidBetweenEvents) {
  for (const std::string& name : synthetic_scene_names()) {
    const std::uint64_t audits = audit_between_events<float>(name) + audit_between_events<double>(name);
    EXPECT_GT(audits, name == "soups" ? 400u : 3u);
  }
}

/// Points on slow circles: many realisers last longer than queues look ahead at once.
TestScene<float> circling_points(std::uint32_t count, std::uint32_t keyframes) {
  Body<float> body;
  body.name = "points";
  body.primitives.kind = PrimitiveKind::points;
  std::vector<double> times;
  std::vector<float> positions;
  for (std::uint32_t p = 0; p < count; ++p) body.primitives.add(std::vector<std::uint32_t>{p});
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    times.push_back(k);
    for (std::uint32_t p = 0; p < count; ++p)
      for (std::uint32_t axis = 0; axis < 3; ++axis)
        positions.push_back(float((1 + 0.1 * p) * std::sin(0.013 * k * (1 + 0.07 * p) + 2.1 * axis + p)));
  }
  body.plans = FlightPlans<float>(count, times, std::move(positions));
  TestScene<float> test;
  test.scene.name = "circling points";
  test.scene.bodies.push_back(std::move(body));
  return test;
}

TEST(BoxTree, LongClipsAreLookedAtInParts) {
  const TestScene<float> test = circling_points(24, 300);
  BoxTreePlay play;
  const BoxTreeReport report = prove_with_all_queues(test, play);
  EXPECT_GT(report.events, 100u);
  play.construction = for_the_clip;
  EXPECT_GT(prove_with_all_queues(test, play).events, 30u);
}

// ---- Rows that queries read ------------------------------------------------------------------------------

/// Makes all rows of a scene's trees at each frame, like queries, and compares them with the boxes that
/// single nodes inherit. Returns the number of boxes compared.
template <class S>
std::uint64_t compare_rows(const std::string& name, const BoxTreeConstruction& construction,
                           LeafBoxes leaf_boxes, std::uint32_t leaf_size) {
  const auto test = synthetic_scene<S>(name);
  const SceneView<S> view(test.scene);
  Playback<S> playback(test.scene);
  const std::vector<double> frames = frame_times(test.scene, 3);
  playback.seek(frames.front());
  const ClipMotion<S> motion(playback);
  Counters count;
  KineticBoxForest<S, SegmentHeapQueue<S>> forest(
      view, motion, build_topologies(view, playback, {.width = 2, .leaf_size = leaf_size}), count);
  for (std::uint32_t body = 0; body < view.body_count(); ++body) forest.tree(body).construct_as(construction);
  forest.reset(frames.front());
  std::vector<BoxTreeRows<S>> rows(view.body_count());
  std::uint64_t compared = 0;
  for (const double t : frames) {
    playback.seek(t);
    forest.advance(t);
    for (std::uint32_t body = 0; body < view.body_count(); ++body) {
      const auto& tree = forest.tree(body);
      if (tree.topology().empty()) continue;
      rows[body].follow(tree, view.primitives(body), leaf_boxes);
      rows[body].new_frame(motion, body);
      rows[body].make_visited(tree, motion, body);
      for (std::uint32_t node = 0; node < rows[body].hierarchy().node_count(); ++node)
        if (rows[body].stale()[node] != 0) rows[body].make_wanted(node, tree, motion, body);
      BoxCache<S> cache(tree.topology().size());
      InheritedBoxes<S, std::remove_cvref_t<decltype(tree)>> boxes(tree, motion, body, cache, leaf_boxes);
      for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
        boxes.ensure(node);
        Box<S> room;
        const Box<S>* read = rows[body].read_box(node, room);
        if (read == nullptr) continue;
        EXPECT_EQ(*read, boxes(node)) << name << ", t = " << t << ", body " << body << ", node " << node;
        ++compared;
      }
      EXPECT_TRUE(boxes(0).contains(rows[body].hierarchy().box(0)));
    }
  }
  return compared;
}

TEST(BoxTreeRows, AreTheInheritedBoxes) {
  const KernelSet before = active_kernel_set();
  for (const KernelSet set : supported_kernel_sets()) {
    use_kernel_set(set);
    for (const char* name : {"soups", "sheets", "integer_ties", "four_bodies_own_keyframes"})
      for (const LeafBoxes leaf_boxes : {LeafBoxes::tight, LeafBoxes::inherited})
        for (const std::uint32_t leaf_size : {1U, 3U})
          for (const BoxTreeConstruction& construction : {BoxTreeConstruction{}, for_the_clip}) {
            EXPECT_GT(compare_rows<float>(name, construction, leaf_boxes, leaf_size), 20u) << name;
            EXPECT_GT(compare_rows<double>(name, construction, leaf_boxes, leaf_size), 20u) << name;
          }
  }
  use_kernel_set(before);
}

// ---- The cost of certificate searches (T12) --------------------------------------------------------------

constexpr BoxTreeConstruction one_axis{.root_axis = 0, .inner_axis = 0};
/// The root is split on x, all other nodes on y (Z&W fig. 10).
constexpr BoxTreeConstruction adversarial{.root_axis = 0, .inner_axis = 1};

/// Points that wander on the first `axes` axes from keyframe to keyframe; the others stay 0.
TestScene<double> wandering_points(std::uint32_t count, int axes) {
  Random random(count);
  Body<double> body;
  body.name = "points";
  body.primitives.kind = PrimitiveKind::points;
  std::vector<double> positions, times;
  for (std::uint32_t p = 0; p < count; ++p) body.primitives.add(std::vector<std::uint32_t>{p});
  for (int keyframe = 0; keyframe < 4; ++keyframe) {
    times.push_back(keyframe);
    for (std::uint32_t p = 0; p < count; ++p)
      for (int axis = 0; axis < 3; ++axis) positions.push_back(axis < axes ? random.unit() : 0);
  }
  body.plans = FlightPlans<double>(count, times, std::move(positions));
  TestScene<double> test;
  test.scene.name = "wandering points";
  test.scene.bodies.push_back(std::move(body));
  return test;
}

struct EventCost {
  std::uint64_t events = 0, searches = 0, nodes = 0, most_per_search = 0;
  double per_search() const { return double(nodes) / double(searches); }
};

/// Returns the cost of the events at `node` (none: at any node).
EventCost cost_of_events(const TestScene<double>& test, const BoxTreeConstruction& construction,
                         std::optional<std::uint32_t> at_node = {}) {
  const SceneView<double> view(test.scene);
  Playback<double> playback(test.scene);
  playback.seek(0);
  Counters count;
  KineticBoxForest<double, AvlQueue<double>> forest(
      view, ClipMotion<double>(playback), build_topologies(view, playback, {.width = 2, .leaf_size = 1}),
      count);
  auto& tree = forest.tree(0);
  tree.construct_as(construction);
  forest.reset(0);
  EventCost cost;
  while (forest.due(3)) {
    const std::uint32_t slot = forest.queue().top().slot, node = slot < 6 ? 0 : slot - 5;
    tree.search_cost().forget();
    forest.handle_next();
    if (at_node && node != *at_node) continue;
    ++cost.events;
    cost.searches += tree.search_cost().searches;
    cost.nodes += tree.search_cost().nodes;
    cost.most_per_search = std::max(cost.most_per_search, tree.search_cost().most_nodes);
  }
  return cost;
}

TEST(BoxTreeSearch, IsLogarithmicOnOneAxis) {
  for (const std::uint32_t n : {64u, 256u, 1024u, 4096u}) {
    const EventCost cost = cost_of_events(wandering_points(n, 1), one_axis);
    std::printf("one axis, %u leaves: %llu events, %.2f nodes per search, at most %llu\n", n,
                (unsigned long long)cost.events, cost.per_search(), (unsigned long long)cost.most_per_search);
    EXPECT_GT(cost.events, n / 2);
    // Down one path, reading at each of its nodes the other child's realiser.
    EXPECT_LE(cost.most_per_search, 2 * std::uint64_t(std::log2(n)) + 1);
  }
}

TEST(BoxTreeSearch, TakesTheWholeSubtreeWhereOnlyTheRootIsSplitOnItsAxis) {
  for (const std::uint32_t n : {64u, 256u, 1024u, 4096u}) {
    const TestScene<double> test = wandering_points(n, 2);
    // Node 1 is a child of the root: n / 2 leaves below it, none of whose inner nodes is split on x.
    const EventCost cost = cost_of_events(test, adversarial, 1);
    std::printf("root x, else y, %u leaves: %llu events at the root's child, %llu nodes per search\n", n,
                (unsigned long long)cost.events, (unsigned long long)cost.most_per_search);
    EXPECT_GT(cost.events, 3u);
    EXPECT_GE(cost.most_per_search, n - 1);  // 2 (n / 2) - 1 nodes
    EXPECT_GE(cost.nodes, cost.events * (n - 1));
  }
}

TEST(BoxTreeSearch, OnMixedAxesLiesBetween) {
  for (const std::uint32_t n : {64u, 256u, 1024u, 4096u}) {
    const EventCost cost = cost_of_events(wandering_points(n, 3), {});
    std::printf("mixed axes, %u leaves: %llu events, %.2f nodes per search, at most %llu\n", n,
                (unsigned long long)cost.events, cost.per_search(), (unsigned long long)cost.most_per_search);
    EXPECT_LT(cost.most_per_search, 2 * n);
  }
}

TEST(BoxTreeSearch, AdversarialTreesAreSoundToo) {
  for (const char* name : {"soups", "integer_ties", "plan_changes"}) {
    const auto test = synthetic_scene<float>(name);
    for (const BoxTreeConstruction& construction : {adversarial, one_axis})
      EXPECT_EQ((BoxTreeProof<float, AnyQueue>::run(test, {.construction = construction}).envelope.violation),
                "")
          << name;
  }
}

// ---- Its size (T11)
// -----------------------------------------------------------------------------------------

TEST(BoxTree, StoresTwoRealisersPerInnerNodeAndSixMore) {
  const auto test = synthetic_scene<float>("soups");
  const SceneView<float> view(test.scene);
  Playback<float> playback(test.scene);
  const Topologies topologies = build_topologies(view, playback, {.width = 2, .leaf_size = 1});
  std::uint64_t inner = 0;
  for (const TopologyNode node : topologies[0].nodes) inner += node.is_leaf() ? 0 : 1;
  using Tree = KineticBoxForest<float, AvlQueue<float>>::Tree;
  EXPECT_EQ(Tree::slot_count(topologies[0]), 2 * inner + 6);
}

TEST(BoxTree, RefusesWideTopologies) {
  const auto test = synthetic_scene<float>("soups");
  const SceneView<float> view(test.scene);
  Playback<float> playback(test.scene);
  Counters count;
  EXPECT_THROW((KineticBoxForest<float, AvlQueue<float>>(
                   view, ClipMotion<float>(playback),
                   build_topologies(view, playback, {.width = 4, .leaf_size = 1}), count)),
               std::invalid_argument);
}

}  // namespace
}  // namespace kbvh::test::boxtree_test
