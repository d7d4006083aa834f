// A broad phase whose elements come and go, and what began and ended between two questions.
#include <gtest/gtest.h>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

/// A broad phase and what it should hold: a mesh that grows, and the ids of removed elements.
template <class S>
class Edited {
 public:
  Edited(const Mesh<S>& mesh, S radius, const BroadPhaseSettings& settings = {})
      : broad(settings), mesh_(mesh), elements_(mesh.elements()), radius_(radius) {
    mesh.build(broad, radius);
  }

  InsertedElements insert(const Mesh<S>& part) {
    const InsertedElements first = broad.insert(part.begin(), part.e(), part.f());
    EXPECT_EQ(first.vertex, elements_.vertex_count());
    EXPECT_EQ(first.edge, elements_.count(Element::edge));
    EXPECT_EQ(first.face, elements_.count(Element::face));
    mesh_.v0.insert(mesh_.v0.end(), part.v0.begin(), part.v0.end());
    if (mesh_.swept()) mesh_.v1.insert(mesh_.v1.end(), part.v0.begin(), part.v0.end());
    mesh_.edges.insert(mesh_.edges.end(), part.edges.begin(), part.edges.end());
    mesh_.faces.insert(mesh_.faces.end(), part.faces.begin(), part.faces.end());
    Elements grown = mesh_.elements();
    for (std::size_t kind = 0; kind < element_kinds; ++kind)
      for (std::uint32_t id = 0; id < elements_.lists[kind].count(); ++id)
        if (!elements_.lists[kind].alive(id)) grown.lists[kind].remove(id);
    elements_ = grown;
    return first;
  }
  void remove(Element element, const std::vector<std::uint32_t>& ids) {
    broad.remove(element, ids);
    for (const std::uint32_t id : ids) elements_.lists[std::size_t(element)].remove(id);
  }
  /// Returns up to `count` ids of living elements.
  std::vector<std::uint32_t> some(Element element, std::uint32_t count, Random& random) const {
    std::set<std::uint32_t> ids;
    const Primitives& list = elements_.of(element);
    for (std::uint32_t i = 0; i < count && list.count() > 0; ++i)
      if (const std::uint32_t id = random.below(list.count()); list.alive(id)) ids.insert(id);
    return {ids.begin(), ids.end()};
  }

  Pairs expected(CandidateKind kind) const {
    return brute_force(elements_, kind, vertex_boxes(mesh_, radius_));
  }
  std::string wrong(More more = More::wrong) {
    CandidateBuffer found;
    for (const CandidateKind kind : candidate_kinds) {
      broad.detect(kind, found);
      for (const Candidate& pair : found)
        if (!elements_.of(first_element(kind)).alive(pair.first) ||
            !elements_.of(second_element(kind)).alive(pair.second))
          return std::string(name(kind)) + " of a removed element";
      const std::string wrong = difference(found, expected(kind), elements_, kind, more);
      if (!wrong.empty()) return wrong;
    }
    return {};
  }

  BroadPhase<S> broad;
  Mesh<S>& mesh() { return mesh_; }
  const Elements& elements() const { return elements_; }

 private:
  Mesh<S> mesh_;
  Elements elements_;
  S radius_;
};

template <class S>
class BroadPhaseEdits : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(BroadPhaseEdits, Scalars);

/// Elements of a small mesh between vertices of a larger one, and vertices of its own.
template <class S>
Mesh<S> random_part(std::uint32_t vertices, Random& random) {
  Mesh<S> part;
  const std::uint32_t more = random.below(4), all = vertices + more;
  for (std::uint32_t i = 0; i < 3 * more; ++i) part.v0.push_back(S(random.unit()));
  for (std::uint32_t n = all == 0 ? 0 : 2 * random.below(5); n > 0; --n)
    part.edges.push_back(std::int32_t(random.below(all)));
  for (std::uint32_t n = all == 0 ? 0 : 3 * random.below(4); n > 0; --n)
    part.faces.push_back(std::int32_t(random.below(all)));
  return part;
}

TYPED_TEST(BroadPhaseEdits, AnySequenceEqualsAllPairs) {
  using S = TypeParam;
  const std::vector<KernelSet>& sets = supported_kernel_sets();
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const Mesh<S> mesh = random_mesh<S>(seed);
    const S radius = random_radius<S>(seed);
    Edited<S> edited(mesh, radius,
                     {.leaf_size = 5 + std::uint32_t(seed % 12), .kernels = sets[seed % sets.size()]});
    Random random(seed + 9);
    for (int step = 0; step < 12; ++step) {
      const auto element = Element(random.below(3));
      switch (random.below(4)) {
        case 0:
          edited.insert(random_part<S>(edited.elements().vertex_count(), random));
          break;
        case 1:
        case 2:
          edited.remove(element, edited.some(element, 1 + random.below(6), random));
          break;
        default:
          for (S& x : edited.mesh().v0)
            if (random.below(3) == 0) x += S(0.1 * random.unit());
          edited.mesh().update(edited.broad);
      }
      if (random.below(3) == 0) continue;  // several edits without a question between them
      ASSERT_EQ(edited.wrong(), "") << "seed " << seed << ", step " << step;
    }
    ASSERT_EQ(edited.wrong(), "") << "seed " << seed;
  }
}

TYPED_TEST(BroadPhaseEdits, TreesShrinkAndAreBuiltAgainWhereHalfIsGone) {
  using S = TypeParam;
  for (const KernelSet set : supported_kernel_sets()) {
    Edited<S> edited(crumpled<S>(24, 3), S(0.05), {.kernels = set});
    ASSERT_EQ(edited.wrong(), "");
    Random random(4);
    const std::uint32_t faces = edited.elements().count(Element::face);
    while (edited.elements().of(Element::face).live_count() > faces / 2 + 20) {
      edited.remove(Element::face, edited.some(Element::face, 20, random));
      // By part and by whole, with removed elements at the vertices.
      std::vector<std::uint32_t> moved{random.below(500), random.below(500)};
      for (const std::uint32_t v : moved) edited.mesh().v0[3 * v] += S(0.2 * random.unit());
      if (random.below(2) == 0)
        edited.broad.update(edited.mesh().begin(), moved);
      else
        edited.broad.update(edited.mesh().begin());
      if (random.below(4) == 0) {
        ASSERT_EQ(edited.wrong(), "") << name(set);
      }
    }
    ASSERT_EQ(edited.wrong(), "") << name(set);
    EXPECT_EQ(edited.broad.work(Element::face).builds, 1u);
    const std::uint64_t before = edited.broad.detections();
    edited.remove(Element::face, edited.some(Element::face, 40, random));
    edited.broad.candidates(CandidateKind::face_face);
    edited.remove(Element::face, edited.some(Element::face, 200, random));
    ASSERT_EQ(edited.wrong(), "") << name(set);
    EXPECT_EQ(edited.broad.work(Element::face).builds, 2u);
    EXPECT_EQ(edited.broad.work(Element::edge).builds, 1u);
    EXPECT_GT(edited.broad.detections(), before);
    // All of them, and others in their place.
    std::vector<std::uint32_t> rest;
    for (std::uint32_t id = 0; id < faces; ++id)
      if (edited.elements().of(Element::face).alive(id)) rest.push_back(id);
    edited.remove(Element::face, rest);
    ASSERT_EQ(edited.wrong(), "") << name(set);
    Mesh<S> part;
    part.faces = edited.mesh().faces;
    edited.insert(part);
    ASSERT_EQ(edited.wrong(), "") << name(set);
    EXPECT_EQ(edited.elements().of(Element::face).live_count(), faces);
  }
}

TYPED_TEST(BroadPhaseEdits, KeptCandidatesLoseWhatIsRemovedWithoutASearch) {
  using S = TypeParam;
  Edited<S> edited(crumpled<S>(16, 5), S(0.1));
  edited.broad.valid_for(S(0.05));
  ASSERT_EQ(edited.wrong(More::allowed), "");
  const std::uint64_t before = edited.broad.detections();
  Random random(6);
  for (const Element element : {Element::face, Element::edge, Element::vertex}) {
    edited.remove(element, edited.some(element, 30, random));
    ASSERT_EQ(edited.wrong(More::allowed), "");
    for (S& x : edited.mesh().v0) x += S(0.005 * random.unit());
    edited.mesh().update(edited.broad);
    ASSERT_EQ(edited.wrong(More::allowed), "");
  }
  EXPECT_EQ(edited.broad.detections(), before);
  // Added edges: of the kinds with edges only. Then a bound for each vertex, and added vertices.
  Mesh<S> part;
  part.edges = {0, 200, 1, 150, 100, 7};
  edited.insert(part);
  ASSERT_EQ(edited.wrong(More::allowed), "");
  EXPECT_EQ(edited.broad.detections(), before + 3);
  edited.broad.valid_for(std::vector<S>(edited.mesh().vertex_count(), S(0.05)));
  part.v0 = {1, 2, 3, 2, 2, 2};
  edited.insert(part);
  ASSERT_EQ(edited.wrong(More::allowed), "");
  for (S& x : edited.mesh().v0) x += S(0.04);
  const std::uint64_t references = edited.broad.references();
  edited.mesh().update(edited.broad);
  EXPECT_EQ(edited.broad.references(), references);
  ASSERT_EQ(edited.wrong(More::allowed), "");
}

TYPED_TEST(BroadPhaseEdits, InsertedVerticesRestInAMotion) {
  using S = TypeParam;
  Mesh<S> mesh = crumpled<S>(12, 7);
  mesh.v1 = crumpled<S>(12, 8).v0;
  Edited<S> edited(mesh, S(0.05));
  ASSERT_EQ(edited.wrong(), "");
  Mesh<S> part;
  part.v0 = {1, 1, 0, 2, 5, 1, 3, 3, 0};
  part.edges = {144, 145, 144, 20};
  part.faces = {144, 145, 146};
  edited.insert(part);
  ASSERT_EQ(edited.wrong(), "");
  edited.remove(Element::face, {242});  // the one that was added
  edited.mesh().update(edited.broad);
  ASSERT_EQ(edited.wrong(), "");
}

TYPED_TEST(BroadPhaseEdits, InsertedElementsHaveGroups) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(12, 7);
  const std::uint32_t vertices = std::uint32_t(mesh.vertex_count());
  for (const bool by_vertices : {true, false}) {
    Edited<S> edited(mesh, S(0.3));
    std::vector<GroupMask> of_vertices, of_edges;
    for (std::uint32_t v = 0; v < vertices; ++v)
      of_vertices.push_back(v % 2 == 0 ? GroupMask{1, 2} : GroupMask{2, 1});
    for (std::uint32_t e = 0; e < edited.elements().count(Element::edge); ++e)
      of_edges.push_back(e % 2 == 0 ? GroupMask{2, 1} : GroupMask{4, 8});
    if (by_vertices)
      edited.broad.set_vertex_groups(of_vertices);
    else
      edited.broad.set_groups(Element::edge, of_edges);
    edited.broad.exclude(CandidateKind::edge_edge, std::vector<Candidate>{{0, 300}, {17, 40}});
    Mesh<S> part;
    part.v0 = {0, 1, 0, 1, 1, 1};
    part.edges = {std::int32_t(vertices), 5, 4, 9, std::int32_t(vertices + 1), std::int32_t(vertices)};
    edited.insert(part);
    // By definition.
    of_vertices.resize(vertices + 2);
    of_edges.resize(of_edges.size() + 3);
    const auto groups_of = [&](std::uint32_t edge) {
      if (!by_vertices) return of_edges[edge];
      GroupMask all{0, 0};
      for (const std::uint32_t v : edited.elements().vertices(Element::edge, edge)) {
        all.groups |= of_vertices[v].groups;
        all.mask |= of_vertices[v].mask;
      }
      return all;
    };
    Pairs expected = edited.expected(CandidateKind::edge_edge);
    const std::size_t all = expected.size();
    std::erase_if(expected, [&](const Candidate& pair) {
      const GroupMask a = groups_of(pair.first), b = groups_of(pair.second);
      return (a.groups & b.mask) == 0 || (b.groups & a.mask) == 0 || pair == Candidate{0, 300} ||
             pair == Candidate{17, 40};
    });
    EXPECT_LT(expected.size(), all);
    EXPECT_EQ(difference(edited.broad.candidates(CandidateKind::edge_edge), expected, edited.elements(),
                         CandidateKind::edge_edge),
              "");
  }
}

// Groups that are set for one kind do not end those that another kind has from its vertices.
TYPED_TEST(BroadPhaseEdits, InsertedFacesHaveTheGroupsOfTheirVerticesWhateverOtherKindsHave) {
  using S = TypeParam;
  const Mesh<S> mesh = crumpled<S>(12, 7);
  const auto vertices = std::uint32_t(mesh.vertex_count());
  enum class Later { of_edges, of_vertices, of_no_vertices };
  for (const Later later : {Later::of_edges, Later::of_vertices, Later::of_no_vertices}) {
    Edited<S> edited(mesh, S(0.3));
    const std::uint32_t faces = edited.elements().count(Element::face);
    std::vector<GroupMask> of_vertices, of_faces;
    for (std::uint32_t v = 0; v < vertices; ++v)
      of_vertices.push_back(2 * v < vertices ? GroupMask{2, 4} : GroupMask{4, 2});
    const auto add_groups_of_faces = [&] {
      while (of_faces.size() < edited.elements().count(Element::face)) {
        GroupMask all{0, 0};
        for (const std::uint32_t v :
             edited.elements().vertices(Element::face, std::uint32_t(of_faces.size())))
          all |= of_vertices[v];
        of_faces.push_back(all);
      }
    };
    add_groups_of_faces();
    edited.broad.set_vertex_groups(of_vertices);
    if (later == Later::of_edges) {
      edited.broad.set_groups(
          Element::edge, std::vector<GroupMask>(edited.elements().count(Element::edge), GroupMask{4, 4}));
    } else {
      of_vertices.assign(vertices, later == Later::of_vertices ? GroupMask{2, 6} : GroupMask{});
      edited.broad.set_groups(Element::vertex,
                              later == Later::of_vertices ? of_vertices : std::vector<GroupMask>());
    }
    Mesh<S> part;
    part.faces = {0, 13, 140};
    edited.insert(part);
    add_groups_of_faces();
    Pairs expected = edited.expected(CandidateKind::face_face);
    std::erase_if(expected,
                  [&](const Candidate& pair) { return !of_faces[pair.first].admits(of_faces[pair.second]); });
    const bool of_inserted = std::any_of(expected.begin(), expected.end(),
                                         [&](const Candidate& pair) { return pair.second >= faces; });
    EXPECT_EQ(of_inserted, later != Later::of_no_vertices);
    EXPECT_EQ(difference(edited.broad.candidates(CandidateKind::face_face), expected, edited.elements(),
                         CandidateKind::face_face),
              "");
  }
}

TYPED_TEST(BroadPhaseEdits, WrongEditsAreNamedAndChangeNothing) {
  using S = TypeParam;
  Edited<S> edited(crumpled<S>(6, 7), S(0.1));
  BroadPhase<S>& broad = edited.broad;
  const auto remove = [&](Element element, std::vector<std::uint32_t> ids) {
    return complaint([&] { broad.remove(element, ids); });
  };
  edited.remove(Element::edge, {3});
  EXPECT_EQ(remove(Element::edge, {4, 3}), "edge 3 has been removed before");
  EXPECT_EQ(remove(Element::face, {1, 2, 1}), "face 1 is to be removed twice");
  EXPECT_EQ(remove(Element::vertex, {0, 36}), "vertex 36 does not exist");
  const std::int32_t edge[] = {3, 37};
  const S at[] = {0, 0, std::numeric_limits<S>::infinity()};
  const auto e = MatrixView<std::int32_t>::by_rows(edge, 1, 2);
  const MatrixView<std::int32_t> none;
  EXPECT_EQ(complaint([&] { broad.insert(MatrixView<S>::by_rows(at, 1, 3), e, none); }),
            "edge 0 names vertex 37 of 37");
  EXPECT_NE(
      complaint([&] { broad.insert(MatrixView<S>::by_rows(at, 1, 3), none, none); }).find("coordinate z"),
      std::string::npos);
  EXPECT_EQ(edited.wrong(), "");
  BroadPhase<S> unbuilt;
  EXPECT_NE(complaint([&] { unbuilt.insert(MatrixView<S>(), none, none); }).find("before build()"),
            std::string::npos);
}

// ---- Changes ----------------------------------------------------------------------------------------------

Pairs set_of(std::span<const Candidate> list) {
  EXPECT_TRUE(std::is_sorted(list.begin(), list.end()));
  Pairs pairs(list.begin(), list.end());
  EXPECT_EQ(pairs.size(), list.size());
  return pairs;
}
Pairs without(const Pairs& a, const Pairs& b) {
  Pairs rest;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::inserter(rest, rest.end()));
  return rest;
}

TYPED_TEST(BroadPhaseEdits, ChangesAreDifferences) {
  using S = TypeParam;
  Edited<S> edited(crumpled<S>(16, 9), S(0.1));
  Random random(2);
  std::array<Pairs, 6> known, near;
  std::size_t begun = 0, ended = 0;
  for (int step = 0; step < 12; ++step) {
    for (const CandidateKind kind : candidate_kinds) {
      if (step % 3 == 1 && kind == CandidateKind::edge_face) continue;  // kinds are asked independently
      const auto compare = [&](const CandidateChanges& changes, const Pairs& now, Pairs& before) {
        EXPECT_EQ(set_of(changes.begun), without(now, before)) << name(kind) << ", step " << step;
        EXPECT_EQ(set_of(changes.ended), without(before, now)) << name(kind) << ", step " << step;
        begun += changes.begun.size();
        ended += changes.ended.size();
        before = now;
      };
      compare(edited.broad.changes(kind), edited.expected(kind), known[std::size_t(kind)]);
      CandidateBuffer list;
      edited.broad.within(kind, step % 2 == 0 ? 0.1 : 0.05, list);
      compare(edited.broad.changes_within(kind, step % 2 == 0 ? 0.1 : 0.05), Pairs(list.begin(), list.end()),
              near[std::size_t(kind)]);
    }
    // Nothing has changed since.
    EXPECT_TRUE(edited.broad.changes(CandidateKind::edge_edge).begun.empty());
    EXPECT_TRUE(edited.broad.changes(CandidateKind::edge_edge).ended.empty());
    if (step % 4 == 2) edited.remove(Element::face, edited.some(Element::face, 5, random));
    for (S& x : edited.mesh().v0) x += S(0.05 * random.unit());
    edited.mesh().update(edited.broad);
  }
  EXPECT_GT(begun, 1000u);
  EXPECT_GT(ended, 1000u);
  // Another mesh: all begin.
  edited.mesh().build(edited.broad, S(0.1));
  const CandidateChanges changes = edited.broad.changes(CandidateKind::edge_edge);
  EXPECT_EQ(changes.begun.size(), edited.broad.candidates(CandidateKind::edge_edge).size());
  EXPECT_TRUE(changes.ended.empty());
}

/// The comparison above fails for a list that lost a pair, and for one that took another.
TEST(ChangeTrackers, LostPairsAreSeen) {
  ChangeTracker tracker;
  std::vector<Candidate> list{{3, 1}, {0, 9}, {3, 0}, {1, 4}};
  EXPECT_EQ(set_of(tracker.take(list, 4).begun), Pairs(list.begin(), list.end()));
  list[2] = {2, 8};
  const CandidateChanges changes = tracker.take(list, 4);
  EXPECT_EQ(set_of(changes.begun), (Pairs{{2, 8}}));
  EXPECT_EQ(set_of(changes.ended), (Pairs{{3, 0}}));
  EXPECT_EQ(set_of(tracker.take({}, 0).ended), Pairs(list.begin(), list.end()));
  tracker.take(list, 4);
  tracker.clear();
  EXPECT_EQ(tracker.take(list, 4).begun.size(), 4u);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
