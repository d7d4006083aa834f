// The kinetic BoxTree while its parts are rebuilt as often as its parameters allow: in every frame, at the
// least degradation. The suite over all strategies varies one parameter at a time and rebuilds little.

#include <gtest/gtest.h>

#include "tests/conformance/check.hpp"

namespace kbvh::test::boxtree_rebuild_test {
namespace {

using Words = std::map<std::string, std::string>;
const Words eager{{"rebuild", "median"}, {"degradation", "1"}, {"check_every", "1"}};
const Words eager_sah{
    {"rebuild", "sah"}, {"degradation", "1.1"}, {"check_every", "2"}, {"leaf_boxes", "tight"}};

class EagerRebuilding : public testing::TestWithParam<std::string> {};

template <class S>
void expect_conforms(const std::string& scene_name) {
  const StrategyEntry& entry = find_strategy("kinetic_boxtree");
  for (const std::uint32_t l : {1u, 7u}) {
    const auto test = synthetic_scene<S>(scene_name, l);
    for (const Words& words : {eager, eager_sah})
      for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah})
        EXPECT_EQ(check(entry, test, l, words, {.method = method, .width = 2, .leaf_size = 2}), "")
            << scene_name << ", l = " << l << ", rebuild = " << words.at("rebuild");
  }
}

TEST_P(EagerRebuilding, Conforms) {
  expect_conforms<float>(GetParam());
  expect_conforms<double>(GetParam());
}
INSTANTIATE_TEST_SUITE_P(Scenes, EagerRebuilding, testing::ValuesIn(synthetic_scene_names()),
                         [](const auto& test) { return test.param; });
INSTANTIATE_TEST_SUITE_P(ChangingGeometry, EagerRebuilding, testing::ValuesIn(geometry_scene_names()),
                         [](const auto& test) { return test.param; });

TEST(Rebuilding, ChangesTheTopologyAndStartingOverUndoesIt) {
  const auto test = synthetic_scene<float>("soups", 7);
  Session<float> session(test.scene,
                         {&find_strategy("kinetic_boxtree"), eager, {.width = 2, .leaf_size = 1}});
  const auto topology = [&] { return session.strategy().audit_view(0)->topology; };
  const std::vector<double> frames = frame_times(test.scene, 7);
  PhaseTimes ignored;
  session.reset(frames.front());
  const Topology first = topology();
  for (const double t : frames)
    if (t > frames.front()) session.advance(t, ignored);
  EXPECT_FALSE(first == topology());
  const Counters once = session.strategy().counters();
  session.reset(frames.front());
  EXPECT_TRUE(first == topology());
  for (const double t : frames)
    if (t > frames.front()) session.advance(t, ignored);
  for (const Counter counter :
       {Counter::certificates_failed, Counter::certificates_made, Counter::values_written})
    EXPECT_EQ(once[counter], session.strategy().counters()[counter]) << name(counter);
}

TEST(Rebuilding, IsOffByDefault) {
  const auto test = synthetic_scene<float>("soups", 7);
  Session<float> session(test.scene, {&find_strategy("kinetic_boxtree"), {}, {.width = 2, .leaf_size = 1}});
  PhaseTimes ignored;
  session.reset(0);
  const Topology first = session.strategy().audit_view(0)->topology;
  session.advance(1, ignored);
  EXPECT_TRUE(first == session.strategy().audit_view(0)->topology);
}

}  // namespace
}  // namespace kbvh::test::boxtree_rebuild_test
