// The façade with a radius: candidates of elements by strategies, against all pairs of boxes that rationals
// have grown, for positions handed in and for known motion; positions are those of vertices, not of corners.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <numeric>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/facade/world.hpp"
#include "core/motion/flight_plans.hpp"
#include "tests/unit/broad_phase_oracle.hpp"

namespace kbvh::test::world_radius_test {
namespace {

using broad_phase::Mesh;
using Ids = std::vector<std::uint32_t>;

template <class S>
class WorldRadius : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(WorldRadius, Scalars);

Ids counted_by(std::uint32_t step, std::size_t last) {
  Ids ids;
  for (std::size_t i = 0; i <= last; ++i) ids.push_back(std::uint32_t(step * i));
  return ids;
}

/// Adds the vertices and edges of a mesh to a world that has its faces, and asks for pairs of vertices and
/// faces, and of edges.
template <class S>
void add_elements(World& world, const Mesh<S>& mesh, double radius) {
  const Ids edges(mesh.edges.begin(), mesh.edges.end());
  Ids vertices(mesh.vertex_count());
  std::iota(vertices.begin(), vertices.end(), 0u);
  const Ids of_vertices = counted_by(1, vertices.size()), of_edges = counted_by(2, edges.size() / 2);
  EXPECT_EQ(world.add_body_over(0, "vertices", {vertices, of_vertices}), 1u);
  EXPECT_EQ(world.add_body_over(0, "edges", {edges, of_edges}), 2u);
  world.add_pair(0, 1);
  world.add_pair(2, 2);
  world.set_radius(radius);
}

/// Makes a world whose positions are handed in.
template <class S>
World handed_in(const Mesh<S>& mesh, double radius) {
  World world(sizeof(S) == 4 ? Precision::float32 : Precision::float64);
  const Ids faces(mesh.faces.begin(), mesh.faces.end());
  world.add_body("faces", {faces}, std::span<const S>(mesh.v0));
  add_elements(world, mesh, radius);
  return world;
}

/// Returns how the pairs of a world differ from all pairs of grown boxes; empty if they do not. Adds their
/// number to `found`.
template <class S>
std::string wrong_pairs(World& world, const Mesh<S>& mesh, const Elements& elements, S radius,
                        std::size_t& found) {
  std::vector<WorldPair> pairs, truth;
  world.pairs(pairs);
  found += pairs.size();
  broad_phase::Pairs of_kind[2];
  for (const WorldPair& pair : pairs)
    if (!of_kind[pair.body_a == 2 ? 1 : 0].insert({pair.primitive_a, pair.primitive_b}).second)
      return "a pair twice";
  const std::vector<Box<S>> boxes = broad_phase::vertex_boxes(mesh, radius);
  if (of_kind[0] != broad_phase::brute_force(elements, CandidateKind::face_vertex, boxes))
    return "wrong pairs of faces and vertices";
  if (of_kind[1] != broad_phase::brute_force(elements, CandidateKind::edge_edge, boxes))
    return "wrong pairs of edges";
  world.true_pairs(truth);
  return truth.size() == pairs.size() ? "" : "other true pairs";
}
template <class S>
std::string wrong_pairs(World& world, const Mesh<S>& mesh, S radius, std::size_t& found) {
  return wrong_pairs(world, mesh, mesh.elements(), radius, found);
}

template <class S>
void expect_positions(World& world, const std::vector<S>& expected) {
  for (std::uint32_t body = 0; body < 3; ++body) {
    std::vector<double> now;
    world.positions(body, now);
    EXPECT_TRUE(std::equal(now.begin(), now.end(), expected.begin(), expected.end())) << body;
    const WorldPositions lying = world.current_positions(body);
    ASSERT_EQ(std::size_t(3) * lying.vertices, expected.size());
    const S* const numbers = static_cast<const S*>(lying.data);
    EXPECT_TRUE(std::equal(numbers, numbers + expected.size(), expected.begin())) << body;
  }
}

TYPED_TEST(WorldRadius, FindsCandidatesOfPositionsThatAreHandedIn) {
  using S = TypeParam;
  const S radius = S(0.1);
  for (const char* const id : {"bottom_up", "dirty_refit", "lbvh", "sweep"}) {
    Mesh<S> mesh = broad_phase::crumpled<S>(9, 1);
    World world = handed_in(mesh, double(radius));
    world.start(id);
    std::size_t found = 0;
    EXPECT_EQ(wrong_pairs(world, mesh, radius, found), "") << id;
    expect_positions(world, mesh.v0);
    for (std::uint32_t step = 1; step < 5; ++step) {
      mesh.v0 = broad_phase::crumpled<S>(9, 1 + step).v0;
      std::vector<S> given = mesh.v0;
      if (step % 2 == 0) given.push_back(S(0));  // an array that a world without a radius reads in place
      world.set_positions(step % 3, std::span<const S>(given));
      world.advance(step);
      given.assign(given.size(), S(0));
      EXPECT_EQ(wrong_pairs(world, mesh, radius, found), "") << id << ", step " << step;
      expect_positions(world, mesh.v0);
    }
    EXPECT_GT(found, 1000u) << id;
    world.reset(0);
    expect_positions(world, mesh.v0);
  }
}

/// Only some vertices move; a list that lacks them is seen.
TYPED_TEST(WorldRadius, TakesTheVerticesThatMoved) {
  using S = TypeParam;
  const S radius = S(0.1);
  Mesh<S> mesh = broad_phase::crumpled<S>(9, 1);
  const std::vector<S> later = broad_phase::crumpled<S>(9, 2).v0;
  World world = handed_in(mesh, double(radius));
  // Trees of many nodes: where most of them hold vertices that moved, all are refitted.
  world.start("dirty_refit", {}, 0, {{"width", "2"}, {"leaf_size", "1"}});
  std::size_t found = 0;
  EXPECT_EQ(wrong_pairs(world, mesh, radius, found), "");
  const Ids moved{3, 40, 41, 80};
  for (const std::uint32_t v : moved) std::copy_n(later.begin() + 3 * v, 3, mesh.v0.begin() + 3 * v);
  world.set_positions(1, std::span<const S>(mesh.v0), moved);
  world.advance(1);
  EXPECT_EQ(wrong_pairs(world, mesh, radius, found), "");
  WorldAudit audit;
  ASSERT_TRUE(world.audit(0, audit));
  EXPECT_EQ(audit.invalid, 0u) << audit.first_fault;
  const Ids too_few{3};
  world.set_positions(1, std::span<const S>(later), too_few);
  world.advance(2);
  std::vector<WorldPair> pairs;
  world.pairs(pairs);
  ASSERT_TRUE(world.audit(0, audit));
  EXPECT_GT(audit.invalid, 0u);
  EXPECT_THROW(world.set_positions(1, std::span<const S>(later), Ids{81}), std::invalid_argument);
}

TYPED_TEST(WorldRadius, PlaysKnownMotion) {
  using S = TypeParam;
  const Mesh<S> mesh = broad_phase::crumpled<S>(7, 1);
  std::vector<S> keyframes = mesh.v0;
  const std::vector<S> second = broad_phase::crumpled<S>(7, 2).v0;
  keyframes.insert(keyframes.end(), second.begin(), second.end());
  const std::vector<double> times{0, 1}, frames{0, 0.25, 0.5, 1};
  const FlightPlans<S> plans(std::uint32_t(mesh.vertex_count()), times, keyframes);
  for (const char* const id : {"bottom_up", "interval_join", "kinetic_aabb", "brute_force"}) {
    const StrategyEntry& entry = find_strategy(id);
    if (!entry.info.can.self_pairs) continue;
    World world(sizeof(S) == 4 ? Precision::float32 : Precision::float64);
    const Ids faces(mesh.faces.begin(), mesh.faces.end());
    world.add_body("faces", {faces}, times, std::span<const S>(keyframes));
    add_elements(world, mesh, 0.1);
    world.start(id);
    for (const double t : frames) {
      world.advance(t);
      std::vector<S> expected(3 * mesh.vertex_count() + 1);
      plans.evaluate(t, expected.data());
      expected.pop_back();
      expect_positions(world, expected);
      std::vector<double> then;
      world.positions(1, t, then);
      EXPECT_TRUE(std::equal(then.begin(), then.end(), expected.begin(), expected.end())) << t;
      std::vector<WorldPair> pairs, truth;
      world.pairs(pairs);
      world.true_pairs(truth);
      EXPECT_FALSE(pairs.empty());
      EXPECT_EQ(pairs.size(), truth.size()) << id << ", t = " << t;
    }
    const WorldVerdict verdict = world.verify(id, frames);
    EXPECT_TRUE(verdict.holds) << id << ": " << verdict.first_violation;
    EXPECT_GT(verdict.pairs, 0u);
  }
}

/// Removes some faces, vertices and edges, which are the bodies 0, 1 and 2, and inserts others.
WorldEdit random_edit(Elements& elements, Random& random) {
  WorldEdit edit;
  constexpr Element of_body[] = {Element::face, Element::vertex, Element::edge};
  for (std::uint32_t body = 0; body < 3; ++body) {
    Primitives& list = elements.lists[std::size_t(of_body[body])];
    std::set<std::uint32_t> gone;
    for (int i = 0; i < 8; ++i)
      if (const std::uint32_t id = random.below(list.count()); list.alive(id)) gone.insert(id);
    for (const std::uint32_t id : gone) {
      edit.removed_primitives.push_back({body, id});
      list.remove(id);
    }
    for (int i = 0; i < 4; ++i) {
      Ids vertices;
      for (std::size_t c = 0; c <= std::size_t(of_body[body]); ++c)
        vertices.push_back(random.below(elements.vertex_count() / 2));
      edit.primitives.push_back({body, vertices});
    }
  }
  for (const WorldEdit::Primitive& added : edit.primitives)
    elements.lists[std::size_t(of_body[added.body])].add(added.vertices);
  return edit;
}

template <class S>
bool takes_edits(const StrategyEntry& entry) {
  const auto& kinds = entry.info.primitives;
  return entry.info.guarantee == Guarantee::exact && entry.info.can.geometry_changes &&
         entry.info.can.self_pairs && entry.factory<S>() != nullptr && entry.info.max_primitive_pairs == 0 &&
         std::find(kinds.begin(), kinds.end(), PrimitiveKind::control_nets) != kinds.end();
}

TYPED_TEST(WorldRadius, PrimitivesComeAndGo) {
  using S = TypeParam;
  const S radius = S(0.1);
  std::size_t took_part = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!takes_edits<S>(entry) || entry.info.foresight != Foresight::none) continue;
    ++took_part;
    Mesh<S> mesh = broad_phase::crumpled<S>(9, 1);
    World world = handed_in(mesh, double(radius));
    world.start(entry.info.id);
    Elements elements = mesh.elements();
    Random random(4);
    std::size_t found = 0;
    for (std::uint32_t step = 1; step < 6; ++step) {
      world.change_geometry(random_edit(elements, random));
      EXPECT_EQ(wrong_pairs(world, mesh, elements, radius, found), "")
          << entry.info.id << ", step " << step << ", edited";
      // Seeded fault: the elements as they were.
      EXPECT_NE(wrong_pairs(world, mesh, radius, found), "") << entry.info.id;
      mesh.v0 = broad_phase::crumpled<S>(9, 1 + step).v0;
      world.set_positions(0, std::span<const S>(mesh.v0));
      world.advance(step);
      EXPECT_EQ(wrong_pairs(world, mesh, elements, radius, found), "")
          << entry.info.id << ", step " << step << ", moved";
    }
    EXPECT_GT(found, 1000u) << entry.info.id;
    world.reset(0);
    EXPECT_EQ(wrong_pairs(world, mesh, radius, found), "") << entry.info.id << ", the original geometry";
  }
  EXPECT_GE(took_part, 3u);
}

TYPED_TEST(WorldRadius, PrimitivesComeAndGoDuringKnownMotion) {
  using S = TypeParam;
  const Mesh<S> mesh = broad_phase::crumpled<S>(7, 1);
  std::vector<S> keyframes = mesh.v0;
  const std::vector<S> second = broad_phase::crumpled<S>(7, 2).v0;
  keyframes.insert(keyframes.end(), second.begin(), second.end());
  const std::vector<double> times{0, 1};
  const auto listed = [](const std::vector<WorldPair>& pairs) {
    std::set<std::array<std::uint32_t, 4>> set;
    for (const WorldPair& pair : pairs)
      set.insert(std::array{pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b});
    return set;
  };
  std::size_t took_part = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!takes_edits<S>(entry)) continue;
    ++took_part;
    World world(sizeof(S) == 4 ? Precision::float32 : Precision::float64);
    const Ids faces(mesh.faces.begin(), mesh.faces.end());
    world.add_body("faces", {faces}, times, std::span<const S>(keyframes));
    add_elements(world, mesh, 0.1);
    world.start(entry.info.id);
    Elements elements = mesh.elements();
    Random random(6);
    for (const double t : {0.25, 0.5, 0.75, 1.0}) {
      world.advance(t);
      if (t < 0.7) world.change_geometry(random_edit(elements, random));
      std::vector<WorldPair> pairs, truth;
      world.pairs(pairs);
      world.true_pairs(truth);
      EXPECT_FALSE(pairs.empty());
      EXPECT_EQ(listed(pairs), listed(truth)) << entry.info.id << ", t = " << t;
      EXPECT_EQ(pairs.size(), truth.size()) << entry.info.id << ", t = " << t;
    }
  }
  EXPECT_GE(took_part, 3u);
}

TYPED_TEST(WorldRadius, IsSeenIfForgotten) {
  using S = TypeParam;
  const Mesh<S> mesh = broad_phase::crumpled<S>(9, 1);
  World world = handed_in(mesh, 0);
  world.start("bottom_up");
  std::size_t found = 0;
  EXPECT_EQ(wrong_pairs(world, mesh, S(0), found), "");
  EXPECT_NE(wrong_pairs(world, mesh, S(0.1), found), "");
}

TEST(RadiusOfWorlds, SaysWhatItCannotDo) {
  const Mesh<float> mesh = broad_phase::crumpled<float>(5, 1);
  World world = handed_in(mesh, 0.1);
  for (const double radius :
       {-0.1, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN(), 1e31})
    EXPECT_THROW(world.set_radius(radius), std::invalid_argument) << radius;
  for (const StrategyEntry& entry : registry()) {
    const auto& kinds = entry.info.primitives;
    if (std::find(kinds.begin(), kinds.end(), PrimitiveKind::control_nets) != kinds.end()) continue;
    try {
      world.start(entry.info.id);
      ADD_FAILURE() << entry.info.id;
    } catch (const ConfigError& problem) {
      EXPECT_NE(std::string(problem.what()).find("takes no radius"), std::string::npos) << problem.what();
    }
  }
  world.start("bottom_up");
  EXPECT_THROW(world.set_radius(0.2), std::logic_error);
  std::vector<WorldHit> hits;
  std::vector<WorldBallHit> balls;
  std::vector<WorldContact> contacts;
  EXPECT_THROW(world.hits(WorldRayQuery::any, {}, hits), std::logic_error);
  EXPECT_THROW(world.within({}, balls), std::logic_error);
  EXPECT_THROW(world.contacts(1, contacts), std::logic_error);
  EXPECT_THROW(world.change_plans({}), std::logic_error);
  WorldEdit vertices, removed_vertices, primitive;
  vertices.vertices.push_back({});
  removed_vertices.removed_vertices.push_back({0, 3});
  EXPECT_THROW(world.change_geometry(vertices), std::logic_error);
  EXPECT_THROW(world.change_geometry(removed_vertices), std::logic_error);
  primitive.primitives.push_back({2, {24, 25}});
  EXPECT_EQ(broad_phase::complaint([&] { world.change_geometry(primitive); }),
            "geometry change: a new primitive of body 2 refers to vertex 25, but there are 25");
  primitive.primitives[0] = {3, {0}};
  EXPECT_THROW(world.change_geometry(primitive), std::invalid_argument);
}

}  // namespace
}  // namespace kbvh::test::world_radius_test
