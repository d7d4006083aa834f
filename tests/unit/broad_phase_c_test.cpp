// The C interface of the broad phase: the same answers, errors as texts, numbers rounded up to the scalar.
#include "core/broad_phase/broad_phase_c.h"

#include <gtest/gtest.h>

#include <memory>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

using Handle = std::unique_ptr<kbvh_broad_phase, decltype(&kbvh_broad_phase_free)>;

Handle handle(kbvh_scalar scalar) {
  return {kbvh_broad_phase_new(scalar), &kbvh_broad_phase_free};
}

template <class S>
kbvh_positions positions(const std::vector<S>& v) {
  return {v.data(), v.size() / 3, 3, 1};
}

template <class S>
int build(const Handle& broad, const Mesh<S>& mesh, double radius) {
  const kbvh_positions v0 = positions(mesh.v0), v1 = positions(mesh.v1);
  return kbvh_broad_phase_build(broad.get(), &v0, mesh.swept() ? &v1 : nullptr, mesh.edges.data(),
                                mesh.edges.size() / 2, mesh.faces.data(), mesh.faces.size() / 3, radius);
}

TEST(BroadPhaseInC, AnswersAsInCpp) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Mesh<double> mesh = random_mesh<double>(seed);
    const double radius = random_radius<double>(seed);
    const Handle broad = handle(KBVH_DOUBLE);
    ASSERT_EQ(build(broad, mesh, radius), 0);
    for (const CandidateKind kind : candidate_kinds) {
      const std::uint32_t* pairs = nullptr;
      std::size_t count = 0;
      const auto found = [&] {
        CandidateBuffer list;
        for (std::size_t i = 0; i < count; ++i) list.push_back({pairs[2 * i], pairs[2 * i + 1]});
        return list;
      };
      ASSERT_EQ(kbvh_broad_phase_candidates(broad.get(), kbvh_candidate_kind(int(kind)), &pairs, &count), 0);
      EXPECT_EQ(difference(found(), brute_force(mesh, kind, radius), mesh.elements(), kind), "");
      ASSERT_EQ(kbvh_broad_phase_within(broad.get(), kbvh_candidate_kind(int(kind)), radius, &pairs, &count),
                0);
      EXPECT_EQ(difference(found(), within(all_distances(mesh, kind), radius), mesh.elements(), kind), "");
    }
    EXPECT_EQ(kbvh_broad_phase_detections(broad.get()), 6u);
  }
}

TEST(BroadPhaseInC, NumbersAreRoundedUp) {
  const Mesh<float> mesh = crumpled<float>(6, 1);
  const Handle broad = handle(KBVH_FLOAT);
  const std::uint32_t* pairs = nullptr;
  std::size_t count = 0;
  // The nearest float is larger than 0.1, and smaller than 0.7.
  for (const double radius : {0.1, 0.7}) {
    ASSERT_EQ(build(broad, mesh, radius), 0);
    EXPECT_EQ(kbvh_broad_phase_within(broad.get(), KBVH_EDGE_EDGE, radius, &pairs, &count), 0);
  }
  EXPECT_EQ(kbvh_broad_phase_valid_for(broad.get(), 0.7), 0);
  EXPECT_GE(kbvh_broad_phase_left(broad.get()), 0.7);
}

TEST(BroadPhaseInC, ErrorsAreTexts) {
  EXPECT_EQ(kbvh_broad_phase_new(kbvh_scalar(7)), nullptr);
  kbvh_broad_phase_free(nullptr);
  const Mesh<float> mesh = crumpled<float>(6, 1);
  const Handle broad = handle(KBVH_FLOAT);
  EXPECT_STREQ(kbvh_broad_phase_error(broad.get()), "");
  const std::uint32_t* pairs = nullptr;
  std::size_t count = 7;
  EXPECT_EQ(kbvh_broad_phase_candidates(broad.get(), KBVH_EDGE_EDGE, &pairs, &count), -1);
  EXPECT_NE(std::string(kbvh_broad_phase_error(broad.get())).find("before build()"), std::string::npos);
  ASSERT_EQ(build(broad, mesh, 0.1), 0);
  EXPECT_EQ(kbvh_broad_phase_candidates(broad.get(), kbvh_candidate_kind(6), &pairs, &count), -1);
  EXPECT_STREQ(kbvh_broad_phase_error(broad.get()), "a kind of candidates is 0 to 5, not 6");
  EXPECT_EQ(kbvh_broad_phase_candidates(broad.get(), KBVH_EDGE_EDGE, nullptr, &count), -1);
  EXPECT_STREQ(kbvh_broad_phase_error(broad.get()), "pairs is a null pointer");
  EXPECT_EQ(kbvh_broad_phase_update(broad.get(), nullptr, nullptr), -1);
  EXPECT_EQ(kbvh_broad_phase_update(nullptr, nullptr, nullptr), -1);
  EXPECT_EQ(build(broad, mesh, -1), -1);
  EXPECT_EQ(build(broad, mesh, std::numeric_limits<double>::quiet_NaN()), -1);
  EXPECT_EQ(build(broad, mesh, 1e300), -1);
  EXPECT_EQ(count, 7u);
  const std::uint32_t moved[] = {5, 36};
  const kbvh_positions v = positions(mesh.v0);
  EXPECT_EQ(kbvh_broad_phase_update_moved(broad.get(), &v, moved, 2), -1);
  EXPECT_STREQ(kbvh_broad_phase_error(broad.get()), "vertex 36 moved, but there are 36");
  EXPECT_EQ(kbvh_broad_phase_update_moved(broad.get(), &v, moved, 1), 0);
  // Null pointers that stand for numbers.
  const auto says = [&](int status, const char* what) {
    EXPECT_EQ(status, -1) << what;
    EXPECT_EQ(kbvh_broad_phase_error(broad.get()), std::string(what) + " is a null pointer");
  };
  kbvh_positions nowhere = v;
  nowhere.data = nullptr;
  std::uint32_t first[3];
  says(kbvh_broad_phase_build(broad.get(), &v, nullptr, nullptr, 1, nullptr, 0, 0.1), "edges");
  says(kbvh_broad_phase_build(broad.get(), &v, nullptr, nullptr, 0, nullptr, 1, 0.1), "faces");
  says(kbvh_broad_phase_build(broad.get(), &v, &nowhere, nullptr, 0, nullptr, 0, 0.1),
       "the data of positions");
  says(kbvh_broad_phase_update(broad.get(), &nowhere, nullptr), "the data of positions");
  says(kbvh_broad_phase_update_moved(broad.get(), &v, nullptr, 1), "moved");
  says(kbvh_broad_phase_insert(broad.get(), nullptr, nullptr, 1, nullptr, 0, first), "edges");
  says(kbvh_broad_phase_insert(broad.get(), nullptr, nullptr, 0, nullptr, 1, first), "faces");
  says(kbvh_broad_phase_remove(broad.get(), KBVH_FACE, nullptr, 1), "ids");
  says(kbvh_broad_phase_set_vertex_groups(broad.get(), nullptr, 1), "groups");
  EXPECT_EQ(kbvh_broad_phase_update_moved(broad.get(), &v, nullptr, 0), 0);
  EXPECT_EQ(kbvh_broad_phase_remove(broad.get(), KBVH_FACE, nullptr, 0), 0);
  // The mesh is still the one that was taken.
  EXPECT_EQ(kbvh_broad_phase_candidates(broad.get(), KBVH_EDGE_EDGE, &pairs, &count), 0);
  EXPECT_EQ(count, brute_force(mesh, CandidateKind::edge_edge, 0.1F).size());
}

CandidateBuffer list_of(const std::uint32_t* pairs, std::size_t count) {
  CandidateBuffer list;
  for (std::size_t i = 0; i < count; ++i) list.push_back({pairs[2 * i], pairs[2 * i + 1]});
  return list;
}

TEST(BroadPhaseInC, FiltersAndEdits) {
  const Mesh<double> mesh = crumpled<double>(12, 1);
  const Handle broad = handle(KBVH_DOUBLE);
  ASSERT_EQ(build(broad, mesh, 0.1), 0);
  const std::uint32_t* pairs = nullptr;
  std::size_t count = 0;
  const auto wrong = [&](const auto& admitted) {
    Pairs expected = brute_force(mesh, CandidateKind::edge_edge, 0.1);
    std::erase_if(expected, [&](const Candidate& pair) { return !admitted(pair); });
    EXPECT_EQ(kbvh_broad_phase_candidates(broad.get(), KBVH_EDGE_EDGE, &pairs, &count), 0);
    return difference(list_of(pairs, count), expected, mesh.elements(), CandidateKind::edge_edge);
  };
  // Even edges pair with odd ones only.
  std::vector<kbvh_group_mask> groups;
  for (std::size_t e = 0; e < mesh.edges.size() / 2; ++e)
    groups.push_back(e % 2 == 0 ? kbvh_group_mask{1, 2} : kbvh_group_mask{2, 1});
  ASSERT_EQ(kbvh_broad_phase_set_groups(broad.get(), KBVH_EDGE, groups.data(), groups.size()), 0);
  EXPECT_EQ(wrong([](const Candidate& pair) { return (pair.first + pair.second) % 2 == 1; }), "");
  const std::uint32_t excluded[] = {pairs[0], pairs[1], pairs[3], pairs[2]};
  const Candidate two[] = {{pairs[0], pairs[1]}, {pairs[2], pairs[3]}};
  ASSERT_EQ(kbvh_broad_phase_exclude(broad.get(), KBVH_EDGE_EDGE, excluded, 2), 0);
  EXPECT_EQ(wrong([&](const Candidate& pair) {
              return (pair.first + pair.second) % 2 == 1 && pair != two[0] && pair != two[1];
            }),
            "");
  ASSERT_EQ(kbvh_broad_phase_clear_filters(broad.get()), 0);
  std::uint32_t below = 100;
  const auto filter = [](void* context, kbvh_candidate_kind, std::uint32_t* list, std::size_t all) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < all; ++i) {
      if (list[2 * i] >= *static_cast<std::uint32_t*>(context)) continue;
      list[2 * kept] = list[2 * i];
      list[2 * kept++ + 1] = list[2 * i + 1];
    }
    return kept;
  };
  ASSERT_EQ(kbvh_broad_phase_keep_only(broad.get(), filter, &below), 0);
  EXPECT_EQ(wrong([&](const Candidate& pair) { return pair.first < below; }), "");
  ASSERT_EQ(kbvh_broad_phase_keep_only(broad.get(), nullptr, nullptr), 0);
  const std::vector<kbvh_group_mask> apart(mesh.vertex_count(), kbvh_group_mask{1, 2});
  ASSERT_EQ(kbvh_broad_phase_set_vertex_groups(broad.get(), apart.data(), apart.size()), 0);
  EXPECT_EQ(wrong([](const Candidate&) { return false; }), "");
  ASSERT_EQ(kbvh_broad_phase_set_vertex_groups(broad.get(), nullptr, 0), 0);
  EXPECT_EQ(wrong([](const Candidate&) { return true; }), "");
  // Edges that one edge connects, by definition: an end of one next to an end of the other.
  std::set<std::pair<std::int32_t, std::int32_t>> next;
  for (std::size_t e = 0; e < mesh.edges.size(); e += 2) {
    next.insert({mesh.edges[e], mesh.edges[e + 1]});
    next.insert({mesh.edges[e + 1], mesh.edges[e]});
  }
  ASSERT_EQ(kbvh_broad_phase_exclude_rings(broad.get(), 1), 0);
  EXPECT_EQ(
      wrong([&](const Candidate& pair) {
        bool connected = false;
        for (const std::size_t i : {0U, 1U})
          for (const std::size_t j : {0U, 1U})
            connected |= next.contains({mesh.edges[2 * pair.first + i], mesh.edges[2 * pair.second + j]});
        return !connected;
      }),
      "");
  ASSERT_EQ(kbvh_broad_phase_exclude_rings(broad.get(), 0), 0);
  // Self intersections are the faces at a distance of 0.
  const std::uint32_t* within = nullptr;
  std::size_t within_count = 0;
  ASSERT_EQ(kbvh_broad_phase_within(broad.get(), KBVH_FACE_FACE, 0, &within, &within_count), 0);
  const CandidateBuffer touching = list_of(within, within_count);
  ASSERT_EQ(kbvh_broad_phase_self_intersections(broad.get(), &pairs, &count), 0);
  EXPECT_EQ(difference(list_of(pairs, count), Pairs(touching.begin(), touching.end()), mesh.elements(),
                       CandidateKind::face_face),
            "");
  EXPECT_NE(kbvh_broad_phase_self_intersections(broad.get(), nullptr, &count), 0);
  EXPECT_EQ(kbvh_broad_phase_use_threads(broad.get(), 1), 0);
  EXPECT_NE(kbvh_broad_phase_use_threads(broad.get(), 0), 0);
  // Edges go, and changes say so; others come.
  const std::uint32_t *begun = nullptr, *ended = nullptr;
  std::size_t begun_count = 0, ended_count = 0;
  const auto changes = [&] {
    return kbvh_broad_phase_changes(broad.get(), KBVH_EDGE_EDGE, &begun, &begun_count, &ended, &ended_count);
  };
  ASSERT_EQ(changes(), 0);
  EXPECT_EQ(begun_count, brute_force(mesh, CandidateKind::edge_edge, 0.1).size());
  const std::uint32_t removed[] = {begun[0]};
  const auto of_removed = [&](const Candidate& pair) {
    return pair.first == removed[0] || pair.second == removed[0];
  };
  ASSERT_EQ(kbvh_broad_phase_remove(broad.get(), KBVH_EDGE, removed, 1), 0);
  EXPECT_EQ(wrong([&](const Candidate& pair) { return !of_removed(pair); }), "");
  ASSERT_EQ(changes(), 0);
  EXPECT_EQ(begun_count, 0u);
  EXPECT_GT(ended_count, 0u);
  for (const Candidate& pair : list_of(ended, ended_count)) EXPECT_TRUE(of_removed(pair));
  const double more[] = {1, 2, 3};
  const kbvh_positions v{more, 1, 3, 1};
  const std::int32_t edge[] = {144, 0};
  std::uint32_t first[3] = {};
  ASSERT_EQ(kbvh_broad_phase_insert(broad.get(), &v, edge, 1, nullptr, 0, first), 0);
  EXPECT_EQ(first[0], 144u);
  EXPECT_EQ(first[1], mesh.edges.size() / 2);
  EXPECT_EQ(first[2], mesh.faces.size() / 3);
  ASSERT_EQ(kbvh_broad_phase_insert(broad.get(), nullptr, edge, 1, nullptr, 0, first), 0);
  EXPECT_EQ(first[1], mesh.edges.size() / 2 + 1);
  ASSERT_EQ(kbvh_broad_phase_changes_within(broad.get(), KBVH_EDGE_EDGE, 0.1, &begun, &begun_count, &ended,
                                            &ended_count),
            0);
  EXPECT_GT(begun_count, 0u);
}

TEST(BroadPhaseInC, ErrorsOfFiltersAndEditsAreTexts) {
  const Mesh<double> mesh = crumpled<double>(6, 1);
  const Handle broad = handle(KBVH_DOUBLE);
  ASSERT_EQ(build(broad, mesh, 0.1), 0);
  const auto error = [&](int status) {
    EXPECT_EQ(status, -1);
    return std::string(kbvh_broad_phase_error(broad.get()));
  };
  const std::uint32_t ids[] = {99, 0};
  EXPECT_EQ(error(kbvh_broad_phase_remove(broad.get(), kbvh_element(3), ids, 1)),
            "an element is 0 to 2, not 3");
  EXPECT_EQ(error(kbvh_broad_phase_remove(broad.get(), KBVH_VERTEX, ids, 1)), "vertex 99 does not exist");
  EXPECT_EQ(error(kbvh_broad_phase_set_groups(broad.get(), KBVH_FACE, nullptr, 3)),
            "groups is a null pointer");
  EXPECT_EQ(error(kbvh_broad_phase_exclude(broad.get(), KBVH_VERTEX_VERTEX, ids, 1)),
            "the excluded vertex_vertex pair (99, 0) is not one of 36 vertices and 36 vertices");
  const auto failing = [](void*, kbvh_candidate_kind, std::uint32_t*, std::size_t) {
    return ~std::size_t(0);
  };
  ASSERT_EQ(kbvh_broad_phase_keep_only(broad.get(), failing, nullptr), 0);
  const std::uint32_t* pairs = nullptr;
  std::size_t count = 0;
  EXPECT_NE(error(kbvh_broad_phase_candidates(broad.get(), KBVH_EDGE_EDGE, &pairs, &count)).find("kept"),
            std::string::npos);
  kbvh_impact impact{};
  EXPECT_NE(error(kbvh_broad_phase_earliest_impact(broad.get(), 0, &impact)).find("motion"),
            std::string::npos);
}

TEST(BroadPhaseInC, EarliestImpacts) {
  // A vertex that falls from 8 to 0 on a face.
  const double v0[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0.25, 0.25, 8},
               v1[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0.25, 0.25, 0};
  const kbvh_positions begin{v0, 4, 3, 1}, end{v1, 4, 3, 1};
  const std::int32_t face[] = {0, 1, 2};
  const Handle broad = handle(KBVH_DOUBLE);
  ASSERT_EQ(kbvh_broad_phase_build(broad.get(), &begin, &end, nullptr, 0, face, 1, 2), 0);
  kbvh_impact impact{};
  for (const double separation : {0.0, 1.0, 2.0}) {
    ASSERT_EQ(kbvh_broad_phase_earliest_impact(broad.get(), separation, &impact), 0);
    EXPECT_EQ(impact.touches, 1);
    EXPECT_EQ(impact.kind, KBVH_FACE_VERTEX);
    EXPECT_EQ(impact.pair[0], 0u);
    EXPECT_EQ(impact.pair[1], 3u);
    EXPECT_LE(impact.begin, 1 - separation / 8);
    EXPECT_GE(impact.end, 1 - separation / 8);
  }
  EXPECT_EQ(kbvh_broad_phase_earliest_impact(broad.get(), 2.5, &impact), -1);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
