// Candidates of vertices, edges and faces by every strategy that needs no foresight: the same as those of all
// pairs of elements, and as those of BroadPhase.

#include "core/facade/strategy_broad_phase.hpp"

#include <gtest/gtest.h>

#include "core/contract/registry.hpp"
#include "tests/unit/broad_phase_oracle.hpp"

namespace kbvh::test::strategy_broad_phase_test {
namespace {

using broad_phase::brute_force;
using broad_phase::complaint;
using broad_phase::Mesh;

template <class S>
bool suits(const StrategyEntry& entry) {
  const auto& kinds = entry.info.primitives;
  return entry.info.guarantee == Guarantee::exact && entry.info.foresight == Foresight::none &&
         entry.factory<S>() != nullptr && entry.info.max_primitive_pairs == 0 &&
         std::find(kinds.begin(), kinds.end(), PrimitiveKind::control_nets) != kinds.end();
}

/// Returns the first difference between the candidates of a strategy and those of all pairs.
template <class S>
std::string wrong_candidates(StrategyBroadPhase<S>& broad, const StrategyEntry& entry, const Mesh<S>& mesh,
                             S radius, std::size_t& found_in_all) {
  CandidateBuffer found;
  for (const CandidateKind kind : candidate_kinds) {
    if (first_element(kind) == second_element(kind) && !entry.info.can.self_pairs) continue;
    broad.detect(kind, found);
    found_in_all += found.size();
    const std::string wrong =
        broad_phase::difference(found, brute_force(mesh, kind, radius), mesh.elements(), kind);
    if (!wrong.empty()) return wrong;
  }
  return {};
}

template <class S>
void build(StrategyBroadPhase<S>& broad, const Mesh<S>& mesh, S radius) {
  if (mesh.swept())
    broad.build(mesh.begin(), mesh.end(), mesh.e(), mesh.f(), double(radius));
  else
    broad.build(mesh.begin(), mesh.e(), mesh.f(), double(radius));
}

template <class S>
class StrategiesAsBroadPhases : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(StrategiesAsBroadPhases, Scalars);

TYPED_TEST(StrategiesAsBroadPhases, FindWhatAllPairsFind) {
  using S = TypeParam;
  std::size_t took_part = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!suits<S>(entry)) continue;
    ++took_part;
    std::size_t found = 0;
    StrategyBroadPhase<S> broad(entry.info.id);
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      const Mesh<S> mesh = broad_phase::random_mesh<S>(seed);
      const S radius = broad_phase::random_radius<S>(seed);
      build(broad, mesh, radius);
      EXPECT_EQ(wrong_candidates(broad, entry, mesh, radius, found), "")
          << entry.info.id << ", seed " << seed;
    }
    EXPECT_GT(found, 100u) << entry.info.id;
  }
  EXPECT_GT(took_part, 10u);
}

TYPED_TEST(StrategiesAsBroadPhases, FollowUpdatesAndMotions) {
  using S = TypeParam;
  const S radius = S(0.05);
  for (const StrategyEntry& entry : registry()) {
    if (!suits<S>(entry)) continue;
    std::size_t found = 0;
    StrategyBroadPhase<S> broad(entry.info.id);
    Mesh<S> mesh = broad_phase::crumpled<S>(9, 1);
    build(broad, mesh, radius);
    EXPECT_EQ(wrong_candidates(broad, entry, mesh, radius, found), "") << entry.info.id;
    mesh.v0 = broad_phase::crumpled<S>(9, 2).v0;
    broad.update(mesh.begin());
    mesh.v0 = broad_phase::crumpled<S>(9, 3).v0;  // nothing was asked about the last positions
    broad.update(mesh.begin());
    EXPECT_EQ(wrong_candidates(broad, entry, mesh, radius, found), "") << entry.info.id << ", updated";
    EXPECT_EQ(wrong_candidates(broad, entry, mesh, radius, found), "") << entry.info.id << ", asked again";
    mesh.v1 = broad_phase::crumpled<S>(9, 4).v0;
    broad.update(mesh.begin(), mesh.end());
    EXPECT_EQ(wrong_candidates(broad, entry, mesh, radius, found), "") << entry.info.id << ", moving";
    EXPECT_GT(found, 1000u) << entry.info.id;
  }
}

TYPED_TEST(StrategiesAsBroadPhases, FindWhatBroadPhaseFinds) {
  using S = TypeParam;
  Mesh<S> mesh = broad_phase::crumpled<S>(20, 5);
  BroadPhase<S> own;
  mesh.build(own, S(0.1));
  for (const char* const id : {"bottom_up", "rebuild", "lbvh", "sweep"}) {
    StrategyBroadPhase<S> broad(id);
    build(broad, mesh, S(0.1));
    CandidateBuffer expected, found;
    std::size_t in_all = 0;
    for (const CandidateKind kind : candidate_kinds) {
      own.detect(kind, expected);
      broad.detect(kind, found);
      std::sort(expected.begin(), expected.end());
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, expected) << id << ", " << name(kind);
      in_all += found.size();
    }
    EXPECT_GT(in_all, 1000u) << id;
  }
}

TYPED_TEST(StrategiesAsBroadPhases, FilterAsBroadPhaseDoes) {
  using S = TypeParam;
  const Mesh<S> mesh = broad_phase::crumpled<S>(9, 5);
  const Elements elements = mesh.elements();
  const S radius = S(0.2);
  BroadPhase<S> own;
  mesh.build(own, radius);
  StrategyBroadPhase<S> broad("bottom_up");
  build(broad, mesh, radius);
  CandidateBuffer expected, found;
  const auto of_all_kinds = [&] {
    std::vector<std::size_t> counts;
    for (const CandidateKind kind : candidate_kinds) {
      own.detect(kind, expected);
      broad.detect(kind, found);
      std::sort(expected.begin(), expected.end());
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, expected) << name(kind);
      counts.push_back(found.size());
    }
    return counts;
  };
  const std::vector<std::size_t> unfiltered = of_all_kinds();
  const auto on_both = [&](const auto& filter) {
    filter(own);
    filter(broad);
    EXPECT_NE(of_all_kinds(), unfiltered);
  };
  std::vector<GroupMask> of_vertices, of_faces;
  for (std::uint32_t v = 0; v < elements.vertex_count(); ++v) of_vertices.push_back({1u << (v % 3), 1u << 1});
  for (std::uint32_t f = 0; f < elements.count(Element::face); ++f) of_faces.push_back({f % 4, 3});
  on_both([&](auto& phase) { phase.set_vertex_groups(of_vertices); });
  on_both([&](auto& phase) { phase.set_groups(Element::face, of_faces); });
  on_both([&](auto& phase) { phase.clear_filters(), phase.exclude_rings(2); });
  own.detect(CandidateKind::edge_edge, expected);
  ASSERT_GT(expected.size(), 1u);
  const std::vector<Candidate> some{expected[0], {expected[1].second, expected[1].first}};
  on_both([&](auto& phase) { phase.exclude(CandidateKind::edge_edge, some); });
  on_both([&](auto& phase) {
    phase.clear_filters();
    phase.keep_only([](CandidateKind kind, std::span<Candidate> pairs) {
      std::size_t kept = 0;
      for (const Candidate& pair : pairs)
        if (kind == CandidateKind::edge_face || pair.first % 2 == 0) pairs[kept++] = pair;
      return kept;
    });
  });
  own.clear_filters();
  broad.clear_filters();
  EXPECT_EQ(of_all_kinds(), unfiltered);
  // Seeded fault: one side has forgotten a filter. A new mesh has none.
  broad.exclude_rings(3);
  own.detect(CandidateKind::face_face, expected);
  broad.detect(CandidateKind::face_face, found);
  EXPECT_LT(found.size(), expected.size());
  build(broad, mesh, radius);
  EXPECT_EQ(of_all_kinds(), unfiltered);
  EXPECT_THROW(broad.set_groups(Element::face, of_vertices), std::invalid_argument);
  EXPECT_THROW(broad.exclude(CandidateKind::edge_edge, std::vector<Candidate>{{0, 1u << 20}}),
               std::invalid_argument);
}

/// Seeded fault: a mesh whose radius is forgotten, or whose motion is.
TYPED_TEST(StrategiesAsBroadPhases, AreComparedWithTheRightBoxes) {
  using S = TypeParam;
  const StrategyEntry& entry = find_strategy("bottom_up");
  Mesh<S> mesh = broad_phase::crumpled<S>(9, 1);
  std::size_t found = 0;
  StrategyBroadPhase<S> broad("bottom_up");
  build(broad, mesh, S(0));
  EXPECT_NE(wrong_candidates(broad, entry, mesh, S(0.05), found), "");
  mesh.v1 = broad_phase::crumpled<S>(9, 2).v0;
  EXPECT_NE(wrong_candidates(broad, entry, mesh, S(0), found), "");
}

TEST(StrategyBroadPhases, SayWhatTheyCannotDo) {
  const Mesh<float> mesh = broad_phase::crumpled<float>(5, 1);
  CandidateBuffer found;
  EXPECT_THROW(StrategyBroadPhase<float>("none"), ConfigError);
  EXPECT_THROW(StrategyBroadPhase<float>("bottom_up", {}, {{"depth", "3"}}), std::invalid_argument);
  StrategyBroadPhase<float> early("bottom_up");
  EXPECT_THROW(early.detect(CandidateKind::edge_edge, found), std::logic_error);
  EXPECT_THROW(early.update(mesh.begin()), std::logic_error);
  EXPECT_THROW(early.set_groups(Element::face, {}), std::logic_error);
  EXPECT_THROW(early.set_vertex_groups({}), std::logic_error);
  EXPECT_THROW(early.exclude(CandidateKind::edge_edge, {}), std::logic_error);
  EXPECT_THROW(early.exclude_rings(1), std::logic_error);
  EXPECT_THROW(early.keep_only({}), std::logic_error);
  EXPECT_NO_THROW(early.clear_filters());
  const auto refusal = [&](const char* id, CandidateKind kind) {
    StrategyBroadPhase<float> broad(id);
    build(broad, mesh, 0.1f);
    return complaint([&] { broad.detect(kind, found); });
  };
  EXPECT_NE(refusal("kinetic_aabb", CandidateKind::edge_face).find("needs to know the motion in advance"),
            std::string::npos);
  for (const StrategyEntry& entry : registry())
    if (suits<float>(entry) && !entry.info.can.self_pairs) {
      EXPECT_NE(refusal(entry.info.id.c_str(), CandidateKind::edge_edge).find("pairs within one body"),
                std::string::npos);
      EXPECT_EQ(refusal(entry.info.id.c_str(), CandidateKind::face_vertex), "");
    }
  StrategyBroadPhase<float> wrong_parameter("bottom_up", {{"no_such_parameter", "1"}});
  build(wrong_parameter, mesh, 0.1f);
  EXPECT_THROW(wrong_parameter.detect(CandidateKind::edge_face, found), ConfigError);
  StrategyBroadPhase<float> broad("bottom_up");
  EXPECT_THROW(build(broad, mesh, -1.0f), std::invalid_argument);
  build(broad, mesh, 0.1f);
  const auto fewer = MatrixView<float>::by_rows(mesh.v0.data(), mesh.vertex_count() - 1, 3);
  EXPECT_THROW(broad.update(fewer), std::invalid_argument);
  // The end of a motion is checked, too, where it begins in the same memory as the start.
  EXPECT_THROW(broad.update(mesh.begin(), fewer), std::invalid_argument);
  broad.detect(CandidateKind::face_vertex, found);
  EXPECT_FALSE(found.empty());
}

}  // namespace
}  // namespace kbvh::test::strategy_broad_phase_test
