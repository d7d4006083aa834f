// The stress suite: its scenes, that it finds seeded faults and shrinks them, that no failure ends it, and
// the results of the approximate contestants in it.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "core/families/events/kinetic_tree_strategy.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/stress/isolate.hpp"
#include "experiments/stress/runner.hpp"
#include "experiments/stress/shrink.hpp"

namespace kbvh::experiments::stress {
namespace {

enum class Fault { none, one_ulp, hangs, crashes, throws };

/// A refit with one fault, which needs more than one keyframe.
template <class S, Fault fault>
class FaultyRefit : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;

 private:
  void update(std::uint32_t body) override {
    this->refit(body);
    auto& hierarchy = this->hierarchies_[body];
    if (hierarchy.topology().empty()) return;
    Box<S> box = hierarchy.box(0);
    if (fault == Fault::one_ulp) box.upper[1] = std::nextafter(box.upper[1], S(-1e38));
    if (fault == Fault::hangs && box.upper[1] > 0)
      for (volatile int forever = 1; forever != 0;) {
      }
    if (fault == Fault::crashes && box.upper[1] > 0) std::abort();
    if (fault == Fault::throws && box.upper[1] > 0) throw std::logic_error("cannot go on");
    hierarchy.set_box(0, box);
  }
};
template <class S>
using Sound = FaultyRefit<S, Fault::none>;
template <class S>
using OneUlp = FaultyRefit<S, Fault::one_ulp>;
template <class S>
using Hangs = FaultyRefit<S, Fault::hangs>;
template <class S>
using Crashes = FaultyRefit<S, Fault::crashes>;
template <class S>
using Throws = FaultyRefit<S, Fault::throws>;

/// Some events never enter the queue.
template <class S>
class LossyQueue : public AvlQueue<S> {
 public:
  using AvlQueue<S>::AvlQueue;
  void schedule(const Event& event) {
    if ((event.winner + event.loser) % 5 != 0) AvlQueue<S>::schedule(event);
  }
};
template <class S>
class LosesEvents : public KineticAabbStrategy<S, LossyQueue<S>> {
 public:
  LosesEvents(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies, const Params&)
      : KineticAabbStrategy<S, LossyQueue<S>>(scene, motion, std::move(topologies), 0,
                                              KineticQuery::wide_rows) {}
};

template <template <class> class Strategy>
const StrategyEntry& entry(const char* id) {
  static const StrategyEntry made = [id] {
    Info info;
    info.id = id;
    info.family = "seeded";
    info.topology.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 2};
    return make_entry<Strategy>(info);
  }();
  return made;
}

ContestantSpec contestant(const StrategyEntry& entry, std::map<std::string, std::string> params = {}) {
  ContestantSpec spec;
  spec.entry = &entry;
  spec.builder = entry.info.topology.preferred;
  spec.given = params;
  spec.params = Params(entry.info.id, entry.info.parameters, params).values();
  spec.label = entry.info.id;
  for (const auto& [key, value] : params) spec.label += " " + key + "=" + value;
  return spec;
}

StressOptions small_suite(std::vector<ContestantSpec> contestants, std::vector<std::string> names) {
  StressOptions options;
  for (const std::string& name : names) options.families.push_back(&find_family(name));
  options.contestants = std::move(contestants);
  options.scenes = names.size();
  options.l = {7};
  options.limits = {.seconds = 2, .silent = true};
  options.many_keyframes = 300;
  return options;
}

const auto silence = [](const std::string&) {};

TEST(StressScenes, EveryFamilyMakesScenesThatCanBePlayedOrAreRefused) {
  for (const Family& family : families())
    for (const std::uint32_t l : {1u, 7u, 100u})
      for (const std::uint64_t seed : {1, 2, 3}) {
        FamilySetting setting{seed, l, scalar_limits<float>(), 300};
        const StressScene scene = make_scene(family, setting), again = make_scene(family, setting);
        ASSERT_FALSE(scene.frames.empty()) << family.name;
        EXPECT_TRUE(std::is_sorted(scene.frames.begin(), scene.frames.end())) << family.name;
        EXPECT_LE(scene.triangles(), 300u) << family.name;
        Repro repro;
        repro.scalar = "float";
        repro.scene = scene;
        const std::string text = to_text(repro);
        repro.scene = again;
        EXPECT_EQ(text, to_text(repro)) << family.name << " is not the same twice";
        EXPECT_EQ(text, to_text(repro_of(text, "text"))) << family.name << " does not read back";
        setting.seed = seed + 100;
        repro.scene = make_scene(family, setting);
        EXPECT_NE(text, to_text(repro)) << family.name << " ignores its seed";
        if (family.name == "beyond_range") continue;
        EXPECT_NO_THROW(playable<float>(scene)) << family.name;
      }
}

TEST(StressScenes, WhatIsBeyondTheRangeIsRefusedAndIsNoFailure) {
  StressOptions options = small_suite({contestant(entry<Sound>("sound"))}, {"beyond_range"});
  options.scenes = 12;
  options.l = {1};
  const StressReport report = run_stress(options, silence);
  EXPECT_GT(report.rows[0].refused, 0u);
  EXPECT_GT(report.rows[0].scenes, 0u);
  EXPECT_EQ(report.rows[0].refused + report.rows[0].scenes, 24u);
  EXPECT_EQ(report.rows[0].failures(), 0u);
}

TEST(StressScenes, ReprosReadBackToTheLastBitOrSayWhatIsWrong) {
  Repro repro;
  repro.scalar = "double";
  repro.scene.frames = {0.1, 5e-324};
  repro.scene.frames = {5e-324, 0.1};
  StressBody body;
  body.vertex_count = 1;
  body.primitives = {{0, 0, 0}};
  body.positions = {-0.0, 4.9e-324, 1.0 / 3};
  repro.scene.bodies = {body};
  const Repro back = repro_of(to_text(repro), "text");
  EXPECT_TRUE(std::signbit(back.scene.bodies[0].positions[0]));
  EXPECT_EQ(back.scene.bodies[0].positions, body.positions);
  EXPECT_EQ(back.scene.frames, repro.scene.frames);
  std::string text = to_text(repro);
  text.replace(text.find("[[0,0,0]]"), 9, "[[0,0,1]]");
  EXPECT_THROW(repro_of(text, "text"), io::InputError);
  EXPECT_THROW(repro_of("{}", "text"), io::InputError);
}

void expect_found_and_small(const StrategyEntry& faulty, std::vector<std::string> names,
                            std::size_t largest) {
  StressOptions options = small_suite({contestant(faulty), contestant(entry<Sound>("sound"))}, names);
  const StressReport report = run_stress(options, silence);
  ASSERT_FALSE(report.failures.empty());
  for (const StressFailure& failure : report.failures) {
    EXPECT_EQ(failure.repro.strategy, faulty.info.id);
    EXPECT_LT(failure.repro.scene.size(), failure.size_before);
    EXPECT_LE(failure.repro.scene.triangles(), largest) << to_text(failure.repro);
    // The scene read back from the file fails as well.
    const Repro back = repro_of(to_text(failure.repro), "text");
    EXPECT_EQ(run_scene(back.scene, back.scalar, {contestant(faulty)}, options.limits)[0].outcome,
              Outcome::broken);
  }
  for (const StressRow& row : report.rows)
    if (row.strategy == "sound") {
      EXPECT_EQ(row.failures(), 0u);
    }
}

TEST(StressFaults, OneUlpTooSmallIsFoundAndMadeSmall) {
  expect_found_and_small(entry<OneUlp>("one_ulp"), {"unit", "far_away"}, 1);
}

TEST(StressFaults, LostEventsAreFoundAndMadeSmall) {
  expect_found_and_small(entry<LosesEvents>("loses_events"), {"unit", "near_tangent"}, 4);
}

TEST(StressFaults, HangsAndCrashesAreCountedAndTheRestIsPlayed) {
  StressOptions options =
      small_suite({contestant(entry<Crashes>("crashes")), contestant(entry<Hangs>("hangs")),
                   contestant(entry<Throws>("throws")), contestant(entry<Sound>("sound"))},
                  {"unit"});
  options.scalars = {"float"};
  options.shrink = false;
  const StressReport report = run_stress(options, silence);
  EXPECT_EQ(report.rows[0].crashes, 1u);
  EXPECT_EQ(report.rows[1].hangs, 1u);
  EXPECT_EQ(report.rows[2].threw, 1u);
  EXPECT_EQ(report.rows[3].failures(), 0u);
  EXPECT_EQ(report.rows[3].scenes, 1u);
  EXPECT_GT(report.rows[3].frames, 1u);
  EXPECT_EQ(report.failures.size(), 3u);
}

TEST(Isolation, AnswersComeBackInOrderWhateverHappensBetween) {
  const auto outcomes = run_in_children(
      6, 1,
      [](std::size_t job) {
        if (job == 1 || job == 5) std::_Exit(0);
        if (job == 3)
          for (volatile int forever = 1; forever != 0;) {
          }
        return std::string(job * 100000, 'x');
      },
      Stderr::silent);
  ASSERT_EQ(outcomes.size(), 6u);
  using End = JobOutcome::End;
  const End expected[] = {End::finished, End::crashed, End::finished, End::hung, End::finished, End::crashed};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(outcomes[i].end, expected[i]) << i;
    if (expected[i] != End::finished) continue;
    EXPECT_EQ(outcomes[i].said.size(), i * 100000);
  }
}

TEST(Shrinking, LeavesWhatIsNeededAndNothingElse) {
  FamilySetting setting{5, 7, scalar_limits<double>(), 300};
  const StressScene scene = make_scene(find_family("changes_at_keyframes"), setting);
  // Requires one vertex of a triangle beyond 0.5 at the second keyframe, and a later frame.
  std::size_t asked = 0;
  const auto fails = [&](const StressScene& candidate) {
    ++asked;
    for (const StressBody& body : candidate.bodies)
      if (body.times.size() > 1)
        for (const auto& primitive : body.primitives)
          for (const std::uint32_t v : primitive)
            if (body.position(1, v)[0] > 0.5 && candidate.frames.back() > body.times[0]) return true;
    return false;
  };
  ASSERT_TRUE(fails(scene));
  const StressScene small = shrink(scene, fails);
  EXPECT_TRUE(fails(small));
  EXPECT_EQ(small.bodies.size(), 1u);
  EXPECT_EQ(small.triangles(), 1u);
  EXPECT_EQ(small.frames.size(), 1u);
  EXPECT_TRUE(small.steps.empty());
  EXPECT_EQ(small.keyframes(), 2u);
  // The only remaining coordinate is a round number.
  std::size_t others = 0;
  for (const double x : small.bodies[0].positions) others += x != 0;
  EXPECT_EQ(others, 1u);
  EXPECT_LT(asked, 3000u);
}

// Scenes that the suite has found, each with the contestant that failed on it.
TEST(Repro, WhatFailedOnceHolds) {
  std::size_t played = 0;
  for (const auto& file : std::filesystem::directory_iterator(KBVH_SOURCE_DIR "/tests/repro/stress")) {
    const Repro repro = repro_of(io::read_file(file.path()), file.path().string());
    const StrategyEntry* known = known_strategy(repro.strategy);
    if (known == nullptr) continue;  // a peer that is not installed here
    ContestantSpec spec = contestant(*known, repro.params);
    if (!repro.builder.empty()) spec.builder = builder_of(repro.builder);
    const CaseResult result = run_scene(repro.scene, repro.scalar, {spec}, {})[0];
    // A peer may state a range of its own; it never ends the program.
    const bool stated = result.outcome == Outcome::unsuitable && std::isfinite(known->info.max_coordinate) &&
                        result.what.starts_with("takes coordinates up to");
    EXPECT_TRUE(result.outcome == Outcome::held || stated) << file.path() << ": " << result.what;
    ++played;
  }
  RecordProperty("played", int(played));
}

// --- what exactness buys --------------------------------------------------------------------------------

std::vector<StressRow> played(std::vector<ContestantSpec> contestants, std::vector<std::string> names) {
  StressOptions options = small_suite(std::move(contestants), std::move(names));
  options.scenes *= 2;
  return run_stress(options, silence).rows;
}

TEST(Approximate, ErrorsAreResultsAndNoFailures) {
  const auto rows = played({contestant(find_strategy("kinetic_aabb_approximate"),
                                       {{"event_times", "float"}, {"formula", "textbook"}}),
                            contestant(find_strategy("kinetic_aabb"))},
                           {"near_parallel", "near_tangent", "uneven_keyframes", "ties_that_separate"});
  double worst = 0;
  for (const StressRow& row : rows) {
    EXPECT_EQ(row.failures(), 0u) << row.family << " " << row.strategy;
    if (row.approximate)
      worst = std::max(worst, row.protrusion);
    else
      EXPECT_EQ(row.protrusion, 0) << row.family;
  }
  EXPECT_GT(worst, 0) << "rounded times of events should cost something here";
}

TEST(Approximate, PlainPositionsLeaveTheirBoxes) {
  const auto rows = played({contestant(find_strategy("bottom_up_approximate")),
                            contestant(find_strategy("bottom_up_approximate"), {{"positions", "rounded"}})},
                           {"unit", "far_away"});
  EXPECT_GT(rows[0].protrusion + rows[2].protrusion, 0);
  EXPECT_EQ(rows[1].protrusion, 0);
  EXPECT_EQ(rows[3].protrusion, 0);
}

TEST(Approximate, BoxesRoundedOutwardsHoldAndThoseRoundedToNearestDoNot) {
  const StrategyEntry& entry = find_strategy("bottom_up_approximate");
  const auto with = [&](const char* rounding) {
    return contestant(entry, {{"positions", "rounded"}, {"boxes", "bfloat16"}, {"rounding", rounding}});
  };
  const auto rows = played({with("nearest"), with("outward")}, {"unit", "denormals", "huge"});
  for (std::size_t family = 0; family < 3; ++family) {
    const StressRow &nearest = rows[2 * family], &outward = rows[2 * family + 1];
    EXPECT_GT(nearest.protrusion, 0) << nearest.family;
    EXPECT_EQ(outward.protrusion, 0) << nearest.family;
    EXPECT_EQ(outward.missed, 0u) << nearest.family;
    EXPECT_GT(outward.looseness(), nearest.looseness()) << nearest.family;
  }
}

TEST(Approximate, ABudgetMissesPairsAndReportsNoneThatAreNot) {
  const StrategyEntry& entry = find_strategy("bottom_up_budget");
  const auto rows =
      played({contestant(entry, {{"box_tests", "1"}}), contestant(entry, {{"box_tests", "10000000"}})},
             {"near_parallel"});
  EXPECT_GT(rows[0].missed, 0u);
  EXPECT_EQ(rows[0].extra, 0u);
  EXPECT_EQ(rows[0].protrusion, 0);
  EXPECT_EQ(rows[1].missed, 0u);
}

}  // namespace
}  // namespace kbvh::experiments::stress
