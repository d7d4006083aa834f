#pragma once
// Scenes of bodies over one vertex set, and what strategies must answer on them: the pairs of bodies with
// copies of the vertices, without those that have a common vertex.
#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/judge/oracle.hpp"
#include "core/judge/sort_pairs.hpp"
#include "core/judge/verify.hpp"
#include "core/judge/verify_changes.hpp"
#include "tests/support/random.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::vertex_sets_test {

using Corners = std::vector<std::uint32_t>;

// ---- Scenes

/// The primitives of a sheet of side x side vertices, folded once along y.
struct Sheet {
  explicit Sheet(std::uint32_t vertices_a_side) : side(vertices_a_side) {
    const auto vertex = [this](std::uint32_t x, std::uint32_t y) { return y * side + x; };
    std::set<Corners> all_edges;
    for (std::uint32_t y = 0; y < side; ++y)
      for (std::uint32_t x = 0; x < side; ++x) {
        points.push_back({vertex(x, y)});
        if (x + 1 == side || y + 1 == side) continue;
        for (Corners face : {Corners{vertex(x, y), vertex(x + 1, y), vertex(x, y + 1)},
                             Corners{vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)}}) {
          for (std::size_t i = 0; i < 3; ++i)
            all_edges.insert({std::min(face[i], face[(i + 1) % 3]), std::max(face[i], face[(i + 1) % 3])});
          faces.push_back(std::move(face));
        }
      }
    edges.assign(all_edges.begin(), all_edges.end());
  }
  std::uint32_t side;
  std::vector<Corners> points, edges, faces;
};

inline Primitives primitives(PrimitiveKind kind, std::span<const Corners> lists) {
  Primitives made;
  made.kind = kind;
  for (const Corners& corners : lists) made.add(corners);
  return made;
}

/// Keyframes at 0, 1, 2 of a sheet whose two halves lie close to each other and move. On integers, elements
/// often touch exactly.
enum class Numbers : std::uint8_t { any, integers };
template <class S>
FlightPlans<S> folding(const Sheet& sheet, Numbers numbers) {
  Random random(11);
  std::vector<S> positions;
  for (int keyframe = 0; keyframe < 3; ++keyframe)
    for (std::uint32_t y = 0; y < sheet.side; ++y)
      for (std::uint32_t x = 0; x < sheet.side; ++x) {
        const double fold = std::abs(double(x) - (sheet.side - 1) / 2.0);
        const double much = numbers == Numbers::integers ? 2 : 1;
        const double at[3] = {fold + 0.4 * much * random.unit(), y + 0.4 * much * random.unit(),
                              0.5 * much * random.unit()};
        for (const double c : at)
          positions.push_back(S(numbers == Numbers::integers ? std::round(c) + 0.0 : c));
      }
  return FlightPlans<S>(sheet.side * sheet.side, {0, 1, 2}, std::move(positions));
}

template <class S>
Body<S> first_body(std::string name, Primitives connectivity, FlightPlans<S> plans) {
  Body<S> body;
  body.name = std::move(name);
  body.primitives = std::move(connectivity);
  body.plans = std::move(plans);
  return body;
}

/// Vertices, edges and faces of one mesh. `polygons`: exact pairs; else pairs of boxes.
enum class Level : std::uint8_t { boxes, polygons };
/// Which pairs of bodies are asked for.
enum class Asked : std::uint8_t { of_two_bodies, within_bodies_too };
template <class S>
TestScene<S> elements(Level level, Numbers numbers, Asked asked) {
  const Sheet sheet(5);
  const bool exact = level == Level::polygons;
  const PrimitiveKind nets = exact ? PrimitiveKind::polygons : PrimitiveKind::control_nets;
  TestScene<S> test;
  Scene<S>& scene = test.scene;
  scene.name = std::string("elements") + (exact ? "_exact" : "_boxes") +
               (numbers == Numbers::integers ? "_integers" : "");
  scene.bodies.push_back(first_body("vertices",
                                    primitives(exact ? nets : PrimitiveKind::points, sheet.points),
                                    folding<S>(sheet, numbers)));
  add_body_over(scene, 0, "edges", primitives(nets, sheet.edges));
  add_body_over(scene, 0, "faces", primitives(nets, sheet.faces));
  scene.pairs = {{0, 1}, {0, 2}, {1, 2}};
  if (asked == Asked::within_bodies_too) {
    scene.name += "_self";
    for (std::uint32_t body = 0; body < 3; ++body) scene.pairs.push_back({body, body});
  }
  return test;
}

/// A cloth of two panels with a common seam next to its fold, and a sheet of its own that crosses both.
template <class S>
TestScene<S> panels() {
  const Sheet sheet(6);
  std::vector<Corners> left, right;
  for (const Corners& face : sheet.faces) {
    std::uint32_t most = 0;
    for (const std::uint32_t v : face) most = std::max(most, v % sheet.side);
    (most <= 3 ? left : right).push_back(face);
  }
  TestScene<S> test;
  Scene<S>& scene = test.scene;
  scene.name = "panels";
  scene.bodies.push_back(
      first_body("left", primitives(PrimitiveKind::polygons, left), folding<S>(sheet, Numbers::any)));
  std::vector<S> crossing;
  for (std::uint32_t y = 0; y < 3; ++y)
    for (std::uint32_t x = 0; x < 3; ++x)
      for (const double c : {0.3 + 0.9 * x, 0.2 + 2.2 * y, 0.6 * x - 0.7}) crossing.push_back(S(c));
  scene.bodies.push_back(first_body("crossing", primitives(PrimitiveKind::polygons, Sheet(3).faces),
                                    FlightPlans<S>(9, {0}, std::move(crossing))));
  add_body_over(scene, 0, "right", primitives(PrimitiveKind::polygons, right));
  scene.pairs = all_pairs(scene.bodies);
  return test;
}

/// Gives vertices new plans at a frame between keyframes and at a keyframe, under different bodies.
template <class S>
TestScene<S> with_plan_changes(TestScene<S> test) {
  test.scene.name += "_plans";
  std::uint32_t body = 0;
  for (const double time : {0.5, 1.0, 1.75}) {
    auto& step = test.script.steps.emplace_back();
    step.time = time;
    for (const std::uint32_t vertex : {7u, 12u, 18u}) {
      PlanChange<S> change;
      change.body = test.scene.same_vertices(0, body) ? body : 0;
      change.vertex = vertex;
      change.times = {time + 0.5};
      change.positions = {S(vertex % 5), S(2), S(time)};
      change.velocity[2] = S(-1);
      step.changes.push_back(change);
      body = (body + 1) % std::uint32_t(test.scene.bodies.size());
    }
  }
  return test;
}

/// Inserts a vertex with primitives in two bodies of the set, then deletes some.
template <class S>
TestScene<S> with_geometry_changes(TestScene<S> test) {
  test.scene.name += "_geometry";
  const std::uint32_t added = test.scene.bodies[0].plans.vertex_count();
  const std::uint32_t last = std::uint32_t(test.scene.bodies.size() - 1);
  const std::uint32_t corners[2] = {test.scene.bodies[0].primitives.offsets[1],
                                    test.scene.bodies[last].primitives.offsets[1]};
  const auto list = [&](std::uint32_t which, Corners vertices) {
    vertices.resize(corners[which]);
    return vertices;
  };
  auto& first = test.script.steps.emplace_back();
  first.time = 0.5;
  typename GeometryChange<S>::NewVertex vertex;
  vertex.body = last;
  vertex.position[0] = S(1.1);
  vertex.position[1] = S(2.2);
  vertex.plan.velocity[2] = S(0.3);
  first.geometry.vertices = {vertex, vertex};
  first.geometry.vertices[1].body = 0;
  first.geometry.vertices[1].position[0] = S(1.6);
  first.geometry.primitives = {{0, list(0, {added, 6, 8})},
                               {last, list(1, {added, added + 1, 12})},
                               {last, list(1, {added + 1, 3, 9})}};
  auto& second = test.script.steps.emplace_back();
  second.time = 1.25;
  const std::uint32_t primitive = test.scene.bodies[last].primitives.count();
  second.geometry.removed_primitives = {
      {last, primitive}, {last, primitive + 1}, {last, 2}, {0, test.scene.bodies[0].primitives.count()}};
  second.geometry.removed_vertices = {{last, added}};
  return test;
}

template <class S>
std::vector<TestScene<S>> all_scenes() {
  std::vector<TestScene<S>> scenes;
  for (const Asked asked : {Asked::of_two_bodies, Asked::within_bodies_too}) {
    scenes.push_back(elements<S>(Level::boxes, Numbers::any, asked));
    scenes.push_back(elements<S>(Level::polygons, Numbers::integers, asked));
    scenes.push_back(with_plan_changes(elements<S>(Level::boxes, Numbers::any, asked)));
    scenes.push_back(with_geometry_changes(elements<S>(Level::boxes, Numbers::any, asked)));
  }
  scenes.push_back(panels<S>());
  scenes.push_back(with_plan_changes(panels<S>()));
  scenes.push_back(with_geometry_changes(panels<S>()));
  for (TestScene<S>& test : scenes) test.frames = frame_times(test.scene, 4);
  return scenes;
}

// ---- The truth, from bodies with copies of the vertices

/// Lists a change of a vertex set for all bodies over it, by hand.
template <class S, class Item>
void list_for_all(const Scene<S>& scene, std::vector<Item>& items) {
  std::vector<Item> all;
  for (const Item& item : items)
    for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
      if (scene.same_vertices(item.body, body)) {
        all.push_back(item);
        all.back().body = body;
      }
  items = std::move(all);
}

template <class S>
TestScene<S> unshared(TestScene<S> test) {
  for (auto& step : test.script.steps) {
    list_for_all(test.scene, step.changes);
    list_for_all(test.scene, step.geometry.vertices);
    list_for_all(test.scene, step.geometry.removed_vertices);
  }
  for (Body<S>& body : test.scene.bodies) body.vertex_set = own_vertices;
  return test;
}

template <class S>
bool have_common_vertex(const Scene<S>& scene, const PrimitivePair& pair) {
  const auto a = scene.bodies[pair.body_a].primitives[pair.primitive_a];
  const auto b = scene.bodies[pair.body_b].primitives[pair.primitive_b];
  return std::find_first_of(a.begin(), a.end(), b.begin(), b.end()) != a.end();
}

/// The pairs at each frame, before the changes that are made at it.
struct Truth {
  std::vector<PairBuffer> frames;
  std::size_t pairs_of_sets = 0, incident = 0;
};

template <class S>
Truth truth_of(const TestScene<S>& shared) {
  const TestScene<S> test = unshared(shared);
  Playback<S> playback(test.scene);
  ChangingScene<S> changing(test.scene);
  Truth truth;
  auto step = test.script.steps.begin();
  for (const double t : test.frames) {
    playback.seek(t);
    PairBuffer& pairs = truth.frames.emplace_back();
    for (const PrimitivePair& pair : brute_force_pairs(changing.scene(), playback)) {
      const bool of_set = pair.body_a != pair.body_b && shared.scene.same_vertices(pair.body_a, pair.body_b);
      if (of_set && have_common_vertex(changing.scene(), pair)) {
        ++truth.incident;
        continue;
      }
      truth.pairs_of_sets += of_set ? 1 : 0;
      pairs.push_back(pair);
    }
    for (; step != test.script.steps.end() && step->time <= t; ++step) {
      playback.change_plans(t, step->changes);
      if (!step->geometry.empty()) changing.apply(step->geometry, playback);
    }
  }
  return truth;
}

// ---- Contestants

/// Returns how a contestant's answers at the frames differ from the truth, first of all at which frame; or
/// nothing. Every other frame is asked as changes alone.
template <class S>
std::string difference(Session<S>& session, const TestScene<S>& test, const Truth& truth) {
  PhaseTimes ignored;
  PairBuffer pairs, candidates, begun, ended;
  ChangeReplay replays[2];
  auto step = test.script.steps.begin();
  for (std::size_t f = 0; f < test.frames.size(); ++f) {
    const double t = test.frames[f];
    const std::string at = "t = " + std::to_string(t) + ": ";
    if (f == 0)
      session.reset(t);
    else
      session.advance(t, ignored);
    for (const Answer answer : {Answer::candidates, Answer::pairs}) {
      session.changes(answer, begun, ended, ignored);
      const std::string fault = replays[std::size_t(answer)].add(begun, ended);
      if (!fault.empty()) return at + fault;
    }
    if (session.info().guarantee != Guarantee::approximate && replays[1].pairs() != truth.frames[f])
      return at + "the changes add up to other pairs";
    for (const PrimitivePair& pair : replays[0].pairs())
      if (session.scene().same_vertices(pair.body_a, pair.body_b) &&
          have_common_vertex(session.scene(), pair))
        return at + "the changes of candidates begin a pair of incident primitives";
    if (f % 2 == 0) {
      candidates.clear();
      session.strategy().candidates_at(t, candidates, {});
      for (const PrimitivePair& pair : candidates)
        if (test.scene.same_vertices(pair.body_a, pair.body_b) && have_common_vertex(session.scene(), pair))
          return at + "candidate " + text(pair) + " is of incident primitives";
      session.query(pairs, ignored);
      sort_pairs(pairs);
      if (session.info().guarantee != Guarantee::approximate && pairs != truth.frames[f])
        return at + std::to_string(pairs.size()) + " pairs, not " + std::to_string(truth.frames[f].size());
    }
    for (; step != test.script.steps.end() && step->time <= t; ++step) {
      if (!step->changes.empty()) session.change_plans(step->changes, ignored);
      if (!step->geometry.empty()) session.change_geometry(step->geometry, ignored);
    }
  }
  return {};
}

}  // namespace kbvh::test::vertex_sets_test
