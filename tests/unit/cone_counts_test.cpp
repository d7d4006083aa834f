// The counts of three ways to the certificates of patches: what holds whatever the scene.
#include <gtest/gtest.h>

#include "experiments/micro/cone_counts.hpp"
#include "experiments/micro/folded_cloth.hpp"

namespace kbvh::experiments::micro {
namespace {

/// A cloth and a linear segment, and a tree with small leaves, so that small cloths have several patches.
struct Case {
  const char* what;
  std::vector<double> begin, end;
  PatchTree patches;
  std::uint64_t faces;

  Case(const char* name, std::uint32_t side, double from, double to)
      : what(name),
        begin(folded_cloth(side, from)),
        end(folded_cloth(side, to)),
        patches(begin, cloth_faces(side), 5),
        faces(2 * std::uint64_t(side - 1) * (side - 1)) {}
  ClothSegment segment() const { return {begin, end}; }
  ConeWays count(int frames) const {
    ConeWays ways;
    count_cones(patches, segment(), frames, ways);
    return ways;
  }
};

template <class Check>
void for_cases(const Check& check) {
  check(Case("32 triangles at rest", 5, 0, 0));
  check(Case("32 triangles", 5, 0.2, 1));
  check(Case("at rest", 25, 0, 0));
  check(Case("a flat cloth that folds", 25, 0, 2));
  check(Case("folds", 25, 1.4, 1.6));
  check(Case("folds that open", 25, 2, 1.2));
  check(Case("a small motion", 25, 1.5, 1.503));
}

bool holds_along(const PatchTree& patches, const std::vector<double>& points, std::uint32_t node,
                 const PatchCertificate<double>::Axis& axis) {
  PatchCertificate<double> certificate;
  certificate.take(points.data(), nullptr);
  return certificate.normals_agree(patches.leaves(), patches.padded(), node, axis) &&
         certificate.contour_is_simple(patches.contours().of(node), axis);
}

/// Events are cheaper on one frame only where they certify less: folds that open are scheduled closed.
TEST(ConeCounts, OneFrameSavesNothing) {
  int compared = 0;
  for_cases([&](const Case& of) {
    const ConeWays ways = of.count(1);
    EXPECT_GT(ways.each_frame.determinants, 0u) << of.what;
    EXPECT_EQ(ways.bisected.determinants, ways.each_frame.determinants) << of.what;
    EXPECT_EQ(ways.bisected.signs, ways.each_frame.signs) << of.what;
    EXPECT_EQ(ways.bisected.patches, ways.each_frame.patches) << of.what;
    EXPECT_EQ(ways.bisected.certified_faces, ways.each_frame.certified_faces) << of.what;
    if (ways.events.certified_faces < ways.each_frame.certified_faces) return;
    ++compared;
    EXPECT_GE(ways.events.determinants, ways.each_frame.determinants) << of.what;
  });
  EXPECT_GE(compared, 2);
}

TEST(ConeCounts, AFlatClothAtRestNeverFails) {
  for (const std::uint32_t side : {5u, 25u}) {
    const Case of("at rest", side, 0, 0);
    for (const int frames : {1, 10}) {
      const ConeWays ways = of.count(frames);
      EXPECT_EQ(ways.events.failures, 0u);
      EXPECT_EQ(ways.events.roots, 0u);
      EXPECT_EQ(ways.each_frame.patches, std::uint64_t(frames));
      for (const ConeCounts* const counts : {&ways.events, &ways.bisected}) EXPECT_EQ(counts->patches, 1u);
      for (const ConeCounts* const counts : {&ways.each_frame, &ways.events, &ways.bisected})
        EXPECT_EQ(counts->certified_faces, of.faces * std::uint64_t(frames));
    }
  }
}

TEST(ConeCounts, EventsDoNotDependOnFrames) {
  for_cases([](const Case& of) {
    ConeCounts few, many;
    count_events(of.patches, of.segment(), 1, few);
    count_events(of.patches, of.segment(), 64, many);
    EXPECT_EQ(few.patches, many.patches) << of.what;
    EXPECT_EQ(few.signs, many.signs) << of.what;
    EXPECT_EQ(few.determinants, many.determinants) << of.what;
    EXPECT_EQ(few.roots, many.roots) << of.what;
    EXPECT_EQ(few.failures, many.failures) << of.what;
  });
}

/// What is certified for a motion is certified along the same axis at each frame of the motion.
TEST(ConeCounts, BisectedPatchesHoldAtEveryFrame) {
  std::uint64_t motions = 0;
  for_cases([&](const Case& of) {
    const FramePositions positions = frame_positions(of.segment(), 16);
    const BisectedCones bisected(of.patches, positions);
    for (const CertifiedFrames& one : bisected.certified()) {
      motions += one.first < one.last ? 1 : 0;
      PatchCertificate<double> certificate;
      PatchCertificate<double>::Axis axis;
      const std::vector<double>&first = positions[std::size_t(one.first)],
            &last = positions[std::size_t(one.last)];
      certificate.take(first.data(), one.first == one.last ? nullptr : last.data());
      ASSERT_TRUE(certificate.find_axis(of.patches.contours().of(one.node), axis)) << of.what;
      for (int k = one.first; k <= one.last; ++k)
        EXPECT_TRUE(holds_along(of.patches, positions[std::size_t(k)], one.node, axis))
            << of.what << ": patch " << one.node << ", frame " << k << " of " << one.first << " to "
            << one.last;
    }
  });
  EXPECT_GT(motions, 5u);
}

/// Certificates hold until they fail, and most of them no longer just after.
TEST(ConeCounts, FailureTimesAreThoseOfTheCertificate) {
  std::uint64_t ended = 0, failed = 0;
  const auto check = [&](const Case& of) {
    ConeCounts counts;
    std::vector<CertifiedSpan> spans;
    count_events(of.patches, of.segment(), 1, counts, &spans);
    for (const CertifiedSpan& span : spans) {
      for (const double part : {0.01, 0.3, 0.6, 0.99}) {
        const double t = span.begin + part * (span.end - span.begin);
        if (span.end - span.begin > 1e-6) {
          EXPECT_TRUE(holds_along(of.patches, of.segment().at(t), span.node, span.axis))
              << of.what << ": patch " << span.node << " at " << t << " of " << span.begin << " to "
              << span.end;
        }
      }
      if (span.end > 1 - 1e-5) continue;
      ++ended;
      if (!holds_along(of.patches, of.segment().at(span.end + 1e-6), span.node, span.axis)) ++failed;
    }
  };
  for_cases(check);
  for (const double from : {0.3, 0.8, 1.3})
    for (const double to : {1.6, 2.0, 2.4, 3.0}) check(Case("further folds", 41, from, to));
  EXPECT_GT(ended, 3u);
  EXPECT_GT(2 * failed, ended);
}

}  // namespace
}  // namespace kbvh::experiments::micro
