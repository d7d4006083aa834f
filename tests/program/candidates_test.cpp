// Box candidates between two frames, against all pairs, and against published counts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include "complaint.hpp"
#include "core/contract/registry.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/study/box_candidates.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::candidates_test {
namespace {

/// A grid of triangles whose vertices jump to multiples of a step, so that many boxes touch.
FramePair crumpled(std::uint32_t seed, double step) {
  constexpr std::uint32_t side = 9;
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> jump(-3, 3);
  FramePair frames;
  frames.name = "crumpled";
  for (auto& positions : frames.positions)
    for (std::uint32_t v = 0; v < side * side; ++v)
      for (const std::uint32_t base : {v % side, v / side, 0u})
        positions.push_back(step * (4 * base + jump(random)));
  for (std::uint32_t y = 0; y + 1 < side; ++y)
    for (std::uint32_t x = 0; x + 1 < side; ++x) {
      const std::uint32_t a = y * side + x;
      frames.faces.push_back({a, a + 1, a + side});
      frames.faces.push_back({a + 1, a + side + 1, a + side});
    }
  for (const auto& face : frames.faces)
    for (std::size_t i = 0; i < 3; ++i)
      frames.edges.push_back(std::minmax({face[i], face[(i + 1) % 3]}) ==
                                     std::pair(face[i], face[(i + 1) % 3])
                                 ? std::array{face[i], face[(i + 1) % 3]}
                                 : std::array{face[(i + 1) % 3], face[i]});
  std::sort(frames.edges.begin(), frames.edges.end());
  frames.edges.erase(std::unique(frames.edges.begin(), frames.edges.end()), frames.edges.end());
  return frames;
}

/// All pairs of two lists of features that share no vertex and whose boxes meet.
template <class A, class B>
std::uint64_t all_pairs_of(const FramePair& frames, const A& first, const B& second, BoxMargin margin,
                           bool same) {
  const auto box = [&](const auto& feature) {
    std::array<double, 6> sides;
    for (std::size_t d = 0; d < 3; ++d) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (const auto& positions : frames.positions)
        for (const std::uint32_t v : feature) {
          const double x = positions[3 * v + d];
          constexpr float far = std::numeric_limits<float>::infinity();
          low = std::min(low, margin == BoxMargin::none ? x : double(std::nextafter(float(x), -far)));
          high = std::max(high, margin == BoxMargin::none ? x : double(std::nextafter(float(x), far)));
        }
      sides[d] = low;
      sides[3 + d] = high;
    }
    return sides;
  };
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < first.size(); ++i)
    for (std::size_t j = same ? i + 1 : 0; j < second.size(); ++j) {
      if (std::find_first_of(first[i].begin(), first[i].end(), second[j].begin(), second[j].end()) !=
          first[i].end())
        continue;
      const auto a = box(first[i]), b = box(second[j]);
      bool meet = true;
      for (std::size_t d = 0; d < 3; ++d) meet = meet && a[d] <= b[3 + d] && b[d] <= a[3 + d];
      count += meet ? 1 : 0;
    }
  return count;
}

TEST(BoxCandidates, AreThoseOfAllPairs) {
  for (const double step : {0.25, 0.1})  // exact in float, and not
    for (std::uint32_t seed = 0; seed < 4; ++seed) {
      FramePair frames = crumpled(seed, step);
      for (auto& positions : frames.positions)
        for (double& x : positions) x = double(float(x));
      std::vector<std::array<std::uint32_t, 1>> vertices;
      for (std::uint32_t v = 0; v < frames.positions[0].size() / 3; ++v) vertices.push_back({v});
      for (const BoxMargin margin : {BoxMargin::none, BoxMargin::one_ulp}) {
        const BoxCandidates found = box_candidates(frames, margin);
        EXPECT_EQ(found.vertex_face, all_pairs_of(frames, vertices, frames.faces, margin, false));
        EXPECT_EQ(found.edge_edge, all_pairs_of(frames, frames.edges, frames.edges, margin, true));
        EXPECT_GT(found.edge_edge, 1000u);
        const BoxCandidates brute = box_candidates(frames, margin, "brute_force");
        EXPECT_GE(brute.edge_edge, found.edge_edge);
      }
    }
}

TEST(BoxCandidates, ListedPairsThatAreNoneAreCounted) {
  FramePair frames = crumpled(1, 0.25);
  const std::uint32_t last = std::uint32_t(frames.faces.size() - 1);
  frames.listed.push_back({Contact::Kind::vertex_face, 0, last, true});  // at the other end of the grid
  frames.listed.push_back({Contact::Kind::vertex_face, 0, last - 1, false});
  const BoxCandidates found = box_candidates(frames, BoxMargin::none);
  EXPECT_EQ(found.touching, 1u);
  EXPECT_EQ(found.missed, 1u);
  EXPECT_NE(complaint([&] { box_candidates(frames, BoxMargin::none, "rebuild"); }).find("finds no contacts"),
            std::string::npos);
}

/// Writes two frames of one triangle each, the second with a coordinate of this text, and their lists of
/// pairs.
void write_frame_pair(const std::filesystem::path& folder, const std::string& coordinate) {
  for (const char* part : {"frames", "boxes", "mma_bool"}) std::filesystem::create_directories(folder / part);
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  write_text(folder / "frames/0.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  write_text(folder / "frames/1.ply", head + "0 0 0\n1 0 0\n0 " + coordinate + " 0\n3 0 1 2\n");
  for (const char* kind : {"vf", "ee"}) {
    write_text(folder / "boxes" / (std::string("1") + kind + ".json"), "[]");
    write_text(folder / "mma_bool" / (std::string("1") + kind + "_mma_bool.json"), "[]");
  }
}

TEST(BoxCandidates, FramesAreLimitedAsAllFiles) {
  TemporaryFolder folder;
  write_frame_pair(folder.path(), "1e30");
  EXPECT_EQ(box_candidates(read_frame_pair(folder.path()), BoxMargin::one_ulp).edge_edge, 0u);
  for (const std::string coordinate : {"1e+31", "-1e+38", "1e+39", "1e+300"}) {
    write_frame_pair(folder.path(), coordinate);
    const std::string said = complaint([&] { read_frame_pair(folder.path()); });
    EXPECT_NE(said.find("1.ply: vertex 2: coordinate y is " + coordinate + ", beyond the limit of 1e+30"),
              std::string::npos)
        << said;
  }
}

TEST(ImpactQueries, AreLimitedAsTheExactTestIs) {
  TemporaryFolder folder;
  const auto write = [&](int power) {
    std::string digits = "1", rows;
    for (int i = 0; i < power; ++i) {  // 2^power, in decimal
      int carry = 0;
      for (auto digit = digits.rbegin(); digit != digits.rend(); ++digit) {
        const int twice = 2 * (*digit - '0') + carry;
        *digit = char('0' + twice % 10);
        carry = twice / 10;
      }
      if (carry > 0) digits.insert(digits.begin(), char('0' + carry));
    }
    for (int row = 0; row < 8; ++row)
      rows += (row == 5 ? digits : std::to_string(row)) + ",1,0,1," + std::to_string(row % 3) + ",1,0\n";
    write_text(folder / "vf.csv", rows);
  };
  write(332);  // 8.7e99
  EXPECT_EQ(read_impact_queries(folder / "vf.csv").queries.size(), 1u);
  write(333);
  const std::string said = complaint([&] { read_impact_queries(folder / "vf.csv"); });
  EXPECT_NE(said.find("line 6: 1.74"), std::string::npos) << said;
  EXPECT_NE(said.find("is beyond the limit of 1e+100"), std::string::npos) << said;
}

TEST(BoxCandidates, OfClothBallAreThePublishedOnes) {
  const std::filesystem::path folder = data_folder() / "ccd" / "frames" / "cloth-ball";
  if (!is_frame_pair(folder)) GTEST_SKIP() << "there is no " << folder;
  const BoxCandidates found = box_candidates(read_frame_pair(folder), BoxMargin::none);
  EXPECT_EQ(found.vertex_face, 1'655'541u);
  EXPECT_EQ(found.edge_edge, 5'197'332u);
  EXPECT_EQ(found.missed, 0u);
}

}  // namespace
}  // namespace kbvh::experiments::candidates_test
