// Live simulations whose pairs a strategy finds: the trajectory of the default finder, bit by bit, its
// candidates at every question, and refusals with a reason.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/contract/registry.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/loop/simulation.hpp"
#include "loop_simulator.hpp"
#include "tests/program/temporary_folder.hpp"
#include "tests/support/random.hpp"

namespace kbvh::experiments::loop {
namespace loop_strategies_test {

using nlohmann::json;

/// The state after each step, and the sum of the candidates of its questions.
struct Trajectory {
  std::vector<std::string> states;
  std::vector<std::uint64_t> candidates;
  std::uint64_t most_contacts = 0, penetrations = 0;
};

Trajectory trajectory(SimulationOptions options, const std::string& strategy = "") {
  options.strategy.id = strategy;
  Trajectory made;
  simulate(options, [&](const json& record) {
    made.states.push_back(record["state"].get<std::string>());
    made.candidates.push_back(record["candidates"].get<std::uint64_t>());
    made.most_contacts = std::max(made.most_contacts, record["contacts"].get<std::uint64_t>());
    made.penetrations += record["penetrations"].get<std::uint64_t>();
  });
  return made;
}

void expect_equal(const Trajectory& found, const Trajectory& expected, const std::string& strategy) {
  EXPECT_EQ(found.states, expected.states) << strategy;
  EXPECT_EQ(found.candidates, expected.candidates) << strategy;
  EXPECT_EQ(found.penetrations, 0u) << strategy;
}

class EverySceneByStrategies : public testing::TestWithParam<std::string> {};

TEST_P(EverySceneByStrategies, MovesAsWithTheDefaultFinder) {
  const SimulationOptions options = small(GetParam(), 35);
  const Trajectory expected = trajectory(options);
  ASSERT_EQ(expected.states.size(), 35u);
  for (const char* const strategy : {"bottom_up", "leaf_slabs", "lbvh", "dirty_refit"})
    expect_equal(trajectory(options, strategy), expected, strategy);
}

INSTANTIATE_TEST_SUITE_P(Scenes, EverySceneByStrategies, testing::ValuesIn(scene_names()),
                         [](const auto& scene) { return scene.param; });

/// Returns why a strategy is refused, or "".
std::string refusal(const ContactStrategy& strategy, const ContactMesh& mesh) {
  try {
    check_contact_strategy(strategy, mesh);
  } catch (const ConfigError& problem) {
    return problem.what();
  }
  return {};
}

TEST(LiveStrategies, AllThatSuitMoveAsWithTheDefaultFinder) {
  SimulationOptions options = small("sphere", 40);
  options.triangles = 100;
  const ContactMesh mesh(make_scene(options.scene, options.triangles, options.seed).mesh);
  const Trajectory expected = trajectory(options);
  EXPECT_GT(expected.most_contacts, 0u);
  std::size_t took_part = 0;
  for (const StrategyEntry& entry : registry()) {
    if (entry.info.guarantee != Guarantee::exact || !refusal({entry.info.id}, mesh).empty()) continue;
    ++took_part;
    expect_equal(trajectory(options, entry.info.id), expected, entry.info.id);
  }
  EXPECT_GT(took_part, 10u);
}

std::vector<Candidate> sorted(std::span<const Candidate> candidates) {
  std::vector<Candidate> list(candidates.begin(), candidates.end());
  std::sort(list.begin(), list.end());
  return list;
}

constexpr CandidateKind contact_kinds[] = {CandidateKind::face_vertex, CandidateKind::edge_edge};

/// Counts the kinds of which two finders list other candidates, and adds up those of the first.
std::size_t differences(IterateDetector& a, IterateDetector& b, std::size_t& listed) {
  std::size_t count = 0;
  for (const CandidateKind kind : contact_kinds) {
    const std::vector<Candidate> of_a = sorted(a.candidates(kind));
    listed += of_a.size();
    count += of_a == sorted(b.candidates(kind)) ? 0 : 1;
  }
  return count;
}

/// Meshes with obstacles, with inner vertices, and with neither.
TEST(LiveStrategies, ListWhatTheDefaultFinderLists) {
  constexpr double radius = 0.03, separation = 1e-3;
  std::size_t impacts = 0;
  for (const char* const scene : {"sphere", "stack", "cloths"})
    for (const std::uint32_t lose_every : {0U, 3U}) {
      const SimulatedMesh simulated = make_scene(scene, 200, 1).mesh;
      const ContactMesh mesh(simulated);
      for (const char* const strategy : {"bottom_up", "leaf_slabs", "lbvh", "dirty_refit", "front"}) {
        IterateDetector own(mesh, {Detection::refit, 0, radius, lose_every});
        IterateDetector other(mesh, {Detection::refit, 0, radius, lose_every, {strategy}});
        const auto place = [&](int i) {
          return std::string(strategy) + " on " + scene + ", " + std::to_string(i);
        };
        test::Random random(7);
        std::size_t listed = 0;
        Positions x = simulated.positions, end = x;
        for (int i = 0; i < 4; ++i) {
          for (Eigen::Index k = 0; k < x.size(); ++k) end.data()[k] = x.data()[k] + 0.05 * random.unit();
          own.update(x);
          other.update(x);
          EXPECT_EQ(differences(own, other, listed), 0u) << place(i);
          EXPECT_THROW(other.earliest_impact(separation), std::logic_error);
          own.update(x, end);
          other.update(x, end);
          const EarliestImpact a = own.earliest_impact(separation), b = other.earliest_impact(separation);
          EXPECT_EQ(a.touches, b.touches) << place(i);
          if (a.touches && b.touches) {
            ++impacts;
            EXPECT_EQ(a.kind, b.kind) << place(i);
            EXPECT_EQ(a.pair, b.pair) << place(i);
            EXPECT_EQ(a.begin, b.begin) << place(i);
            EXPECT_EQ(a.end, b.end) << place(i);
          }
          EXPECT_EQ(differences(own, other, listed), 0u) << place(i) << ", moving";
          x.swap(end);
        }
        EXPECT_GT(listed, 100u) << place(4);
        // One of each kind for each update.
        EXPECT_EQ(other.searches(), 16u) << place(4);
        EXPECT_GT(other.bytes(), 1000u);
      }
    }
  EXPECT_GT(impacts, 0u);
}

/// Seeded fault: one of both loses pairs.
TEST(LiveStrategies, AreComparedWithTheRightLists) {
  const SimulatedMesh simulated = make_scene("cloths", 200, 1).mesh;
  const ContactMesh mesh(simulated);
  std::size_t listed = 0;
  IterateDetector whole(mesh, {Detection::refit, 0, 0.03, 0, {"bottom_up"}});
  IterateDetector lossy(mesh, {Detection::refit, 0, 0.03, 3, {"bottom_up"}});
  whole.update(simulated.positions);
  lossy.update(simulated.positions);
  EXPECT_EQ(differences(whole, lossy, listed), 2u);
  EXPECT_EQ(differences(whole, whole, listed), 0u);
}

TEST(LiveStrategies, LosePairsLikeTheDefaultFinder) {
  SimulationOptions options = small("sheets", 100);
  options.lose_every = 3;
  const SimulationResult expected = simulate(options);
  options.strategy.id = "bottom_up";
  const SimulationResult found = simulate(options);
  EXPECT_GT(found.penetrations, 0u);
  EXPECT_EQ(found.penetrations, expected.penetrations);
  EXPECT_EQ(found.first_penetration, expected.first_penetration);
  EXPECT_EQ(hash_of_state(found.state), hash_of_state(expected.state));
}

TEST(LiveStrategies, ThatDoNotSuitAreRefusedWithAReason) {
  const ContactMesh mesh(make_scene("sphere", 100, 1).mesh);
  const auto expect_refused = [&](const ContactStrategy& strategy, const std::string& part) {
    const std::string said = refusal(strategy, mesh);
    EXPECT_NE(said.find(part), std::string::npos) << strategy.id << ": " << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  };
  expect_refused({"kinetic_aabb"}, "'kinetic_aabb' needs to know the motion in advance");
  expect_refused({"kinetic_separation_list"}, "needs to know the motion in advance");
  expect_refused({"limit_moved_bytes"}, "'limit_moved_bytes' cannot answer pairs within one body");
  expect_refused({"botom_up"}, "there is no strategy 'botom_up'; did you mean 'bottom_up'?");
  expect_refused({"bottom_up", {{"no_such_parameter", "1"}}}, "no_such_parameter");
  EXPECT_EQ(refusal({"bottom_up"}, mesh), "");
  EXPECT_EQ(refusal({"brute_force"}, mesh), "");
  EXPECT_NE(
      refusal({"brute_force"}, ContactMesh(make_scene("sphere", 20000, 1).mesh)).find("is offered at most"),
      std::string::npos);

  const TemporaryFolder folder;
  SimulationOptions options = small("sphere", 1);
  options.folder = folder / "out";
  options.strategy.id = "kinetic_aabb";
  EXPECT_THROW(simulate(options), ConfigError);
  EXPECT_FALSE(std::filesystem::exists(options.folder));
  options.folder.clear();
  options.strategy.id = "bottom_up";
  options.detection = Detection::rebuild;
  EXPECT_THROW(simulate(options), std::invalid_argument);
  options.detection = Detection::kept;
  options.keep = 1;
  EXPECT_THROW(simulate(options), std::invalid_argument);
}

struct Killed {};

TEST(LiveStrategies, GoOnWithTheSameBitsAfterTheyWereKilled) {
  const TemporaryFolder folder;
  SimulationOptions options = small("sphere", 40);
  options.save_every = 4;
  options.record = true;
  options.folder = folder / "whole";
  const std::uint64_t expected = hash_of_state(simulate(options).state);
  options.strategy.id = "lbvh";
  options.folder = folder / "out";
  for (const std::uint64_t last : {std::uint64_t(7), std::uint64_t(34)})
    EXPECT_THROW(simulate(options,
                          [&](const json& record) {
                            if (record["step"] == last) throw Killed{};
                          }),
                 Killed);
  const SimulationResult continued = simulate(options);
  EXPECT_EQ(continued.first_step, 32u);
  EXPECT_EQ(hash_of_state(continued.state), expected);
  EXPECT_EQ(text_of_file(folder / "out" / "loop.recording"),
            text_of_file(folder / "whole" / "loop.recording"));
  const std::vector<json> lines = lines_of(options.folder / "loop.jsonl");
  ASSERT_EQ(lines.size(), 41u);
  EXPECT_EQ(lines[0].at("options").at("strategy"), "lbvh");
  EXPECT_EQ(lines[0].at("options").at("detection"), "strategy");
  // Another strategy does not continue it.
  options.strategy.id = "bottom_up";
  EXPECT_THROW(simulate(options), io::InputError);
  options.strategy.id.clear();
  EXPECT_THROW(simulate(options), io::InputError);
}

/// Two cloths at half their thickness.
TEST(ImplicitStep, RefusesAStateThatIsTooNear) {
  MeshBuilder builder;
  builder.add_cloth({3, {0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}}, {});
  builder.add_cloth({3, {0, 0, 0.0005}, {0.1, 0, 0}, {0, 0.1, 0}}, {});
  Simulator simulator(Simulated{builder.finish(), {}});
  const std::uint64_t before = hash_of_state(simulator.state);
  EXPECT_THROW(simulator.advance(), TooNear);
  EXPECT_EQ(hash_of_state(simulator.state), before);
}

}  // namespace loop_strategies_test
}  // namespace kbvh::experiments::loop
