// Plans that change at difficult moments, for every strategy that declares plan_changes: several at once, at
// the exact time of an event, at keyframes, at the first and the last frame, thousands of them, and of unused
// vertices; and errors, after which nothing has changed.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/conformance/check.hpp"
#include "tests/support/plan_changes.hpp"

namespace kbvh::test::plan_changes_test {
namespace {

/// Goes through one point of its own, then stays there.
template <class S>
PlanChange<S> goes_to(std::uint32_t body, std::uint32_t vertex, double when, S x, S y, S z) {
  PlanChange<S> change;
  change.body = body;
  change.vertex = vertex;
  change.times = {when};
  change.positions = {x, y, z};
  return change;
}

class PlanChanges : public testing::TestWithParam<std::string> {
 protected:
  /// Leaves of one primitive, and wide, full leaves: both ways in which a certificate can involve a changed
  /// vertex.
  template <class S>
  void conforms(const TestScene<S>& test, const std::string& what) {
    const StrategyEntry& entry = find_strategy(GetParam());
    std::vector<BuilderConfig> builders{entry.info.topology.preferred};
    if (!entry.info.topology.own) {
      const auto& needs = entry.info.topology;
      builders.push_back({.method = BuildMethod::sah,
                          .width = needs.widths.back(),
                          .leaf_size = std::min(needs.max_leaf_size, std::max(needs.min_leaf_size, 4u))});
    }
    for (const BuilderConfig& builder : builders) {
      const std::string violation = check(entry, test, 1, {}, builder);
      if (violation.starts_with("skipped")) continue;
      EXPECT_EQ(violation, "") << GetParam() << ": " << what << ", " << (sizeof(S) == 4 ? "float" : "double")
                               << ", leaf size " << builder.leaf_size;
    }
  }
  template <class Make>
  void conforms_with(const std::string& scene, std::uint32_t l, const std::string& what, const Make& make) {
    const auto run = [&](auto test) {
      make(test);
      conforms(test, what + " on " + scene);
    };
    run(synthetic_scene<float>(scene, l));
    if (in_both_scalars()) run(synthetic_scene<double>(scene, l));
  }
};

TEST_P(PlanChanges, OneVertexSeveralTimesAtOnce) {
  for (const std::string scene : {"soups", "integer_ties"})
    conforms_with(scene, 3, "a vertex changed thrice in one call", []<class S>(TestScene<S>& test) {
      const double when = test.frames[2];
      test.script.steps.push_back(
          {when,
           {flies<S>(0, 5, 9, 9, 9), flies<S>(0, 5, -9, 9, 1), flies<S>(1, 7, 1, 0, 0),
            goes_to<S>(0, 5, when + 0.5, 0, 1, 0), flies<S>(0, 5, S(0.25), 0, S(-0.5))}});
      test.script.steps.push_back(
          {test.frames[5], {goes_to<S>(0, 5, test.frames[5] + 0.3, 1, 1, 1), flies<S>(0, 5, 0, 0, 0)}});
    });
}

// In the mirrored sheet every pair of vertices meets at t = 0.5: the event, the frame and the change are one.
TEST_P(PlanChanges, AtTheExactTimeOfEvents) {
  conforms_with("all_cross_at_once", 2, "changes at the time of all events", []<class S>(TestScene<S>& test) {
    for (const std::size_t frame : {std::size_t(1), std::size_t(3)}) {
      std::vector<PlanChange<S>> changes;
      for (std::uint32_t v = 0; v < test.scene.bodies[0].plans.vertex_count(); v += 2)
        changes.push_back(flies<S>(0, v, S(int(v % 5) - 2), S(int(v % 3) - 1), 0));
      test.script.steps.push_back({test.frames[frame], std::move(changes)});
    }
  });
  // Two vertices on a line, at x = t and x = 4 - t: they meet at t = 2, where one of them, or both, turn
  // back. They part without having crossed, and are then sent to meet at an integer time again.
  const auto meeting = [](auto scalar, std::uint32_t turned) {
    using S = decltype(scalar);
    TestScene<S> test;
    Primitives segments;
    for (std::uint32_t v = 0; v < 4; ++v) segments.add(std::vector<std::uint32_t>{v});
    segments.add(std::vector<std::uint32_t>{0, 1});
    test.scene.bodies.push_back(
        {"line", segments, FlightPlans<S>(4, {0, 8}, {0, 0, 0, 4,  0, 0, -1, 0, 0, 5, 0, 0,
                                                      8, 0, 0, -4, 0, 0, -1, 0, 0, 5, 0, 0})});
    Primitives obstacle;
    for (std::uint32_t v = 0; v < 5; ++v) obstacle.add(std::vector<std::uint32_t>{v});
    test.scene.bodies.push_back(
        {"points", obstacle, FlightPlans<S>(5, {0}, {0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4, 0, 0})});
    test.scene.pairs = all_pairs(test.scene.bodies);
    for (int f = 0; f <= 8; ++f) test.frames.push_back(f);
    typename PlanScript<S>::Step step{2, {}};
    if (turned != 1) step.changes.push_back(flies<S>(0, 0, -1, 0, 0));
    if (turned != 0) step.changes.push_back(flies<S>(0, 1, 1, 0, 0));
    test.script.steps = {step, {4, {flies<S>(0, 0, 1, 0, 0), flies<S>(0, 1, -1, 0, 0)}}};
    return test;
  };
  for (const std::uint32_t turned : {0u, 1u, 2u}) {
    conforms(meeting(float(), turned), "vertices that meet and turn");
    if (in_both_scalars()) conforms(meeting(double(), turned), "vertices that meet and turn");
  }
}

TEST_P(PlanChanges, AtKeyframesAndAtTheFirstAndTheLastFrame) {
  for (const std::string scene : {"soups", "integer_ties", "four_bodies_own_keyframes", "zero_motion"})
    conforms_with(scene, 4, "changes at keyframes", []<class S>(TestScene<S>& test) {
      const std::vector<double> keyframes = overlaid_keyframes(test.scene);
      for (const double t : keyframes) {
        std::vector<PlanChange<S>> changes;
        for (std::uint32_t body = 0; body < test.scene.bodies.size(); ++body) {
          const std::uint32_t vertices = test.scene.bodies[body].plans.vertex_count();
          const auto k = std::uint32_t(changes.size() + test.script.steps.size());
          changes.push_back(flies<S>(body, (7 * k + 1) % vertices, S(0.5), S(-0.25), 0));
          // A knot at the next frame, and at the next keyframe if there is one.
          changes.push_back(goes_to<S>(body, (5 * k + 2) % vertices, t + 0.25, 0, S(0.5), S(0.5)));
        }
        test.script.steps.push_back({t, std::move(changes)});
      }
      // The clip continues after the last change.
      for (int f = 1; f <= 3; ++f) test.frames.push_back(keyframes.back() + 0.5 * f);
    });
}

TEST_P(PlanChanges, ThousandsAtOnce) {
  const auto grid = [](auto scalar) {
    using S = decltype(scalar);
    TestScene<S> test;
    constexpr std::uint32_t side = 47;
    for (int b = 0; b < 2; ++b) {
      Primitives primitives;
      std::vector<S> positions;
      for (int keyframe = 0; keyframe < 2; ++keyframe)
        for (std::uint32_t y = 0; y <= side; ++y)
          for (std::uint32_t x = 0; x <= side; ++x)
            for (const double c :
                 {x / 16.0, y / 16.0, b == 0 ? ((x * y + std::uint32_t(keyframe)) % 7) / 64.0 : 0.05})
              positions.push_back(S(c));
      for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
          const std::uint32_t v = y * (side + 1) + x, w = v + side + 1;
          primitives.add(std::vector<std::uint32_t>{v, v + 1, w});
          primitives.add(std::vector<std::uint32_t>{w, v + 1, w + 1});
        }
      test.scene.bodies.push_back(
          {"grid", primitives, FlightPlans<S>((side + 1) * (side + 1), {0, 1}, std::move(positions))});
    }
    test.scene.pairs = all_pairs(test.scene.bodies);
    test.frames = frame_times(test.scene, 6);
    Random random(5);
    for (const std::size_t frame : {std::size_t(0), std::size_t(1), std::size_t(4)}) {
      typename PlanScript<S>::Step step{test.frames[frame], {}};
      for (std::uint32_t b = 0; b < 2; ++b)
        for (std::uint32_t v = 0; v < (side + 1) * (side + 1); ++v)
          step.changes.push_back(
              flies<S>(b, v, S(0.1 * random.unit()), S(0.1 * random.unit()), S(0.1 * random.unit())));
      test.script.steps.push_back(std::move(step));
    }
    return test;
  };
  conforms(grid(float()), "4608 changes at once");
  conforms(grid(double()), "4608 changes at once");
}

TEST_P(PlanChanges, OfVerticesThatNoPrimitiveUses) {
  conforms_with("soups", 3, "a vertex without a primitive", []<class S>(TestScene<S>& test) {
    for (Body<S>& body : test.scene.bodies) {  // removes every fourth triangle, but not its vertices
      Primitives fewer;
      for (std::uint32_t p = 0; p < body.primitives.count(); ++p)
        if (p % 4 != 1) fewer.add(body.primitives[p]);
      body.primitives = fewer;
    }
    test.script.steps.push_back({test.frames[1], {flies<S>(0, 3, 100, 0, 0)}});
    test.script.steps.push_back({test.frames[4],
                                 {flies<S>(0, 3, -100, 0, 0), flies<S>(0, 4, 0, 50, 0),
                                  flies<S>(0, 0, 1, 0, 0), goes_to<S>(1, 5, test.frames[4] + 0.1, 7, 7, 7)}});
  });
}

// If any one of several changes is invalid, none is made: the clip continues as if there had been no request.
TEST_P(PlanChanges, ErrorsChangeNothing) {
  const StrategyEntry& entry = find_strategy(GetParam());
  const auto run = [&]<class S>(const TestScene<S>& test) {
    if (entry.factory<S>() == nullptr) return;
    constexpr S infinity = std::numeric_limits<S>::infinity(), nan = std::numeric_limits<S>::quiet_NaN();
    const Contestant contestant{&entry, {}, entry.info.topology.preferred};
    Session<S> session(test.scene, contestant);
    Session<S> other(test.scene, contestant);  // receives no requests for changes
    Playback<S> undisturbed(test.scene);
    PairBuffer pairs, expected;
    PhaseTimes times;
    session.reset(test.frames[0]);
    other.reset(test.frames[0]);
    for (std::size_t f = 0; f < test.frames.size(); ++f) {
      const double t = test.frames[f];
      if (f > 0) session.advance(t, times);
      if (f > 0) other.advance(t, times);
      session.query(pairs, times);
      other.query(expected, times);
      std::sort(pairs.begin(), pairs.end());
      std::sort(expected.begin(), expected.end());
      EXPECT_EQ(pairs, expected) << GetParam() << " at frame " << f;
      undisturbed.seek(t);
      if (entry.info.guarantee != Guarantee::approximate) {
        EXPECT_EQ(pairs, sweep_pairs(test.scene, undisturbed)) << GetParam() << " at frame " << f;
      }
      PlanChange<S> odd_sizes = goes_to<S>(0, 2, t + 1, 0, 0, 0), two_knots = odd_sizes;
      odd_sizes.positions.pop_back();
      two_knots.times = {t + 1, t + 1};
      two_knots.positions.assign(6, S(0));
      for (const PlanChange<S>& wrong :
           {flies<S>(std::uint32_t(test.scene.bodies.size()), 0, 0, 0, 0),
            flies<S>(0, test.scene.bodies[0].plans.vertex_count(), 0, 0, 0), flies<S>(0, 1, nan, 0, 0),
            flies<S>(0, 1, 0, 0, infinity), flies<S>(0, 1, 0, admissible_magnitude<S> * 2, 0),
            goes_to<S>(0, 1, t - 0.125, 0, 0, 0), goes_to<S>(0, 1, t, 0, 0, 0),
            goes_to<S>(0, 1, std::numeric_limits<double>::infinity(), 0, 0, 0),
            goes_to<S>(0, 1, std::numeric_limits<double>::quiet_NaN(), 0, 0, 0),
            goes_to<S>(0, 1, t + 1, nan, 0, 0), odd_sizes, two_knots}) {
        const std::vector<PlanChange<S>> changes{flies<S>(0, 1, 3, 3, 3), flies<S>(1, 2, 3, 3, 3), wrong};
        EXPECT_THROW(session.change_plans(changes, times), std::invalid_argument) << GetParam();
      }
      // In the past, and in the future.
      const std::vector<PlanChange<S>> sound{flies<S>(0, 1, 3, 3, 3)};
      EXPECT_THROW(session.playback().change_plans(t - 0.125, sound), std::invalid_argument);
      EXPECT_THROW(session.playback().change_plans(t + 0.125, sound), std::invalid_argument);
    }
  };
  run(synthetic_scene<float>("soups", 3));
  run(synthetic_scene<double>("soups", 3));
}

// A reset session plays the scene's own plans again, and then the script as before.
TEST_P(PlanChanges, ResetForgetsThem) {
  const StrategyEntry& entry = find_strategy(GetParam());
  const auto run = [&]<class S>(const TestScene<S>& test) {
    if (entry.factory<S>() == nullptr) return;
    Session<S> session(test.scene, {&entry, {}, entry.info.topology.preferred});
    TestScene<S> unchanged = test;
    unchanged.script = {};
    const auto verified = [&](const TestScene<S>& of) {
      return verify(session, std::span<const double>(of.frames), shared_oracle(of),
                    of.script.steps.empty() ? nullptr : &of.script, {.areas = Areas::left_out});
    };
    const Verification first = verified(test);
    EXPECT_EQ(verified(unchanged).first_violation, "") << GetParam() << ": not forgotten";
    const Verification again = verified(test);
    EXPECT_EQ(first.first_violation, "") << GetParam();
    EXPECT_EQ(again.first_violation, "") << GetParam();
    EXPECT_EQ(first.pairs, again.pairs);
  };
  for (const std::string scene : {"plan_changes", "plans_start_at_rest", "plans_move_the_obstacle"}) {
    run(synthetic_scene<float>(scene, 3));
    run(synthetic_scene<double>(scene, 3));
  }
}

std::vector<std::string> ids() {
  std::vector<std::string> ids;
  for (const StrategyEntry& entry : registry())
    if (entry.info.can.plan_changes) ids.push_back(entry.info.id);
  return ids;
}

INSTANTIATE_TEST_SUITE_P(Registry, PlanChanges, testing::ValuesIn(ids()),
                         [](const auto& test) { return test.param; });

// A vertex may fly out of the admissible range, but its plan cannot be changed there.
TEST(PlanChange, BeyondTheAdmissibleRange) {
  FlightPlans<float> plans(1, {0}, {0, 0, 0});
  const float far[3] = {0, 2e30f, 0};
  EXPECT_THROW(plans.change(1, flies<float>(0, 0, 0, 0, 0), far), std::invalid_argument);
  EXPECT_FALSE(plans.moving());
}

// Plans that begin together are evaluated together; if vertices join and leave, positions are still those of
// the pieces.
template <class S>
void evaluated_as_pieces() {
  constexpr std::uint32_t vertices = 300;
  Random random(9);
  std::vector<S> keyframes;
  for (std::uint32_t i = 0; i < 6 * vertices; ++i) keyframes.push_back(S(random.unit()));
  FlightPlans<S> plans(vertices, {0, 10}, keyframes);
  std::vector<S> all(3 * vertices + 1), some(3 * vertices + 1);
  std::vector<std::uint32_t> list;
  for (std::uint32_t v = 0; v < vertices; v += 2) list.push_back(v);
  for (int frame = 0; frame < 120; ++frame) {
    const double t = 0.1 * frame;
    plans.evaluate(t, all.data());
    plans.evaluate(t, list, some.data());
    for (std::uint32_t v = 0; v < vertices; ++v)
      for (int axis = 0; axis < 3; ++axis) {
        const std::size_t at = std::size_t(3) * v + std::size_t(axis);
        ASSERT_EQ(all[at], round_piece(plans.piece_after(v, axis, t), t)) << "vertex " << v << " at " << t;
        if (v % 2 == 0) {
          ASSERT_EQ(all[at], some[at]) << "vertex " << v << " at " << t;
        }
      }
    for (std::uint32_t changes = random.below(frame % 10 == 0 ? 2 * vertices : 12); changes > 0; --changes) {
      PlanChange<S> change = flies<S>(0, random.below(vertices), S(random.unit()), S(random.unit()), 0);
      if (random.below(5) == 0) {
        change.times = {t + 0.25};
        change.positions = {S(random.unit()), 0, S(random.unit())};
      }
      plans.change(t, change, all.data() + std::size_t(3) * change.vertex);
    }
  }
}

TEST(PlanChange, EvaluatedTogetherAsOneByOne) {
  evaluated_as_pieces<float>();
  evaluated_as_pieces<double>();
}

TEST(Script, TimesMustBeFrames) {
  PlanScript<float> script;
  script.steps = {{0.5, {flies<float>(0, 0, 1, 0, 0)}}, {1.5, {flies<float>(0, 0, 0, 0, 0)}}};
  ScriptCursor<float> cursor(&script);
  EXPECT_EQ(cursor.at(0), nullptr);
  EXPECT_EQ(cursor.at(0.5), &script.steps[0]);
  EXPECT_EQ(cursor.at(1), nullptr);
  EXPECT_THROW(cursor.at(2), std::invalid_argument);
  EXPECT_NE(hash(script), 0u);
  EXPECT_EQ(hash(PlanScript<float>{}), 0u);
}

}  // namespace
}  // namespace kbvh::test::plan_changes_test
