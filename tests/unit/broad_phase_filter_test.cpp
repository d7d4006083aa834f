// Filters of a broad phase against all pairs: groups and masks, which searches use to skip subtrees, excluded
// pairs, and functions of a caller.
#include <gtest/gtest.h>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

/// What a filter admits, by definition.
struct Admitted {
  std::array<std::vector<GroupMask>, element_kinds> groups;
  std::array<Pairs, 6> excluded;

  bool operator()(CandidateKind kind, const Candidate& pair) const {
    const auto of = [&](Element element, std::uint32_t id) {
      const auto& list = groups[std::size_t(element)];
      return list.empty() ? GroupMask{1, 0xffffffffU} : list[id];
    };
    const GroupMask a = of(first_element(kind), pair.first), b = of(second_element(kind), pair.second);
    return (a.groups & b.mask) != 0 && (b.groups & a.mask) != 0 &&
           !excluded[std::size_t(kind)].contains(pair);
  }
};

template <class S>
std::string wrong_candidates(BroadPhase<S>& broad, const Mesh<S>& mesh, S radius, const Admitted& admitted) {
  const std::vector<Box<S>> boxes = vertex_boxes(mesh, radius);
  CandidateBuffer found;
  for (const CandidateKind kind : candidate_kinds) {
    Pairs expected = brute_force(mesh, kind, boxes);
    std::erase_if(expected, [&](const Candidate& pair) { return !admitted(kind, pair); });
    broad.detect(kind, found);
    std::string wrong = difference(found, expected, mesh.elements(), kind);
    if (wrong.empty()) wrong = difference(broad.candidates(kind), expected, mesh.elements(), kind);
    if (!wrong.empty()) return wrong;
  }
  return {};
}

/// Groups with few bits, also none; masks likewise.
std::vector<GroupMask> random_groups(std::uint32_t count, Random& random) {
  std::vector<GroupMask> groups;
  for (std::uint32_t i = 0; i < count; ++i) groups.push_back({random.below(8), random.below(8)});
  return groups;
}
template <class S>
std::vector<GroupMask> united(const Mesh<S>& mesh, Element element, const std::vector<GroupMask>& vertices) {
  const Elements elements = mesh.elements();
  std::vector<GroupMask> groups;
  for (std::uint32_t id = 0; id < elements.count(element); ++id) {
    GroupMask all{0, 0};
    for (const std::uint32_t v : elements.vertices(element, id)) {
      all.groups |= vertices[v].groups;
      all.mask |= vertices[v].mask;
    }
    groups.push_back(all);
  }
  return groups;
}

template <class S>
class BroadPhaseFilters : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(BroadPhaseFilters, Scalars);

TYPED_TEST(BroadPhaseFilters, AdmitWhatTheirDefinitionsAdmit) {
  using S = TypeParam;
  const std::vector<KernelSet>& sets = supported_kernel_sets();
  for (std::uint64_t seed = 0; seed < 1'500; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    const Elements elements = mesh.elements();
    const S radius = random_radius<S>(seed);
    Random random(seed + 5);
    BroadPhase<S> broad(BroadPhaseSettings{.kernels = sets[seed % sets.size()]});
    mesh.build(broad, radius);
    Admitted admitted;
    if (seed % 3 == 0) {
      admitted.groups[0] = random_groups(elements.vertex_count(), random);
      broad.set_vertex_groups(admitted.groups[0]);
      for (const Element element : {Element::edge, Element::face})
        if (!admitted.groups[0].empty())
          admitted.groups[std::size_t(element)] = united(mesh, element, admitted.groups[0]);
    } else {
      for (const Element element : {Element::vertex, Element::edge, Element::face}) {
        if (random.below(3) == 0) continue;  // some kinds have the default
        admitted.groups[std::size_t(element)] = random_groups(elements.count(element), random);
        broad.set_groups(element, admitted.groups[std::size_t(element)]);
      }
    }
    for (const CandidateKind kind : candidate_kinds) {
      std::vector<Candidate> excluded;
      for_all_pairs(elements, kind, [&](const Candidate& pair) {
        if (random.below(4) != 0) return;
        admitted.excluded[std::size_t(kind)].insert(pair);
        // Of one kind, in either order, and sometimes twice.
        const bool turned = first_element(kind) == second_element(kind) && random.below(2) == 0;
        excluded.push_back(turned ? Candidate{pair.second, pair.first} : pair);
        if (random.below(3) == 0) excluded.push_back(pair);
      });
      broad.exclude(kind, excluded);
    }
    ASSERT_EQ(wrong_candidates(broad, mesh, radius, admitted), "") << "seed " << seed;
    broad.clear_filters();
    ASSERT_EQ(wrong_candidates(broad, mesh, radius, Admitted()), "") << "seed " << seed;
  }
}

TYPED_TEST(BroadPhaseFilters, HoldInDeepTreesThroughUpdates) {
  using S = TypeParam;
  for (const std::uint32_t leaf_size : {5U, 16U})
    for (const KernelSet set : supported_kernel_sets()) {
      Mesh<S> mesh = crumpled<S>(24, leaf_size);
      const Elements elements = mesh.elements();
      BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = leaf_size, .kernels = set});
      mesh.build(broad, S(0.05));
      Random random(3);
      Admitted admitted;
      for (const Element element : {Element::edge, Element::face})
        admitted.groups[std::size_t(element)] = random_groups(elements.count(element), random);
      broad.set_groups(Element::edge, admitted.groups[1]);
      broad.set_groups(Element::face, admitted.groups[2]);
      ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), admitted), "") << name(set);
      std::vector<std::uint32_t> moved{7, 8, 300};
      for (const std::uint32_t v : moved) mesh.v0[3 * v + 2] += S(0.3);
      broad.update(mesh.begin(), moved);
      ASSERT_EQ(wrong_candidates(broad, mesh, S(0.05), admitted), "") << name(set);
      const Mesh<S> next = crumpled<S>(24, leaf_size + 100);
      next.update(broad);
      ASSERT_EQ(wrong_candidates(broad, next, S(0.05), admitted), "") << name(set);
      broad.forget_trees();
      ASSERT_EQ(wrong_candidates(broad, next, S(0.05), admitted), "") << name(set);
      for (GroupMask& groups : admitted.groups[2]) groups.mask = random.below(4);
      broad.set_groups(Element::face, admitted.groups[2]);
      ASSERT_EQ(wrong_candidates(broad, next, S(0.05), admitted), "") << name(set);
    }
}

/// A body and a ground that overlaps it: groups admit pairs of the two only, so whole subtrees are skipped.
TYPED_TEST(BroadPhaseFilters, GroupsSkipSubtrees) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(60, 1);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.02));
  CandidateBuffer all, some;
  broad.detect(CandidateKind::edge_edge, all);
  const std::uint64_t tests = broad.last_box_tests();
  std::vector<GroupMask> groups;
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    const bool ground = v / 60 < 15;  // a quarter
    groups.push_back(ground ? GroupMask{1, 2} : GroupMask{2, 1});
  }
  broad.set_vertex_groups(groups);
  broad.detect(CandidateKind::edge_edge, some);
  EXPECT_GT(some.size(), 0u);
  EXPECT_LT(8 * some.size(), all.size());
  EXPECT_LT(3 * broad.last_box_tests(), tests);
  // Nothing at all: the search ends at the root.
  broad.set_groups(Element::edge, std::vector<GroupMask>(mesh.edges.size() / 2, GroupMask{1, 2}));
  broad.detect(CandidateKind::edge_edge, some);
  EXPECT_EQ(some.size(), 0u);
  EXPECT_LT(broad.last_box_tests(), 10u);
}

TYPED_TEST(BroadPhaseFilters, FunctionsChooseAmongWhatIsLeft) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(20, 2);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.05));
  const std::vector<Box<S>> boxes = vertex_boxes(mesh, S(0.05));
  const auto even = [](CandidateKind, const Candidate& pair) { return (pair.first + pair.second) % 2 == 0; };
  const auto expected = [&](CandidateKind kind, const Pairs& excluded) {
    Pairs pairs = brute_force(mesh, kind, boxes);
    std::erase_if(pairs, [&](const Candidate& pair) { return !even(kind, pair) || excluded.contains(pair); });
    return pairs;
  };
  broad.keep_if(even);
  for (const CandidateKind kind : candidate_kinds)
    EXPECT_EQ(difference(broad.candidates(kind), expected(kind, {}), mesh.elements(), kind), "");
  // Excluded pairs are not shown to the function, nor are incident ones; it may change the order.
  const Pairs even_edges = expected(CandidateKind::edge_edge, {});
  Pairs excluded;
  for (const Candidate& pair : even_edges)
    if (excluded.size() < 10) excluded.insert(pair);
  broad.exclude(CandidateKind::edge_edge, std::vector<Candidate>(excluded.begin(), excluded.end()));
  int calls = 0, wrong = 0;
  const Elements elements = mesh.elements();
  broad.keep_only([&](CandidateKind kind, std::span<Candidate> pairs) {
    ++calls;
    for (const Candidate& pair : pairs)
      wrong += kind != CandidateKind::edge_edge || elements.incident(kind, pair) || excluded.contains(pair);
    const auto end =
        std::remove_if(pairs.begin(), pairs.end(), [&](const Candidate& pair) { return !even(kind, pair); });
    std::reverse(pairs.begin(), end);
    return std::size_t(end - pairs.begin());
  });
  EXPECT_EQ(difference(broad.candidates(CandidateKind::edge_edge),
                       expected(CandidateKind::edge_edge, excluded), elements, CandidateKind::edge_edge),
            "");
  EXPECT_GT(calls, 0);
  EXPECT_LT(calls, 100);  // many pairs at a time
  EXPECT_EQ(wrong, 0);
  // Distances and impacts are asked of admitted pairs only.
  CandidateBuffer near;
  broad.within(CandidateKind::edge_edge, S(0.05), near);
  for (const Candidate& pair : near) EXPECT_TRUE(even(CandidateKind::edge_edge, pair));
  broad.keep_only({});
  broad.exclude(CandidateKind::edge_edge, {});
  EXPECT_EQ(
      difference(broad.candidates(CandidateKind::edge_edge),
                 brute_force(mesh, CandidateKind::edge_edge, boxes), elements, CandidateKind::edge_edge),
      "");
}

// ---- Seeded faults ----------------------------------------------------------------------------------------

TYPED_TEST(BroadPhaseFilters, ForgottenFiltersAreCaught) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(12, 2);
  BroadPhase<S> broad;
  mesh.build(broad, S(0.05));
  Random random(1);
  Admitted admitted;
  admitted.groups[1] = random_groups(std::uint32_t(mesh.edges.size() / 2), random);
  EXPECT_NE(wrong_candidates(broad, mesh, S(0.05), admitted), "");  // groups that were not set
  broad.set_groups(Element::edge, admitted.groups[1]);
  EXPECT_EQ(wrong_candidates(broad, mesh, S(0.05), admitted), "");
  admitted.groups[1][5].groups = ~admitted.groups[1][5].groups;  // one element's groups are wrong
  admitted.groups[1][5].mask = ~admitted.groups[1][5].mask;
  EXPECT_NE(wrong_candidates(broad, mesh, S(0.05), admitted), "");
}

// ---- Input ------------------------------------------------------------------------------------------------

TYPED_TEST(BroadPhaseFilters, WrongInputIsNamedAndChangesNothing) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(6, 2);
  BroadPhase<S> broad;
  EXPECT_NE(complaint([&] { broad.set_vertex_groups({}); }).find("before build()"), std::string::npos);
  EXPECT_NE(complaint([&] { broad.keep_only({}); }).find("before build()"), std::string::npos);
  mesh.build(broad, S(0.05));
  EXPECT_EQ(complaint([&] { broad.set_vertex_groups(std::vector<GroupMask>(5)); }),
            "there are groups of 5 vertices for 36");
  EXPECT_EQ(complaint([&] { broad.set_groups(Element::face, std::vector<GroupMask>(51)); }),
            "there are groups of 51 faces for 50");
  EXPECT_EQ(complaint([&] {
              broad.exclude(CandidateKind::face_vertex, std::vector<Candidate>{{1, 36}});
            }),
            "the excluded face_vertex pair (1, 36) is not one of 50 faces and 36 vertices");
  EXPECT_EQ(wrong_candidates(broad, mesh, S(0.05), Admitted()), "");
  broad.keep_only([](CandidateKind, std::span<Candidate> pairs) { return pairs.size() + 1; });
  CandidateBuffer found;
  EXPECT_NE(complaint([&] { broad.detect(CandidateKind::edge_edge, found); }).find("kept"),
            std::string::npos);
  broad.keep_only(
      [](CandidateKind, std::span<Candidate>) -> std::size_t { throw std::domain_error("mine"); });
  EXPECT_EQ(complaint([&] { broad.candidates(CandidateKind::edge_edge); }), "mine");
  EXPECT_EQ(complaint([&] { broad.candidates(CandidateKind::edge_edge); }), "mine");
  broad.keep_only({});
  EXPECT_EQ(wrong_candidates(broad, mesh, S(0.05), Admitted()), "");
  // A build ends filters.
  broad.set_groups(Element::edge, std::vector<GroupMask>(mesh.edges.size() / 2, GroupMask{1, 2}));
  mesh.build(broad, S(0.05));
  EXPECT_EQ(wrong_candidates(broad, mesh, S(0.05), Admitted()), "");
}

}  // namespace
}  // namespace kbvh::test::broad_phase
