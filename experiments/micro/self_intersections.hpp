#pragma once
// Self intersections and impacts of one cloth, with patches left out by cones and without: for the bench of
// the broad phase.
#include <cstdio>
#include <string>
#include <vector>

#include "folded_cloth.hpp"
#include "frame_mesh.hpp"
#include "turns_table.hpp"

namespace kbvh::experiments::micro {

/// Self intersections of a cloth of 65,522 triangles, updates included, frame by frame.
inline void self_intersections(const char* what, const std::vector<double>& swings, int repetitions,
                               Table& table) {
  constexpr std::uint32_t n = 182;
  const std::vector<std::uint32_t> f = cloth_faces(n);
  std::vector<std::vector<double>> frames;
  for (const double swing : swings) frames.push_back(folded_cloth(n, swing));
  CandidateBuffer out;
  SelfIntersectionStats stats[2];
  BroadPhase<double> broad[2];
  std::vector<Contestant> contestants;
  for (const bool cones : {true, false}) {
    BroadPhase<double>* const own = &broad[cones ? 0 : 1];
    own->build(points_of(frames[0]), MatrixView<std::uint32_t>(),
               MatrixView<std::uint32_t>::by_rows(f.data(), f.size() / 3, 3));
    contestants.push_back({std::string(what) + (cones ? ", cones" : ", none"), [&, own, cones] {
                             SelfIntersectionStats& counts = stats[cones ? 0 : 1];
                             counts = {};
                             std::size_t pairs = 0;
                             for (const auto& v : frames) {
                               own->update(points_of(v));
                               own->self_intersections(out, cones ? SelfCulling::cones : SelfCulling::none,
                                                       &counts);
                               pairs += out.size();
                             }
                             return pairs;
                           }});
  }
  table.compare(
      "Exact self intersections of 65,522 triangles, " + std::to_string(frames.size()) + " frames: " + what,
      std::move(contestants), repetitions);
  for (const bool cones : {true, false}) {
    const SelfIntersectionStats& counts = stats[cones ? 0 : 1];
    std::printf("  %s: %llu box tests, %llu triangle tests, %llu patches tested, %llu left out\n",
                cones ? "cones" : "none", (unsigned long long)counts.box_tests,
                (unsigned long long)counts.triangles.tests, (unsigned long long)counts.patches,
                (unsigned long long)counts.certified);
  }
}

/// The earliest impact of the same cloth while it folds further, candidates included.
inline void self_impacts(int repetitions, Table& table) {
  constexpr std::uint32_t n = 182;
  const std::vector<std::uint32_t> f = cloth_faces(n), e = cloth_edges(n);
  const std::vector<double> begin = folded_cloth(n, 1.6), end = folded_cloth(n, 1.603);
  BroadPhase<double> broad[2];
  std::vector<Contestant> contestants;
  for (const bool cones : {true, false}) {
    BroadPhase<double>* const own = &broad[cones ? 0 : 1];
    own->build(points_of(begin), points_of(end),
               MatrixView<std::uint32_t>::by_rows(e.data(), e.size() / 2, 2),
               MatrixView<std::uint32_t>::by_rows(f.data(), f.size() / 3, 3));
    contestants.push_back(
        {std::string("impacts of a folding cloth") + (cones ? ", cones" : ", none"), [&, own, cones] {
           own->update(points_of(begin), points_of(end));
           EarliestImpactStats stats;
           own->earliest_impact(0, &stats, cones ? SelfCulling::cones : SelfCulling::none);
           return std::size_t(stats.candidates);
         }});
  }
  table.compare("Earliest impact of 65,522 triangles, with candidates", std::move(contestants), repetitions);
}

inline void compare_self_intersections(int repetitions, Table& table) {
  self_intersections("flat cloth", {0}, 3 * repetitions, table);
  self_intersections("folding cloth", {1.4, 1.6, 1.8, 2, 2.2, 2.4}, repetitions, table);
  self_impacts(repetitions, table);
  table.target("exact self intersections of a flat cloth, cones over none", "flat cloth, cones",
               "flat cloth, none", 4, 20);
  table.target("exact self intersections of a folding cloth, cones over none", "folding cloth, cones",
               "folding cloth, none", 1.3, 3);
  table.target("earliest impact of a folding cloth, cones over none", "impacts of a folding cloth, cones",
               "impacts of a folding cloth, none", 0, 0);
}

}  // namespace kbvh::experiments::micro
