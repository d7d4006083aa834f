// Rings that a broad phase excludes, against the lengths of all ways along edges and sides of faces.
#include <gtest/gtest.h>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

constexpr std::uint32_t unconnected = 1000;

/// The number of edges between each two vertices, by definition: every way through every vertex.
std::vector<std::vector<std::uint32_t>> all_ways(const Elements& elements) {
  const std::uint32_t count = elements.vertex_count();
  std::vector<std::vector<std::uint32_t>> away(count, std::vector<std::uint32_t>(count, unconnected));
  for (std::uint32_t v = 0; v < count; ++v) away[v][v] = 0;
  for (const Element element : {Element::edge, Element::face})
    for (std::uint32_t id = 0; id < elements.count(element); ++id)
      for (const std::uint32_t v : elements.vertices(element, id))
        for (const std::uint32_t w : elements.vertices(element, id))
          if (v != w && elements.of(element).alive(id)) away[v][w] = 1;
  for (std::uint32_t by = 0; by < count; ++by)
    for (std::uint32_t v = 0; v < count; ++v)
      for (std::uint32_t w = 0; w < count; ++w) away[v][w] = std::min(away[v][w], away[v][by] + away[by][w]);
  return away;
}

/// Compares the candidates with those of all pairs that more than `rings` edges connect.
template <class S>
std::string wrong_candidates(BroadPhase<S>& broad, const Mesh<S>& mesh, S radius, std::uint32_t rings) {
  const Elements& elements = broad.elements();
  const auto away = all_ways(elements);
  const std::vector<Box<S>> boxes = vertex_boxes(mesh, radius);
  for (const CandidateKind kind : candidate_kinds) {
    Pairs expected = brute_force(elements, kind, boxes);
    std::erase_if(expected, [&](const Candidate& pair) {
      std::uint32_t least = unconnected;
      for (const std::uint32_t v : elements.vertices(first_element(kind), pair.first))
        for (const std::uint32_t w : elements.vertices(second_element(kind), pair.second))
          least = std::min(least, away[v][w]);
      return least <= rings;
    });
    const std::string wrong = difference(broad.candidates(kind), expected, elements, kind);
    if (!wrong.empty()) return wrong;
  }
  return {};
}

template <class S>
class Rings : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Rings, Scalars);

TYPED_TEST(Rings, ExcludeWhatFewEdgesConnect) {
  using S = TypeParam;
  for (std::uint64_t seed = 0; seed < 1'000; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    const S radius = random_radius<S>(seed);
    BroadPhase<S> broad;
    mesh.build(broad, radius);
    for (const std::uint32_t rings : {1U, 3U, 0U, 2U}) {
      broad.exclude_rings(rings);
      ASSERT_EQ(wrong_candidates(broad, mesh, radius, rings), "") << seed << ", " << rings << " rings";
    }
  }
}

TYPED_TEST(Rings, OfASheetThroughUpdatesAndEdits) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(12, 4);
  BroadPhase<S> broad;
  mesh.build(broad, S(1.5));
  for (const std::uint32_t rings : {1U, 2U, 5U}) {
    broad.exclude_rings(rings);
    ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), rings), "") << rings;
  }
  broad.exclude_rings(2);
  mesh.v0 = crumpled<S>(12, 5).v0;
  mesh.update(broad);
  ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), 2), "");
  // A tear: faces and edges across a row no longer connect its two sides.
  const Elements elements = mesh.elements();
  for (const Element element : {Element::edge, Element::face}) {
    std::vector<std::uint32_t> torn;
    for (std::uint32_t id = 0; id < elements.count(element); ++id) {
      const auto vertices = elements.vertices(element, id);
      const auto [low, high] = std::minmax_element(vertices.begin(), vertices.end());
      if (*low / 12 < 6 && *high / 12 >= 6) torn.push_back(id);
    }
    ASSERT_GT(torn.size(), 10u);
    broad.remove(element, torn);
    ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), 2), "");
  }
  // A seam across the tear.
  const std::int32_t seam[] = {5 * 12 + 3, 6 * 12 + 3, 5 * 12 + 4, 6 * 12 + 4};
  broad.insert(MatrixView<S>(), MatrixView<std::int32_t>::by_rows(seam, 2, 2), MatrixView<std::int32_t>());
  ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), 2), "");
  // A vertex that nothing connects, then a face that does.
  const S added[] = {3, 3, 0};
  broad.insert(MatrixView<S>::by_rows(added, 1, 3), MatrixView<std::int32_t>(), MatrixView<std::int32_t>());
  mesh.v0.insert(mesh.v0.end(), added, added + 3);
  ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), 2), "");
  const std::int32_t corners[] = {144, 40, 41};
  broad.insert(MatrixView<S>(), MatrixView<std::int32_t>(), MatrixView<std::int32_t>::by_rows(corners, 1, 3));
  ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), 2), "");
  broad.clear_filters();
  ASSERT_EQ(wrong_candidates(broad, mesh, S(1.5), 0), "");
}

/// The fault of an implementation that stops a ring too early, or goes one too far.
TYPED_TEST(Rings, OneRingTooFewIsCaught) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(8, 2);
  BroadPhase<S> broad;
  mesh.build(broad, S(2));
  broad.exclude_rings(2);
  EXPECT_EQ(wrong_candidates(broad, mesh, S(2), 2), "");
  EXPECT_NE(wrong_candidates(broad, mesh, S(2), 3), "");
  EXPECT_NE(wrong_candidates(broad, mesh, S(2), 1), "");
  mesh.build(broad, S(2));  // a build ends filters
  EXPECT_EQ(wrong_candidates(broad, mesh, S(2), 0), "");
  EXPECT_NE(complaint([] { BroadPhase<S>().exclude_rings(1); }).find("before build()"), std::string::npos);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
