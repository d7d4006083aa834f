// The façade gives the library's answers, reports errors in its input, and walks from event to event like the
// theory checks.

#include "core/facade/world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <utility>

#include "core/contract/registry.hpp"
#include "core/judge/audit.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "tests/support/ray_sets.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/support/world_of.hpp"

namespace kbvh::test {
namespace {

template <class S>
void expect_the_same(const StrategyEntry& entry, const char* name,
                     const std::map<std::string, std::string>& params = {}) {
  SCOPED_TRACE(entry.info.id + " on " + name);
  const TestScene<S> test = synthetic_scene<S>(name, 3);
  if (!unsuitable_bodies(entry.info, test.scene).empty() || entry.factory<S>() == nullptr) return;
  const std::vector<double> frames = frame_times(test.scene, 3);
  Session<S> session(test.scene, {&entry, params, entry.info.topology.preferred});
  World world = world_of(test.scene);
  world.start(entry.info.id, params, frames[0]);
  session.reset(frames[0]);
  PairBuffer expected;
  std::vector<WorldPair> pairs;
  PhaseTimes times;
  WorldHierarchy hierarchy;
  for (const double t : frames) {
    if (t > frames[0]) {
      session.advance(t, times);
      world.advance(t);
    }
    session.query(expected, times);
    world.pairs(pairs);
    ASSERT_EQ(pairs.size(), expected.size());
    for (std::size_t i = 0; i < pairs.size(); ++i)
      ASSERT_EQ(pairs[i], (WorldPair{expected[i].body_a, expected[i].primitive_a, expected[i].body_b,
                                     expected[i].primitive_b}));
    for (std::uint32_t body = 0; body < test.scene.bodies.size(); ++body) {
      const auto view = session.strategy().audit_view(body);
      ASSERT_EQ(world.hierarchy(body, hierarchy), view.has_value());
      if (!view) continue;
      ASSERT_EQ(hierarchy.nodes.size(), view->topology.size());
      ASSERT_EQ(view->boxes.size(), view->topology.size());
      const std::vector<Box<double>> tight =
          tight_boxes(view->topology, test.scene.bodies[body].primitives, session.playback().positions(body));
      for (std::size_t node = 0; node < view->boxes.size(); ++node)
        for (int axis = 0; axis < 3; ++axis) {
          ASSERT_EQ(hierarchy.nodes[node].lower[axis], view->boxes[node].lower[axis]);
          ASSERT_EQ(hierarchy.nodes[node].upper[axis], view->boxes[node].upper[axis]);
          if (!view->volumes) continue;
          ASSERT_LE(hierarchy.nodes[node].lower[axis], tight[node].lower[axis]);
          ASSERT_GE(hierarchy.nodes[node].upper[axis], tight[node].upper[axis]);
        }
    }
  }
  const Counters counters = session.strategy().counters();
  for (const WorldCounter& counter : world.counters())
    for (std::size_t c = 0; c < counters.values.size(); ++c)
      if (counter.name == kbvh::name(Counter(c)) && Counter(c) != Counter::bytes &&
          Counter(c) != Counter::positions_fetched) {
        EXPECT_EQ(counter.value, counters.values[c]) << counter.name;
      }
}

TEST(World, AnswersWhatTheLibraryAnswers) {
  for (const StrategyEntry& entry : registry())
    for (const char* scene : {"soups", "self_rolled_cloth"}) {
      expect_the_same<float>(entry, scene);
      expect_the_same<double>(entry, scene);
    }
}

// For volumes of every kind, the hierarchy shows the boxes around them.
TEST(World, ShowsBoxesAroundVolumes) {
  for (const char* id : {"bottom_up_volumes", "kinetic_kdop"}) {
    const StrategyEntry& entry = find_strategy(id);
    const auto is_volume = [](const Parameter& parameter) { return parameter.name == "volume"; };
    const auto& parameters = entry.info.parameters;
    const auto volume = std::find_if(parameters.begin(), parameters.end(), is_volume);
    ASSERT_NE(volume, parameters.end()) << id;
    ASSERT_GE(volume->allowed.size(), 3u) << id;
    for (const std::string& kind : volume->allowed) {
      SCOPED_TRACE(kind);
      expect_the_same<float>(entry, "soups", {{"volume", kind}});
      expect_the_same<double>(entry, "soups", {{"volume", kind}});
    }
  }
}

/// Returns whether the pairs that began and ended add up to the world's pairs, after each of some frames and
/// after a reset.
void expect_changes_add_up(const std::string& id, const TestScene<float>& test) {
  SCOPED_TRACE(id);
  World world = world_of(test.scene);
  const std::vector<double> frames = frame_times(test.scene, 7);
  world.start(id, {}, frames[0]);
  std::vector<WorldPair> held, begun, ended, pairs;
  const auto take = [&] {
    world.changes(begun, ended);
    for (const WorldPair& pair : ended) {
      const auto found = std::find(held.begin(), held.end(), pair);
      ASSERT_NE(found, held.end());
      held.erase(found);
    }
    for (const WorldPair& pair : begun) {
      ASSERT_EQ(std::find(held.begin(), held.end(), pair), held.end());
      held.push_back(pair);
    }
    world.pairs(pairs);
    ASSERT_TRUE(std::is_permutation(held.begin(), held.end(), pairs.begin(), pairs.end()));
  };
  std::size_t changed = 0;
  for (int round = 0; round < 2; ++round) {
    if (round == 1) world.reset(frames[0]);
    held.clear();  // a reset begins all pairs again
    for (std::size_t f = 0; f < frames.size(); f += 1 + f % 3) {
      if (f > 0) world.advance(frames[f]);
      take();
      if (f > 0) changed += begun.size() + ended.size();
    }
  }
  EXPECT_GT(changed, 20u);
  EXPECT_THROW(world.changes(begun, begun), std::invalid_argument);
}

TEST(World, TellsWhatBeganAndEnded) {
  const auto test = synthetic_scene<float>("soups", 7);
  for (const char* const id :
       {"bottom_up", "interval_join", "interval_join_ahead", "kinetic_separation_list", "auto"})
    expect_changes_add_up(id, test);
  World world;
  std::vector<WorldPair> begun, ended;
  EXPECT_THROW(world.changes(begun, ended), std::logic_error) << "not started";
}

const std::vector<std::uint32_t> triangle{0, 1, 2};

template <class S>
void expect_the_same_hits(const char* id) {
  SCOPED_TRACE(id);
  const StrategyEntry& entry = find_strategy(id);
  const TestScene<S> test = synthetic_scene<S>("soups", 3);
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  World world = world_of(test.scene);
  const std::vector<double> frames = frame_times(test.scene, 3);
  world.start(id, {}, frames[0]);
  session.reset(frames[0]);
  PhaseTimes times;
  std::size_t hits = 0;
  for (const double t : frames) {
    if (t > frames[0]) {
      session.advance(t, times);
      world.advance(t);
    }
    session.playback().evaluate_all();
    const std::vector<Ray<S>> rays = rays_at(test.scene, session.playback(), 5, 1);
    std::vector<WorldRay> plain;
    for (const Ray<S>& ray : rays) {
      WorldRay& made = plain.emplace_back();
      std::copy_n(ray.origin, 3, made.origin);
      std::copy_n(ray.direction, 3, made.direction);
      made.length = double(ray.length);
    }
    for (const WorldRayQuery query : {WorldRayQuery::closest, WorldRayQuery::any}) {
      std::vector<RayHit> expected(rays.size());
      std::vector<WorldHit> found(1000);  // old content, to be replaced
      session.probe(RayProbes<S>{RayQuery(query), rays, std::span<RayHit>(expected)}, times);
      world.hits(query, plain, found);
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t i = 0; i < found.size(); ++i) {
        ASSERT_EQ(found[i], (WorldHit{expected[i].body, expected[i].primitive, expected[i].parameter})) << i;
        hits += expected[i] ? 1 : 0;
      }
    }
  }
  EXPECT_GT(hits, 50U);
}

TEST(World, RaysMeetWhatTheLibrarySays) {
  for (const char* id : {"bottom_up", "kinetic_aabb", "lbvh"}) {
    expect_the_same_hits<float>(id);
    expect_the_same_hits<double>(id);
  }
  World world;
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 0, 1, 0};
  world.add_body("triangle", {triangle}, std::span<const float>(positions));
  std::vector<WorldHit> hits{{7, 7, 7}};
  EXPECT_THROW(world.hits(WorldRayQuery::any, {}, hits), std::logic_error);
  world.start("sweep");
  EXPECT_THROW(world.hits(WorldRayQuery::any, {}, hits), std::logic_error);
  World other;
  other.add_body("triangle", {triangle}, std::span<const float>(positions));
  other.start("bottom_up");
  const std::vector<WorldRay> wrong{{{0.25, 0.25, 1}, {0, 0, -1}}, {{0, 0, 1}, {0, 0, -1}, -2}};
  EXPECT_THROW(other.hits(WorldRayQuery::any, wrong, hits), std::invalid_argument);
  EXPECT_EQ(hits[0].body, 7U);
  const std::vector<WorldRay> right{{{0.25, 0.25, 1}, {0, 0, -1}}, {{0.25, 0.25, 1}, {0, 0, 1}}};
  other.hits(WorldRayQuery::closest, right, hits);
  EXPECT_EQ(hits, (std::vector<WorldHit>{{0, 0, 1}, {}}));
}

TEST(World, PositionsFrameByFrame) {
  for (const bool padded : {false, true}) {
    World world;
    const auto table = world.add_body("table", {triangle}, std::vector<double>{0}, triangle_at(0));
    const auto leaf = world.add_body("leaf", {triangle}, triangle_at(1));
    world.start("bottom_up");
    std::vector<WorldPair> pairs;
    world.pairs(pairs);
    EXPECT_TRUE(pairs.empty());
    std::vector<float> array;
    for (const float z : {0.5F, 0.0F, -0.5F}) {
      array = triangle_at(z, padded);
      world.set_positions(leaf, array);
      world.advance(1 - double(z));
      world.pairs(pairs);
      EXPECT_EQ(pairs.size(), z == 0 ? 1u : 0u) << z;
    }
    std::vector<double> now;
    world.positions(leaf, now);
    EXPECT_EQ(now, (std::vector<double>{0, 0, -0.5, 1, 0, -0.5, 0, 1, -0.5}));
    EXPECT_THROW(world.set_positions(table, array), std::logic_error);
    array[4] = std::nanf("");
    EXPECT_THROW(world.set_positions(leaf, array), std::invalid_argument);
    EXPECT_THROW(world.set_positions(leaf, std::vector<float>(8)), std::invalid_argument);
  }
  World world;
  world.add_body("a", {triangle}, triangle_at(1));
  world.add_body("b", {triangle}, triangle_at(0));
  EXPECT_THROW(world.start("interval_join"), std::invalid_argument);
  world.start("rebuild");  // what does not suit one strategy may suit another
}

// Lists of moved vertices reach the strategy, for the next frame only; a wrong one changes nothing.
TEST(World, PositionsOfWhichFewMoved) {
  constexpr std::uint32_t side = 64;
  std::vector<float> sheet;
  std::vector<std::uint32_t> corners;
  for (std::uint32_t j = 0; j < side; ++j)
    for (std::uint32_t i = 0; i < side; ++i) {
      sheet.insert(sheet.end(), {float(i), float(j), 0});
      const std::uint32_t v = j * side + i;
      if (i + 1 < side && j + 1 < side)
        corners.insert(corners.end(), {v, v + 1, v + side, v + side, v + 1, v + side + 1});
    }
  World world;
  const std::uint32_t body = world.add_body("sheet", {corners}, sheet);
  world.add_body("lid", {triangle}, std::vector<double>{0},
                 std::vector<float>{0, 0, 1, float(side), 0, 1, 0, float(side), 1});
  world.start("dirty_refit");
  std::vector<WorldPair> pairs;
  std::uint64_t before = 0;
  const auto visited = [&](double t) {
    world.advance(t);
    world.pairs(pairs);
    std::uint64_t all = 0;
    for (const WorldCounter& counter : world.counters())
      if (counter.name == name(Counter::nodes_visited)) all = counter.value;
    return all - std::exchange(before, all);
  };
  const std::uint64_t whole = visited(0.5);
  const std::vector<std::uint32_t> moved{30}, none, wrong{30, side * side};
  sheet[3 * 30 + 2] = 2;
  world.set_positions(body, std::span<const float>(sheet), moved);
  const std::uint64_t one = visited(1);
  EXPECT_GT(one, 0u);
  EXPECT_LT(one, whole);
  EXPECT_GT(pairs.size(), 0u);
  world.set_positions(body, std::span<const float>(sheet), none);
  EXPECT_EQ(visited(2), 0u);
  EXPECT_GT(pairs.size(), 0u);
  // Without a list, any vertex may have moved, whatever an earlier list for the frame said.
  sheet[3 * 30 + 2] = 0;
  world.set_positions(body, std::span<const float>(sheet), none);
  world.set_positions(body, std::span<const float>(sheet));
  EXPECT_EQ(visited(3), whole);
  EXPECT_EQ(pairs.size(), 0u);
  EXPECT_THROW(world.set_positions(body, std::span<const float>(sheet), wrong), std::invalid_argument);
}

TEST(World, ContactsFrameByFrame) {
  World world(Precision::float64);
  world.add_body("table", {triangle}, std::vector<double>{0}, triangle_at(0));
  const auto leaf = world.add_body("leaf", {triangle}, triangle_at(1));
  world.start("bottom_up");
  std::vector<WorldContact> contacts;
  std::vector<std::size_t> found;
  float z = 1;
  for (const double t : {1.0, 2.0, 3.0}) {
    z -= 0.75F;
    world.set_positions(leaf, triangle_at(5));  // the last positions before the world moves count
    world.set_positions(leaf, triangle_at(-5));
    world.set_positions(leaf, triangle_at(z));
    world.contacts(t, contacts);
    found.push_back(contacts.size());
    for (const WorldContact& contact : contacts) {
      EXPECT_LE(contact.begin, 1 + 1 / 3.0);
      EXPECT_GE(contact.end, 1 + 1 / 3.0);
    }
  }
  EXPECT_EQ(found[0], 0u);
  EXPECT_GT(found[1], 0u);  // from 0.25 to -0.5
  EXPECT_EQ(found[2], 0u);
}

// Contacts after a change of plans: the leaf turns back before it has come down.
TEST(World, ContactsAfterChangesOfPlans) {
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts || !entry.info.can.plan_changes || entry.factory<float>() == nullptr)
      continue;
    for (const bool turns : {false, true}) {
      World world;
      world.add_body("table", {triangle}, std::vector<double>{0}, triangle_at(0));
      std::vector<float> keyframes = triangle_at(1), end = triangle_at(-1);
      keyframes.insert(keyframes.end(), end.begin(), end.end());
      const auto leaf = world.add_body("leaf", {triangle}, std::vector<double>{0, 2}, keyframes);
      world.start(entry.info.id);
      std::vector<WorldContact> contacts;
      world.contacts(0.5, contacts);
      EXPECT_TRUE(contacts.empty()) << entry.info.id;
      if (turns) {
        std::vector<WorldPlan> plans(3);
        for (std::uint32_t v = 0; v < 3; ++v) plans[v] = {.body = leaf, .vertex = v, .velocity = {0, 0, 1}};
        world.change_plans(plans);
      }
      world.contacts(2, contacts);
      EXPECT_EQ(contacts.empty(), turns) << entry.info.id;
    }
  }
}

TEST(World, GeometryComesAndGoes) {
  World world;
  const auto table = world.add_body("table", {triangle}, std::vector<double>{0, 1},
                                    std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0});
  world.add_body("leaf", {triangle}, std::vector<double>{0}, triangle_at(1));
  world.start("kinetic_aabb");
  std::vector<WorldPair> pairs;
  world.pairs(pairs);
  EXPECT_TRUE(pairs.empty());
  world.advance(0.5);
  WorldEdit edit;
  for (const double z : {0.5, 1.5, 1.5}) edit.vertices.push_back({table, {0.2 * z, 0.3, z}, {0, 0, 0}});
  edit.vertices[2].position[0] = 0.1;
  edit.primitives.push_back({table, {3, 4, 5}});
  world.change_geometry(edit);
  world.pairs(pairs);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0], (WorldPair{table, 1, 1, 0}));
  WorldEdit removal;
  removal.removed_primitives.push_back({table, 1});
  world.advance(0.75);
  world.change_geometry(removal);
  world.pairs(pairs);
  EXPECT_TRUE(pairs.empty());
}

TEST(World, SaysWhatIsWrong) {
  const auto said = [](auto&& call) -> std::string {
    try {
      call();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "nothing";
  };
  World world;
  std::vector<WorldPair> pairs;
  EXPECT_NE(said([&] { world.pairs(pairs); }).find("has not started"), std::string::npos);
  EXPECT_NE(said([&] {
              world.add_body("x", {std::vector<std::uint32_t>{0, 1}}, std::vector<double>{0}, triangle_at(0));
            }).find("2 indices"),
            std::string::npos);
  EXPECT_NE(
      said([&] {
        world.add_body("x", {std::vector<std::uint32_t>{0, 1, 7}}, std::vector<double>{0}, triangle_at(0));
      }).find("7"),
      std::string::npos);
  EXPECT_NE(said([&] {
              world.add_body("x", {triangle}, std::vector<double>{0, 1}, triangle_at(0));
            }).find("9 coordinates for 2 keyframes"),
            std::string::npos);
  world.add_body("a", {triangle}, std::vector<double>{0}, triangle_at(0));
  world.add_body("b", {triangle}, std::vector<double>{0}, triangle_at(1));
  EXPECT_NE(said([&] { world.add_pair(0, 2); }).find("no body 2"), std::string::npos);
  EXPECT_NE(said([&] { world.start("bottom_up", {{"threads", "x"}}); }).find("'threads'"), std::string::npos);
  EXPECT_NE(said([&] { world.start("nobody"); }).find("'nobody'"), std::string::npos);
  EXPECT_NE(said([&] {
              world.start("bottom_up", {}, 0, {{"width", "3"}});
            }).find("width 3"),
            std::string::npos);
  EXPECT_NE(said([&] {
              world.start("bottom_up", {}, 0, {{"depth", "3"}});
            }).find("'depth'"),
            std::string::npos);
  world.start("bottom_up");
  EXPECT_NE(said([&] { world.add_pair(0, 1); }).find("has started"), std::string::npos);
  EXPECT_NE(said([&] { world.advance(-1); }).find("back to"), std::string::npos);
  WorldStep step;
  EXPECT_FALSE(world.has_events());
  EXPECT_NE(said([&] { world.step_event(1, step); }).find("events"), std::string::npos);
  std::vector<WorldSpan> spans;
  EXPECT_NE(said([&] { world.spans(1, spans); }).find("spans"), std::string::npos);
  EXPECT_EQ(world.time(), 0);
}

// The walk from event to event shows what `kbvh theory` proves: the same changes of bounds, in the same
// order, at the same exact times.
template <class S>
void expect_the_same_log(const char* name) {
  const TestScene<S> test = synthetic_scene<S>(name, 3);
  const StrategyEntry& entry = find_strategy("kinetic_aabb");
  theory::Play play;
  play.builder = entry.info.topology.preferred;
  play.frames_per_keyframe = 3;
  const auto log = theory::record_strategy<S>(entry, test.scene, {}, play).log();
  const std::vector<double> frames = frame_times(test.scene, 3);
  World world = world_of(test.scene);
  world.start("kinetic_aabb", {}, frames[0]);
  WorldStep step;
  std::vector<WorldEvent> queue;
  std::size_t at = 0, events = 0;
  for (const double t : frames) {
    for (;;) {
      world.scheduled_events(queue);
      if (!world.step_event(t, step)) break;
      ASSERT_EQ(step.event, queue.front());
      ++events;
      for (const WorldBoundChange& change : step.touched) {
        ASSERT_LT(at, log.size());
        const theory::Notice<S>& notice = log[at++];
        ASSERT_EQ(change, (WorldBoundChange{notice.body, notice.node, notice.side, notice.old_vertex,
                                            notice.new_vertex}));
        ASSERT_EQ(step.event.winner_piece.t0, notice.crossing.winner.t0);
        ASSERT_EQ(step.event.winner_piece.x0, double(notice.crossing.winner.x0));
        ASSERT_EQ(step.event.loser_piece.x1, double(notice.crossing.loser.x1));
        ASSERT_EQ(notice.event + 1, events);
      }
    }
    world.advance(t);
  }
  EXPECT_EQ(at, log.size());
  EXPECT_GT(events, 20u);
  EXPECT_TRUE(std::isinf(world.next_event_time()));
}

TEST(World, TheWalkFromEventToEventIsTheLogOfTheTheoryChecks) {
  for (const char* name : {"soups", "integer_ties"}) {
    expect_the_same_log<float>(name);
    expect_the_same_log<double>(name);
  }
}

// Callers of the façade see no template of the library.
TEST(World, ItsHeaderIncludesNoOtherHeaderOfTheLibrary) {
  std::ifstream header(KBVH_SOURCE_DIR "/core/facade/world.hpp");
  ASSERT_TRUE(header.good());
  for (std::string line; std::getline(header, line);) {
    EXPECT_EQ(line.find("#include \""), std::string::npos) << line;
    EXPECT_FALSE(line.starts_with("template")) << line;
  }
}

}  // namespace
}  // namespace kbvh::test
