// Contacts between keyframes: every strategy that declares them, against brute force over all features, on
// the synthetic scenes whose bodies are triangles.
#include "core/continuous/contacts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <utility>

#include "core/judge/oracle.hpp"
#include "core/judge/session.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::contacts_test {
namespace {

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const auto& list : {synthetic_scene_names(), self_scene_names()})
    for (const std::string& name : list) {
      bool suitable = true;
      for (const char* part : {"polygons", "points", "plan", "geometry"})
        suitable = suitable && name.find(part) == std::string::npos;
      if (suitable) names.push_back(name);
    }
  return names;
}

template <class S>
struct Truth {
  std::vector<double> knots;
  std::vector<ContactBuffer> contacts;  ///< of each interval, sorted
  std::size_t total = 0;
};

template <class S>
Truth<S> truth_of(const Scene<S>& scene, std::vector<double> knots) {
  Truth<S> truth{std::move(knots), {}};
  ContactFinder<S> finder(scene);
  Playback<S> playback(scene);
  for (std::size_t k = 0; k + 1 < truth.knots.size(); ++k) {
    playback.seek(truth.knots[k]);
    playback.evaluate_all();
    finder.start(playback);
    playback.seek(truth.knots[k + 1]);
    playback.evaluate_all();
    ContactBuffer all, swept;
    finder.find_all(playback, all);
    finder.find_by_sweep(playback, swept);
    std::sort(all.begin(), all.end());
    std::sort(swept.begin(), swept.end());
    EXPECT_EQ(all, swept) << scene.name << ", interval " << k;
    EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end());
    for (const Contact& contact : all) {
      EXPECT_LE(truth.knots[k], contact.begin);
      EXPECT_LE(contact.begin, contact.end);
      EXPECT_LE(contact.end, truth.knots[k + 1]);
    }
    truth.total += all.size();
    truth.contacts.push_back(std::move(all));
  }
  return truth;
}

template <class S>
Truth<S> truth_of(const Scene<S>& scene) {
  return truth_of(scene, overlaid_keyframes(scene));
}

template <class S>
void expect_contacts(const StrategyEntry& entry, const Scene<S>& scene, const Truth<S>& truth,
                     const BuilderConfig& builder, int rounds, const std::string& where,
                     const std::map<std::string, std::string>& params = {}) {
  if (entry.factory<S>() == nullptr) return;
  Session<S> session(scene, {&entry, params, builder});
  PhaseTimes ignored;
  // Several rounds, because `reset` starts over.
  for (int round = 0; round < rounds; ++round) {
    session.reset(truth.knots[0]);
    for (std::size_t k = 0; k < truth.contacts.size(); ++k) {
      ContactBuffer found;
      session.contacts(truth.knots[k + 1], found, ignored);
      std::sort(found.begin(), found.end());
      ASSERT_EQ(found.size(), truth.contacts[k].size()) << where << ", interval " << k;
      ASSERT_TRUE(found == truth.contacts[k]) << where << ", interval " << k;
      PairBuffer pairs = session.swept_pairs();
      std::sort(pairs.begin(), pairs.end());
      EXPECT_EQ(std::adjacent_find(pairs.begin(), pairs.end()), pairs.end()) << where;
      for (const PrimitivePair& pair : pairs)
        ASSERT_TRUE(pair.body_a < pair.body_b ||
                    (pair.body_a == pair.body_b && pair.primitive_a < pair.primitive_b))
            << where;
    }
  }
}

class Contacts : public testing::TestWithParam<std::string> {};

TEST_P(Contacts, AreThoseOfEveryFeatureWithEveryOther) {
  // Nearly every decision in these scenes needs exact arithmetic, some with integers of thousands of bits.
  const bool costly = GetParam() == "extreme_velocities" || GetParam() == "integer_ties" ||
                      GetParam() == "self_sheets_crumpled" || GetParam() == "self_coincident";
  const auto run = [&]<class S>(const TestScene<S>& test) {
    const Truth<S> truth = truth_of(test.scene);
    for (const StrategyEntry& entry : registry()) {
      if (!entry.info.can.contacts) continue;
      if (costly && sizeof(S) == 8 && !entry.info.baseline) continue;  // minutes; code as in float
      const std::string where =
          entry.info.id + " on " + test.scene.name + (sizeof(S) == 4 ? ", float" : ", double");
      expect_contacts(entry, test.scene, truth, entry.info.topology.preferred, costly ? 1 : 2, where);
      if (entry.info.topology.own || costly) continue;
      for (const std::uint32_t leaf : {1u, 3u})
        expect_contacts(entry, test.scene, truth,
                        {.method = BuildMethod::sah, .width = leaf == 1 ? 4u : 2u, .leaf_size = leaf}, 1,
                        where + ", leaf size " + std::to_string(leaf));
    }
  };
  run(synthetic_scene<float>(GetParam()));
  run(synthetic_scene<double>(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Scenes, Contacts, testing::ValuesIn(scene_names()),
                         [](const auto& test) { return test.param; });

// Contacts are those of straight lines between two frames, which leave the curves and their boxes.
template <class S>
std::size_t expect_contacts_on_curves(const std::string& name) {
  const Scene<S> scene = curved_scene<S>(name).scene;
  std::vector<double> knots = overlaid_keyframes(scene);
  for (std::size_t k = knots.size() - 1; k-- > 0;)
    knots.insert(knots.begin() + std::ptrdiff_t(k) + 1, 0.5 * (knots[k] + knots[k + 1]));
  const Truth<S> truth = truth_of(scene, knots);
  std::size_t played = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts || !entry.info.can.curves) continue;
    for (const std::uint32_t leaf : {1u, 3u}) {
      BuilderConfig builder = entry.info.topology.preferred;
      if (!entry.info.topology.own) builder.leaf_size = leaf;
      expect_contacts(entry, scene, truth, builder, 2, entry.info.id + " on " + name);
    }
    ++played;
  }
  EXPECT_GT(played, 2u);
  return truth.total;
}

TEST(CurvedContacts, AreThoseOfEveryFeatureWithEveryOther) {
  EXPECT_TRUE(find_strategy("kinetic_separation_list").info.can.contacts);
  std::size_t contacts = 0;
  for (const char* const name : {"curved_soups", "curved_thrown", "curved_gravity", "curved_mixed"})
    contacts += expect_contacts_on_curves<float>(name) + expect_contacts_on_curves<double>(name);
  EXPECT_GT(contacts, 100u);
}

// The vertex with the least x at both ends flies an arc, above a vertex at rest: the box of the triangle ends
// at that one meanwhile. The straight line from end to end is outside of this box when the other body passes.
TEST(CurvedContacts, LinesOutsideOfTheBoxesOfCurvesAreSwept) {
  Scene<float> scene;
  for (int body = 0; body < 2; ++body) {
    Body<float> made;
    made.primitives.add(std::vector<std::uint32_t>{0, 1, 2});
    std::vector<float> positions;
    std::vector<SegmentBends<float>> bends;
    for (const float y : {1.0F, -1.0F}) {
      const std::vector<float> at = body == 0
                                        ? std::vector<float>{0, 0, 0, 0.5F, 0, 1, 2, 0, -1}
                                        : std::vector<float>{0.1F, y, 0, 0.12F, y, 0.02F, 0.1F, y, 0.04F};
      positions.insert(positions.end(), at.begin(), at.end());
    }
    if (body == 0) bends.push_back({{8, 0, 0, 0, 0, 0, 0, 0, 0}, std::vector<float>(9)});
    made.plans = FlightPlans<float>(3, {0, 1}, std::move(positions), std::move(bends));
    scene.bodies.push_back(std::move(made));
  }
  scene.pairs = all_pairs(scene.bodies);
  const Truth<float> truth = truth_of(scene);
  EXPECT_GT(truth.total, 0u);
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts || !entry.info.can.curves) continue;
    BuilderConfig builder = entry.info.topology.preferred;
    if (!entry.info.topology.own) builder.leaf_size = 1;
    expect_contacts(entry, scene, truth, builder, 2, entry.info.id);
  }
}

TEST(ContactScenes, HaveContacts) {
  for (const char* name : {"soups", "four_bodies_own_keyframes", "self_rolled_cloth"}) {
    const Truth<float> truth = truth_of(synthetic_scene<float>(name).scene);
    EXPECT_GT(truth.total, 100u) << name;
  }
  // Within the cloth, and between it and the obstacle.
  const Truth<float> truth = truth_of(synthetic_scene<float>("self_rolled_cloth").scene);
  std::size_t within = 0, between = 0;
  for (const ContactBuffer& contacts : truth.contacts)
    for (const Contact& contact : contacts) ++(contact.body_a == contact.body_b ? within : between);
  EXPECT_GT(within, 50u);
  EXPECT_GT(between, 50u);
}

TEST(Features, EveryVertexAndEdgeHasOneOwner) {
  Primitives primitives;
  for (const auto& face : {std::vector<std::uint32_t>{0, 1, 2}, {2, 1, 3}, {4, 4, 5}, {3, 1, 2}})
    primitives.add(face);
  const Features features(primitives);
  // By larger, then smaller vertex.
  ASSERT_EQ(features.edges().size(), 7u);
  const std::uint32_t expected[7][2] = {{0, 1}, {0, 2}, {1, 2}, {1, 3}, {2, 3}, {4, 4}, {4, 5}};
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(features.edges()[i].vertices[0], expected[i][0]);
    EXPECT_EQ(features.edges()[i].vertices[1], expected[i][1]);
  }
  std::vector<int> vertices(6), edges(7);
  for (const Features::Face& face : features.faces())
    for (std::uint32_t i = 0; i < 3; ++i) {
      vertices[face.vertices[i]] += face.owned_vertices >> i & 1;
      edges[face.edges[i]] += face.owned_edges >> i & 1;
      const auto& edge = features.edges()[face.edges[i]].vertices;
      EXPECT_EQ(edge[0], std::min(face.vertices[i], face.vertices[(i + 1) % 3]));
      EXPECT_EQ(edge[1], std::max(face.vertices[i], face.vertices[(i + 1) % 3]));
    }
  EXPECT_EQ(vertices, std::vector<int>(6, 1));
  EXPECT_EQ(edges, std::vector<int>(7, 1));
  Primitives quad;
  quad.add(std::vector<std::uint32_t>{0, 1, 2, 3});
  EXPECT_THROW(Features{quad}, std::invalid_argument);
}

/// A triangle falls through another one in the middle of the interval; the other one's only keyframe is at 0.
Scene<float> falling_triangle(const std::vector<double>& interval) {
  Scene<float> scene;
  for (int body = 0; body < 2; ++body) {
    Body<float> made;
    made.primitives.add(std::vector<std::uint32_t>{0, 1, 2});
    std::vector<float> positions;
    for (int keyframe = 0; keyframe < (body == 0 ? 2 : 1); ++keyframe) {
      const float z = body == 1 ? 0 : keyframe == 0 ? 1 : -1;
      for (const float x : {0.25F, 0.25F, z, 1.25F, 0.25F, z + 2, 0.25F, 1.25F, z + 2})
        positions.push_back(x);
      if (body == 1) positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    }
    made.plans = FlightPlans<float>(3, body == 0 ? interval : std::vector<double>{0}, std::move(positions));
    scene.bodies.push_back(std::move(made));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

TEST(ContactFinder, EnclosesTheTimeOfImpact) {
  const Truth<float> truth = truth_of(falling_triangle({2, 6}));
  ASSERT_EQ(truth.contacts.size(), 1u);
  const auto first = std::min_element(truth.contacts[0].begin(), truth.contacts[0].end(),
                                      [](const Contact& a, const Contact& b) { return a.begin < b.begin; });
  ASSERT_NE(first, truth.contacts[0].end());
  EXPECT_EQ(first->kind, Contact::Kind::vertex_face);
  EXPECT_EQ(first->feature_a, 0u);
  EXPECT_LE(first->begin, 4);
  EXPECT_GE(first->end, 4);
  EXPECT_LE(first->end - first->begin, 4 * impact_width + 1e-14);
}

// The body is at this keyframe's position at all times: segments of other bodies continue across it.
TEST(ContactScenes, TheOneKeyframeOfABodyIsNoKnot) {
  const Scene<float> scene = falling_triangle({-1, 1});
  const Truth<float> truth = truth_of(scene);
  ASSERT_EQ(truth.total, 3u);
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts) continue;
    expect_contacts(entry, scene, truth, entry.info.topology.preferred, 2, entry.info.id);
  }
}

TEST(ContactScenes, CountWhatBoxesCost) {
  const auto test = synthetic_scene<float>("self_rolled_cloth");
  const Truth<float> truth = truth_of(test.scene);
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts || entry.info.can.spans) continue;  // pair lists need no boxes for it
    Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes ignored;
    session.reset(truth.knots[0]);
    ContactBuffer found;
    for (const int k : {1, 2}) session.contacts(truth.knots[std::size_t(k)], found, ignored);
    const Counters counters = session.strategy().counters();
    for (const Counter counter : {Counter::values_written, Counter::vertex_reads, Counter::box_tests})
      EXPECT_GT(counters[counter], 0u) << entry.info.id << ", " << name(counter);
  }
}

// Pieces of segments are for frames only; contacts use whole segments.
TEST(ContactScenes, PiecesOfSegmentsMakeNoDifference) {
  const auto test = synthetic_scene<float>("self_rolled_cloth");
  const Truth<float> truth = truth_of(test.scene);
  for (const StrategyEntry& entry : registry()) {
    const bool has_pieces =
        std::any_of(entry.info.parameters.begin(), entry.info.parameters.end(),
                    [](const Parameter& parameter) { return parameter.name == "pieces"; });
    if (!has_pieces || !entry.info.can.contacts) continue;
    expect_contacts(entry, test.scene, truth, entry.info.topology.preferred, 2, entry.info.id,
                    {{"pieces", "3"}});
  }
}

// Contacts, then frames from the first on, then contacts again.
TEST(ContactScenes, ResetComesBetweenContactsAndFrames) {
  const auto test = synthetic_scene<float>("self_rolled_cloth");
  const Truth<float> truth = truth_of(test.scene);
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts || entry.factory<float>() == nullptr) continue;
    Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes ignored;
    for (int round = 0; round < 2; ++round) {
      session.reset(truth.knots[0]);
      ContactBuffer found;
      session.contacts(truth.knots[1], found, ignored);
      std::sort(found.begin(), found.end());
      EXPECT_TRUE(found == truth.contacts[0]) << entry.info.id;
      session.reset(truth.knots[0]);
      for (const double t : {truth.knots[0], 0.5 * (truth.knots[0] + truth.knots[1]), truth.knots[2]}) {
        if (t != truth.knots[0]) session.advance(t, ignored);
        PairBuffer pairs;
        session.query(pairs, ignored);
        std::sort(pairs.begin(), pairs.end());
        Playback<float> playback(test.scene);
        playback.seek(t);
        EXPECT_EQ(pairs, brute_force_pairs(test.scene, playback)) << entry.info.id << " at " << t;
      }
    }
  }
}

/// Plans change at every stop, some to lines without an end and some with their own knots; geometry changes
/// at every second stop, for strategies that can follow. A second scene and playback make the same changes,
/// for the truth.
template <class S>
void expect_contacts_while_changing(const StrategyEntry& entry, const std::string& name, std::size_t& total) {
  const auto test = synthetic_scene<S>(name);
  Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
  PhaseTimes ignored;
  for (int round = 0; round < 2; ++round) {
    ChangingScene<S> mirror(test.scene);
    Playback<S> playback(test.scene);
    Random random(7);
    const double end = overlaid_keyframes(test.scene).back();
    double t = overlaid_keyframes(test.scene).front();
    session.reset(t);
    for (int stop = 0; t < end && stop < 40; ++stop) {
      const std::string where = entry.info.id + " on " + name + ", stop " + std::to_string(stop);
      playback.seek(t);
      playback.evaluate_all();
      if (entry.info.can.plan_changes && stop % 3 != 2) {
        std::vector<PlanChange<S>> changes;
        for (std::uint32_t i = 0; i < 6; ++i) {
          PlanChange<S> change{.body = random.below(2), .vertex = 5 * i + random.below(5)};
          for (S& v : change.velocity) v = S(0.4 * random.unit());
          if (i % 2 == 0) {
            change.times = {t + 0.17};
            for (int axis = 0; axis < 3; ++axis) change.positions.push_back(S(0.7 * random.unit()));
          }
          changes.push_back(change);
        }
        session.change_plans(changes, ignored);
        playback.change_plans(t, changes);
      }
      if (entry.info.can.geometry_changes && stop % 4 == 1) {
        GeometryChange<S> change;
        change.removed_primitives = {{0, std::uint32_t(stop)}};
        const std::uint32_t first = mirror.scene().bodies[0].plans.vertex_count();
        for (int i = 0; i < 3; ++i) {
          typename GeometryChange<S>::NewVertex vertex;
          for (S& x : vertex.position) x = S(0.8 * random.unit());
          for (S& v : vertex.plan.velocity) v = S(0.5 * random.unit());
          change.vertices.push_back(vertex);
        }
        change.primitives = {{0, {first, first + 1, first + 2}}};
        session.change_geometry(change, ignored);
        mirror.apply(change, playback);
      }
      const double next = std::min({session.next_knot(), t + 0.3, end});
      EXPECT_THROW(
          {
            ContactBuffer none;
            session.contacts(session.next_knot() + 1, none, ignored);
          },
          std::invalid_argument)
          << where;
      ContactFinder<S> finder(mirror.scene());
      playback.evaluate_all();
      finder.start(playback);
      playback.seek(next);
      playback.evaluate_all();
      ContactBuffer truth, found;
      finder.find_by_sweep(playback, truth);
      session.contacts(next, found, ignored);
      std::sort(truth.begin(), truth.end());
      std::sort(found.begin(), found.end());
      ASSERT_EQ(found.size(), truth.size()) << where;
      ASSERT_TRUE(found == truth) << where;
      total += found.size();
      t = next;
    }
  }
}

TEST(ContactScenes, AreFoundWhilePlansAndGeometryChange) {
  std::size_t total = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.contacts) continue;
    for (const char* name : {"soups", "self_rolled_cloth"}) {
      if (entry.factory<float>() != nullptr) expect_contacts_while_changing<float>(entry, name, total);
      if (entry.factory<double>() != nullptr) expect_contacts_while_changing<double>(entry, name, total);
    }
  }
  EXPECT_GT(total, 1000u);
}

TEST(Registry, ContactsAreDeclaredOrRefused) {
  const auto test = synthetic_scene<float>("sheets");
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr || entry.info.can.contacts) continue;
    Session<float> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    session.reset(0);
    ContactBuffer contacts;
    PhaseTimes ignored;
    EXPECT_THROW(session.contacts(1, contacts, ignored), std::logic_error) << entry.info.id;
  }
}

}  // namespace
}  // namespace kbvh::test::contacts_test
