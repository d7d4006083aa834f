// Self intersections of a mesh against all pairs of its faces, with patches left out by cones of normals and
// projected contours, and without.
#include <gtest/gtest.h>

#include "core/geometry/triangle_triangle.hpp"
#include "folded_meshes.hpp"

namespace kbvh::test::broad_phase {
namespace {

/// Finds the pairs of faces that touch, by definition.
template <class S>
Pairs all_touching(const Mesh<S>& mesh, const Elements& elements) {
  const std::vector<S>& at = mesh.swept() ? mesh.v1 : mesh.v0;
  Pairs touching;
  for_all_pairs(elements, CandidateKind::face_face, [&](const Candidate& pair) {
    const auto a = elements.vertices(Element::face, pair.first);
    const auto b = elements.vertices(Element::face, pair.second);
    const auto corner = [&](std::uint32_t v) { return at.data() + std::size_t(3) * v; };
    if (triangles_intersect<S>(corner(a[0]), corner(a[1]), corner(a[2]), corner(b[0]), corner(b[1]),
                               corner(b[2])))
      touching.insert(pair);
  });
  return touching;
}
template <class S>
Pairs all_touching(const Mesh<S>& mesh) {
  return all_touching(mesh, mesh.elements());
}

template <class S>
std::string wrong_self(BroadPhase<S>& broad, const Pairs& expected, SelfIntersectionStats* stats = nullptr) {
  CandidateBuffer found;
  broad.self_intersections(found, SelfCulling::none);
  std::string wrong = difference(span_of(found), expected, broad.elements(), CandidateKind::face_face);
  if (!wrong.empty()) return "all patches: " + wrong;
  broad.self_intersections(found, SelfCulling::cones, stats);
  wrong = difference(span_of(found), expected, broad.elements(), CandidateKind::face_face);
  return wrong.empty() ? wrong : "cones: " + wrong;
}

template <class S>
std::vector<std::pair<std::string, Mesh<S>>> scenes() {
  std::vector<std::pair<std::string, Mesh<S>>> list;
  for (const double swing : {0.5, 1.4, 1.9, 2.6})
    list.emplace_back("folds " + std::to_string(swing), folds<S>(30, swing));
  list.emplace_back("crumpled folds", folds<S>(28, 2.2, 0.3));
  list.emplace_back("smooth rod", twisted_rod<S>(80, 0.2));
  list.emplace_back("tight rod", twisted_rod<S>(80, 0.05));
  list.emplace_back("layers", layers<S>(14, 4, 0.5));
  list.emplace_back("layers apart", layers<S>(14, 4, 2));
  list.emplace_back("yarn", yarn<S>(200));
  list.emplace_back("ramp", ramp<S>(120, 3, 1, 0));
  list.emplace_back("ramp that cuts itself", ramp<S>(120, 3, 0.04, 0.05));
  list.emplace_back("mushroom", mushroom<S>(26));
  list.emplace_back("double disc", double_disc<S>(40, 6));
  list.emplace_back("crumpled", crumpled<S>(24, 3));
  return list;
}

template <class S>
class SelfIntersections : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SelfIntersections, Scalars);

TYPED_TEST(SelfIntersections, AreThoseOfAllPairs) {
  using S = TypeParam;
  int touching = 0;
  for (const auto& [what, mesh] : scenes<S>()) {
    const Pairs expected = all_touching(mesh);
    touching += expected.empty() ? 0 : 1;
    {
      BroadPhase<S> broad;
      mesh.build(broad, S(0));
      CandidateBuffer exact;
      broad.within(CandidateKind::face_face, 0, exact);
      ASSERT_EQ(difference(span_of(exact), expected, mesh.elements(), CandidateKind::face_face), "") << what;
    }
    for (const std::uint32_t leaf_size : {5U, 16U})
      for (const KernelSet set : supported_kernel_sets()) {
        BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = leaf_size, .kernels = set});
        mesh.build(broad, S(0));
        ASSERT_EQ(wrong_self(broad, expected), "") << what << ", " << name(set);
      }
  }
  EXPECT_GE(touching, 8);
}

/// Where all is smooth, whole subtrees are left out; what is left out is seen in the numbers of tests.
TYPED_TEST(SelfIntersections, SmoothPatchesAreLeftOut) {
  using S = TypeParam;
  struct Case {
    Mesh<S> mesh;
    double fewer;  ///< tests of triangles without cones, over those with them, at least
  };
  for (const Case& one : {Case{flat<S>(40), 1e9}, Case{folds<S>(60, 1.2), 1e9}, Case{folds<S>(60, 1.9), 1.5},
                          Case{ramp<S>(200, 3, 1, 0), 1.5}}) {
    BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = 8});
    one.mesh.build(broad, S(0));
    CandidateBuffer found;
    SelfIntersectionStats with, without;
    broad.self_intersections(found, SelfCulling::cones, &with);
    broad.self_intersections(found, SelfCulling::none, &without);
    EXPECT_GT(with.certified, 0u);
    EXPECT_EQ(without.patches, 0u);
    EXPECT_GE(double(without.triangles.tests), one.fewer * double(with.triangles.tests))
        << without.triangles.tests << ", " << with.triangles.tests;
    if (one.fewer < 1e9) continue;
    EXPECT_EQ(with.patches, 1u);
    EXPECT_EQ(with.box_tests, 1u);
  }
}

TYPED_TEST(SelfIntersections, OfFewElementsInEveryPosition) {
  using S = TypeParam;
  std::uint64_t certified = 0;
  for (std::uint64_t seed = 0; seed < 4'000; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    BroadPhase<S> broad;
    mesh.build(broad, random_radius<S>(seed));
    SelfIntersectionStats stats;
    ASSERT_EQ(wrong_self(broad, all_touching(mesh), &stats), "") << seed;
    certified += stats.certified;
  }
  EXPECT_GT(certified, 20u);
}

/// Sheets of few cells, corners of which lie in a plane, in a line or on each other, or next to it.
TYPED_TEST(SelfIntersections, OfSheetsThatJustTouch) {
  using S = TypeParam;
  std::uint64_t certified = 0, touching = 0;
  for (std::uint64_t seed = 0; seed < 3'000; ++seed) {
    Random random(seed);
    Mesh<S> mesh = flat<S>(3 + random.below(4));
    const auto count = std::uint32_t(mesh.vertex_count());
    for (std::uint32_t moves = random.below(4); moves > 0; --moves) {
      const std::uint32_t v = random.below(count), w = random.below(count), style = random.below(5);
      for (std::size_t k = 0; k < 3; ++k) {
        S& x = mesh.v0[3 * v + k];
        const S other = mesh.v0[3 * w + k];
        x = style == 0   ? other                                           // onto another vertex
            : style == 1 ? (x + other) / 2                                 // between two
            : style == 2 ? std::nextafter(other, S(random.below(2) * 10))  // next to it
            : style == 3 ? x + S(int(random.below(3)) - 1)                 // by a cell
                         : S(int(random.below(9)) - 2) / 2;                // on half a cell
      }
    }
    // In any direction, the same in exact arithmetic: coordinates change places and signs.
    const std::uint32_t turn = random.below(3);
    const bool mirrored = random.below(2) == 0;
    for (std::size_t v = 0; v < count; ++v) {
      S* const p = &mesh.v0[3 * v];
      std::rotate(p, p + turn, p + 3);
      if (mirrored) p[0] = -p[0];
    }
    BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = 5});
    mesh.build(broad, S(0));
    const Pairs expected = all_touching(mesh);
    SelfIntersectionStats stats;
    ASSERT_EQ(wrong_self(broad, expected, &stats), "") << seed;
    certified += stats.certified;
    touching += expected.empty() ? 0 : 1;
  }
  EXPECT_GT(certified, 1000u);
  EXPECT_GT(touching, 500u);
}

TYPED_TEST(SelfIntersections, FollowUpdatesEditsAndFilters) {
  using S = TypeParam;
  Mesh<S> mesh = folds<S>(24, 0);
  BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = 6});
  mesh.build(broad, S(0.01));
  std::uint64_t certified = 0;
  for (int step = 0; step <= 10; ++step) {  // the tree and the contours of the flat sheet
    mesh.v0 = folds<S>(24, 0.27 * step, 0.02 * step).v0;
    if (step % 3 == 2)
      broad.update(flat<S>(24).begin(), mesh.begin());  // a motion: at its end
    else
      mesh.update(broad);
    SelfIntersectionStats stats;
    ASSERT_EQ(wrong_self(broad, all_touching(mesh), &stats), "") << step;
    certified += stats.certified;
  }
  EXPECT_GT(certified, 50u);
  mesh.update(broad);
  std::vector<std::uint32_t> moved{40, 41, 300};
  for (const std::uint32_t v : moved) mesh.v0[3 * v + 2] -= S(6);
  broad.update(mesh.begin(), moved);
  ASSERT_EQ(wrong_self(broad, all_touching(mesh)), "");
  // Faces that are removed, then one that is added and stands across the sheet.
  const std::vector<std::uint32_t> gone{3, 4, 5, 77, 400, 401};
  broad.remove(Element::face, gone);
  ASSERT_EQ(wrong_self(broad, all_touching(mesh, broad.elements())), "");
  const S added[] = {5, 5, -9, 6, 5, 9, 5, 6, 9};
  const std::int32_t corners[] = {576, 577, 578};
  broad.insert(MatrixView<S>::by_rows(added, 3, 3), MatrixView<std::int32_t>(),
               MatrixView<std::int32_t>::by_rows(corners, 1, 3));
  mesh.v0.insert(mesh.v0.end(), added, added + 9);
  const Pairs expected = all_touching(mesh, broad.elements());
  ASSERT_EQ(wrong_self(broad, expected), "");
  EXPECT_GT(expected.size(), 10u);
  // Filters hold for them, too.
  Pairs kept = expected;
  std::vector<Candidate> excluded;
  for (const Candidate& pair : expected)
    if (pair.second % 3 == 0) {
      excluded.push_back(pair);
      kept.erase(pair);
    }
  broad.exclude(CandidateKind::face_face, excluded);
  ASSERT_EQ(wrong_self(broad, kept), "");
  broad.clear_filters();
  broad.valid_for(S(0.5));
  ASSERT_EQ(wrong_self(broad, expected), "");
  EXPECT_NE(complaint([] {
              CandidateBuffer found;
              BroadPhase<S>().self_intersections(found);
            }),
            "");
}

// ---- Seeded faults: what these tests compare with finds them ----------------------------------------------

/// Normals alone would certify a ramp whose storeys cut each other, and a disc that covers itself.
TYPED_TEST(SelfIntersections, AnOmittedContourTestIsCaught) {
  using S = TypeParam;
  for (const Mesh<S>& mesh : {ramp<S>(120, 3, 0.04, 0.05), double_disc<S>(40, 6)}) {
    Patches<S> patches(mesh);
    typename PatchCertificate<S>::Axis axis;
    ASSERT_TRUE(patches.certificate.find_axis(patches.contour(0), axis));
    EXPECT_TRUE(patches.normals_agree(0, axis));  // so a search without contours would find nothing at all
    EXPECT_FALSE(patches.certificate.contour_is_simple(patches.contour(0), axis));
    EXPECT_FALSE(all_touching(mesh).empty());
  }
}

/// A cone of some of the normals only, and the contour, would certify a sheet through which a mushroom that
/// grows from it bends back.
TYPED_TEST(SelfIntersections, AConeThatIsTooNarrowIsCaught) {
  using S = TypeParam;
  const Mesh<S> mesh = mushroom<S>(26);
  Patches<S> patches(mesh);
  typename PatchCertificate<S>::Axis axis;
  ASSERT_TRUE(patches.certificate.find_axis(patches.contour(0), axis));
  EXPECT_TRUE(patches.certificate.contour_is_simple(patches.contour(0), axis));
  EXPECT_FALSE(patches.normals_agree(0, axis));
  int agreeing = 0;
  std::vector<std::uint32_t> nodes{0};
  while (!nodes.empty()) {
    const WideNode at = patches.tree.leaves().tree.nodes[nodes.back()];
    nodes.pop_back();
    for (std::uint32_t c = 0; c < std::uint32_t(at.count - at.leaf_count); ++c) {
      nodes.push_back(at.first_child + c);
      agreeing += patches.normals_agree(nodes.back(), axis) ? 1 : 0;
    }
  }
  EXPECT_GT(agreeing, 3);
  EXPECT_FALSE(all_touching(mesh).empty());
}

/// Contours by definition: the sides of the faces below a node that have no opposite.
TYPED_TEST(SelfIntersections, ContoursAreWhatIsLeftOfSides) {
  using S = TypeParam;
  std::size_t loops_with_holes = 0, closed = 0;
  for (const Mesh<S>& mesh :
       {flat<S>(20), twisted_rod<S>(40, 0.3), double_disc<S>(12, 3), layers<S>(9, 3, 1)}) {
    Patches<S> patches(mesh);
    const ElementLeaves<S> leaves = patches.tree.leaves();
    const std::uint32_t padded = patches.tree.padded_leaf_size();
    std::vector<std::uint32_t> nodes{0};
    while (!nodes.empty()) {
      const std::uint32_t node = nodes.back();
      nodes.pop_back();
      std::multiset<std::pair<std::uint32_t, std::uint32_t>> sides;
      std::vector<std::uint32_t> below{node};
      while (!below.empty()) {
        const WideNode at = leaves.tree.nodes[below.back()];
        if (below.back() == node)
          for (std::uint32_t c = 0; c < std::uint32_t(at.count - at.leaf_count); ++c)
            nodes.push_back(at.first_child + c);
        below.pop_back();
        for (std::uint32_t c = 0; c < std::uint32_t(at.count - at.leaf_count); ++c)
          below.push_back(at.first_child + c);
        for (std::uint32_t leaf = at.first_leaf; leaf < at.first_leaf + at.leaf_count; ++leaf)
          for (std::uint32_t i = leaves.first_entry[leaf]; i < leaves.end_entry[leaf]; ++i)
            for (std::uint32_t c = 0; c < 3; ++c) {
              const auto corners = patches.elements.vertices(Element::face, leaves.ids[i]);
              const auto opposite = sides.find({corners[(c + 1) % 3], corners[c]});
              if (opposite != sides.end())
                sides.erase(opposite);
              else
                sides.insert({corners[c], corners[(c + 1) % 3]});
            }
      }
      ASSERT_EQ(padded, 8u);
      std::set<std::uint32_t> begins;
      for (const auto& [from, to] : sides) begins.insert(from);
      const std::span<const FaceSide> contour = patches.contour(node);
      if (begins.size() != sides.size() || sides.empty()) {  // loops with a common vertex
        EXPECT_TRUE(contour.empty());
        continue;
      }
      ASSERT_EQ(contour.size(), sides.size()) << node;
      std::size_t loops = 0;
      for (std::size_t begin = 0; begin < contour.size(); ++loops) {
        std::size_t end = begin;
        while (contour[end].to != contour[begin].from) {
          ASSERT_LT(end + 1, contour.size());
          ASSERT_EQ(contour[end + 1].from, contour[end].to);
          ++end;
        }
        begin = end + 1;
      }
      for (const FaceSide& side : contour) EXPECT_EQ(sides.count({side.from, side.to}), 1u);
      loops_with_holes += loops > 1 ? 1 : 0;
      ++closed;
    }
  }
  EXPECT_GT(loops_with_holes, 0u);
  EXPECT_GT(closed, 50u);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
