// A broad phase answers the same with any number of threads: the same pairs in the same order, and the same
// numbers of tests. threads_test.cpp allows four threads, and looks for data races.
#include <gtest/gtest.h>

#include "core/base/hasher.hpp"
#include "core/broad_phase/broad_phase.hpp"
#include "core/parallel/workers.hpp"
#include "tests/unit/folded_meshes.hpp"

namespace kbvh::test::broad_phase {
namespace {

/// All answers of a round of updates and filters, in their own order.
template <class S>
std::vector<std::uint64_t> answers(std::uint32_t threads, std::uint32_t leaf_size) {
  const Mesh<S> first = crumpled<S>(70, 1), second = crumpled<S>(70, 2);
  BroadPhase<S> broad(BroadPhaseSettings{.leaf_size = leaf_size, .threads = threads});
  first.build(broad, S(0.1));
  std::vector<std::uint64_t> hashes;
  CandidateBuffer found;
  const auto add = [&] {
    Hasher hasher;
    hasher.mix(found.size());
    hasher.bytes(found.data(), found.size() * sizeof(Candidate));
    hasher.mix(broad.last_box_tests());
    hashes.push_back(hasher.value());
  };
  const auto ask = [&] {
    for (const CandidateKind kind : candidate_kinds) {
      broad.detect(kind, found);
      add();
    }
    for (const SelfCulling culling : {SelfCulling::none, SelfCulling::cones}) {
      SelfIntersectionStats stats;
      broad.self_intersections(found, culling, &stats);
      add();
      hashes.push_back(stats.triangles.tests);
      hashes.push_back(stats.triangles.exact);
      hashes.push_back(stats.certified);
    }
  };
  ask();
  second.update(broad);
  ask();
  broad.update(first.begin(), second.begin());
  ask();
  broad.forget_trees();
  std::vector<GroupMask> groups(first.vertex_count());
  for (std::size_t v = 0; v < groups.size(); ++v) groups[v] = v % 3 == 0 ? GroupMask{1, 2} : GroupMask{3, 1};
  broad.set_vertex_groups(groups);
  broad.exclude_rings(2);
  broad.exclude(CandidateKind::edge_edge, std::vector<Candidate>{{1, 900}, {40, 2000}});
  ask();
  broad.keep_if([](CandidateKind, const Candidate& pair) { return (pair.first + pair.second) % 2 == 0; });
  ask();
  return hashes;
}

TEST(BroadPhaseThreads, AnswerLikeOne) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  for (const std::uint32_t leaf_size : {8U, 16U}) {
    const auto expected = answers<float>(1, leaf_size);
    EXPECT_EQ(answers<float>(2, leaf_size), expected) << leaf_size;
    EXPECT_EQ(answers<float>(4, leaf_size), expected) << leaf_size;
  }
  const auto expected = answers<double>(1, 16);
  EXPECT_EQ(answers<double>(2, 16), expected);
  EXPECT_EQ(answers<double>(4, 16), expected);
}

/// Cloth whose patches are certified: pairs of the nodes that are left are the items that threads share.
TEST(BroadPhaseThreads, ShareWhatConesLeave) {
  if (most_threads() < 4) GTEST_SKIP() << "built without TBB";
  const Mesh<float> mesh = folds<float>(100, 2.4);
  std::vector<CandidateBuffer> found;
  for (const std::uint32_t threads : {1U, 4U}) {
    BroadPhase<float> broad;
    mesh.build(broad, 0.0F);
    broad.use_threads(threads);
    found.emplace_back();
    SelfIntersectionStats stats;
    broad.self_intersections(found.back(), SelfCulling::cones, &stats);
    EXPECT_GT(stats.certified, 10u);
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_GT(found[0].size(), 100u);
}

TEST(BroadPhaseThreads, AreRefusedBeyondWhatThereIs) {
  EXPECT_THROW(BroadPhase<float>(BroadPhaseSettings{.threads = 0}), std::invalid_argument);
  EXPECT_THROW(BroadPhase<float>(BroadPhaseSettings{.threads = most_threads() + 1}), std::invalid_argument);
  EXPECT_THROW(BroadPhase<float>().use_threads(0), std::invalid_argument);
}

}  // namespace
}  // namespace kbvh::test::broad_phase
