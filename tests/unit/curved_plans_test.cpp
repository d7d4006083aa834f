// Flight plans with curves: what their constructor refuses, positions, bounds of motion, hashes, renumbering,
// and which contestants take them.

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/motion/round_curve.hpp"
#include "core/topology/renumber.hpp"
#include "tests/support/curved_scenes.hpp"
#include "tests/support/rational_curves.hpp"

namespace kbvh::test::curved_plans_test {
namespace {

/// Two vertices, three keyframes: a parabola, then a line.
FlightPlans<float> small_plans() {
  return {2,
          {0, 1, 3},
          {0, 0, 0, 1, 1, 1, 0, 0, 1, 1, 1, 2, 0, 0, 0, 1, 1, 1},
          {{{0, 0, 4, 0, 0, 2}, {0, 0, 0, 0, 0, 0}}, {{}, {}}}};
}

template <class Make>
std::string refusal(const Make& make) {
  try {
    make();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST(CurvedPlans, KnowTheirCurves) {
  const FlightPlans<float> plans = small_plans();
  EXPECT_TRUE(plans.curved());
  EXPECT_TRUE(plans.curved_in(0));
  EXPECT_FALSE(plans.curved_in(1));
  EXPECT_FALSE(plans.curved_at(-1));
  EXPECT_TRUE(plans.curved_at(0));
  EXPECT_FALSE(plans.curved_at(1));
  EXPECT_FALSE(plans.curved_at(5));
  EXPECT_EQ(plans.twists(0), nullptr) << "zeros are not stored";
  EXPECT_EQ(plans.curved_piece(0, 2, 0), (CurvedPiece<float>{0, 1, 0, 1, 4, 0}));
  EXPECT_EQ(plans.curved_piece(1, 2, 1), (CurvedPiece<float>{1, 3, 2, 1, 0, 0}));
  EXPECT_EQ(plans.piece_after(0, 2, 1), (Piece<float>{1, 3, 1, 0, PieceKind::chord}));
  EXPECT_THROW(plans.piece_after(0, 2, 0.5), std::logic_error);
  float out[6];
  plans.evaluate(0.5, out);
  EXPECT_EQ(out[2], 1.5F);
  EXPECT_EQ(out[5], 2.0F);
  EXPECT_EQ(out[3], 1.0F);
  plans.evaluate(2, out);
  EXPECT_EQ(out[2], 0.5F);
  const std::uint32_t second[] = {1};
  plans.evaluate(0.25, second, out);
  EXPECT_EQ(out[5], 1.625F);
  EXPECT_EQ(out[2], 0.5F);
}

TEST(CurvedPlans, ZerosMakeLines) {
  const FlightPlans<float> plans(1, {0, 1}, {0, 0, 0, 1, 1, 1}, {{{0, -0.0F, 0}, {0, 0, 0}}});
  EXPECT_FALSE(plans.curved());
  EXPECT_EQ(plans.piece_after(0, 0, 0.5).x1, 1.0F);
  // A cubic alone gets zeros for its bend.
  const FlightPlans<float> cubic(1, {0, 1}, {0, 0, 0, 1, 1, 1}, {{{}, {1, 0, 0}}});
  ASSERT_TRUE(cubic.curved());
  EXPECT_EQ(cubic.curved_piece(0, 0, 0), (CurvedPiece<float>{0, 1, 0, 1, 0, 1}));
}

TEST(CurvedPlans, RefuseWhatIsWrong) {
  const auto made = [](std::vector<SegmentBends<float>> bends) {
    return refusal([&] { FlightPlans<float>(1, {0, 1, 2}, {0, 0, 0, 1, 1, 1, 2, 2, 2}, std::move(bends)); });
  };
  EXPECT_EQ(made({{{1, 0, 0}, {}}, {}}), "");
  EXPECT_EQ(made({{{1, 0, 0}, {}}}), "expected the curves of 2 segments, got 1");
  EXPECT_EQ(made({{}, {{1, 0}, {}}}), "expected 3 numbers for the curves of segment 1, got 2");
  EXPECT_NE(made({{}, {{1, 0, 2e30F}, {}}}).find("bend of vertex 0, axis z"), std::string::npos);
  EXPECT_NE(made({{{1, 0, 0}, {0, NAN, 0}}, {}}).find("twist of vertex 0, axis y"), std::string::npos);
}

TEST(CurvedPlans, DoNotChangeAtRunTime) {
  FlightPlans<float> plans = small_plans();
  const float position[3] = {0, 0, 0};
  PlanChange<float> change;
  change.vertex = 1;
  const std::string why = "plans of a body whose vertices move on curves cannot change";
  EXPECT_EQ(refusal([&] { plans.change(1, change, position); }), why);
  EXPECT_EQ(refusal([&] { plans.add_vertex(1, change, position); }), why);
}

/// Bounds of speed and displacement hold for every vertex, and are reached but for a factor.
template <class S>
void check_bounds(const std::string& name) {
  const Scene<S> scene = curved_scene<S>(name).scene;
  Random random(3);
  for (const Body<S>& body : scene.bodies) {
    const FlightPlans<S>& plans = body.plans;
    const double first = plans.keyframe_times().front(), last = plans.keyframe_times().back();
    std::vector<S> from(std::size_t(3) * plans.vertex_count()), to(from.size());
    for (int i = 0; i < 60; ++i) {
      double t0 = first + (last - first) * (0.5 + 0.55 * random.unit()),
             t1 = i % 2 == 0 ? t0 + 0.01 * (last - first)
                             : first + (last - first) * (0.5 + 0.55 * random.unit());
      if (t1 < t0) std::swap(t0, t1);
      plans.evaluate(t0, from.data());
      plans.evaluate(t1, to.data());
      const double bound = plans.displacement_bound(t0, t1);
      double longest = 0, rounding = 0;
      for (std::size_t v = 0; v < from.size(); v += 3) {
        longest = std::max(
            longest, std::hypot(double(to[v]) - double(from[v]), double(to[v + 1]) - double(from[v + 1]),
                                double(to[v + 2]) - double(from[v + 2])));
        for (std::size_t axis = 0; axis < 3; ++axis)
          rounding = std::max({rounding, std::abs(double(to[v + axis])), std::abs(double(from[v + axis]))});
      }
      EXPECT_LE(longest, bound + 4 * rounding * double(std::numeric_limits<S>::epsilon())) << name;
      if (t0 >= first && plans.segment_at(t0) == plans.segment_at(t1)) {
        EXPECT_LE(longest, plans.speed_bound(t0) * (t1 - t0) * (1 + 1e-9) +
                               4 * rounding * double(std::numeric_limits<S>::epsilon()))
            << name;
      }
    }
  }
}

TEST(CurvedPlans, SpeedsAndDisplacementsAreBounded) {
  for (const std::string& name : curved_scene_names()) {
    check_bounds<float>(name);
    check_bounds<double>(name);
  }
}

// Lines through the points of a hull, at both ends of a segment or of a part of it, enclose the curve.
template <class S>
void check_hulls(const std::string& name) {
  const Scene<S> scene = curved_scene<S>(name).scene;
  Random random(4);
  for (const Body<S>& body : scene.bodies) {
    const FlightPlans<S>& plans = body.plans;
    const std::size_t n = std::size_t(3) * plans.vertex_count();
    std::vector<S> first(2 * n), last(2 * n);
    for (std::size_t k = 0; k + 1 < plans.keyframe_count(); ++k)
      for (int round = 0; round < 3; ++round) {
        const double t0 = plans.keyframe_times()[k], t1 = plans.keyframe_times()[k + 1];
        double begin = t0, end = t1;
        if (round > 0) begin = t0 + (t1 - t0) * (0.25 + 0.2 * random.unit());
        if (round > 1) end = t1 - (t1 - t0) * (0.25 + 0.2 * random.unit());
        if (!(t0 <= begin && begin < end && end <= t1)) continue;
        plans.evaluate_hull(begin, end, begin, first.data());
        plans.evaluate_hull(begin, end, end, last.data());
        for (std::size_t i = 0; i < n; i += 1 + i % 7)
          for (int step = 0; step <= 4; ++step) {
            const Rational share(step, 4), t = Rational(begin) + (Rational(end) - Rational(begin)) * share;
            const Rational x = rational_value(plans.curved_piece(std::uint32_t(i / 3), int(i % 3), k), t);
            const auto line = [&](std::size_t at) {
              return Rational(Rational(double(first[at])) * (1 - share) + Rational(double(last[at])) * share);
            };
            // Positions at the ends are rounded.
            const double largest = std::max(std::abs(double(first[i])), std::abs(double(last[i])));
            const Rational rounding(largest * double(std::numeric_limits<S>::epsilon()) +
                                    double(std::numeric_limits<S>::denorm_min()));
            EXPECT_LE(line(i), x + rounding) << name;
            EXPECT_GE(line(n + i), x - rounding) << name;
          }
      }
  }
}

TEST(CurvedPlans, HullsEncloseCurves) {
  for (const std::string& name : curved_scene_names()) {
    check_hulls<float>(name);
    check_hulls<double>(name);
  }
}

// Short parts around the top of a parabola, x = -(s - 1/2)^2: the distances of the curve from its chord and
// from zero are of one size, so that a hull has to know the length of the part to many digits.
TEST(CurvedPlans, HullsOfShortPartsEncloseTheTopOfAParabola) {
  const FlightPlans<double> plans(1, {0.1, 0.8}, {-0.25, 0, 0, -0.25, 0, 0}, {{{1, 0, 0}, {}}});
  const CurvedPiece<double> piece = plans.curved_piece(0, 0, 0);
  Random random(5);
  double first[6], last[6];
  for (int i = 0; i < 600; ++i) {
    const double half = 0.35 * std::ldexp(1 + 0.5 * random.unit(), -12 - i % 12),
                 middle = 0.45 + 0.1 * half * random.unit(), begin = middle - half, end = middle + half;
    plans.evaluate_hull(begin, end, begin, first);
    plans.evaluate_hull(begin, end, end, last);
    const Rational t = (Rational(begin) + Rational(end)) / 2, x = rational_value(piece, t),
                   lower = (Rational(first[0]) + Rational(last[0])) / 2,
                   upper = (Rational(first[3]) + Rational(last[3])) / 2;
    EXPECT_TRUE(lower <= x && x <= upper) << begin << " to " << end;
  }
}

TEST(CurvedPlans, HashesTellCurvesApart) {
  const Scene<float> curved = curved_scene<float>("curved_gravity").scene,
                     lines = synthetic_scene<float>("sheets").scene;
  EXPECT_NE(hash(curved), hash(lines));
  Scene<float> other = curved;
  const FlightPlans<float>& plans = curved.bodies[0].plans;
  const std::size_t scalars = std::size_t(3) * plans.vertex_count();
  std::vector<float> positions;
  std::vector<SegmentBends<float>> bends;
  for (std::size_t k = 0; k < plans.keyframe_count(); ++k) {
    positions.insert(positions.end(), plans.keyframe(k), plans.keyframe(k) + scalars);
    if (k + 1 < plans.keyframe_count()) bends.push_back({{plans.bends(k), plans.bends(k) + scalars}, {}});
  }
  const auto remade = [&] {
    return FlightPlans<float>(plans.vertex_count(),
                              {plans.keyframe_times().begin(), plans.keyframe_times().end()}, positions,
                              bends);
  };
  other.bodies[0].plans = remade();
  EXPECT_EQ(hash(curved), hash(other));
  bends[1].bend[5] = 0.25F;
  other.bodies[0].plans = remade();
  EXPECT_NE(hash(curved), hash(other));
}

TEST(CurvedPlans, SurviveRenumbering) {
  const Scene<float> scene = curved_scene<float>("curved_mixed").scene;
  const RenumberedScene<float> renumbered = renumber_in_leaf_order(scene, {});
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const FlightPlans<float>&before = scene.bodies[b].plans, &after = renumbered.scene.bodies[b].plans;
    EXPECT_EQ(before.curved(), after.curved());
    std::vector<float> old_positions(std::size_t(3) * before.vertex_count()),
        new_positions(old_positions.size());
    for (const double t : {-1.0, 0.0, 0.1, 0.2, 0.33, 0.7, 5.0}) {
      before.evaluate(t, old_positions.data());
      after.evaluate(t, new_positions.data());
      for (std::uint32_t v = 0; v < before.vertex_count(); ++v)
        for (std::uint32_t axis = 0; axis < 3; ++axis)
          EXPECT_EQ(new_positions[3 * v + axis], old_positions[3 * renumbered.old_vertex[b][v] + axis]);
    }
  }
}

TEST(CurvedPlans, ContestantsSayWhetherTheyTakeThem) {
  const Scene<float> curved = curved_scene<float>("curved_mixed").scene;
  Info info;
  info.id = "lines_only";
  EXPECT_EQ(unsuitable_bodies(info, curved),
            "foresees linear motion only, but vertices of body 'body0' move on curves");
  EXPECT_EQ(unsuitable_bodies(info, synthetic_scene<float>("four_bodies_own_keyframes").scene), "");
  info.can.curves = true;
  EXPECT_EQ(unsuitable_bodies(info, curved), "");
}

// A curve may leave the range of a contestant although its keyframes are within.
TEST(CurvedPlans, StayWithinTheRangeOfAContestant) {
  const auto refused = [](double most, float bend) {
    Scene<float> scene;
    Body<float>& body = scene.bodies.emplace_back();
    body.name = "arc";
    body.plans = FlightPlans<float>(1, {0, 1, 2}, {0, 0, 0, 1, 0, 0, 1, 0, 0}, {{}, {{0, bend, 0}, {}}});
    Info info;
    info.id = "near";
    info.can.curves = true;
    info.max_coordinate = most;
    return unsuitable_bodies(info, scene);
  };
  EXPECT_EQ(refused(2.5, 8), "");
  EXPECT_TRUE(refused(1.5, 8).starts_with(
      "takes coordinates up to 1.5, but vertex 0 of body 'arc' may come to y = 2"));
  EXPECT_TRUE(refused(1.5, 8).ends_with(" after keyframe 1"));
  EXPECT_EQ(refused(2.5, -8), "");
  EXPECT_TRUE(refused(1.5, -8).starts_with(
      "takes coordinates up to 1.5, but vertex 0 of body 'arc' may come to y = -2"));
  EXPECT_EQ(refused(1.5, 0), "");
  EXPECT_TRUE(refused(0.5, 8).ends_with("is at x = 1 at keyframe 1"));
}

}  // namespace
}  // namespace kbvh::test::curved_plans_test
