// The broad phase against ground truth of continuous collision detection (Wang et al. 2021): every pair that
// is known to touch is a candidate, and the numbers of candidates are the published ones.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/broad_phase/broad_phase.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/study/box_candidates.hpp"

namespace kbvh::experiments::broad_phase_truth_test {
namespace {

/// Counts the listed pairs that touch, and those of them that are no candidates.
struct Tally {
  std::uint64_t touching = 0, missed = 0;
};

template <class S>
Tally tally(const FramePair& frames, CandidateBuffer (&found)[2]) {
  std::vector<S> positions[2];
  for (int i = 0; i < 2; ++i) positions[i].assign(frames.positions[i].begin(), frames.positions[i].end());
  const auto view = [&](int i) {
    return MatrixView<S>::by_rows(positions[i].data(), positions[i].size() / 3, 3);
  };
  BroadPhase<S> broad;
  broad.build(view(0), view(1),
              MatrixView<std::uint32_t>::by_rows(frames.edges[0].data(), frames.edges.size(), 2),
              MatrixView<std::uint32_t>::by_rows(frames.faces[0].data(), frames.faces.size(), 3));
  broad.detect_face_vertex_candidates(found[0]);
  broad.detect_edge_edge_candidates(found[1]);
  Tally result;
  for (const bool edges : {false, true}) {
    // The second ids that are looked for, by the first: short lists, next to millions of candidates.
    std::vector<std::vector<std::uint32_t>> wanted(edges ? frames.edges.size() : frames.faces.size());
    for (const FramePair::Listed& pair : frames.listed) {
      if (!pair.touches || (pair.kind == Contact::Kind::edge_edge) != edges) continue;
      ++result.touching;
      if (edges)
        wanted[std::min(pair.first, pair.second)].push_back(std::max(pair.first, pair.second));
      else
        wanted[pair.second].push_back(pair.first);
    }
    for (const Candidate& candidate : found[edges ? 1 : 0])
      std::erase(wanted[candidate.first], candidate.second);
    for (const auto& left : wanted) result.missed += left.size();
  }
  return result;
}

TEST(BroadPhaseTruth, ListedPairsOfFramesAreCandidates) {
  for (const char* name : {"cloth-ball", "rod-twist"}) {
    const std::filesystem::path folder = data_folder() / "ccd" / "frames" / name;
    if (!is_frame_pair(folder)) GTEST_SKIP() << "there is no " << folder << " (set KBVH_DATA)";
    const FramePair frames = read_frame_pair(folder);
    CandidateBuffer found[2];
    const Tally exact = tally<double>(frames, found);
    EXPECT_GT(exact.touching, 1000u) << name;
    EXPECT_EQ(exact.missed, 0u) << name;
    const PublishedCandidates published = published_candidates(name);
    if (published.edge_edge != 0) {
      EXPECT_EQ(found[0].size(), published.vertex_face) << name;
      EXPECT_EQ(found[1].size(), published.edge_edge) << name;
    }
    // Rounding positions to float is monotone: boxes that overlap do so afterwards.
    EXPECT_EQ(tally<float>(frames, found).missed, 0u) << name;
  }
}

TEST(BroadPhaseTruth, QueriesThatTouchAreCandidates) {
  const std::filesystem::path folder = data_folder() / "ccd" / "queries";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no queries at " << folder << " (set KBVH_DATA)";
  std::uint64_t touching = 0, missed = 0;
  const std::uint32_t face[] = {1, 2, 3}, edges[] = {0, 1, 2, 3};
  BroadPhase<double> broad;
  for (const ImpactQueries& file : find_impact_queries(folder))
    for (const ImpactQuery& query : file.queries) {
      if (!query.truth.value_or(false)) continue;
      ++touching;
      const bool of_edges = query.kind == Contact::Kind::edge_edge;
      broad.build(MatrixView<double>::by_rows(query.points[0][0], 4, 3),
                  MatrixView<double>::by_rows(query.points[1][0], 4, 3),
                  MatrixView<std::uint32_t>::by_rows(edges, of_edges ? 2 : 0, 2),
                  MatrixView<std::uint32_t>::by_rows(face, of_edges ? 0 : 1, 3));
      missed +=
          broad.candidates(of_edges ? CandidateKind::edge_edge : CandidateKind::face_vertex).empty() ? 1 : 0;
    }
  EXPECT_GT(touching, 300u);
  EXPECT_EQ(missed, 0u);
}

}  // namespace
}  // namespace kbvh::experiments::broad_phase_truth_test
