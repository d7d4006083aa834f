// Every registered strategy and adapter over every synthetic scene, against the brute-force oracle. Loops
// over the registry: a new strategy is tested without any edit here.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>

#include "core/base/library_gaps.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/scene/self_pairs.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/grids.hpp"

namespace kbvh::test {
namespace {

void expect_conforms(const std::string& violation, const std::string& where) {
  if (violation.rfind("skipped", 0) == 0) return;
  EXPECT_EQ(violation, "") << where;
}

std::vector<std::string> all_scene_names() {
  std::vector<std::string> names = all_synthetic_names();
  names.insert(names.end(), curved_scene_names().begin(), curved_scene_names().end());
  return names;
}

template <class S>
TestScene<S> scene_of(const std::string& name, std::uint32_t l = 1) {
  return name.starts_with("curved_") ? curved_scene<S>(name, l) : synthetic_scene<S>(name, l);
}

/// Returns whether it is float's turn when scenes are not played in both scalars. The scalars take turns from
/// scene to scene, and within a scene by the number of frames per keyframe, so that every strategy is played
/// in both.
bool is_turn_of_float(const std::string& scene, std::uint32_t l) {
  static const std::vector<std::string> scenes = all_scene_names();
  const auto place = std::find(scenes.begin(), scenes.end(), scene) - scenes.begin();
  return (place % 2 == 0) == (l != 7);
}

/// Returns how many frames a keyframe interval has in each play: what the environment lists in
/// KBVH_PER_KEYFRAME, so that the parts of tests/run divide the plays among them; otherwise all, many for the
/// slow tests alone.
std::vector<std::uint32_t> frames_per_keyframe() {
  if (const char* list = std::getenv("KBVH_PER_KEYFRAME")) {
    std::vector<std::uint32_t> chosen;
    std::istringstream words(list);
    for (std::string word; std::getline(words, word, ',');) chosen.push_back(std::uint32_t(std::stoul(word)));
    if (chosen.empty()) throw std::invalid_argument("KBVH_PER_KEYFRAME is empty");
    return chosen;
  }
  if (std::getenv("KBVH_SLOW") != nullptr) return {1, 7, 20, 100};
  return {1, 7, 20};
}

/// Scene, strategy.
class Conformance : public testing::TestWithParam<std::pair<std::string, std::string>> {};

TEST_P(Conformance, KeepsItsGuaranteeOnEveryFrame) {
  const auto& [scene_name, id] = GetParam();
  const StrategyEntry& entry = find_strategy(id);
  const BuilderConfig builder = entry.info.topology.preferred;
  for (const std::uint32_t l : frames_per_keyframe()) {
    const std::string where = id + " on " + scene_name + ", l = " + std::to_string(l);
    const bool float_alone = is_turn_of_float(scene_name, l);
    if (in_both_scalars() || float_alone)
      expect_conforms(check(entry, scene_of<float>(scene_name, l), l, {}, builder), where + ", float");
    if (in_both_scalars() || !float_alone)
      expect_conforms(check(entry, scene_of<double>(scene_name, l), l, {}, builder), where + ", double");
  }
}

std::vector<std::string> strategy_ids() {
  std::vector<std::string> ids;
  for (const StrategyEntry& entry : registry()) ids.push_back(entry.info.id);
  return ids;
}

/// Every strategy on every scene in which it takes part, ordered by scene, so that each truth is found once.
std::vector<std::pair<std::string, std::string>> scenes_with_contestants() {
  std::vector<std::pair<std::string, std::string>> cases;
  for (const std::string& scene : all_scene_names()) {
    const auto in_float = scene_of<float>(scene);
    const auto in_double = scene_of<double>(scene);
    for (const StrategyEntry& entry : registry())
      if (skipped(entry, in_float).empty() || skipped(entry, in_double).empty())
        cases.emplace_back(scene, entry.info.id);
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Registry, Conformance, testing::ValuesIn(scenes_with_contestants()),
                         [](const auto& test) { return test.param.second + "_on_" + test.param.first; });

class Configurations : public testing::TestWithParam<std::string> {};

// Every admissible topology (method x width x leaf size) and every word of every parameter.
TEST_P(Configurations, AllConform) {
  const StrategyEntry& entry = find_strategy(GetParam());
  const auto sweep = [&](const std::string& scene_name, bool scripted, const auto& run) {
    if (entry.info.topology.own) return;
    for (BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
      for (std::uint32_t width : entry.info.topology.widths)
        for (std::uint32_t leaf = entry.info.topology.min_leaf_size;
             leaf <= entry.info.topology.max_leaf_size; leaf += scripted   ? 5
                                                                : leaf < 4 ? 1
                                                                           : 4)
          run({.method = method, .width = width, .leaf_size = leaf}, scene_name + ", " + name(method) +
                                                                         ", width " + std::to_string(width) +
                                                                         ", leaf " + std::to_string(leaf));
  };
  for (const std::string scene_name : {"sheets", "integer_ties", "plan_changes", "geometry_changes",
                                       "self_rolled_cloth", "self_plan_changes", "curved_ties"}) {
    // Scripts and curves make every frame expensive: fewer frames and leaf sizes.
    const bool scripted = scene_name != "sheets" && scene_name != "integer_ties";
    const std::uint32_t l = scripted ? 2 : 7;
    const auto in_float = scene_of<float>(scene_name, l);
    const auto in_double = scene_of<double>(scene_name, l);
    sweep(scene_name, scripted, [&](const BuilderConfig& builder, const std::string& where) {
      expect_conforms(check(entry, in_float, l, {}, builder), GetParam() + " on " + where + ", float");
      expect_conforms(check(entry, in_double, l, {}, builder), GetParam() + " on " + where + ", double");
    });
    for (const Parameter& parameter : entry.info.parameters)
      for (const std::string& word : parameter.allowed) {
        const std::map<std::string, std::string> params{{parameter.name, word}};
        const std::string where = GetParam() + " on " + scene_name + " with " + parameter.name + "=" + word;
        expect_conforms(check(entry, in_float, l, params, entry.info.topology.preferred), where + ", float");
        expect_conforms(check(entry, in_double, l, params, entry.info.topology.preferred),
                        where + ", double");
      }
  }
}

INSTANTIATE_TEST_SUITE_P(Registry, Configurations, testing::ValuesIn(strategy_ids()),
                         [](const auto& test) { return test.param; });

// Tests positions, refits, queries and triangle tests with every other set of kernels that this machine can
// run.
class Kernels : public testing::TestWithParam<KernelSet> {};

TEST_P(Kernels, Conform) {
  const KernelSet before = active_kernel_set();
  use_kernel_set(GetParam());
  for (const std::string& scene_name : all_scene_names()) {
    const auto in_float = scene_of<float>(scene_name, 3);
    const auto in_double = scene_of<double>(scene_name, 3);
    for (const StrategyEntry& entry : registry()) {
      if (entry.info.topology.own || entry.info.max_primitive_pairs != 0) continue;
      const std::string where = entry.info.id + " on " + scene_name + " with " + name(GetParam());
      const BuilderConfig builder = entry.info.topology.preferred;
      expect_conforms(check(entry, in_float, 3, {}, builder), where + ", float");
      expect_conforms(check(entry, in_double, 3, {}, builder), where + ", double");
    }
  }
  for (const std::string scene_name : {"sheets", "integer_ties"}) {
    const auto found = std::find_if(registry().begin(), registry().end(),
                                    [](const StrategyEntry& entry) { return entry.info.id == "bottom_up"; });
    if (found == registry().end()) break;  // a suite over other people's strategies
    const StrategyEntry& refit = *found;
    const auto in_float = scene_of<float>(scene_name, 7);
    const auto in_double = scene_of<double>(scene_name, 7);
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (std::uint32_t leaf = 1; leaf <= 16; ++leaf) {
        const BuilderConfig builder{.method = BuildMethod::median, .width = width, .leaf_size = leaf};
        const std::string where = scene_name + " with " + name(GetParam()) + ", width " +
                                  std::to_string(width) + ", leaf " + std::to_string(leaf);
        expect_conforms(check(refit, in_float, 7, {}, builder), where + ", float");
        expect_conforms(check(refit, in_double, 7, {}, builder), where + ", double");
      }
  }
  use_kernel_set(before);
}

/// All other tests cover the set in use.
std::vector<KernelSet> other_kernel_sets() {
  std::vector<KernelSet> sets = supported_kernel_sets();
  std::erase(sets, active_kernel_set());
  return sets;
}
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Kernels);
INSTANTIATE_TEST_SUITE_P(Registry, Kernels, testing::ValuesIn(other_kernel_sets()),
                         [](const auto& test) { return std::string(name(test.param)); });

/// A grid of 2 side^2 triangles that bends from one keyframe to the next, and one at rest that it cuts.
template <class S>
TestScene<S> bending_grid(std::uint32_t side) {
  TestScene<S> test;
  test.scene.name = "bending grid";
  for (int body = 0; body < 2; ++body) {
    Body<S> made;
    made.name = "grid";
    std::vector<S> positions;
    for (int keyframe = 0; keyframe < (body == 0 ? 2 : 1); ++keyframe)
      for (std::uint32_t j = 0; j <= side; ++j)
        for (std::uint32_t i = 0; i <= side; ++i) {
          const S x = S(i) / S(side), y = S(j) / S(side);
          positions.push_back(x);
          positions.push_back(y);
          positions.push_back(body == 0 ? (x - S(0.4)) * (S(0.1) + S(keyframe) * y) : S(0.01));
        }
    add_grid_triangles(made.primitives, side);
    const std::vector<double> times = body == 0 ? std::vector<double>{0, 1} : std::vector<double>{0};
    made.plans = FlightPlans<S>((side + 1) * (side + 1), times, std::move(positions));
    test.scene.bodies.push_back(std::move(made));
  }
  test.scene.pairs = all_pairs(test.scene.bodies);
  return test;
}

// Large enough to be divided among threads.
TEST(Threads, GiveTheSameAnswers) {
  const auto found = std::find_if(registry().begin(), registry().end(),
                                  [](const StrategyEntry& entry) { return entry.info.id == "bottom_up"; });
  if (found == registry().end()) GTEST_SKIP() << "bottom_up is not in this suite";
  const auto& parameters = found->info.parameters;
  const auto threads = std::find_if(parameters.begin(), parameters.end(),
                                    [](const Parameter& parameter) { return parameter.name == "threads"; });
  if (!threads->allowed.empty()) GTEST_SKIP() << "built without TBB";
  const auto machine = unsigned(threads->most);  // fewer than the machine has, if this process is pinned
  if (machine < 2) GTEST_SKIP() << "there is one core";
  for (const std::string& count : std::set<std::string>{"2", std::to_string(std::min(machine, 5u))})
    for (const std::uint32_t leaf : {1u, 4u}) {
      const BuilderConfig builder{.method = BuildMethod::median, .width = 8, .leaf_size = leaf};
      expect_conforms(check(*found, bending_grid<float>(110), 3, {{"threads", count}}, builder),
                      count + " threads, float");
      expect_conforms(check(*found, bending_grid<double>(110), 3, {{"threads", count}}, builder),
                      count + " threads, double");
    }
}

// Cases that would be skipped are not generated, so a strategy could end up without any test.
TEST(Registry, EveryStrategyTakesPart) {
  std::map<std::string, std::size_t> scenes;
  for (const auto& [scene, id] : scenes_with_contestants()) ++scenes[id];
  for (const StrategyEntry& entry : registry()) EXPECT_GE(scenes[entry.info.id], 8u) << entry.info.id;
}

TEST(Registry, DescribesEveryStrategy) {
  EXPECT_GE(registry().size(), 1u);
  for (const StrategyEntry& entry : registry()) {
    EXPECT_FALSE(entry.info.title.empty()) << entry.info.id;
    EXPECT_FALSE(entry.info.family.empty()) << entry.info.id;
    EXPECT_FALSE(entry.info.citation.empty()) << entry.info.id;
    EXPECT_TRUE(entry.info.has_float || entry.info.has_double) << entry.info.id;
    EXPECT_EQ(entry.info.has_float, entry.make_float != nullptr) << entry.info.id;
    EXPECT_EQ(entry.info.has_double, entry.make_double != nullptr) << entry.info.id;
    for (const Parameter& parameter : entry.info.parameters) {
      EXPECT_FALSE(parameter.meaning.empty()) << entry.info.id << "." << parameter.name;
      EXPECT_NO_THROW(
          Params(entry.info.id, entry.info.parameters, {{parameter.name, parameter.default_value}}));
    }
  }
}

// A scene that asks for pairs within a body is answered, or refused at once.
TEST(Registry, SelfPairsAreDeclaredOrRefused) {
  const auto test = synthetic_scene<float>("self_rolled_cloth");
  std::set<std::string> able, refusing;
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    const auto make = [&] { Session<float>(test.scene, {&entry, {}, entry.info.topology.preferred}); };
    if (entry.info.can.self_pairs)
      EXPECT_NO_THROW(make()) << entry.info.id;
    else
      EXPECT_THROW(make(), ConfigError) << entry.info.id;
    (entry.info.can.self_pairs ? able : refusing).insert(entry.info.id);
  }
  // A program may have a few strategies only. Contract.RefitsAnswerPairsWithinABody checks all of them.
  EXPECT_FALSE(able.empty() && refusing.empty());
  // Scenes of this kind prove nothing if there are no such pairs.
  Playback<float> playback(test.scene);
  playback.seek(4);
  std::size_t within = 0;
  for (const PrimitivePair& pair : brute_force_pairs(test.scene, playback)) {
    if (pair.body_a != pair.body_b) continue;
    ++within;
    const Primitives& primitives = test.scene.bodies[pair.body_a].primitives;
    EXPECT_FALSE(share_vertex(primitives[pair.primitive_a], primitives[pair.primitive_b]));
  }
  EXPECT_GT(within, 20u);
}

/// Returns values of a parameter: all its words, or the ends of its range and numbers in between.
std::vector<std::string> values_of(const Parameter& parameter) {
  if (!parameter.allowed.empty()) return parameter.allowed;
  const double most = std::min(parameter.most, std::numeric_limits<double>::max());
  std::set<std::string> values{parameter.default_value, shortest_text(parameter.least), shortest_text(most)};
  for (double value = 1; value <= std::min(most, 1e6); value *= 10)
    if (value >= parameter.least) values.insert(shortest_text(value));
  return {values.begin(), values.end()};
}

template <class S>
void expect_all_values_are_taken() {
  const TestScene<S> test = bending_grid<S>(4);
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<S>() == nullptr) continue;
    for (const Parameter& parameter : entry.info.parameters)
      for (const std::string& value : values_of(parameter))
        EXPECT_NO_THROW(
            Session<S>(test.scene, {&entry, {{parameter.name, value}}, entry.info.topology.preferred}))
            << entry.info.id << ", " << parameter.name << " = " << value;
  }
}

// The declaration alone decides which values a parameter accepts: a study whose parameters were accepted
// never fails in a strategy.
TEST(Registry, EveryStrategyTakesTheValuesThatItDeclares) {
  expect_all_values_are_taken<float>();
  expect_all_values_are_taken<double>();
}

TEST(Registry, RejectsWhatItDoesNotKnow) {
  EXPECT_THROW(find_strategy("no_such_strategy"), ConfigError);
  const StrategyEntry& entry = registry().front();
  EXPECT_THROW(Params(entry.info.id, entry.info.parameters, {{"no_such_parameter", "1"}}), ConfigError);
}

// The driver's promises that hold for every strategy: time does not run backwards, and `reset` starts over.
TEST_P(Configurations, TimeRunsForwardAndResetStartsOver) {
  const StrategyEntry& entry = find_strategy(GetParam());
  const auto run = [&]<class S>(const TestScene<S>& test) {
    if (entry.factory<S>() == nullptr) return;
    Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes times;
    PairBuffer first, again;
    session.reset(0);
    session.advance(1, times);
    session.query(first, times);
    session.advance(3, times);
    session.query(again, times);
    EXPECT_THROW(session.advance(2, times), std::invalid_argument) << GetParam();
    session.reset(0);
    session.advance(1, times);
    session.query(again, times);
    std::sort(first.begin(), first.end());
    std::sort(again.begin(), again.end());
    EXPECT_EQ(first, again) << GetParam();
  };
  run(synthetic_scene<float>("sheets"));
  run(synthetic_scene<double>("sheets"));
}

// Strategies that answer intervals: at every frame of an interval the spans that contain it include the
// truth, and confirming them yields exactly the truth.
class Spans : public testing::TestWithParam<std::tuple<std::string, std::string>> {};

template <class S>
void expect_spans_enclose(const StrategyEntry& entry, const TestScene<S>& test, std::uint32_t l) {
  if (!skipped(entry, test).empty()) return;
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  // A second playback, which makes the same changes, provides the frames.
  const SceneView<S> view(test.scene);
  Playback<S> playback(test.scene);
  const SampledMotion<S> motion(playback);
  const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, l) : test.frames;
  session.reset(frames.front());
  PhaseTimes ignored;
  SpanBuffer spans;
  auto step = test.script.steps.begin();
  const auto change_plans = [&](double t) {
    for (; step != test.script.steps.end() && step->time <= t; ++step) {
      playback.seek(t);
      playback.change_plans(t, step->changes);
      session.change_plans(step->changes, ignored);
    }
  };
  change_plans(frames.front());
  for (std::size_t begin = 0; begin < frames.size();) {
    // Advances to the next frame at which plans change, or by some frames: intervals of uneven length.
    std::size_t end = std::min(begin + 1 + begin % 5, frames.size() - 1);
    if (step != test.script.steps.end())
      for (std::size_t f = begin; f < end; ++f)
        if (frames[f] >= step->time && f > begin) end = f;
    spans.clear();
    session.spans(frames[end], spans);
    for (const PairSpan& span : spans) {
      ASSERT_LE(span.begin, span.end);
      ASSERT_GE(span.begin, frames[begin]);
      ASSERT_LE(span.end, frames[end]);
    }
    for (std::size_t f = begin; f <= end; ++f) {
      playback.seek(frames[f]);
      PairBuffer alive;
      for (const PairSpan& span : spans)
        if (span.begin <= frames[f] && frames[f] <= span.end) alive.push_back(span.pair);
      std::sort(alive.begin(), alive.end());
      alive.erase(std::unique(alive.begin(), alive.end()), alive.end());
      TriangleTestStats stats;
      confirm_pairs(view, motion, alive, stats);
      ASSERT_EQ(alive, brute_force_pairs(test.scene, playback))
          << entry.info.id << " on " << test.scene.name << " at t = " << frames[f];
    }
    change_plans(frames[end]);
    if (end + 1 == frames.size()) break;
    begin = end;
  }
}

TEST_P(Spans, EncloseEveryFrame) {
  const StrategyEntry& entry = find_strategy(std::get<0>(GetParam()));
  expect_spans_enclose(entry, scene_of<float>(std::get<1>(GetParam()), 7), 7);
  expect_spans_enclose(entry, scene_of<double>(std::get<1>(GetParam()), 3), 3);
}

std::vector<std::string> ids_with_spans() {
  std::vector<std::string> ids;
  for (const StrategyEntry& entry : registry())
    if (entry.info.can.spans) ids.push_back(entry.info.id);
  return ids;
}

std::vector<std::string> scenes_for_spans() {
  std::vector<std::string> names = synthetic_scene_names();
  for (const std::string& name : self_scene_names())
    if (name.find("geometry") == std::string::npos) names.push_back(name);
  names.insert(names.end(), curved_scene_names().begin(), curved_scene_names().end());
  return names;
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Spans);
INSTANTIATE_TEST_SUITE_P(Registry, Spans,
                         testing::Combine(testing::ValuesIn(ids_with_spans()),
                                          testing::ValuesIn(scenes_for_spans())),
                         [](const auto& test) {
                           return std::get<0>(test.param) + "_on_" + std::get<1>(test.param);
                         });

// Changes of geometry are made as a whole or refused as a whole, before the strategy sees them.
TEST_P(Configurations, ChangesOfGeometryAreRefusedAsAWhole) {
  const StrategyEntry& entry = find_strategy(GetParam());
  const auto run = [&]<class S>(const TestScene<S>& test) {
    if (entry.factory<S>() == nullptr) return;
    Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes times;
    session.reset(0);
    session.advance(1, times);
    GeometryChange<S> change;
    change.removed_primitives = {{0, 5}};
    if (!entry.info.can.geometry_changes) {
      EXPECT_THROW(session.change_geometry(change, times), std::logic_error) << GetParam();
      EXPECT_THROW(session.strategy().geometry_changed(1, change), std::logic_error) << GetParam();
      return;
    }
    PairBuffer before, after;
    session.query(before, times);
    change.removed_vertices = {{1, 0}};
    EXPECT_THROW(session.change_geometry(change, times), std::invalid_argument) << GetParam();
    EXPECT_TRUE(session.scene().bodies[0].primitives.alive(5));
    session.query(after, times);
    EXPECT_EQ(before, after) << GetParam();
    change.removed_vertices.clear();
    change.primitives = {{0, {0, 1, 2}}};
    session.change_geometry(change, times);
    EXPECT_FALSE(session.scene().bodies[0].primitives.alive(5));
    EXPECT_TRUE(test.scene.bodies[0].primitives.alive(5)) << "the caller's scene stays as it was";
    // A reset starts over, with the current geometry.
    session.reset(0);
    session.advance(1, times);
    session.query(after, times);
    std::sort(before.begin(), before.end());
    std::sort(after.begin(), after.end());
    EXPECT_EQ(before, after) << GetParam();
    EXPECT_TRUE(session.scene().bodies[0].primitives.alive(5));
  };
  run(synthetic_scene<float>("sheets"));
  run(synthetic_scene<double>("sheets"));
}

}  // namespace
}  // namespace kbvh::test
