// kbvh::broad_phase: candidates against all pairs of elements, in both scalars, at rest and in motion, for
// radii from none to everything, through updates of all vertices, of some, and within a bound.
#include <gtest/gtest.h>

#include <numeric>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

template <class S>
std::string wrong_candidates(BroadPhase<S>& broad, const Mesh<S>& mesh, S radius, More more = More::wrong) {
  const Elements elements = mesh.elements();
  const std::vector<Box<S>> boxes = vertex_boxes(mesh, radius);
  CandidateBuffer found;
  for (const CandidateKind kind : candidate_kinds) {
    broad.detect(kind, found);
    const Pairs expected = brute_force(mesh, kind, boxes);
    std::string wrong = difference(found, expected, elements, kind, more);
    if (wrong.empty()) wrong = difference(broad.candidates(kind), expected, elements, kind, more);
    if (!wrong.empty()) return wrong;
  }
  return {};
}

/// Compares distances of all pairs of a small mesh with each of several distances.
template <class S>
std::string wrong_within(BroadPhase<S>& broad, const Mesh<S>& mesh, std::initializer_list<S> distances) {
  CandidateBuffer found;
  for (const CandidateKind kind : candidate_kinds) {
    const Distances all = all_distances(mesh, kind);
    for (const S distance : distances) {
      broad.within(kind, distance, found);
      const std::string wrong = difference(found, within(all, distance), mesh.elements(), kind);
      if (!wrong.empty()) return "within " + std::to_string(distance) + ": " + wrong;
    }
  }
  return {};
}

/// Compares distances of vertices and faces, and of edges, of a larger mesh.
template <class S>
std::string wrong_near(BroadPhase<S>& broad, const Mesh<S>& mesh, S distance) {
  CandidateBuffer found;
  for (const CandidateKind kind : {CandidateKind::face_vertex, CandidateKind::edge_edge}) {
    broad.within(kind, distance, found);
    const Pairs expected = within(near_distances(mesh, kind, distance), distance);
    const std::string wrong = difference(found, expected, mesh.elements(), kind);
    if (!wrong.empty()) return "near " + std::to_string(distance) + ": " + wrong;
  }
  return {};
}

template <class S>
class BroadPhases : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(BroadPhases, Scalars);

TYPED_TEST(BroadPhases, FindWhatAllPairsFind) {
  using S = TypeParam;
  const std::vector<KernelSet>& sets = supported_kernel_sets();
  for (std::uint64_t seed = 0; seed < 10'000; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    const S radius = random_radius<S>(seed);
    BroadPhase<S> broad(
        BroadPhaseSettings{.leaf_size = seed % 2 == 0 ? 8U : 16U, .kernels = sets[seed % sets.size()]});
    mesh.build(broad, radius);
    ASSERT_EQ(wrong_candidates(broad, mesh, radius), "") << "seed " << seed << ", radius " << radius;
  }
}

TYPED_TEST(BroadPhases, FindWhatAllPairsFindInDeepTrees) {
  using S = TypeParam;
  for (const std::uint32_t leaf_size : {5U, 8U, 16U})
    for (const KernelSet set : supported_kernel_sets()) {
      Mesh<S> mesh = crumpled<S>(24, leaf_size);
      BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = leaf_size, .kernels = set});
      mesh.build(broad, S(0.05));
      ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05)), "") << name(set);
      EXPECT_GT(broad.candidates(CandidateKind::edge_edge).size(), 3000u);
      // Other positions, by a refit; then a motion between the two.
      Mesh<S> next = crumpled<S>(24, leaf_size + 100);
      next.update(broad);
      ASSERT_EQ(wrong_candidates(broad, next, S(0.05)), "") << name(set);
      mesh.v1 = next.v0;
      mesh.update(broad);
      ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05)), "") << name(set);
    }
}

TYPED_TEST(BroadPhases, AllSetsOfKernelsAndBothWaysToTheTreesAgree) {
  using S = TypeParam;
  const Mesh<S> first = crumpled<S>(40, 1), second = crumpled<S>(40, 2);
  CandidateBuffer reference, found;
  for (const CandidateKind kind : candidate_kinds) {
    reference.clear();
    for (const KernelSet set : supported_kernel_sets()) {
      BroadPhase<S> broad(BroadPhaseSettings{.kernels = set});
      first.build(broad, S(0.1));
      broad.detect(kind, found);
      second.update(broad);
      broad.detect(kind, found);
      if (reference.empty()) reference = found;
      EXPECT_EQ(found, reference) << name(set) << ", " << name(kind);  // the order, too
      broad.forget_trees();
      CandidateBuffer again;
      broad.detect(kind, again);
      std::sort(again.begin(), again.end());
      std::sort(found.begin(), found.end());
      EXPECT_EQ(again, found) << name(set) << ", " << name(kind);
    }
  }
}

TYPED_TEST(BroadPhases, DistancesAreExact) {
  using S = TypeParam;
  int near = 0;
  for (std::uint64_t seed = 0; seed < 250; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    const S radius = random_radius<S>(seed);
    BroadPhase<S> broad;
    mesh.build(broad, radius);
    CandidateBuffer found;
    broad.within(CandidateKind::face_vertex, radius, found);
    near += found.empty() ? 0 : 1;
    ASSERT_EQ(wrong_within(broad, mesh, {radius, radius / 2, S(0)}), "") << "seed " << seed;
  }
  EXPECT_GT(near, 30);
}

/// Distances that are equal to the radius, or that differ from it by less than an ulp of its square.
TYPED_TEST(BroadPhases, DistancesAtTheRadius) {
  using S = TypeParam;
  const S height = S(5), below = std::nextafter(height, S(0));
  // A face in the plane z = 0, a vertex above its inside, an edge next to it at the distance 5 = |(3, 4)|.
  Mesh<S> mesh;
  mesh.v0 = {-9, -9, 0, 9, -9, 0, 0, 9, 0, 0, 0, height, 3, 13, -1, -3, 13, -1, 0, 12, 4};
  mesh.faces = {0, 1, 2};
  mesh.edges = {4, 5, 0, 2};
  BroadPhase<S> broad;
  mesh.build(broad, height);
  const auto count = [&](CandidateKind kind, S distance) {
    CandidateBuffer found;
    broad.within(kind, distance, found);
    return found;
  };
  const auto contains = [](const CandidateBuffer& list, Candidate pair) {
    return std::find(list.begin(), list.end(), pair) != list.end();
  };
  EXPECT_TRUE(contains(count(CandidateKind::face_vertex, height), {0, 3}));
  EXPECT_FALSE(contains(count(CandidateKind::face_vertex, below), {0, 3}));
  EXPECT_TRUE(contains(count(CandidateKind::vertex_vertex, height), {2, 6}));  // (0, 3, 4)
  EXPECT_FALSE(contains(count(CandidateKind::vertex_vertex, below), {2, 6}));
  ASSERT_EQ(wrong_within(broad, mesh, {height, below}), "");
}

TYPED_TEST(BroadPhases, UpdatesOfMovedVerticesEqualUpdatesOfAll) {
  using S = TypeParam;
  for (const KernelSet set : supported_kernel_sets()) {
    Mesh<S> mesh = crumpled<S>(30, 5);
    BroadPhase<S> part(BroadPhaseSettings{.kernels = set}), whole(BroadPhaseSettings{.kernels = set});
    mesh.build(part, S(0.05));
    mesh.build(whole, S(0.05));
    Random random(9);
    CandidateBuffer a, b;
    for (int step = 0; step < 30; ++step) {
      std::vector<std::uint32_t> moved;
      const std::uint32_t count = step % 7 == 6 ? 400 : 1 + random.below(12), patch = random.below(800);
      for (std::uint32_t i = 0; i < count; ++i)
        moved.push_back(step % 2 == 0 ? patch + i % 100 : random.below(900));
      for (const std::uint32_t v : moved)
        for (std::size_t k = 0; k < 3; ++k) mesh.v0[3 * v + k] += S(0.3 * random.unit());
      part.update(mesh.begin(), moved);
      whole.update(mesh.begin());
      for (const CandidateKind kind : candidate_kinds) {
        part.detect(kind, a);
        whole.detect(kind, b);
        std::sort(a.begin(), a.end());
        std::sort(b.begin(), b.end());
        ASSERT_EQ(a, b) << name(kind) << ", step " << step;
      }
    }
    const auto& work = part.work(Element::face);
    EXPECT_GE(work.partial_refits, 20u);
    // Twelve vertices have at most 72 faces; a refit of 1682 faces makes 211 leaves or more.
    EXPECT_LT(work.leaves_remade, 80 * work.partial_refits);
    EXPECT_EQ(wrong_candidates(part, mesh, S(0.05)), "");
  }
}

TYPED_TEST(BroadPhases, TreesThatUpdatesOfSomeVerticesSpoiltAreBuiltAgain) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(12, 5);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.05));
  ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05)), "");
  Random random(3);
  const auto vertices = std::uint32_t(mesh.vertex_count());
  for (std::uint32_t part = 0; part < 8; ++part) {
    std::vector<std::uint32_t> moved;
    for (std::uint32_t v = part; v < vertices; v += 8) moved.push_back(v);
    for (const std::uint32_t v : moved)
      for (std::size_t k = 0; k < 3; ++k) mesh.v0[3 * v + k] = S(50 * random.unit());
    broad.update(mesh.begin(), moved);
  }
  ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05)), "");
  for (const Element element : {Element::vertex, Element::edge, Element::face}) {
    EXPECT_GE(broad.work(element).partial_refits, 1u);
    EXPECT_EQ(broad.work(element).builds, 2u);
  }
}

TYPED_TEST(BroadPhases, CandidatesHoldWithinABound) {
  using S = TypeParam;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    Mesh<S> mesh = crumpled<S>(16, seed);
    const bool each = seed % 2 == 1, swept = seed % 3 == 2;
    if (swept) mesh.v1 = crumpled<S>(16, seed + 50).v0;
    BroadPhase<S> broad;
    mesh.build(broad, S(0.05));
    const S bound = S(0.1);
    if (each)
      broad.valid_for(std::vector<S>(mesh.vertex_count(), bound));
    else
      broad.valid_for(bound);
    EXPECT_EQ(broad.left(), bound);
    const Mesh<S> start = mesh;
    Random random(seed);
    ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), More::allowed), "");
    const std::uint64_t detected = broad.detections();
    for (int step = 0; step < 12; ++step) {
      // Anywhere within the bound.
      for (std::size_t i = 0; i < mesh.v0.size(); ++i) {
        mesh.v0[i] = start.v0[i] + S(0.0999 * random.unit());
        if (swept) mesh.v1[i] = start.v1[i] + S(0.0999 * random.unit());
      }
      mesh.update(broad);
      ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), More::allowed), "") << "step " << step;
      if (step % 6 == 0) {
        ASSERT_EQ(wrong_near(broad, mesh, S(0.03)), "") << "step " << step;
      }
      EXPECT_GT(broad.left(), 0);
      EXPECT_LT(broad.left(), S(0.01));
    }
    EXPECT_EQ(broad.detections(), detected);
    EXPECT_EQ(broad.references(), 2u);
    // One coordinate of one vertex leaves it.
    mesh.v0[100] = (swept ? std::max(start.v0[100], start.v1[100]) : start.v0[100]) + S(0.11);
    mesh.update(broad);
    EXPECT_EQ(broad.references(), 3u);
    EXPECT_EQ(broad.left(), bound);
    ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), More::allowed), "");
    EXPECT_EQ(broad.detections(), detected + 6);
    // No bound: candidates are those of the present positions.
    broad.valid_for(S(0));
    ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05)), "");
  }
}

TYPED_TEST(BroadPhases, BoundsHoldForMovedVerticesToo) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(16, 3);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.05));
  broad.valid_for(S(0.1));
  ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), More::allowed), "");
  const std::vector<std::uint32_t> moved{17, 40, 200};
  for (int step = 1; step <= 4; ++step) {
    for (const std::uint32_t v : moved) mesh.v0[3 * v + 1] += S(0.03);
    broad.update(mesh.begin(), moved);
    EXPECT_EQ(broad.references(), step < 4 ? 2u : 3u) << step;
    ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), More::allowed), "") << step;
    ASSERT_EQ(wrong_near(broad, mesh, S(0.05)), "") << step;
  }
}

TYPED_TEST(BroadPhases, TheEarliestImpactIsThatOfAllPairs) {
  using S = TypeParam;
  int touching = 0;
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    if (!mesh.swept()) continue;
    BroadPhase<S> broad;
    mesh.build(broad, S(0));
    const Elements elements = mesh.elements();
    double end = 2;
    for (const CandidateKind kind : {CandidateKind::face_vertex, CandidateKind::edge_edge})
      for_all_pairs(elements, kind, [&](const Candidate& pair) {
        const Impact impact = impact_of(mesh, elements, kind, pair);
        if (impact.touches) end = std::min(end, impact.end);
      });
    EarliestImpactStats stats;
    const EarliestImpact found = broad.earliest_impact(0, &stats);
    ASSERT_EQ(found.touches, end <= 1) << seed;
    if (found.touches) {
      ++touching;
      EXPECT_EQ(found.end, end) << seed;
      EXPECT_EQ(found.begin, std::max(0.0, end - impact_width)) << seed;
    }
    EXPECT_EQ(stats.culled + stats.later + stats.impacts.tests, stats.candidates);
  }
  EXPECT_GT(touching, 50);
  BroadPhase<S> broad;
  crumpled<S>(4, 1).build(broad, S(0));
  EXPECT_THROW(broad.earliest_impact(), std::logic_error);
}

TYPED_TEST(BroadPhases, TheEarliestApproachIsThatOfAllPairs) {
  using S = TypeParam;
  int near = 0, later = 0;
  for (std::uint64_t seed = 0; seed < 250; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    const S radius = random_radius<S>(seed);
    if (!mesh.swept() || radius == 0) continue;
    BroadPhase<S> broad;
    mesh.build(broad, radius);
    const double separation = double(radius) / (1 + double(seed % 2));
    const Elements elements = mesh.elements();
    // By definition: of all pairs, in the order of elements.
    EarliestImpact expected;
    std::vector<S> begin, end;
    for (std::size_t v = 0; v < mesh.vertex_count(); ++v)
      for (std::size_t k = 0; k < 4; ++k) {
        begin.push_back(k < 3 ? mesh.v0[3 * v + k] : S(0));
        end.push_back(k < 3 ? mesh.v1[3 * v + k] : S(0));
      }
    for (const CandidateKind kind : {CandidateKind::face_vertex, CandidateKind::edge_edge}) {
      std::vector<Candidate> all;
      for_all_pairs(elements, kind, [&](const Candidate& pair) { all.push_back(pair); });
      take_earlier_impacts<S>(kind, elements, begin.data(), end.data(), all, separation, expected);
    }
    const EarliestImpact found = broad.earliest_impact(separation);
    ASSERT_EQ(found.touches, expected.touches) << seed;
    if (!found.touches) continue;
    EXPECT_EQ(found.end, expected.end) << seed;
    EXPECT_EQ(found.pair, expected.pair) << seed;
    ++near;
    later += found.begin > 0 ? 1 : 0;
    const EarliestImpact contact = broad.earliest_impact();
    EXPECT_TRUE(!contact.touches || contact.end >= found.begin) << seed;
  }
  EXPECT_GT(near, 30);
  EXPECT_GT(later, 3);
  BroadPhase<S> broad;
  Mesh<S> mesh = crumpled<S>(4, 1);
  mesh.v1 = mesh.v0;
  mesh.build(broad, S(0.5));
  EXPECT_NE(complaint([&] { broad.earliest_impact(0.75); }).find("from 0 to the radius 0.5"),
            std::string::npos);
  EXPECT_NE(complaint([&] { broad.earliest_impact(-1); }), "");
}

// ---- Seeded faults: what these tests compare with finds them ----------------------------------------------

TYPED_TEST(BroadPhases, ForgottenVerticesAreCaught) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(16, 3);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.05));
  ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05)), "");
  for (const std::uint32_t v : {20U, 21U, 130U}) mesh.v0[3 * v + 2] += S(1.5);
  broad.update(mesh.begin(), std::vector<std::uint32_t>{20, 21});
  EXPECT_NE(wrong_candidates(broad, mesh, S(0.05)), "");
  broad.update(mesh.begin(), std::vector<std::uint32_t>{130});
  EXPECT_EQ(wrong_candidates(broad, mesh, S(0.05)), "");
}

TYPED_TEST(BroadPhases, OverrunBoundsAreCaught) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(16, 4);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.05));
  broad.valid_for(S(0.1));
  const auto kept = broad.candidates(CandidateKind::edge_edge);
  const CandidateBuffer stale(kept.begin(), kept.end());
  Random random(1);
  for (S& x : mesh.v0) x += S(0.3 * random.unit());
  // Candidates that were kept over a motion of three times the bound.
  EXPECT_NE(difference(stale, brute_force(mesh, CandidateKind::edge_edge, S(0.05)), mesh.elements(),
                       CandidateKind::edge_edge, More::allowed),
            "");
  mesh.update(broad);
  EXPECT_EQ(wrong_candidates(broad, mesh, S(0.05), More::allowed), "");
}

TYPED_TEST(BroadPhases, IncidentElementsAreCaught) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(6, 4);
  const Elements elements = mesh.elements();
  for (const CandidateKind kind : candidate_kinds) {
    if (kind == CandidateKind::vertex_vertex) continue;  // a vertex is incident to itself only
    const Pairs expected = brute_force(mesh, kind, S(0.1));
    CandidateBuffer found(expected.begin(), expected.end());
    EXPECT_EQ(difference(found, expected, elements, kind), "");
    for (std::uint32_t b = 0; b < elements.count(second_element(kind)); ++b)
      if ((first_element(kind) != second_element(kind) || b > 0) && elements.incident(kind, {0, b})) {
        found.push_back({0, b});
        break;
      }
    ASSERT_GT(found.size(), expected.size());
    EXPECT_NE(difference(found, expected, elements, kind, More::allowed), "");
  }
}

// ---- Input ------------------------------------------------------------------------------------------------

TYPED_TEST(BroadPhases, WrongInputIsNamedAndChangesNothing) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(8, 1);
  BroadPhase<S> broad;
  CandidateBuffer found;
  EXPECT_NE(complaint([&] { broad.detect(CandidateKind::edge_edge, found); }).find("before build()"),
            std::string::npos);
  EXPECT_NE(complaint([&] { broad.update(mesh.begin()); }).find("before build()"), std::string::npos);
  mesh.build(broad, S(0.1));
  const Mesh<S> good = mesh;
  const S nan = std::numeric_limits<S>::quiet_NaN();
  for (const S bad : {nan, std::numeric_limits<S>::infinity(), std::numeric_limits<S>::max()}) {
    mesh.v0[3 * 5 + 1] = bad;
    const std::string expected = "V: coordinate y of vertex 5 is ";
    EXPECT_EQ(complaint([&] { mesh.update(broad); }).substr(0, expected.size()), expected);
    const std::vector<std::uint32_t> moved{3, 5};
    EXPECT_EQ(complaint([&] { broad.update(mesh.begin(), moved); }).substr(0, expected.size()), expected);
    EXPECT_EQ(complaint([&] { broad.update(good.begin(), mesh.begin()); }).substr(0, 2), "V1");
    BroadPhase<S> other;
    EXPECT_NE(complaint([&] { mesh.build(other, S(0.1)); }), "");
    EXPECT_FALSE(other.built());
  }
  EXPECT_EQ(wrong_candidates(broad, good, S(0.1)), "");
  const auto rows = MatrixView<S>::by_rows(good.v0.data(), 10, 3);
  EXPECT_EQ(complaint([&] { broad.update(rows); }), "V has 10 rows for 64 vertices");
  EXPECT_EQ(complaint([&] { broad.update(MatrixView<S>::by_rows(good.v0.data(), 64, 2)); }),
            "V has 2 columns instead of 3");
  EXPECT_EQ(complaint([&] { broad.update(good.begin(), std::vector<std::uint32_t>{64}); }),
            "vertex 64 moved, but there are 64");
  EXPECT_NE(complaint([&] { broad.within(CandidateKind::edge_edge, S(0.2), found); }), "");
  EXPECT_NE(complaint([&] { broad.within(CandidateKind::edge_edge, S(-1), found); }), "");
  EXPECT_NE(complaint([&] { broad.within(CandidateKind::edge_edge, nan, found); }), "");
  EXPECT_NE(complaint([&] { broad.valid_for(S(-1)); }), "");
  EXPECT_NE(complaint([&] { broad.valid_for(std::vector<S>(3, S(1))); }), "");
  EXPECT_NE(complaint([&] { good.build(broad, nan); }), "");
  EXPECT_NE(complaint([&] { good.build(broad, S(-1)); }), "");
  EXPECT_NE(complaint([&] { BroadPhase<S>(BroadPhaseSettings{.leaf_size = 4}); }), "");
  EXPECT_NE(complaint([&] { BroadPhase<S>(BroadPhaseSettings{.leaf_size = 17}); }), "");
  EXPECT_NE(complaint([&] { BroadPhase<S>(BroadPhaseSettings{.most_growth = 0.5}); }), "");
  EXPECT_EQ(complaint([&] { BroadPhase<S>(BroadPhaseSettings{.kernels = KernelSet(99)}); }),
            "kernels for '?' cannot run on this machine");
  broad.update(good.begin(), good.begin());
  EXPECT_NE(complaint([&] { broad.update(good.begin(), std::vector<std::uint32_t>{1}); }), "");
  EXPECT_EQ(wrong_candidates(broad, good, S(0.1)), "");
}

TEST(Elements, IndicesAreChecked) {
  const std::int64_t negative[] = {0, 1, 2, -1};
  EXPECT_EQ(complaint([&] {
              make_elements(3, MatrixView<std::int64_t>::by_rows(negative, 2, 2), MatrixView<int>());
            }),
            "edge 1 names vertex -1 of 3");
  const unsigned large[] = {0, 1, 2, 1, 2, 3};
  EXPECT_EQ(
      complaint([&] { make_elements(3, MatrixView<int>(), MatrixView<unsigned>::by_rows(large, 2, 3)); }),
      "face 1 names vertex 3 of 3");
  EXPECT_EQ(
      complaint([&] { make_elements(3, MatrixView<int>(), MatrixView<unsigned>::by_rows(large, 3, 2)); }),
      "faces have 3 vertices each, not 2");
  EXPECT_EQ(make_elements(0, MatrixView<int>(), MatrixView<int>()).vertex_count(), 0u);
  const Elements elements = make_elements(4, MatrixView<unsigned>::by_columns(large, 3, 2),
                                          MatrixView<unsigned>::by_columns(large, 2, 3));
  EXPECT_EQ(elements.vertices(Element::edge, 1)[1], 2u);  // columns 0 1 2 and 1 2 3
  EXPECT_EQ(elements.vertices(Element::face, 1)[2], 3u);
  EXPECT_TRUE(elements.incident(CandidateKind::edge_edge, {0, 1}));
  EXPECT_FALSE(elements.incident(CandidateKind::edge_vertex, {0, 3}));
}

TEST(Elements, KindsHaveNames) {
  for (const CandidateKind kind : candidate_kinds) {
    EXPECT_EQ(candidate_kind(name(kind)), kind);
    const std::string words = name(kind);
    const auto word = [](Element element) {
      return std::string(element == Element::vertex ? "vertex" : element == Element::edge ? "edge" : "face");
    };
    EXPECT_EQ(words, word(first_element(kind)) + "_" + word(second_element(kind)));
  }
  EXPECT_NE(complaint([] { candidate_kind("vertex_edge"); }).find("edge_vertex, "), std::string::npos);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
