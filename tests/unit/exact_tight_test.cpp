// The realisers that envelopes and calendars keep: exact on the flight plans at any requested time, also
// where plans change, and the same for every set of kernels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "core/families/envelope/calendar_tree.hpp"
#include "core/families/envelope/segment_envelope.hpp"
#include "core/motion/exact_piece.hpp"
#include "core/scene/playback.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/support/vertices_below.hpp"

namespace kbvh::test::exact_tight_test {
namespace {

template <class S>
WideHierarchy<S> hierarchy_of(const Body<S>& body, const BuilderConfig& builder,
                              KernelSet kernels = active_kernel_set()) {
  WideHierarchy<S> hierarchy;
  hierarchy.assign(build_topology(body.primitives, body.plans.keyframe(0), builder), body.primitives,
                   kernels);
  return hierarchy;
}

/// Counts sides whose realiser is not exactly the furthest of all vertices below, at t.
template <class S>
std::uint64_t wrong_sides(const WideHierarchy<S>& hierarchy, const WideRealisers& realisers,
                          const FlightPlans<S>& plans, double t) {
  const auto below = vertices_below(hierarchy);
  std::uint64_t wrong = 0;
  for (std::uint32_t node = 0; node < below.size(); ++node) {
    if (hierarchy.wide_parent(node) == WideHierarchy<S>::no_node) continue;
    for (std::uint32_t row = 0; row < 6; ++row) {
      const std::uint32_t place = realisers[hierarchy.row_place(node, row)];
      const int axis = int(row % 3);
      const Piece<S> winner = plans.piece_after(place / 3, axis, t);
      bool sound = place % 3 == row % 3 && std::count(below[node].begin(), below[node].end(), place / 3) > 0;
      for (const std::uint32_t v : below[node]) {
        const int ahead = compare_at(plans.piece_after(v, axis, t), winner, t);
        sound = sound && (row < 3 ? ahead >= 0 : ahead <= 0);
      }
      wrong += sound ? 0 : 1;
    }
  }
  return wrong;
}

const std::vector<BuilderConfig>& builders() {
  static const std::vector<BuilderConfig> list{
      {.method = BuildMethod::median, .width = 8, .leaf_size = 4},
      {.method = BuildMethod::sah, .width = 4, .leaf_size = 1},
      {.method = BuildMethod::morton, .width = 2, .leaf_size = 16},
  };
  return list;
}

template <class S>
void check_envelope_at_frames(const std::string& name) {
  const auto test = synthetic_scene<S>(name);
  for (const Body<S>& body : test.scene.bodies)
    for (const BuilderConfig& builder : builders()) {
      if (!body.plans.moving() || body.primitives.count() == 0) continue;
      WideHierarchy<S> hierarchy = hierarchy_of(body, builder);
      WideRealisers realisers;
      SegmentEnvelope<S> envelope;
      envelope.assign(hierarchy);
      find_realisers(hierarchy, body.plans.keyframe(0), realisers);
      const auto times = body.plans.keyframe_times();
      std::uint64_t stores = 0, seen_without = 0;
      for (std::size_t k = 0; k + 1 < times.size(); ++k) {
        envelope.make(hierarchy, realisers, body.plans.keyframe(k), body.plans.keyframe(k + 1), times[k],
                      times[k + 1]);
        const WideRealisers at_begin = realisers;
        // Times of events: exactly, if doubles allow that, and next to them.
        std::vector<double> frames{times[k]};
        for (const double part : {0.1, 0.25, 1.0 / 3, 0.5, 0.75, 0.999})
          frames.push_back(times[k] + part * (times[k + 1] - times[k]));
        for (std::size_t s = 0; s < envelope.stores().size(); s += 1 + envelope.stores().size() / 40) {
          const double part = double(envelope.stores()[s].key) * 0x1p-32;
          frames.push_back(times[k] + part * (times[k + 1] - times[k]));
          frames.push_back(std::nextafter(frames.back(), times[k + 1]));
        }
        std::sort(frames.begin(), frames.end());
        for (const double t : frames) {
          if (t >= times[k + 1]) continue;
          envelope.advance(t, realisers);
          ASSERT_EQ(wrong_sides(hierarchy, realisers, body.plans, t), 0u) << name << " at t = " << t;
        }
        stores += envelope.stores().size();
        envelope.advance(times[k + 1], realisers);
        seen_without += wrong_sides(hierarchy, at_begin, body.plans, times[k + 1]);
      }
      // A test that forgets the stores must be detected.
      EXPECT_EQ(stores > 0, seen_without > 0) << name;
      EXPECT_EQ(envelope.counts().stores, stores);
    }
}

TEST(SegmentEnvelope, IsExactAtAnyFrame) {
  for (const char* name : {"soups", "sheets", "integer_ties", "all_cross_at_once", "coincident_intervals",
                           "keyframes_a_millionth_apart", "tiny", "extreme_velocities"}) {
    check_envelope_at_frames<float>(name);
    check_envelope_at_frames<double>(name);
  }
}

TEST(SegmentEnvelope, NothingIsActiveWhereOrderDoesNotChange) {
  const auto test = synthetic_scene<float>("pure_translation_far");
  const Body<float>& body = test.scene.bodies[0];
  // All vertices have the same stored step up to rounding: keyframe 0 again, moved by a power of two.
  std::vector<float> first(body.plans.keyframe(0), body.plans.keyframe(0) + 3 * body.plans.vertex_count());
  std::vector<float> last;
  for (const float x : first) last.push_back(2 * x);
  first.push_back(0);
  last.push_back(0);
  WideHierarchy<float> hierarchy = hierarchy_of(body, builders()[0]);
  WideRealisers realisers;
  find_realisers(hierarchy, first.data(), realisers);
  SegmentEnvelope<float> envelope;
  envelope.assign(hierarchy);
  envelope.make(hierarchy, realisers, first.data(), last.data(), 0, 1);
  EXPECT_EQ(envelope.counts().active_sides, 0u);
  EXPECT_TRUE(envelope.stores().empty());
}

/// Triangles that fly about at random: too many for a few of the blocks in which envelopes are made.
template <class S>
Body<S> crowd(std::uint32_t triangles, std::uint32_t keyframes) {
  Body<S> body;
  Random random(11);
  std::vector<S> positions;
  std::vector<double> times;
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    times.push_back(k);
    for (std::uint32_t i = 0; i < 9 * triangles; ++i)
      positions.push_back(k == 0 ? S(random.unit())
                                 : positions[positions.size() - 9 * triangles] + S(0.05 * random.unit()));
  }
  for (std::uint32_t p = 0; p < triangles; ++p)
    body.primitives.add(std::vector<std::uint32_t>{3 * p, 3 * p + 1, 3 * p + 2});
  body.plans = FlightPlans<S>(3 * triangles, std::move(times), std::move(positions));
  return body;
}

// The next segment's envelope, made in slices during the current segment, equals the one made at once.
template <class S>
void check_slices(const Body<S>& body, const BuilderConfig& builder, double slice) {
  WideHierarchy<S> hierarchy = hierarchy_of(body, builder);
  WideRealisers at_once, present;
  SegmentEnvelope<S> whole, sliced;
  whole.assign(hierarchy, 64);
  sliced.assign(hierarchy, 64);
  find_realisers(hierarchy, body.plans.keyframe(0), at_once);
  present = at_once;
  WideRealisers at_end(present.size(), 0);
  const auto times = body.plans.keyframe_times();
  const auto p = [&](std::size_t k) { return body.plans.keyframe(k); };
  sliced.make(hierarchy, present, p(0), p(1), times[0], times[1]);
  for (std::size_t k = 0; k + 1 < times.size(); ++k) {
    whole.make(hierarchy, at_once, p(k), p(k + 1), times[k], times[k + 1]);
    ASSERT_EQ(whole.stores(), sliced.stores()) << "segment " << k << ", slices of " << slice;
    const bool last = k + 2 == times.size();
    if (!last) sliced.start_next(hierarchy, p(k + 1), p(k + 2), times[k + 2]);
    for (double share = 0; share < 1; share += slice) {
      const double t = times[k] + share * (times[k + 1] - times[k]);
      whole.advance(t, at_once);
      sliced.advance(t, present);
      ASSERT_EQ(at_once, present) << "at t = " << t << ", slices of " << slice;
      if (!last) sliced.step(hierarchy, present, at_end, share);
    }
    if (!last) sliced.step(hierarchy, present, at_end, 1);
    whole.advance(times[k + 1], at_once);
    sliced.advance(times[k + 1], present);
    ASSERT_EQ(at_once, present);
    if (last) break;
    EXPECT_EQ(at_once, at_end);
    EXPECT_EQ(sliced.nodes_left(), 0u);
    sliced.take_next();
    EXPECT_EQ(sliced.begin(), times[k + 1]);
    EXPECT_EQ(sliced.end(), times[k + 2]);
  }
  EXPECT_EQ(whole.counts().stores, sliced.counts().stores);
  EXPECT_EQ(whole.counts().active_sides, sliced.counts().active_sides);
  EXPECT_EQ(whole.counts().crossings, sliced.counts().crossings);
}

TEST(SegmentEnvelope, MadeInSlicesIsTheSame) {
  for (const BuilderConfig& builder : builders())
    for (const double slice : {2.0, 0.5, 0.301, 1.0 / 30, 0.001}) {
      for (const char* name : {"soups", "integer_ties", "coincident_intervals", "zero_motion"})
        check_slices(synthetic_scene<float>(name).scene.bodies[0], builder, slice);
      check_slices(crowd<float>(6000, 5), builder, slice);
      check_slices(crowd<double>(1500, 4), builder, slice);
    }
}

TEST(SegmentEnvelope, WhatIsMadeAtOnceEndsWhatWasBegun) {
  const Body<float> body = crowd<float>(3000, 5);
  WideHierarchy<float> hierarchy = hierarchy_of(body, builders()[1]);
  const auto p = [&](std::size_t k) { return body.plans.keyframe(k); };
  WideRealisers first, third;
  find_realisers(hierarchy, p(0), first);
  find_realisers(hierarchy, p(2), third);
  WideRealisers at_end(first.size(), 0);
  SegmentEnvelope<float> envelope, fresh;
  envelope.assign(hierarchy);
  fresh.assign(hierarchy);
  for (const double share : {0.0, 0.4, 0.99, 1.0}) {
    WideRealisers realisers = first;
    envelope.make(hierarchy, realisers, p(0), p(1), 0, 1);
    envelope.start_next(hierarchy, p(1), p(2), 2);
    envelope.step(hierarchy, realisers, at_end, share);
    WideRealisers jumped = third, expected = third;
    envelope.make(hierarchy, jumped, p(2), p(3), 2, 3);
    fresh.make(hierarchy, expected, p(2), p(3), 2, 3);
    ASSERT_EQ(envelope.stores(), fresh.stores()) << share;
    envelope.advance(2.5, jumped);
    fresh.advance(2.5, expected);
    ASSERT_EQ(jumped, expected);
    envelope.make_empty(3, 4);
    EXPECT_TRUE(envelope.stores().empty());
    EXPECT_EQ(envelope.end(), 4);
    envelope.advance(3.5, jumped);
    ASSERT_EQ(jumped, expected);
  }
}

// Frames at uneven distances; plans change at some of them.
template <class S>
void check_calendar(const std::string& name) {
  const auto test = synthetic_scene<S>(name, 7);
  for (const BuilderConfig& builder : builders()) {
    Playback<S> playback(test.scene);
    std::vector<double> frames = test.frames;
    Random random(5);
    for (std::uint32_t i = 0; i < 20; ++i)
      frames.push_back(frames.front() + (frames.back() - frames.front()) * 0.5 * (random.unit() + 1));
    for (const auto& step : test.script.steps) frames.push_back(step.time);
    std::sort(frames.begin(), frames.end());
    playback.seek(frames.front());
    std::vector<WideHierarchy<S>> hierarchies;
    std::vector<WideRealisers> realisers(test.scene.bodies.size());
    for (const Body<S>& body : test.scene.bodies) hierarchies.push_back(hierarchy_of(body, builder));
    std::vector<CalendarTree<S>> trees;
    for (std::uint32_t b = 0; b < hierarchies.size(); ++b) {
      trees.emplace_back(hierarchies[b], SegmentMotion<S>(playback), b);
      trees[b].reset(hierarchies[b], realisers[b]);
    }
    const auto expect_exact = [&](double t) {
      for (std::uint32_t b = 0; b < trees.size(); ++b)
        ASSERT_EQ(wrong_sides(hierarchies[b], realisers[b], playback.plans(b), t), 0u)
            << name << ", body " << b << " at t = " << t;
    };
    auto step = test.script.steps.begin();
    for (const double t : frames) {
      playback.seek(t);
      for (std::uint32_t b = 0; b < trees.size(); ++b) trees[b].advance(hierarchies[b], realisers[b]);
      expect_exact(t);
      if (step == test.script.steps.end() || step->time != t) continue;
      playback.change_plans(t, step->changes);
      for (std::uint32_t b = 0; b < trees.size(); ++b)
        trees[b].plans_changed(hierarchies[b], realisers[b], step->changes);
      expect_exact(t);
      ++step;
    }
    EXPECT_TRUE(step == test.script.steps.end());
  }
}

TEST(CalendarTree, IsExactAtAnyFrame) {
  for (const char* name : {"soups", "integer_ties", "four_bodies_own_keyframes", "plan_changes",
                           "plan_changes_ties", "plans_start_at_rest", "extreme_plan_changes"}) {
    check_calendar<float>(name);
    check_calendar<double>(name);
  }
}

// One vertex of many gets another velocity: only the sides of its leaves and those above are checked.
TEST(CalendarTree, ChangesOfPlansAreLocal) {
  Body<double> body;
  std::vector<double> positions;
  Random random(9);
  constexpr std::uint32_t triangles = 4000;
  for (int k = 0; k < 2; ++k)
    for (std::uint32_t v = 0; v < 3 * triangles; ++v) {
      if (k == 0)
        for (int axis = 0; axis < 3; ++axis) positions.push_back(random.unit());
      else
        for (int axis = 0; axis < 3; ++axis) positions.push_back(2 * positions[3 * v + std::size_t(axis)]);
    }
  for (std::uint32_t p = 0; p < triangles; ++p)
    body.primitives.add(std::vector<std::uint32_t>{3 * p, 3 * p + 1, 3 * p + 2});
  body.plans = FlightPlans<double>(3 * triangles, {0, 1}, std::move(positions));
  Scene<double> scene;
  scene.bodies.push_back(std::move(body));
  Playback<double> playback(scene);
  playback.seek(0);
  WideHierarchy<double> hierarchy = hierarchy_of(scene.bodies[0], {.width = 8, .leaf_size = 4});
  WideRealisers realisers;
  CalendarTree<double> tree(hierarchy, SegmentMotion<double>(playback), 0);
  tree.reset(hierarchy, realisers);
  tree.clear_counts();
  playback.seek(0.25);
  tree.advance(hierarchy, realisers);
  EXPECT_EQ(tree.counts().sides, 0u) << "everything grows alike: no certificate fails";
  PlanChange<double> change;
  change.vertex = 17;
  change.velocity[0] = 3;
  playback.change_plans(0.25, std::vector{change});
  tree.plans_changed(hierarchy, realisers, std::vector{change});
  EXPECT_LE(tree.counts().certificates, 6u * (30 + 8 * 8));
  EXPECT_LE(tree.counts().sides, 6u * 8);
  for (const double t : {0.25, 0.5, 0.9}) {
    playback.seek(t);
    tree.advance(hierarchy, realisers);
    EXPECT_EQ(wrong_sides(hierarchy, realisers, playback.plans(0), t), 0u) << t;
  }
  EXPECT_GT(tree.counts().changes, 0u);
}

template <class S>
void check_kernels() {
  const auto test = synthetic_scene<S>("soups");
  const Body<S>& body = test.scene.bodies[0];
  for (const BuilderConfig& builder : builders()) {
    WideHierarchy<S> plain = hierarchy_of(body, builder, KernelSet::portable);
    const std::size_t scalars = lane_scalars(builder.width);
    WideRealisers realisers;
    find_realisers(plain, body.plans.keyframe(0), realisers);
    plain.refit(body.plans.keyframe(0));
    for (const KernelSet set : supported_kernel_sets()) {
      const auto& kernels = wide_realiser_kernels<S>(set);
      WideHierarchy<S> other = hierarchy_of(body, builder, set);
      std::vector<S> values(scalars);
      for (std::uint32_t node = 0; node < other.node_count(); ++node) {
        kernels.collect(realisers.data() + node * scalars, body.plans.keyframe(0), scalars, values.data());
        kernels.place(builder.width)(other.arrays(), values.data(), node);
      }
      for (std::uint32_t node = 0; node < plain.topology().size(); ++node)
        ASSERT_EQ(plain.box(node), other.box(node)) << name(set) << ", node " << node;
      // At another keyframe some realisers no longer realise their sides: those whose value differs from the
      // box's.
      std::vector<std::uint64_t> lost(other.node_count());
      const S* later = body.plans.keyframe(1);
      kernels.check(builder.width)(other.arrays(), realisers.data(), later, lost.data(), 0,
                                   other.node_count());
      plain.refit(later);
      std::uint64_t found = 0;
      for (std::uint32_t node = 0; node < plain.topology().size(); ++node) {
        if (plain.wide_parent(node) == WideHierarchy<S>::no_node) continue;
        const Box<S> box = plain.box(node);
        for (std::uint32_t row = 0; row < 6; ++row) {
          const std::size_t place = plain.row_place(node, row);
          const bool differs = later[realisers[place]] != (row < 3 ? box.lower : box.upper)[row % 3];
          ASSERT_EQ(lost[place / scalars] >> (place % scalars) & 1, differs ? 1u : 0u) << name(set);
          found += differs ? 1 : 0;
        }
      }
      EXPECT_GT(found, 0u);
      plain.refit(body.plans.keyframe(0));
    }
  }
}

TEST(RealiserKernels, AgreeWithBoxes) {
  check_kernels<float>();
  check_kernels<double>();
}

}  // namespace
}  // namespace kbvh::test::exact_tight_test
