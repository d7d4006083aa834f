// The kinetic AABB tree's log of bound changes against independently computed exact envelopes (claims T1, T7,
// T8).
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "core/families/events/any_queue.hpp"
#include "core/families/events/kinetic_tree_strategy.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/theory/lossy_queue.hpp"
#ifdef KBVH_TEST_HAS_IO
#include "experiments/io/load.hpp"
#endif

namespace kbvh::test {
namespace {

using namespace kbvh::theory;

template <class S, class Queue>
using TreesOn = ExactKineticAabbStrategy<S, Queue>;

/// Kinetic AABB trees on an event queue of a kind.
template <class S>
class TreesOnAnyQueue : public TreesOn<S, AnyQueue<S>> {
 public:
  TreesOnAnyQueue(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                  std::string_view queue)
      : TreesOn<S, AnyQueue<S>>(scene, motion, std::move(topologies), 0, KineticQuery::node_pairs) {
    this->on_forest([&](auto& forest) { forest.choose_queue(queue); });
  }
};

template <class Strategy, class S, class... Arguments>
Recording<S> record_strategy(const TestScene<S>& test, const Play& play, const Arguments&... arguments) {
  Play with_frames = play;
  if (!test.script.steps.empty()) with_frames.frames = test.frames;  // changes are at frames
  return record_events(
      test.scene, test.script, with_frames,
      [&](const SceneView<S>& view, Playback<S>& playback, const Topologies& topologies) {
        return std::make_unique<Strategy>(view, ClipMotion<S>(playback), topologies, arguments...);
      },
      NoWatcher{});
}
/// Records kinetic AABB trees on an event queue of a kind, or on a queue of this test.
template <class S>
Recording<S> record(const TestScene<S>& test, const Play& play, std::string_view queue = AvlQueue<S>::name) {
  return record_strategy<TreesOnAnyQueue<S>>(test, play, queue);
}
template <class S, template <class> class Queue>
Recording<S> record_on(const TestScene<S>& test, const Play& play) {
  return record_strategy<TreesOn<S, Queue<S>>>(test, play, std::size_t(0), KineticQuery::node_pairs);
}

std::string summary(const EnvelopeReport& r) {
  return std::to_string(r.bounds) + " bounds, " + std::to_string(r.logged) + " entries, " +
         std::to_string(r.net) + " net changes = " + std::to_string(r.envelope) + " envelope breakpoints (" +
         std::to_string(r.canonical) + " with smallest ids); several steps " +
         std::to_string(r.several_steps) + ", choices " + std::to_string(r.choices);
}

/// Reviews each certificate at every keyframe.
template <class S>
class ShortSightedQueue : public SegmentHeapQueue<S> {
 public:
  using SegmentHeapQueue<S>::SegmentHeapQueue;
  static constexpr std::size_t look_ahead() { return 1; }
};

/// Plays all queues: their logs must be equal, and one of them is proved.
template <class S>
EnvelopeReport prove(const TestScene<S>& test, const Play& play) {
  const auto recording = test::record(test, play);
  for (const std::string& queue : AnyQueue<S>::names()) {
    if (queue == AvlQueue<S>::name) continue;
    EXPECT_EQ(recording.log(), test::record(test, play, queue).log()) << queue;
  }
  EXPECT_EQ(recording.log(), (record_on<S, ShortSightedQueue>(test, play).log()))
      << "looks one keyframe ahead";
  const EnvelopeReport report = check(test.scene, recording);
  EXPECT_EQ(report.violation, "");
  EXPECT_EQ(report.net, report.envelope);
  return report;
}

// ---- All synthetic scenes ------------------------------------------------------------------------------

class SyntheticEnvelopes : public testing::TestWithParam<std::string> {};

template <class S>
void prove_synthetic(const std::string& name) {
  EnvelopeReport total;
  for (std::uint32_t width : {2u, 4u, 8u})
    for (std::uint32_t leaf_size : {1u, 4u}) {
      SCOPED_TRACE(name + " width " + std::to_string(width) + " leaf size " + std::to_string(leaf_size));
      Play play{{.width = width, .leaf_size = leaf_size}, 2, 0};
      const auto test = synthetic_scene<S>(name, play.frames_per_keyframe);
      total.add(prove(test, play));
      if (width != 2 || !test.script.steps.empty()) continue;
      play.start_after = 0.37;  // between keyframes
      prove(test, play);
    }
  std::printf("%s %s: %s\n", name.c_str(), sizeof(S) == 4 ? "float" : "double", summary(total).c_str());
}

TEST_P(SyntheticEnvelopes, Float) {
  prove_synthetic<float>(GetParam());
}
TEST_P(SyntheticEnvelopes, Double) {
  prove_synthetic<double>(GetParam());
}
INSTANTIATE_TEST_SUITE_P(Scenes, SyntheticEnvelopes, testing::ValuesIn(synthetic_scene_names()),
                         [](const auto& param_info) { return param_info.param; });

TEST(Envelopes, EqualTheLogEntryByEntryInGeneralPosition) {
  const auto test = synthetic_scene<double>("soups");
  const EnvelopeReport report = prove(test, {{.width = 2, .leaf_size = 1}});
  EXPECT_EQ(report.several_steps + report.choices, 0u) << summary(report);  // general position
  EXPECT_EQ(report.logged, report.envelope);
  EXPECT_EQ(report.canonical, report.envelope);
  EXPECT_GT(report.net, 1000u);
}

TEST(Envelopes, EventsDoNotDependOnTheNumberOfFrames) {
  for (const char* name : {"soups", "integer_ties", "keyframes_a_millionth_apart"}) {
    const auto test = synthetic_scene<float>(name);
    const BuilderConfig builder{.width = 2, .leaf_size = 1};
    const auto at_keyframes = test::record(test, {builder, 1});
    std::printf("%s: l = 1: %llu events, %llu values\n", name, (unsigned long long)at_keyframes.events,
                (unsigned long long)at_keyframes.values_written);
    for (std::uint32_t l : {7u, 100u}) {
      const auto finer = test::record(test, {builder, l});
      std::printf("%s: l = %u: %llu events, %llu values\n", name, l, (unsigned long long)finer.events,
                  (unsigned long long)finer.values_written);
      EXPECT_EQ(at_keyframes.events, finer.events);
      EXPECT_EQ(at_keyframes.values_written, finer.values_written);
      EXPECT_EQ(at_keyframes.log(), finer.log());
    }
  }
}

// ---- The checker itself must catch what is wrong ---------------------------------------------------------

Case faultless() {
  static const auto test = synthetic_scene<float>("soups");
  static const auto recording = test::record(test, {{.width = 2, .leaf_size = 1}});
  return make_case(test.scene, recording, recording.epochs[0], 0);
}
/// The next entry of the same bound, or the log's end.
std::size_t next_of_bound(const std::vector<BoundChange>& log, std::size_t i) {
  const std::size_t from = i;
  do ++i;
  while (i < log.size() && (log[i].node != log[from].node || log[i].side != log[from].side));
  return i;
}
constexpr int faults = 25;

TEST(EnvelopeFaults, FaultlessLogHolds) {
  EXPECT_EQ(faultless().check().violation, "");
}

TEST(EnvelopeFaults, RemovedEntry) {
  const Case right = faultless();
  Random random(1);
  for (int i = 0; i < faults; ++i) {
    Case wrong = right;
    const std::size_t at = random.below(std::uint32_t(wrong.log.size()));
    // Corrected so that only the values can reveal it.
    const std::size_t next = next_of_bound(wrong.log, at);
    if (next < wrong.log.size())
      wrong.log[next].old_vertex = wrong.log[at].old_vertex;
    else
      wrong.end[6 * std::size_t(wrong.log[at].node) + wrong.log[at].side] = wrong.log[at].old_vertex;
    wrong.log.erase(wrong.log.begin() + std::ptrdiff_t(at));
    EXPECT_FALSE(wrong.check().holds()) << "entry " << at;
  }
}

TEST(EnvelopeFaults, ShiftedInstant) {
  const Case right = faultless();
  Random random(2);
  for (int i = 0; i < faults; ++i) {
    Case wrong = right;
    const std::size_t at = random.below(std::uint32_t(wrong.log.size()));
    BoundChange& change = wrong.log[at];
    // By far less than a double could resolve; later or earlier.
    change.when.u += exact(i % 2 == 0 ? 0x1p-90 : -0x1p-90);
    if (change.when.u < 0) change.when.u = exact(0x1p-90);
    std::stable_sort(wrong.log.begin(), wrong.log.end(),
                     [](const BoundChange& a, const BoundChange& b) { return a.when < b.when; });
    EXPECT_FALSE(wrong.check().holds()) << "entry " << at;
  }
}

TEST(EnvelopeFaults, SwappedRealiser) {
  const Case right = faultless();
  Random random(3);
  for (int i = 0; i < faults; ++i) {
    Case wrong = right;
    const std::size_t at = random.below(std::uint32_t(wrong.log.size()));
    BoundChange& change = wrong.log[at];
    const auto& below = wrong.below[change.node];
    const std::uint32_t other = below[random.below(std::uint32_t(below.size()))];
    if (other == change.new_vertex || other == change.old_vertex) continue;
    change.new_vertex = other;
    const std::size_t next = next_of_bound(wrong.log, at);
    if (next < wrong.log.size())
      wrong.log[next].old_vertex = other;
    else
      wrong.end[6 * std::size_t(change.node) + change.side] = other;
    EXPECT_FALSE(wrong.check().holds()) << "entry " << at;
  }
}

TEST(EnvelopeFaults, NeedlessEntries) {
  const Case right = faultless();
  Random random(4);
  for (int i = 0; i < faults; ++i) {
    Case wrong = right;
    const std::size_t at = random.below(std::uint32_t(wrong.log.size()));
    BoundChange back = wrong.log[at], forth = back;
    std::swap(back.old_vertex, back.new_vertex);
    wrong.log.insert(wrong.log.begin() + std::ptrdiff_t(at) + 1, {back, forth});
    EXPECT_FALSE(wrong.check().holds()) << "entry " << at;
  }
}

TEST(EnvelopeFaults, QueueThatLosesEvents) {
  const auto test = synthetic_scene<float>("soups");
  EXPECT_FALSE(check(test.scene, record_on<float, LossyQueue>(test, {{.width = 2, .leaf_size = 1}})).holds());
}

TEST(EnvelopeFaults, OtherPlansThanThoseOfTheLog) {
  const auto test = synthetic_scene<float>("soups");
  auto recording = test::record(test, {{.width = 2, .leaf_size = 1}});
  // One coordinate of one keyframe, by one unit in the last place.
  // The vertex realises a bound of its leaf whose change the log has.
  const Notice<float>& notice = recording.epochs[0].events.front();
  StoredPlans& plans = recording.epochs[0].plans[notice.body];
  double& x = plans.positions[3 * std::size_t(notice.new_vertex) + notice.side / 2];
  x = std::nextafter(float(x), 1e9f);
  EXPECT_FALSE(check(test.scene, recording).holds());
}

// ---- Real sequences
// ----------------------------------------------------------------------------------------

#ifdef KBVH_TEST_HAS_IO
std::filesystem::path data_folder() {
  if (const char* folder = std::getenv("KBVH_DATA")) return folder;
  return std::filesystem::path(KBVH_SOURCE_DIR) / ".." / "shared" / "data";
}
bool slow() {
  const char* value = std::getenv("KBVH_SLOW");
  return value != nullptr && std::string(value) == "1";
}

template <class S>
TestScene<S> sequence_scene(const io::AnimatedMesh& mesh, std::size_t keyframes) {
  keyframes = std::min(keyframes, mesh.keyframe_times.size());
  const auto values = std::ptrdiff_t(keyframes * mesh.vertex_count * 3);
  Primitives primitives;
  primitives.offsets = mesh.primitive_offsets;
  primitives.vertices = mesh.primitive_vertices;
  TestScene<S> test;
  test.scene.name = mesh.name;
  test.scene.bodies.push_back(
      {mesh.name, primitives,
       FlightPlans<S>(mesh.vertex_count,
                      {mesh.keyframe_times.begin(), mesh.keyframe_times.begin() + std::ptrdiff_t(keyframes)},
                      {mesh.positions.begin(), mesh.positions.begin() + values})});
  return test;
}

struct Sequence {
  const char* name;
  std::size_t keyframes;  ///< proved without KBVH_SLOW=1
};
class SequenceEnvelopes : public testing::TestWithParam<Sequence> {};

TEST_P(SequenceEnvelopes, EqualTheLog) {
  const auto folder = data_folder() / "sequences" / GetParam().name;
  if (!std::filesystem::exists(folder / "mesh.obj"))
    GTEST_SKIP() << "no data folder at " << data_folder() << " (set KBVH_DATA)";
  const io::AnimatedMesh mesh = io::load_animated_mesh({folder / "mesh.obj", folder / "motion.pc2", "", 30});
  const std::size_t keyframes = slow() ? mesh.keyframe_times.size() : GetParam().keyframes;
  const BuilderConfig binary{.width = 2, .leaf_size = 1}, wide{.width = 8, .leaf_size = 4};
  for (const BuilderConfig& builder : {binary, wide}) {
    const EnvelopeReport report = prove(sequence_scene<float>(mesh, keyframes), {builder, 1});
    std::printf("%s, %zu keyframes, width %u, leaf size %u: %s\n", GetParam().name, keyframes, builder.width,
                builder.leaf_size, summary(report).c_str());
    EXPECT_GT(report.net, 0u);
  }
  if (slow()) prove(sequence_scene<double>(mesh, keyframes), {binary, 1});
}
INSTANTIATE_TEST_SUITE_P(Data, SequenceEnvelopes,
                         testing::Values(Sequence{"robot-Dance", 16}, Sequence{"MorphStressTest", 48},
                                         Sequence{"diffcloth-tshirt-iter0", 48}),
                         [](const auto& param_info) {
                           std::string name = param_info.param.name;
                           std::erase_if(name, [](char c) { return std::isalnum((unsigned char)c) == 0; });
                           return name;
                         });
#endif

}  // namespace
}  // namespace kbvh::test
