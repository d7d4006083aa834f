// Properties of envelope strategies that the conformance suite cannot check: both keep the same boxes in
// whatever order the clip is played, no frame does the work of a whole segment if it is made ahead, and
// bodies that only translate cost nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/play.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::envelopes_ahead_test {
namespace {

constexpr const char* both[] = {"kinetic_envelope", "kinetic_envelope_ahead"};

/// A frame, or the clip starts over at its time.
struct Event {
  double time;
  bool reset;
};

/// All frames; some of them, at most a few per segment, so that many are skipped; the clip started over in
/// the middle, later, earlier, and at a keyframe.
std::vector<std::vector<Event>> ways_to_play(const std::vector<double>& frames,
                                             const std::vector<double>& keyframes) {
  std::vector<std::vector<Event>> ways(3);
  for (const double t : frames) ways[0].push_back({t, false});
  Random random(3);
  for (const double t : frames)
    if (ways[1].empty() || random.below(5) == 0) ways[1].push_back({t, false});
  const std::size_t n = frames.size();
  for (const std::size_t from : {n / 3, n / 2, std::size_t(0), n - 1, n / 4}) {
    ways[2].push_back({frames[from], true});
    for (std::size_t f = from; f < std::min(n, from + n / 3); ++f) ways[2].push_back({frames[f], false});
  }
  ways[2].push_back({keyframes[keyframes.size() / 2], true});
  for (const double t : frames)
    if (t > keyframes[keyframes.size() / 2]) ways[2].push_back({t + 1e-3, false});
  return ways;
}

/// Compares the boxes of both with those of a refit to the last bit, and all pairs, at each frame of each
/// order.
template <class S>
void check_same(const TestScene<S>& test, const std::string& name, const BuilderConfig& builder) {
  std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 7) : test.frames;
  for (const auto& step : test.script.steps) frames.push_back(step.time);
  const std::vector<double> keyframes = overlaid_keyframes(test.scene);
  frames.push_back(keyframes.front() - 0.5);
  frames.push_back(keyframes.back() + 0.5);
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  Play<S> refit(test.scene, "bottom_up", {}, builder);
  Play<S> present(test.scene, both[0], {}, builder), ahead(test.scene, both[1], {}, builder);
  for (const auto& way : ways_to_play(frames, keyframes)) {
    for (Play<S>* player : {&refit, &present, &ahead}) player->reset(way.front().time);
    for (const Event& event : way) {
      const auto step = std::find_if(test.script.steps.begin(), test.script.steps.end(),
                                     [&](const auto& one) { return one.time == event.time; });
      for (Play<S>* player : {&refit, &present, &ahead})
        if (event.reset)
          player->reset(event.time);
        else
          player->frame(event.time, step == test.script.steps.end() ? nullptr : &*step);
      const auto boxes = refit.boxes();
      ASSERT_EQ(boxes, present.boxes()) << name << " at t = " << event.time;
      ASSERT_EQ(boxes, ahead.boxes()) << name << " at t = " << event.time;
      ASSERT_EQ(present.pairs, ahead.pairs) << name << " at t = " << event.time;
    }
  }
}

TEST(EnvelopesAhead, BoxesAreTheSameHoweverTheClipIsPlayed) {
  for (const char* name : {"soups", "integer_ties", "four_bodies_own_keyframes", "all_cross_at_once",
                           "coincident_intervals", "keyframes_a_millionth_apart", "pure_translation_far",
                           "zero_motion", "static_obstacle", "one_triangle_and_none", "plan_changes",
                           "plan_changes_ties", "plans_move_the_obstacle", "extreme_velocities"}) {
    check_same(synthetic_scene<float>(name, 7), name, {.width = 2, .leaf_size = 1});
    check_same(synthetic_scene<double>(name, 7), name, {.width = 8, .leaf_size = 4});
  }
}

/// One body of random triangles whose segments deform it or translate it, as `segments` says: d, t. All
/// positions are multiples of 2^-10, so that steps are exact in float.
Scene<float> made_of(const std::string& segments, std::uint32_t triangles) {
  Scene<float> scene;
  Random random(4);
  const auto about = [&](double size) { return float(std::int64_t(size * 1024 * random.unit())) / 1024; };
  std::vector<float> positions;
  std::vector<double> times{0};
  for (std::uint32_t i = 0; i < 9 * triangles; ++i) positions.push_back(about(1));
  for (const char kind : segments) {
    times.push_back(times.back() + 1);
    const float step[3] = {about(0.5), about(0.5), about(0.5)};
    for (std::uint32_t i = 0; i < 9 * triangles; ++i)
      positions.push_back(positions[positions.size() - 9 * triangles] +
                          (kind == 't' ? step[i % 3] : about(0.05)));
  }
  Body<float> body;
  for (std::uint32_t p = 0; p < triangles; ++p)
    body.primitives.add(std::vector<std::uint32_t>{3 * p, 3 * p + 1, 3 * p + 2});
  Body<float> triangle;
  triangle.primitives.add(std::vector<std::uint32_t>{0, 1, 2});
  triangle.plans = FlightPlans<float>(3, {0}, {0, 0, 0, 0.1f, 0, 0, 0, 0.1f, 0});
  body.plans = FlightPlans<float>(3 * triangles, std::move(times), std::move(positions));
  scene.bodies = {std::move(body), std::move(triangle)};
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

TEST(EnvelopesAhead, BoxesAreTheSameWhereSegmentsAreOfAnyKind) {
  for (const char* segments : {"dtdttdd", "ttd", "td", "ddd"}) {
    TestScene<float> test;
    test.scene = made_of(segments, 500);
    check_same(test, segments, {.width = 2, .leaf_size = 1});
  }
}

TEST(EnvelopesAhead, NoFrameDoesTheWorkOfAWholeSegment) {
  const Scene<float> scene = made_of("ddddd", 8000);
  for (const std::uint32_t width : {2u, 8u})
    for (const std::uint32_t l : {4u, 10u, 30u}) {
      const BuilderConfig builder{.width = width, .leaf_size = 1};
      Play<float> present(scene, both[0], {}, builder), ahead(scene, both[1], {}, builder);
      present.reset(0);
      ahead.reset(0);
      const std::uint64_t size = ahead.session.strategy().audit_view(0)->topology.size();
      // The sorting of stores has a share of the time to itself; nodes are made in at least 64 blocks.
      const std::uint64_t most = size * 16 / (15 * l) + size / 64 + width + 1;
      std::uint64_t sum = 0, sum_present = 0;
      for (std::uint32_t f = 1; f <= 5 * l; ++f) {
        const double t = double(f) / l;
        const std::uint64_t visited = ahead.frame(t)[Counter::nodes_visited];
        const std::uint64_t at_once = present.frame(t)[Counter::nodes_visited];
        EXPECT_EQ(at_once, f % l == 0 && f < 5 * l ? size : 0u);
        // In the first segment, the first frame is that of `reset`, and two slices fall to the next frame.
        EXPECT_LE(visited, f == 1 ? 2 * most : most) << "frame " << f << ", l = " << l;
        sum += visited;
        sum_present += at_once;
      }
      EXPECT_EQ(sum, 4 * size) << "the first segment was made by reset";
      EXPECT_EQ(sum, sum_present);
      EXPECT_EQ(ahead.last[Counter::certificates_made], present.last[Counter::certificates_made]);
      EXPECT_EQ(ahead.last[Counter::certificates_failed], present.last[Counter::certificates_failed]);
      EXPECT_GT(ahead.last[Counter::bytes], present.last[Counter::bytes]);
    }
}

TEST(EnvelopesAhead, BodiesThatTranslateNeedNoPass) {
  for (const char* id : both) {
    const Scene<float> scene = made_of("dtdttd", 200);
    const BuilderConfig builder{.width = 8, .leaf_size = 1};
    Play<float> player(scene, id, {}, builder);
    player.reset(0);
    for (std::uint32_t f = 1; f <= 60; ++f) {
      player.frame(0.1 * f + 1e-9);
      const std::uint64_t begun = std::min(f / 10, 5u), expected[] = {0, 1, 1, 2, 3, 3};
      EXPECT_EQ(player.last[Counter::bodies_translated], expected[begun]) << id << ", frame " << f;
    }
    // Counts the passes of two segments; reset made the first segment's pass.
    const std::uint64_t size = player.session.strategy().audit_view(0)->topology.size();
    EXPECT_EQ(player.last[Counter::nodes_visited], 2 * size) << id;

    const Scene<float> translated = made_of("ttt", 200);
    Play<float> nothing_else(translated, id, {}, builder);
    nothing_else.reset(0);
    for (const double t : {0.5, 1.0, 1.5, 2.25}) nothing_else.frame(t);
    EXPECT_EQ(nothing_else.last[Counter::bodies_translated], 2u);
    EXPECT_EQ(nothing_else.last[Counter::nodes_visited], 0u);
    EXPECT_EQ(nothing_else.last[Counter::certificates_failed], 0u);
  }
}

TEST(EnvelopesAhead, AScenesOwnTranslationIsSeenWhereItIsExact) {
  for (const char* id : both) {
    const auto far = synthetic_scene<float>("pure_translation_far", 5);
    Play<float> player(far.scene, id, {});
    player.reset(0);
    for (const double t : frame_times(far.scene, 5)) player.frame(t);
    EXPECT_EQ(player.last[Counter::bodies_translated], 4u) << "two bodies, two segments after the first";
    EXPECT_EQ(player.last[Counter::nodes_visited], 0u);
  }
  // One coordinate of one vertex is the next number, so this is no longer a translation.
  Scene<float> scene = made_of("tt", 200);
  const FlightPlans<float>& plans = scene.bodies[0].plans;
  std::vector<float> positions;
  for (std::size_t k = 0; k < 3; ++k)
    positions.insert(positions.end(), plans.keyframe(k), plans.keyframe(k) + 3 * plans.vertex_count());
  positions.back() = std::nextafter(positions.back(), 9.f);
  scene.bodies[0].plans = FlightPlans<float>(plans.vertex_count(), {0, 1, 2}, std::move(positions));
  for (const char* id : both) {
    Play<float> player(scene, id, {});
    player.reset(0);
    for (const double t : {0.5, 1.0, 1.5}) player.frame(t);
    EXPECT_EQ(player.last[Counter::bodies_translated], 0u);
    EXPECT_GT(player.last[Counter::nodes_visited], 0u);
  }
}

}  // namespace
}  // namespace kbvh::test::envelopes_ahead_test
