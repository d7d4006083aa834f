// Impacts within patches that are certified for a whole motion: there are none, and the earliest impact is
// that of all pairs.
#include <gtest/gtest.h>

#include "folded_meshes.hpp"

namespace kbvh::test::broad_phase {
namespace {

/// Tests every pair of elements of a mesh in motion by itself: calls take(kind, pair, impact).
template <class S, class Take>
void for_all_impacts(const Mesh<S>& mesh, const Elements& elements, const Take& take) {
  for (const CandidateKind kind : {CandidateKind::face_vertex, CandidateKind::edge_edge}) {
    for_all_pairs(elements, kind,
                  [&](const Candidate& pair) { take(kind, pair, impact_of(mesh, elements, kind, pair)); });
  }
}

template <class S>
Mesh<S> motion(const Mesh<S>& from, const Mesh<S>& to) {
  Mesh<S> mesh = from;
  mesh.v1 = to.v0;
  return mesh;
}

template <class S>
std::vector<std::pair<std::string, Mesh<S>>> motions() {
  Mesh<S> shifted = folds<S>(12, 1.2);
  for (S& x : shifted.v0) x += S(3);
  return {{"a flat sheet that folds", motion(flat<S>(12), folds<S>(12, 1.4))},
          {"folds that close", motion(folds<S>(14, 1.2), folds<S>(14, 2.6))},
          {"folds that fall", motion(folds<S>(12, 1.2), shifted)},
          {"a fold to and fro", motion(folds<S>(12, 1), folds<S>(12, -1))},
          {"noise", motion(folds<S>(12, 0.8), folds<S>(12, 0.9, 0.4))},
          {"a ramp that closes", motion(ramp<S>(50, 2, 1, 0), ramp<S>(50, 2, 0.02, 0.05))},
          {"a mushroom that grows", motion(flat<S>(14), mushroom<S>(14))},
          {"layers", motion(layers<S>(7, 3, 2), layers<S>(7, 3, 0.3))},
          {"a rod", motion(twisted_rod<S>(16, 0.4), twisted_rod<S>(16, 0.05))}};
}

template <class S>
class PatchImpacts : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(PatchImpacts, Scalars);

TYPED_TEST(PatchImpacts, CertifiedPatchesDoNotTouchThemselves) {
  using S = TypeParam;
  std::uint64_t together = 0, touching = 0;
  for (const auto& [what, mesh] : motions<S>()) {
    Patches<S> patches(mesh);
    PatchCulling<S> culling;
    PatchMembers members;
    const std::uint32_t padded = patches.tree.padded_leaf_size();
    culling.run(patches.tree.leaves(), padded, patches.contours(), patches.begin.data(), patches.end.data());
    members.mark(patches.elements, patches.tree.leaves(), padded, culling.certified());
    for_all_impacts(mesh, patches.elements,
                    [&](CandidateKind kind, const Candidate& pair, const Impact& impact) {
                      touching += impact.touches ? 1 : 0;
                      if (!members.together(kind, pair)) return;
                      ++together;
                      EXPECT_FALSE(impact.touches)
                          << what << ": " << name(kind) << " " << pair.first << ", " << pair.second;
                    });
  }
  EXPECT_GT(together, 50'000u);
  EXPECT_GT(touching, 500u);
}

TYPED_TEST(PatchImpacts, TheEarliestIsThatOfAllPairs) {
  using S = TypeParam;
  std::uint64_t culled = 0, later = 0;
  for (const auto& [what, mesh] : motions<S>()) {
    double end = 2;
    for_all_impacts(mesh, mesh.elements(), [&](CandidateKind, const Candidate&, const Impact& impact) {
      if (impact.touches) end = std::min(end, impact.end);
    });
    later += end > 0.01 && end <= 1 ? 1 : 0;
    BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = 5});
    mesh.build(broad, S(0.1));
    EarliestImpactStats stats;
    const EarliestImpact with = broad.earliest_impact(0, &stats);
    const EarliestImpact without = broad.earliest_impact(0, nullptr, SelfCulling::none);
    culled += stats.culled;
    EXPECT_EQ(stats.culled + stats.later + stats.impacts.tests, stats.candidates) << what;
    for (const EarliestImpact& found : {with, without}) {
      EXPECT_EQ(found.touches, end <= 1) << what;
      if (found.touches) {
        EXPECT_EQ(found.end, end) << what;
      }
      EXPECT_EQ(found.pair, without.pair) << what;
      EXPECT_EQ(found.kind, without.kind) << what;
    }
    // A separation is not what cones exclude.
    stats = {};
    broad.earliest_impact(0.05, &stats);
    EXPECT_EQ(stats.culled, 0u) << what;
  }
  EXPECT_GT(culled, 1'000u);
  EXPECT_GE(later, 3u);
}

/// Sides of other faces and edges: marks follow edits.
TYPED_TEST(PatchImpacts, FollowEdits) {
  using S = TypeParam;
  Mesh<S> mesh = motion(folds<S>(12, 1.2), folds<S>(12, 1.5));
  BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = 5});
  mesh.build(broad, S(0));
  EXPECT_FALSE(broad.earliest_impact().touches);
  // An edge that is no side of a face and crosses the sheet at the end, and a face across it.
  const S added[] = {3, 3, 40, 3, 3, 50, 3, 4, 60}, there[] = {3, 3, -9, 3, 3, 50, 3, 4, 60};
  const std::int32_t edge[] = {144, 145}, face[] = {144, 145, 146};
  broad.insert(MatrixView<S>::by_rows(added, 3, 3), MatrixView<std::int32_t>::by_rows(edge, 1, 2),
               MatrixView<std::int32_t>::by_rows(face, 1, 3));
  mesh.v0.insert(mesh.v0.end(), added, added + 9);
  mesh.v1.insert(mesh.v1.end(), there, there + 9);
  mesh.update(broad);
  double end = 2;
  for_all_impacts(mesh, broad.elements(), [&](CandidateKind, const Candidate&, const Impact& impact) {
    if (impact.touches) end = std::min(end, impact.end);
  });
  EXPECT_LE(end, 1);
  EXPECT_EQ(broad.earliest_impact().end, end);
  broad.remove(Element::face, std::vector<std::uint32_t>{242});
  broad.remove(Element::edge, std::vector<std::uint32_t>{std::uint32_t(mesh.edges.size() / 2)});
  broad.remove(Element::vertex, std::vector<std::uint32_t>{144, 145, 146});
  EXPECT_FALSE(broad.earliest_impact().touches);
}

/// The fault of a cone that holds at both ends of a motion, but not in between: a sheet that turns over.
TYPED_TEST(PatchImpacts, AConeOfBothEndsOnlyIsCaught) {
  using S = TypeParam;
  Mesh<S> mesh = flat<S>(6);
  mesh.v1 = mesh.v0;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v)
    for (std::size_t k = 0; k < 2; ++k) mesh.v1[3 * v + k] = -mesh.v0[3 * v + k];  // through one point
  Patches<S> patches(mesh);
  typename PatchCertificate<S>::Axis axis;
  PatchCertificate<S> ends;
  for (const UnfilledArray<S>* points : {&patches.begin, &patches.end}) {
    ends.take(points->data(), nullptr);
    ASSERT_TRUE(ends.find_axis(patches.contour(0), axis));
    EXPECT_TRUE(ends.holds(patches.tree.leaves(), patches.tree.padded_leaf_size(), 0, patches.contour(0)));
  }
  EXPECT_FALSE(patches.certificate.holds(patches.tree.leaves(), patches.tree.padded_leaf_size(), 0,
                                         patches.contour(0)));
  std::uint64_t touching = 0;
  for_all_impacts(mesh, patches.elements, [&](CandidateKind, const Candidate&, const Impact& impact) {
    touching += impact.touches ? 1 : 0;
  });
  EXPECT_GT(touching, 0u);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
