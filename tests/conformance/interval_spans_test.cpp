// The spans of an interval join against rational arithmetic, on every segment of small scenes, with every
// kernel set.
//
// Enough: a span encloses every instant at which the boxes of its two primitives, on the exact flight plans,
// overlap; so it encloses every contact. A pair without a span has no such instant. Frames read from spans
// and then tested are the truth of every frame.
//
// Not much more: the join uses linear boxes, which are exact at both ends of a segment and interpolated in
// between. For each side, the gap g between two such boxes is linear in time. The join looks for g <= m,
// where m is at each end 6 u of one of the two coordinates x and y that bound the gap (WideEnds; u is half an
// epsilon). The computed g - m has an error of u |x| + u |y| for the stored positions, which are rounded, and
// of u for the moved side; a difference of floats has only a relative error. Where gaps matter |x| and |y|
// are nearly equal, so m lies between 5/2 u of the smaller and 10 u of the larger one. Nothing here is
// relative to other coordinates than these two. Fractions have an error of 2 roundings of a quotient and 2 of
// a float, less than 2^-22; 2^-20 is subtracted and added. A pair without a common time is kept if its sides
// open no more than twice that before the last of them closes. So with F(h) the time when the last side comes
// to g <= h, and U(h) the time when the first leaves it,
//   F(10 u) - 5/4 2^-20 <= begin, and begin <= F(5/2 u) - 3/4 2^-20 unless it is 0,
//   end <= U(10 u) + 5/4 2^-20, and U(5/2 u) + 3/4 2^-20 <= end unless it is 1,
//   there is a span if F(5/2 u) <= U(5/2 u), and none if F(10 u) > U(10 u) + 5/2 2^-20.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "core/judge/oracle.hpp"
#include "tests/conformance/interval_play.hpp"

namespace kbvh::test::interval_spans_test {
namespace {

/// Subtracted from a span's begin and added to its end.
const Rational outwards = exact(0x1p-20);

// ---- Two boxes --------------------------------------------------------------------------------------------

/// A side of two boxes: a lies above b along x, y, z (0 to 2), or below it (3 to 5).
constexpr std::size_t sides = 6;

/// A margin at one end of a side: a share of the smaller or of the larger of its two coordinates.
struct Margin {
  Rational of_smaller, of_larger, least;
};
template <class S>
Margin inner_margin() {
  return {exact(std::numeric_limits<S>::epsilon()) * 5 / 4, 0, 0};
}
template <class S>
Margin outer_margin() {
  return {0, exact(std::numeric_limits<S>::epsilon()) * 5, 2 * exact(std::numeric_limits<S>::min())};
}

/// The gap of the boxes at an end, without a margin; the gap of the linear boxes is linear in between.
Rational gap(const Flight& a, const Flight& b, std::size_t side, int end, const Margin& margin) {
  const Flight &above = side < 3 ? a : b, &below = side < 3 ? b : a;
  const Rational &lower = above.lower[end][side % 3], &upper = below.upper[end][side % 3];
  const Rational one = abs(lower), other = abs(upper);
  return lower - upper - margin.of_smaller * std::min(one, other) - margin.of_larger * std::max(one, other) -
         margin.least;
}

/// What doubles can decide about two linear boxes: a side keeps them further apart than a share of its
/// coordinates throughout, or they overlap throughout.
enum class Clearly : std::uint8_t { neither, apart, together };
Clearly clearly(const Flight& a, const Flight& b, double share, double least) {
  bool together = true;
  for (std::size_t side = 0; side < sides; ++side) {
    const Flight &above = side < 3 ? a : b, &below = side < 3 ? b : a;
    bool apart = true;
    for (int end = 0; end < 2; ++end) {
      const double lower = above.lower_near[end][side % 3], upper = below.upper_near[end][side % 3];
      const double error = 0x1p-50 * (std::abs(lower) + std::abs(upper)) + 0x1p-1070;
      apart = apart && lower - upper > share * (std::abs(lower) + std::abs(upper)) + least + error;
      together = together && lower - upper < -error;
    }
    if (apart) return Clearly::apart;
  }
  return together ? Clearly::together : Clearly::neither;
}

/// The first and the last of some instants.
struct Instants {
  Rational first, last;
};

/// When the exact boxes overlap. A side keeps them apart as long as every corner of one box lies beyond every
/// corner of the other: between the latest time at which one of these differences becomes positive and the
/// earliest at which one ceases to be.
std::optional<Instants> exact_overlap(const Flight& a, const Flight& b) {
  struct Open {
    Rational from, to;
  };
  std::vector<Open> apart;
  for (std::size_t side = 0; side < sides; ++side) {
    Open open{-1, 2};  // beyond the segment: its ends are in it
    const Flight &above = side < 3 ? a : b, &below = side < 3 ? b : a;
    for (const auto& high : above.corners) {
      for (const auto& low : below.corners) {
        const Rational first = high[side % 3].first - low[side % 3].first;
        const Rational last = high[side % 3].last - low[side % 3].last;
        if (first > 0 && last > 0) continue;
        if (first <= 0 && last <= 0)
          open.to = open.from;
        else if (first > 0)
          open.to = std::min(open.to, Rational(first / (first - last)));
        else
          open.from = std::max(open.from, Rational(first / (first - last)));
        if (open.from >= open.to) break;
      }
      if (open.from >= open.to) break;
    }
    if (open.from < open.to) apart.push_back(open);
  }
  const auto inside = [&](const Rational& s) {
    return std::find_if(apart.begin(), apart.end(), [&](const Open& o) { return o.from < s && s < o.to; });
  };
  Instants found{0, 1};
  for (auto o = inside(found.first); o != apart.end(); o = inside(found.first)) found.first = o->to;
  for (auto o = inside(found.last); o != apart.end(); o = inside(found.last)) found.last = o->from;
  if (found.first > 1) return std::nullopt;
  return found;
}

/// When the last side of the linear boxes comes to a gap of the margin or less, and when the first one leaves
/// it.
std::optional<Instants> linear_overlap(const Flight& a, const Flight& b, const Margin& margin) {
  Instants found{0, 1};
  for (std::size_t side = 0; side < sides; ++side) {
    const Rational first = gap(a, b, side, 0, margin), last = gap(a, b, side, 1, margin);
    if (first > 0 && last > 0) return std::nullopt;
    if (first > 0) found.first = std::max(found.first, Rational(first / (first - last)));
    if (last > 0) found.last = std::min(found.last, Rational(first / (first - last)));
  }
  return found;
}

// ---- All pairs --------------------------------------------------------------------------------------------

/// The number of comparisons: a scene without contacts would prove nothing.
struct Tally {
  std::size_t spans = 0, partly = 0;
};

bool share_a_vertex(const Primitives& primitives, std::uint32_t a, std::uint32_t b) {
  for (const std::uint32_t v : primitives[a])
    for (const std::uint32_t w : primitives[b])
      if (v == w) return true;
  return false;
}

/// Returns the error of a span, or of its absence, according to the comment above; nothing if there is none.
template <class S>
std::string fault(const Flight& a, const Flight& b, const JoinedPair* span) {
  const bool whole = span != nullptr && span->begin == 0 && span->end == 1;
  const auto contact = whole ? std::nullopt : exact_overlap(a, b);
  const auto inner = linear_overlap(a, b, inner_margin<S>()), outer = linear_overlap(a, b, outer_margin<S>());
  const bool needed = inner && inner->first <= inner->last;
  if (span == nullptr) return contact ? "missed" : needed ? "missed in the margin" : "";
  if (!outer || outer->first > outer->last + outwards * 5 / 2) return "beyond the margin";
  const Rational begin = exact(span->begin), end = exact(span->end);
  if (begin < 0 || end > 1) return "not in the segment";
  if (contact && (contact->first < begin || contact->last > end)) return "too short";
  if (begin < outer->first - outwards * 5 / 4) return "begins too early";
  if (end > outer->last + outwards * 5 / 4) return "ends too late";
  if (needed && begin != 0 && begin > inner->first - outwards * 3 / 4) return "begins late in the margin";
  if (needed && end != 1 && end < inner->last + outwards * 3 / 4) return "ends early in the margin";
  return "";
}

using SpanMap = std::map<std::pair<std::uint32_t, std::uint32_t>, JoinedPair>;

/// All pairs of primitives of each pair of bodies over the current segment.
template <class S>
void check_spans(const Play<S>& play, Tally& tally) {
  const LinearBounds<S>& bounds = play.joiners.front()->bounds;
  const std::vector<BodyFlight> flights = exact_flights(play.scene, bounds);
  for (std::size_t i = 0; i < play.scene.pairs.size(); ++i) {
    const auto [body_a, body_b] = play.scene.pairs[i];
    const BodyFlight &flight_a = flights[body_a], &flight_b = flights[body_b];
    std::vector<SpanMap> spans;
    for (const auto& joiner : play.joiners) {
      SpanMap& map = spans.emplace_back();
      for (const JoinedPair& pair : joiner->joins[i].pairs()) {
        ASSERT_TRUE(map.insert({{pair.primitive_a, pair.primitive_b}, pair}).second) << "twice";
        tally.partly += pair.begin > 0 || pair.end < 1 ? 1 : 0;
      }
      tally.spans += map.size();
    }
    for (std::uint32_t p = 0; p < flight_a.primitives.size(); ++p)
      for (std::uint32_t q = body_a == body_b ? p + 1 : 0; q < flight_b.primitives.size(); ++q) {
        const Flight &a = flight_a.primitives[p], &b = flight_b.primitives[q];
        if (body_a == body_b && share_a_vertex(play.scene.bodies[body_a].primitives, p, q)) continue;
        const Clearly known = clearly(a, b, 16 * double(std::numeric_limits<S>::epsilon()),
                                      4 * double(std::numeric_limits<S>::min()));
        if (known == Clearly::apart) continue;
        std::optional<JoinedPair> right;  // kernel sets agree: it is checked once
        for (std::size_t k = 0; k < spans.size(); ++k) {
          const auto found = spans[k].find({p, q});
          const JoinedPair* span = found == spans[k].end() ? nullptr : &found->second;
          if (span == nullptr || !right || span->begin != right->begin || span->end != right->end) {
            const bool whole = span != nullptr && span->begin == 0 && span->end == 1;
            const std::string wrong = known == Clearly::neither ? fault<S>(a, b, span)
                                      : whole                   ? ""
                                                                : "not throughout";
            ASSERT_EQ(wrong, "") << name(play.joiners[k]->kernels) << ": bodies " << body_a << ", " << body_b
                                 << ", primitives " << p << ", " << q << " from t = " << bounds.begin();
          }
          if (span == nullptr) continue;
          right = *span;
          spans[k].erase(found);
        }
      }
    for (const SpanMap& map : spans) ASSERT_TRUE(map.empty()) << "pairs that are far apart, or no pairs";
  }
}

/// The pairs read at a frame are those whose spans contain the frame, and the true ones among them are the
/// whole truth.
template <class S>
void check_frame(Play<S>& play) {
  const PairBuffer truth = brute_force_pairs(play.scene, play.playback);
  for (const auto& joiner : play.joiners) {
    const float fraction = float(joiner->bounds.fraction(play.playback.time()));
    PairBuffer all;
    for (auto& join : joiner->joins) {
      PairBuffer read, held;
      join.read(fraction, read);
      const BodyPair bodies = join.pairs().empty() ? BodyPair{} : join.bodies_of(0);
      for (const JoinedPair& pair : join.pairs())
        if (pair.begin <= fraction && fraction <= pair.end)
          held.push_back({bodies.first, pair.primitive_a, bodies.second, pair.primitive_b});
      std::sort(read.begin(), read.end());
      std::sort(held.begin(), held.end());
      ASSERT_EQ(read, held) << name(joiner->kernels) << " at t = " << play.playback.time();
      all.insert(all.end(), read.begin(), read.end());
    }
    TriangleTestStats stats;
    confirm_pairs(SceneView<S>(play.scene), play.motion, all, stats);
    std::sort(all.begin(), all.end());
    ASSERT_EQ(all, truth) << name(joiner->kernels) << " at t = " << play.playback.time();
  }
}

template <class S>
void check_scene(const std::string& name, const BuilderConfig& builder, const SegmentCuts& cuts) {
  const Scene<S> scene = scene_of<S>(name);
  Play<S> play(scene, builder, cuts);
  Tally tally;
  play.run([&] { check_spans(play, tally); }, [&] { check_frame(play); });
  EXPECT_GT(tally.spans, 0U);
  const bool always_or_never = name == "nothing_moves" || name == "zero_motion";
  EXPECT_EQ(tally.partly == 0, always_or_never);
}

class IntervalSpans : public testing::TestWithParam<std::string> {};

TEST_P(IntervalSpans, EncloseTheExactPlanAndLittleMoreInFloat) {
  check_scene<float>(GetParam(), {.width = 8, .leaf_size = 4}, {});
}
TEST_P(IntervalSpans, EncloseTheExactPlanAndLittleMoreInDouble) {
  check_scene<double>(GetParam(), {.width = 4, .leaf_size = 7}, {});
}
// Pieces begin and end where no position is stored, so that the ends are rounded.
TEST_P(IntervalSpans, EncloseItInPiecesOfSegmentsInFloat) {
  check_scene<float>(GetParam(), {.width = 2, .leaf_size = 1}, {.pieces = 3});
}
TEST_P(IntervalSpans, EncloseItInPiecesOfSegmentsInDouble) {
  check_scene<double>(GetParam(), {.width = 8, .leaf_size = 16}, {.pieces = 2});
}

INSTANTIATE_TEST_SUITE_P(Scenes, IntervalSpans,
                         testing::Values("grazing", "grazing_far", "soups", "sheets", "static_obstacle",
                                         "nothing_moves", "four_bodies_own_keyframes",
                                         "one_triangle_and_none", "integer_ties", "all_cross_at_once",
                                         "pure_translation_far", "tiny", "huge",
                                         "keyframes_a_millionth_apart", "degenerate_triangles", "polygons",
                                         "points_against_nets", "zero_motion", "coincident_intervals",
                                         "extreme_velocities", "self_rolled_cloth", "self_coincident",
                                         "self_polygons"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace kbvh::test::interval_spans_test
