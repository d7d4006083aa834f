#include "experiments/theory/measure_proposals.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/judge/oracle.hpp"
#include "core/judge/session.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/measure_curves.hpp"

namespace kbvh::theory {

namespace {

using Parameters = std::map<std::string, std::string>;

Contestant contestant_of(const char* id, Parameters params, const BuilderConfig& builder) {
  Contestant contestant;
  contestant.entry = &find_strategy(id);
  contestant.params = std::move(params);
  contestant.builder = builder;
  return contestant;
}

/// Plays a clip with a query at every frame. Calls seen(t, pairs) with the confirmed pairs of each. Returns
/// the counts of the whole clip.
template <class Seen>
Counters play(const Scene<float>& scene, const Contestant& contestant, std::uint32_t l, const Seen& seen) {
  Session<float> session(scene, contestant);
  PairBuffer pairs;
  PhaseTimes times;
  const std::vector<double> frames = frame_times(scene, l);
  session.reset(frames.front());
  for (const double t : frames) {
    if (t > frames.front()) session.advance(t, times);
    session.query(pairs, times);
    seen(t, pairs);
  }
  return session.strategy().counters();
}
Counters play(const Scene<float>& scene, const Contestant& contestant, std::uint32_t l) {
  return play(scene, contestant, l, [](double, const PairBuffer&) {});
}

using ContactKey = std::array<std::uint32_t, 5>;

std::vector<ContactKey> sorted_keys(const ContactBuffer& contacts) {
  std::vector<ContactKey> keys;
  for (const Contact& one : contacts)
    keys.push_back({std::uint32_t(one.kind), one.body_a, one.feature_a, one.body_b, one.feature_b});
  std::sort(keys.begin(), keys.end());
  return keys;
}

/// Counts keys that are in only one of two sorted lists.
template <class Key>
std::uint64_t differences(const std::vector<Key>& a, const std::vector<Key>& b) {
  std::vector<Key> off;
  std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(off));
  return off.size();
}

/// Returns the scene with lines between the keyframes of all bodies.
Scene<float> on_lines(Scene<float> scene) {
  for (Body<float>& body : scene.bodies) {
    const FlightPlans<float>& plans = body.plans;
    if (!plans.curved()) continue;
    const auto times = plans.keyframe_times();
    std::vector<float> positions;
    for (std::size_t k = 0; k < times.size(); ++k)
      positions.insert(positions.end(), plans.keyframe(k),
                       plans.keyframe(k) + std::size_t(3) * plans.vertex_count());
    body.plans = FlightPlans<float>(plans.vertex_count(), {times.begin(), times.end()}, std::move(positions));
  }
  return scene;
}

constexpr std::uint32_t usual_l = 10;

}  // namespace

OrderRun measure_order(const Scene<float>& scene, std::uint32_t width) {
  BuilderConfig builder = paper_builder;
  builder.width = width;
  const Counters counts =
      play(scene, contestant_of("kinetic_aabb", {{"queue", "avl"}, {"query", "nodes"}}, builder), usual_l);
  return {.scene = scene.name,
          .triangles = scene.primitive_count(),
          .width = width,
          .events = counts[Counter::certificates_failed],
          .values = counts[Counter::values_written],
          .certificates = counts[Counter::certificates_made],
          .steps = counts[Counter::queue_steps],
          .box_tests = counts[Counter::box_tests]};
}

RebuildRun measure_rebuild(const Scene<float>& scene, const std::string& rebuild) {
  const Counters counts = play(scene,
                               contestant_of("kinetic_boxtree",
                                             {{"queue", "avl"},
                                              {"planes", "start"},
                                              {"candidates", "searched"},
                                              {"leaf_boxes", "inherited"},
                                              {"rebuild", rebuild}},
                                             paper_builder),
                               usual_l);
  return {.scene = scene.name,
          .triangles = scene.primitive_count(),
          .rebuild = rebuild,
          .events = counts[Counter::certificates_failed],
          .visited = counts[Counter::nodes_visited],
          .box_tests = counts[Counter::box_tests]};
}

SweepRun measure_sweeps(const Scene<float>& scene) {
  SweepRun run{.scene = scene.name, .triangles = scene.primitive_count()};
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Session<float> list(scene, contestant_of("kinetic_separation_list", {{"queue", "avl"}}, paper_builder)),
      refit(scene, contestant_of("bottom_up", {}, paper_builder)),
      all(scene, contestant_of("brute_force", {}, paper_builder));
  for (Session<float>* const one : {&list, &refit}) one->reset(keyframes.front());
  PhaseTimes times;
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    ContactBuffer of_list, of_refit;
    run.list_pairs += list.contacts(keyframes[k], of_list, times);
    run.refit_pairs += refit.contacts(keyframes[k], of_refit, times);
    const std::vector<ContactKey> found = sorted_keys(of_list);
    run.contacts += found.size();
    run.different += differences(found, sorted_keys(of_refit));
    ++run.sweeps;
    if (k % 8 != 1) continue;
    ContactBuffer of_all;
    all.reset(keyframes[k - 1]);
    all.contacts(keyframes[k], of_all, times);
    run.different += differences(found, sorted_keys(of_all));
    ++run.tested_all;
  }
  return run;
}

MotionRun measure_motion(const Scene<float>& scene) {
  MotionRun run{.scene = scene.name, .triangles = scene.primitive_count()};
  run.segments = overlaid_keyframes(scene).size() - 1;
  run.degree = degree_of(scene);
  const Contestant contestant = contestant_of("kinetic_aabb", {{"queue", "avl"}}, paper_builder);
  Playback<float> playback(scene);
  const auto compare = [&](double t, const PairBuffer& found) {
    playback.seek(t);
    playback.evaluate_all();
    const PairBuffer truth = sweep_pairs(scene, playback);
    std::vector<PrimitivePair> expected(truth.begin(), truth.end()), sorted(found.begin(), found.end());
    std::sort(expected.begin(), expected.end());
    std::sort(sorted.begin(), sorted.end());
    run.pairs += expected.size();
    run.different += differences(sorted, expected);
    ++run.frames;
  };
  run.events = play(scene, contestant, usual_l, compare)[Counter::certificates_failed];
  run.events_at_keyframes = play(scene, contestant, 1)[Counter::certificates_failed];
  run.events_on_lines = play(on_lines(scene), contestant, 1)[Counter::certificates_failed];
  return run;
}

}  // namespace kbvh::theory
