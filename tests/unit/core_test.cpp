// Topologies, builders, renumbering, oracle, audit, flight plans and playback, each on its own.

#include <gtest/gtest.h>

#include <unistd.h>
#include <cmath>
#include <fstream>
#include <limits>

#include "core/contract/registry.hpp"
#include "core/judge/audit.hpp"
#include "core/judge/oracle.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/median_order.hpp"
#include "core/topology/renumber.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::core_test {
namespace {

template <class S>
std::vector<S> positions_at(const FlightPlans<S>& plans, double t) {
  std::vector<S> positions(std::size_t(3) * plans.vertex_count());
  plans.evaluate(t, positions.data());
  return positions;
}

TEST(Builders, MakeSoundTopologiesOfEveryShape) {
  for (const std::string& name : synthetic_scene_names()) {
    const Scene<float> scene = synthetic_scene<float>(name).scene;
    for (const auto& body : scene.bodies) {
      const auto positions = positions_at(body.plans, 0.0);
      const auto boxes = primitive_boxes(body.primitives, positions.data());
      for (BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
        for (std::uint32_t width : {2u, 4u, 8u})
          for (std::uint32_t leaf = 1; leaf <= 16; ++leaf) {
            const Topology topology =
                build_topology<float>(boxes, {.method = method, .width = width, .leaf_size = leaf});
            EXPECT_EQ(check_topology(topology, body.primitives.count()), "")
                << name << " " << kbvh::name(method) << " width " << width << " leaf " << leaf;
            if (method == BuildMethod::median) {
              // All leaves but the last are full; with width^k full leaves the tree is perfect.
              const std::uint32_t primitives = body.primitives.count(),
                                  leaves = (primitives + leaf - 1) / leaf;
              std::uint32_t found = 0, full = 0, power = 1;
              for (const TopologyNode node : topology.nodes)
                if (node.is_leaf()) {
                  ++found;
                  full += node.count() == leaf ? 1 : 0;
                }
              while (power < leaves) power *= width;
              EXPECT_EQ(found, leaves) << name << " width " << width << " leaf " << leaf;
              EXPECT_GE(full + 1, leaves) << name << " width " << width << " leaf " << leaf;
              if (leaves > 0 && power == leaves) {
                EXPECT_TRUE(topology.perfect) << name << " width " << width << " leaf " << leaf;
              }
            }
          }
    }
  }
}

// A tree of other boxes gets the order that the builder gives to these; ties included, as some boxes are
// equal.
TEST(Builders, SortByMediansLikeANewTree) {
  Random random(7);
  for (const std::uint32_t count : {0U, 1U, 2U, 7U, 8U, 9U, 63U, 64U, 65U, 200U, 513U}) {
    std::vector<Box<float>> before(count), now(count);
    for (std::vector<Box<float>>* const boxes : {&before, &now})
      for (Box<float>& box : *boxes)
        for (int axis = 0; axis < 3; ++axis) {
          box.lower[axis] = float(random.below(12));
          box.upper[axis] = box.lower[axis] + float(random.below(3));
        }
    for (const std::uint32_t width : {2U, 4U, 8U})
      for (const std::uint32_t leaf : {1U, 3U, 8U}) {
        const BuilderConfig config{.method = BuildMethod::median, .width = width, .leaf_size = leaf};
        const Topology given = build_topology<float>(before, config);
        std::vector<BuildItem> items;
        for (std::uint32_t p = 0; p < count; ++p) items.push_back(build_item(now[p], p));
        sort_by_medians(given, items);
        Topology sorted = given;
        for (std::uint32_t i = 0; i < count; ++i) sorted.primitives[i] = items[i].primitive;
        EXPECT_EQ(sorted, build_topology<float>(now, config))
            << count << " boxes, width " << width << ", leaf " << leaf;
      }
  }
}

TEST(Builders, RefuseWhatIsNotAdmissible) {
  const std::vector<Box<float>> boxes(3);
  EXPECT_THROW(build_topology<float>(boxes, {.width = 3}), std::invalid_argument);
  EXPECT_THROW(build_topology<float>(boxes, {.leaf_size = 0}), std::invalid_argument);
  EXPECT_THROW(build_topology<float>(boxes, {.leaf_size = 17}), std::invalid_argument);
  EXPECT_THROW(build_method("best"), std::invalid_argument);
}

TEST(Topology, CheckFindsBrokenInvariants) {
  const auto test = synthetic_scene<float>("soups");
  const Primitives& primitives = test.scene.bodies[0].primitives;
  const auto positions = positions_at(test.scene.bodies[0].plans, 0.0);
  const Topology sound =
      build_topology<float>(primitive_boxes(primitives, positions.data()), {.leaf_size = 2});
  ASSERT_EQ(check_topology(sound, primitives.count()), "");
  Topology broken = sound;
  broken.primitives[3] = broken.primitives[4];
  EXPECT_NE(check_topology(broken, primitives.count()), "");
  broken = sound;
  broken.nodes[0] = TopologyNode::inner(1, 1);
  EXPECT_NE(check_topology(broken, primitives.count()), "");
  broken = sound;
  broken.parents.back() = 0;
  EXPECT_NE(check_topology(broken, primitives.count()), "");
  broken = sound;
  broken.nodes[1] = broken.nodes[2];
  EXPECT_NE(check_topology(broken, primitives.count()), "");
}

TEST(Oracle, SweepEqualsBruteForceEverywhere) {
  const auto compare = []<class S>(const Scene<S>& scene) {
    Playback<S> playback(scene);
    std::size_t pairs = 0;
    for (double t : frame_times(scene, 3)) {
      playback.seek(t);
      const auto brute = brute_force_pairs(scene, playback);
      EXPECT_EQ(brute, sweep_pairs(scene, playback)) << scene.name << " at " << t;
      pairs += brute.size();
    }
    return pairs;
  };
  std::size_t pairs = 0;
  for (const std::string& name : synthetic_scene_names()) {
    pairs += compare(synthetic_scene<float>(name).scene);
    pairs += compare(synthetic_scene<double>(name).scene);
  }
  for (const std::string& name : self_scene_names()) {
    EXPECT_EQ(has_self_pairs(synthetic_scene<float>(name).scene.pairs), true);
    pairs += compare(synthetic_scene<float>(name).scene);
    pairs += compare(synthetic_scene<double>(name).scene);
  }
  EXPECT_GT(pairs, 10000u) << "the scenes no longer collide";
}

TEST(Oracle, CacheOnDiskIsUsedAndDamageIsIgnored) {
  const auto test = synthetic_scene<float>("soups");
  const auto folder = std::filesystem::temp_directory_path() / ("kbvh-oracle-" + std::to_string(::getpid()));
  Playback<float> playback(test.scene);
  PairBuffer truth;
  { truth = Oracle<float>(test.scene, folder).pairs(playback); }
  ASSERT_FALSE(truth.empty());
  ASSERT_FALSE(std::filesystem::is_empty(folder));
  const auto file = std::filesystem::directory_iterator(folder)->path();
  const auto size = std::filesystem::file_size(file);
  const auto expect = [&](bool damaged) {
    Oracle<float> oracle(test.scene, folder);
    EXPECT_EQ(oracle.problem().empty(), !damaged) << oracle.problem();
    EXPECT_EQ(oracle.pairs(playback), truth);
  };  // finally writes a sound file
  expect(false);
  std::filesystem::resize_file(file, size / 2);
  expect(true);
  for (std::uintmax_t place = 0; place < size; place += 1 + size / 50) {
    std::fstream bytes(file, std::ios::binary | std::ios::in | std::ios::out);
    bytes.seekg(std::streamoff(place));
    const char other = char(bytes.get() ^ 1);
    bytes.seekp(std::streamoff(place));
    bytes.put(other);
    bytes.close();
    expect(true);
  }
  expect(false);
  std::filesystem::remove_all(folder);
  std::ofstream(folder) << "a file where the folder should be";
  Oracle<float> homeless(test.scene, folder);
  EXPECT_EQ(homeless.pairs(playback), truth);
  homeless.keep();
  EXPECT_NE(homeless.problem(), "");
  std::filesystem::remove_all(folder);
}

TEST(Renumber, KeepsGeometryAndOrdersMemory) {
  for (const std::string name :
       {"sheets", "polygons", "four_bodies_own_keyframes", "one_triangle_and_none"}) {
    const Scene<float> scene = synthetic_scene<float>(name).scene;
    const auto renumbered = renumber_in_leaf_order(scene, {.leaf_size = 4});
    validate(renumbered.scene);
    Playback<float> before(scene), after(renumbered.scene);
    for (double t : frame_times(scene, 2)) {
      before.seek(t);
      after.seek(t);
      auto pairs = brute_force_pairs(renumbered.scene, after);
      for (PrimitivePair& pair : pairs) {
        pair.primitive_a = renumbered.old_primitive[pair.body_a][pair.primitive_a];
        pair.primitive_b = renumbered.old_primitive[pair.body_b][pair.primitive_b];
      }
      std::sort(pairs.begin(), pairs.end());
      EXPECT_EQ(pairs, brute_force_pairs(scene, before)) << name << " at " << t;
    }
  }
}

TEST(FlightPlans, RestBeforeAndAfterTheClip) {
  const FlightPlans<float> plans(1, {1.0, 3.0}, {0, 0, 0, 4, 8, -2});
  EXPECT_EQ(positions_at(plans, 0.0), (std::vector<float>{0, 0, 0}));
  EXPECT_EQ(positions_at(plans, 1.5), (std::vector<float>{1, 2, -0.5f}));
  EXPECT_EQ(positions_at(plans, 9.0), (std::vector<float>{4, 8, -2}));
  EXPECT_EQ(plans.segment_at(2.0), 0u);
  EXPECT_EQ(plans.segment_at(3.0), 1u);
}

TEST(FlightPlans, RefuseBadInputNamingIt) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto message = [](auto make) -> std::string {
    try {
      make();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "nothing thrown";
  };
  EXPECT_NE(message([&] {
              FlightPlans<float>(1, {0.0}, {0, nan, 0});
            }).find("vertex 0, axis y"),
            std::string::npos);
  EXPECT_NE(message([&] {
              FlightPlans<float>(1, {0.0, 0.0}, {0, 0, 0, 0, 0, 0});
            }).find("increase"),
            std::string::npos);
  EXPECT_NE(message([&] { FlightPlans<float>(2, {0.0}, {0, 0, 0}); }).find("expected 6"), std::string::npos);
  EXPECT_NE(message([&] {
              FlightPlans<float>(1, {0.0}, {0, 2e30f, 0});
            }).find("admissible"),
            std::string::npos);
  EXPECT_NE(message([&] { FlightPlans<float>(0, {}, {}); }).find("keyframe"), std::string::npos);
}

TEST(FlightPlans, HoldNoNegativeZero) {
  const FlightPlans<float> plans(1, {0.0, 1.0}, {-0.0f, 1, -1, -0.0f, -1, 1});
  for (double t : {0.0, 0.25, 0.5, 1.0, 2.0})
    for (float x : positions_at(plans, t)) EXPECT_FALSE(x == 0 && std::signbit(x)) << "at " << t;
}

TEST(FlightPlans, SeeATranslationWhereStepsDifferByRoundingOnly) {
  // Two vertices that move: by (1, 0, -0.5); one of them by an ulp more than the other; not at all; by a step
  // that no float holds; by different steps.
  const float less = std::nextafter(3.0f, 0.0f), tiny = 0x1p-30f;
  FlightPlans<float> plans(2, {0, 1, 2, 3, 4, 5}, {0,    1, 2,   2,        1, 2,    //
                                                   1,    1, 1.5, 3,        1, 1.5,  //
                                                   1,    1, 1.5, less,     1, 1.5,  //
                                                   1,    1, 1.5, less,     1, 1.5,  //
                                                   tiny, 1, 1.5, less - 1, 1, 1.5,  //
                                                   1,    1, 1.5, 5,        1, 1.5});
  const std::array<float, 3> whole{1, 0, -0.5f}, none{0, 0, 0};
  const auto first = plans.translation(0), almost = plans.translation(1), rest = plans.translation(2.5),
             rounded = plans.translation(3);
  ASSERT_TRUE(first && almost && rest && rounded);
  EXPECT_TRUE(first->exact);
  EXPECT_EQ(first->lower, whole);
  EXPECT_EQ(first->upper, whole);
  EXPECT_FALSE(almost->exact);
  // A step between the two that serves both, an epsilon of each one's own coordinate away.
  EXPECT_LE(std::abs(almost->lower[0]), 0x1p-23f);
  EXPECT_EQ(almost->lower, almost->upper);
  EXPECT_TRUE(rest->exact);
  EXPECT_EQ(rest->lower, none);
  EXPECT_FALSE(rounded->exact);
  EXPECT_EQ(rounded->lower[0], -1);
  EXPECT_EQ(plans.translation(4), std::nullopt);
  EXPECT_EQ(plans.translation(-1), std::nullopt) << "before the first keyframe there is no segment";
  EXPECT_EQ(plans.translation(5), std::nullopt) << "nor after the last one";
  const float at[] = {0, 1, 2};
  plans.change(0, {.vertex = 0, .times = {}, .positions = {}, .velocity = {1, 0, -0.5f}}, at);
  EXPECT_EQ(plans.translation(0), std::nullopt) << "a plan of its own";
}

// The rounding of a far vertex does not affect the others.
TEST(FlightPlans, AFarVertexHidesNoMotionOfTheOthers) {
  const float far = 1e5f;
  for (const float bend : {0.0f, 0.01f}) {
    const FlightPlans<float> plans(3, {0, 1},
                                   {far, 0, 0, 1, 2, 0, 2, 2, 0,  //
                                    far, 0, 0, 1, 2, 0 + bend, 2, 2, 0});
    EXPECT_EQ(plans.translation(0).has_value(), bend == 0);
    const FlightPlans<float> along(2, {0, 1}, {far, 0, 0, 1, 0, 0, far + 0.5f, 0, 0, 1.5f + 5 * bend, 0, 0});
    EXPECT_EQ(along.translation(0).has_value(), bend == 0) << "the step of the far one is known up to 0.012";
  }
}

TEST(Playback, LazyPositionsEqualEagerOnes) {
  const Scene<double> scene = synthetic_scene<double>("soups").scene;
  Playback<double> lazy(scene), eager(scene);
  Random random(5);
  for (double t : frame_times(scene, 4)) {
    lazy.seek(t);
    eager.seek(t);
    eager.evaluate_all();
    for (int i = 0; i < 50; ++i) {
      const std::uint32_t v = random.below(scene.bodies[0].plans.vertex_count());
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_EQ(lazy.position(0, v)[axis], eager.positions(0)[3 * v + std::uint32_t(axis)]);
    }
  }
  EXPECT_GT(lazy.fetched(), 0u);
  EXPECT_EQ(eager.fetched(), 0u);
}

TEST(Playback, PlanChangesAreAllOrNothing) {
  const Scene<float> scene = synthetic_scene<float>("soups").scene;
  Playback<float> playback(scene);
  playback.seek(0.3);
  PlanChange<float> good, bad;
  good.vertex = 1;
  good.velocity[0] = 2;
  bad.vertex = 2;
  bad.velocity[1] = std::numeric_limits<float>::infinity();
  const std::vector<PlanChange<float>> changes{good, bad};
  EXPECT_THROW(playback.change_plans(0.3, changes), std::invalid_argument);
  EXPECT_FALSE(playback.plans(0).has_own_plans());
  EXPECT_THROW(playback.change_plans(0.2, {&good, 1}), std::invalid_argument) << "the past";
  playback.change_plans(0.3, {&good, 1});
  const float start = playback.position(0, 1)[0];
  playback.seek(1.3);
  EXPECT_FLOAT_EQ(playback.position(0, 1)[0], start + 2);
}

TEST(Scene, FrameTimesOverlayTheBodies) {
  const Scene<float> scene = synthetic_scene<float>("four_bodies_own_keyframes").scene;
  const auto keyframes = overlaid_keyframes(scene);
  EXPECT_EQ(keyframes.front(), -0.5);
  EXPECT_EQ(keyframes.back(), 2.0);
  const auto frames = frame_times(scene, 10);
  EXPECT_EQ(frames.size(), (keyframes.size() - 1) * 10 + 1);
  EXPECT_TRUE(std::is_sorted(frames.begin(), frames.end()));
  EXPECT_THROW(frame_times(scene, 0), std::invalid_argument);
  for (const std::size_t most :
       {std::size_t(0), std::size_t(1), std::size_t(17), frames.size() - 1, frames.size()})
    EXPECT_EQ(frame_times(scene, 10, most),
              std::vector<double>(frames.begin(), frames.begin() + std::ptrdiff_t(most)));
  EXPECT_EQ(frame_times(scene, 4000000000u, 2).size(), 2u) << "only so many are made";
}

TEST(Scene, HashSeesEveryNumber) {
  auto test = synthetic_scene<float>("soups");
  const std::uint64_t before = hash(test.scene);
  EXPECT_EQ(hash(synthetic_scene<float>("soups").scene), before);
  EXPECT_NE(hash(synthetic_scene<double>("soups").scene), before);
  test.scene.bodies[0].primitives.vertices[5] ^= 1;
  EXPECT_NE(hash(test.scene), before);
}

TEST(Audit, MeasuresProtrusionAndLooseness) {
  const auto test = synthetic_scene<double>("soups");
  const auto& body = test.scene.bodies[0];
  const auto positions = positions_at(body.plans, 0.0);
  AuditView view;
  view.topology =
      build_topology<double>(primitive_boxes(body.primitives, positions.data()), {.leaf_size = 4});
  view.boxes = tight_boxes(view.topology, body.primitives, positions.data());
  Audit clean = audit(view, body.primitives, positions.data());
  EXPECT_EQ(clean.invalid, 0u);
  EXPECT_EQ(clean.not_tight, 0u);
  EXPECT_EQ(clean.protrusion, 0);
  EXPECT_EQ(clean.looseness(), 0);
  view.boxes[2].upper[1] -= 0.125;
  view.boxes[3].lower[0] -= 0.5;
  const Audit found = audit(view, body.primitives, positions.data());
  EXPECT_EQ(found.invalid, 1u);
  EXPECT_EQ(found.not_tight, 2u);
  EXPECT_DOUBLE_EQ(found.protrusion, 0.125);
  EXPECT_NE(found.first_fault.find("node 2"), std::string::npos);
  view.stale.assign(view.topology.size(), 0);
  view.stale[2] = 1;
  EXPECT_EQ(audit(view, body.primitives, positions.data()).invalid, 0u);
}

}  // namespace
}  // namespace kbvh::test::core_test
