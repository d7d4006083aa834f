// A simulation whose strategy loses pairs: what it loses goes through each other, and the check of
// penetrations sees it. The program has a registry of its own, of strategies with seeded faults.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/contract/about.hpp"
#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "experiments/loop/simulation.hpp"
#include "loop_simulator.hpp"

namespace kbvh {
namespace loop_losses_test {

enum class Loss {
  nothing,
  everything,
  every_third,      // one pair of three, by its ids
  every_other_time  // all pairs, at one search of two
};

template <class S, Loss loss>
class Losing : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) override {
    const std::size_t before = out.size();
    const QueryStatus status = Base::find_candidates(t, out, budget);
    ++searches_;
    std::size_t kept = before;
    for (std::size_t i = before; i < out.size(); ++i)
      if (!takes(out[i])) out[kept++] = out[i];
    out.resize(kept);
    return status;
  }

 private:
  void update(std::uint32_t body) override { this->refit(body); }
  bool takes(const PrimitivePair& pair) const {
    switch (loss) {
      case Loss::nothing:
        return false;
      case Loss::everything:
        return true;
      case Loss::every_third:
        return experiments::loop::is_lost(
            pair.body_a == pair.body_b ? CandidateKind::edge_edge : CandidateKind::face_vertex,
            {pair.primitive_a, pair.primitive_b}, 3);
      case Loss::every_other_time:
        break;
    }
    return searches_ % 2 == 0;
  }
  std::uint64_t searches_ = 0;
};

template <class S, Loss loss>
class LosingSelf final : public Losing<S, loss>, public AnswersSelfPairs {
 public:
  using Losing<S, loss>::Losing;
};

template <class S>
using Sound = LosingSelf<S, Loss::nothing>;
template <class S>
using LosesAll = LosingSelf<S, Loss::everything>;
template <class S>
using LosesAThird = LosingSelf<S, Loss::every_third>;
template <class S>
using LosesAtTimes = LosingSelf<S, Loss::every_other_time>;
template <class S>
using OfTwoBodies = Losing<S, Loss::nothing>;

Info info(const char* id) {
  Info made;
  made.id = made.title = id;
  made.family = "oracle";
  made.citation = "no one";
  made.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16};
  return made;
}

}  // namespace loop_losses_test

const std::vector<StrategyEntry>& registry() {
  using namespace loop_losses_test;
  Info of_triangles = info("of_triangles"), of_few = info("of_few");
  of_triangles.primitives = {PrimitiveKind::polygons, PrimitiveKind::points};
  of_few.max_primitive_pairs = 10;
  static const std::vector<StrategyEntry> entries{make_entry<Sound>(info("sound")),
                                                  make_entry<LosesAll>(info("loses_all")),
                                                  make_entry<LosesAThird>(info("loses_a_third")),
                                                  make_entry<LosesAtTimes>(info("loses_at_times")),
                                                  make_entry<OfTwoBodies>(info("of_two_bodies")),
                                                  make_entry<Sound>(of_triangles),
                                                  make_entry<Sound>(of_few),
                                                  make_entry<Sound, Scalars::float_only>(info("only_float"))};
  return entries;
}
std::string_view about(std::string_view /*id*/) {
  return "Deliberately at fault.";
}

namespace experiments::loop {
namespace loop_losses_test {

SimulationOptions by(const std::string& scene, const std::string& strategy) {
  SimulationOptions options = small(scene, 100);
  options.strategy.id = strategy;
  return options;
}

class LossesInEveryScene : public testing::TestWithParam<std::string> {};

TEST_P(LossesInEveryScene, ArePenetrations) {
  EXPECT_EQ(simulate(by(GetParam(), "sound")).penetrations, 0u);
  const SimulationResult all = simulate(by(GetParam(), "loses_all"));
  EXPECT_GT(all.penetrations, 0u);
  EXPECT_GT(all.first_penetration, 0u);
  const SimulationResult third = simulate(by(GetParam(), "loses_a_third"));
  EXPECT_GT(third.penetrations, 0u);
  // The default finder, with the same fault, loses the same pairs.
  SimulationOptions options = by(GetParam(), "");
  options.lose_every = 3;
  const SimulationResult expected = simulate(options);
  EXPECT_EQ(hash_of_state(third.state), hash_of_state(expected.state));
  EXPECT_EQ(third.penetrations, expected.penetrations);
}

INSTANTIATE_TEST_SUITE_P(Scenes, LossesInEveryScene, testing::Values("sphere", "sheets", "stack"),
                         [](const auto& scene) { return scene.param; });

/// What is lost at one question and found at the next one is seen as a penetration, or as a pair that was
/// already too near when it was found. (Slow contacts outlive such losses: the next question comes in time.)
TEST(Losses, ThatComeAndGoAreSeen) {
  std::uint64_t last = 0;
  const SimulationResult result = simulate(by("sphere", "loses_at_times"), [&](const nlohmann::json& record) {
    last = record["step"].get<std::uint64_t>();
  });
  EXPECT_TRUE(result.penetrations > 0 || result.too_near);
  EXPECT_EQ(result.state.step, last);
  EXPECT_EQ(result.too_near, result.state.step < 100);
}

TEST(Losses, StrategiesThatDoNotSuitSayWhy) {
  const ContactMesh mesh(make_scene("sphere", 100, 1).mesh);
  const auto refusal = [&](const char* id) {
    try {
      check_contact_strategy({id}, mesh);
    } catch (const ConfigError& problem) {
      return std::string(problem.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal("sound"), "");
  EXPECT_NE(refusal("of_two_bodies").find("'of_two_bodies' cannot answer pairs within one body"),
            std::string::npos);
  EXPECT_NE(refusal("of_triangles").find("'of_triangles' does not take control nets"), std::string::npos);
  EXPECT_NE(refusal("of_few").find("'of_few' is offered at most 10 primitive pairs"), std::string::npos);
  EXPECT_NE(refusal("only_float").find("'only_float' has no double version"), std::string::npos);
}

}  // namespace loop_losses_test
}  // namespace experiments::loop
}  // namespace kbvh
