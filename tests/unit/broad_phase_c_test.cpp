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
  // The mesh is still the one that was taken.
  EXPECT_EQ(kbvh_broad_phase_candidates(broad.get(), KBVH_EDGE_EDGE, &pairs, &count), 0);
  EXPECT_EQ(count, brute_force(mesh, CandidateKind::edge_edge, 0.1F).size());
}

}  // namespace
}  // namespace kbvh::test::broad_phase
