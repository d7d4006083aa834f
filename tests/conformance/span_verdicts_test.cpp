// Verdicts on a pair of triangles for a span of time, against rational arithmetic at times within the span,
// on the exact plan: apart means apart at all of them, intersecting means intersecting at all of them. Frames
// that read such verdicts, and test the remaining pairs, give the truth of every frame.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/linear/kernels/span_tests.hpp"
#include "core/judge/oracle.hpp"
#include "tests/conformance/interval_play.hpp"

namespace kbvh::test::span_verdicts_test {
namespace {

/// Checks about this many pairs of a segment.
constexpr std::size_t looked_at = 24;

struct Tally {
  std::size_t apart = 0, intersect = 0;
};

/// The triangles of a pair at a fraction of the segment.
bool intersect_at(const Flight& a, const Flight& b, const Rational& fraction) {
  RationalPoint corners[2][3];
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      corners[0][c][axis] = between(a.corners[c][axis].first, a.corners[c][axis].last, fraction);
      corners[1][c][axis] = between(b.corners[c][axis].first, b.corners[c][axis].last, fraction);
    }
  return RationalTriangles::intersect(corners[0], corners[1]);
}

template <class S>
std::vector<SpanVerdict> decide(const Joiner<S>& joiner, const Scene<S>& scene, const BodyPair& bodies,
                                const std::vector<JoinedPair>& pairs) {
  const auto &a = joiner.bounds.side(bodies.first), &b = joiner.bounds.side(bodies.second);
  std::vector<SpanPair<S>> spans;
  for (const JoinedPair& pair : pairs) {
    SpanPair<S>& span = spans.emplace_back();
    span.begin = pair.begin;
    span.end = pair.end;
    for (std::size_t c = 0; c < 3; ++c)
      for (int end = 0; end < 2; ++end) {
        const std::size_t va = scene.bodies[bodies.first].primitives[pair.primitive_a][c];
        const std::size_t vb = scene.bodies[bodies.second].primitives[pair.primitive_b][c];
        span.corner[end][c] = a.at[end].positions + 3 * va;
        span.corner[end][c + 3] = b.at[end].positions + 3 * vb;
      }
  }
  std::vector<SpanVerdict> verdicts(spans.size());
  span_test_kernels<S>(joiner.kernels)
      .decide(spans.data(), spans.size(), span_rounding(std::max(a.rounding, b.rounding)), verdicts.data());
  return verdicts;
}

/// A sample of the current segment's pairs: their spans, and the first quarters of these.
template <class S>
void check_verdicts(const Play<S>& play, Tally& tally) {
  const std::vector<BodyFlight> flights = exact_flights(play.scene, play.joiners.front()->bounds);
  for (std::size_t i = 0; i < play.scene.pairs.size(); ++i) {
    const BodyPair bodies = play.scene.pairs[i];
    const auto all = play.joiners.front()->joins[i].pairs();
    std::vector<JoinedPair> pairs;
    const std::size_t stride = std::max<std::size_t>(1, all.size() * play.scene.pairs.size() / looked_at);
    for (std::size_t k = 0; k < all.size(); k += stride) {
      pairs.push_back(all[k]);
      pairs.push_back(all[k]);
      pairs.back().end = pairs.back().begin + (pairs.back().end - pairs.back().begin) / 4;
    }
    const std::vector<SpanVerdict> verdicts = decide(*play.joiners.front(), play.scene, bodies, pairs);
    for (const auto& joiner : play.joiners)
      ASSERT_EQ(decide(*joiner, play.scene, bodies, pairs), verdicts) << name(joiner->kernels);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (verdicts[k] == SpanVerdict::open) continue;
      const bool expected = verdicts[k] == SpanVerdict::intersect;
      ++(expected ? tally.intersect : tally.apart);
      const Flight& a = flights[bodies.first].primitives[pairs[k].primitive_a];
      const Flight& b = flights[bodies.second].primitives[pairs[k].primitive_b];
      const Rational begin = exact(pairs[k].begin), end = exact(pairs[k].end);
      for (const auto& [top, bottom] : {std::pair(0, 1), {1, 7}, {1, 3}, {5, 8}, {6, 7}, {1, 1}})
        ASSERT_EQ(intersect_at(a, b, between(begin, end, Rational(top) / bottom)), expected)
            << "bodies " << bodies.first << ", " << bodies.second << ", primitives " << pairs[k].primitive_a
            << ", " << pairs[k].primitive_b << ", " << top << "/" << bottom << " of " << pairs[k].begin
            << " to " << pairs[k].end << " of the segment from t = " << play.joiners.front()->bounds.begin();
    }
  }
}

template <class S>
void check_frame(Play<S>& play) {
  const PairBuffer truth = brute_force_pairs(play.scene, play.playback);
  const SceneView<S> view(play.scene);
  for (const auto& joiner : play.joiners) {
    PairBuffer all;
    for (std::size_t i = 0; i < joiner->joins.size(); ++i) {
      PairBuffer read;
      const std::size_t open =
          joiner->answers[i].read(joiner->bounds.segment(), view, joiner->joins[i],
                                  float(joiner->bounds.fraction(play.playback.time())), read);
      PairBuffer to_test(read.end() - std::ptrdiff_t(open), read.end());
      TriangleTestStats stats;
      confirm_pairs(view, play.motion, to_test, stats);
      all.insert(all.end(), read.begin(), read.end() - std::ptrdiff_t(open));
      all.insert(all.end(), to_test.begin(), to_test.end());
    }
    std::sort(all.begin(), all.end());
    ASSERT_EQ(all, truth) << name(joiner->kernels) << " at t = " << play.playback.time();
  }
}

template <class S>
void check_scene(const std::string& name, const SegmentCuts& cuts) {
  const Scene<S> scene = scene_of<S>(name);
  Play<S> play(scene, {.width = 8, .leaf_size = 4}, cuts);
  Tally tally;
  play.run([&] { check_verdicts(play, tally); }, [&] { check_frame(play); });
  if (name.rfind("grazing", 0) == 0) {
    EXPECT_EQ(tally.apart + tally.intersect, 0U);  // all within the slack
  } else if (std::is_same_v<S, double>) {  // in float it may be more than the scene's size, or out of range
    EXPECT_GT(tally.apart, 100U);
    EXPECT_EQ(tally.intersect == 0, name == "sheets");
  }
}

class SpanVerdicts : public testing::TestWithParam<std::string> {};

TEST_P(SpanVerdicts, HoldOnTheExactPlan) {
  check_scene<float>(GetParam(), {});
  check_scene<double>(GetParam(), {.pieces = 2});
}

INSTANTIATE_TEST_SUITE_P(Scenes, SpanVerdicts,
                         testing::Values("soups", "sheets", "static_obstacle", "four_bodies_own_keyframes",
                                         "integer_ties", "all_cross_at_once", "pure_translation_far", "tiny",
                                         "huge", "degenerate_triangles", "coincident_intervals", "grazing",
                                         "grazing_far"),
                         [](const auto& test) { return test.param; });

}  // namespace

// Tests the reference itself: touching, nested, crossing in one plane, degenerate.
TEST(RationalTriangles, KnowsTheOddCases) {
  using Triangle = std::array<RationalPoint, 3>;
  const Triangle floor{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
  const auto meets = [&](const Triangle& other) {
    const bool answer = RationalTriangles::intersect(floor.data(), other.data());
    EXPECT_EQ(RationalTriangles::intersect(other.data(), floor.data()), answer);
    return answer;
  };
  EXPECT_TRUE(meets({{{1, 1, -1}, {1, 1, 1}, {2, 1, 1}}}));   // through the inside
  EXPECT_TRUE(meets({{{2, 2, 0}, {5, 5, 1}, {5, 5, -1}}}));   // an edge touched by a corner
  EXPECT_TRUE(meets({{{1, 1, 0}, {2, 1, 0}, {1, 2, 0}}}));    // inside, in one plane
  EXPECT_TRUE(meets({{{4, 0, 0}, {8, 0, 0}, {8, 1, 0}}}));    // a corner in common, in one plane
  EXPECT_TRUE(meets({{{1, 1, 0}, {1, 1, 0}, {1, 1, 0}}}));    // a point
  EXPECT_TRUE(meets({{{3, 3, 0}, {-1, -1, 0}, {1, 1, 0}}}));  // a segment in the plane
  EXPECT_TRUE(meets({{{1, 1, 1}, {1, 1, -2}, {1, 1, 0}}}));   // a segment across
  EXPECT_FALSE(meets({{{1, 1, 1}, {2, 1, 1}, {1, 2, 1}}}));   // parallel
  EXPECT_FALSE(meets({{{3, 3, 0}, {3, 2, 0}, {5, 5, 0}}}));   // next to it, in one plane
  EXPECT_FALSE(meets({{{3, 3, 1}, {3, 3, -1}, {5, 5, 0}}}));  // next to it
  EXPECT_FALSE(meets({{{2, 3, 0}, {2, 3, 0}, {2, 3, 0}}}));   // a point of the plane
  EXPECT_FALSE(meets({{{5, 0, 0}, {6, 0, 0}, {8, 0, 0}}}));   // a segment beyond an edge, on its line
  EXPECT_FALSE(meets({{{3, 2, -1}, {3, 2, 1}, {3, 2, 1}}}));  // a segment next to it
  const Triangle segment{{{0, 0, 0}, {2, 2, 2}, {1, 1, 1}}}, point{{{3, 3, 3}, {3, 3, 3}, {3, 3, 3}}};
  const Triangle on{{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}}, across{{{1, 1, 0}, {1, 1, 2}, {1, 1, 1}}};
  EXPECT_TRUE(RationalTriangles::intersect(segment.data(), on.data()));
  EXPECT_TRUE(RationalTriangles::intersect(segment.data(), across.data()));
  EXPECT_FALSE(RationalTriangles::intersect(segment.data(), point.data()));
  EXPECT_FALSE(RationalTriangles::intersect(across.data(), point.data()));
}

}  // namespace kbvh::test::span_verdicts_test
