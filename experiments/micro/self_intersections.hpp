#pragma once
// Self intersections and impacts of one cloth, with patches left out by cones and without: for the bench of
// the broad phase.
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "frame_mesh.hpp"
#include "turns_table.hpp"

namespace kbvh::experiments::micro {

/// A cloth of n x n vertices, drawn over six folds whose direction swings by so many radians; 0: flat. From
/// pi / 2 on it hangs over, from about 2.3 on layers cut each other.
inline std::vector<double> folded_cloth(std::uint32_t n, double swing) {
  std::vector<double> v;
  double x = 0, z = 0;
  std::vector<std::pair<double, double>> curve;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double direction = swing * std::sin(2 * 3.14159265358979 * 6 * i / n);
    curve.emplace_back(x += std::cos(direction), z += std::sin(direction));
  }
  for (std::uint32_t row = 0; row < n; ++row)
    for (std::uint32_t i = 0; i < n; ++i) {
      // Wrinkles across the folds, so that no two normals are equal.
      const double wrinkle = swing == 0 ? 0 : 0.15 * std::sin(0.9 * row + 0.3 * i);
      v.insert(v.end(), {curve[i].first, double(row), curve[i].second + wrinkle});
    }
  return v;
}

inline std::vector<std::uint32_t> cloth_faces(std::uint32_t n) {
  std::vector<std::uint32_t> f;
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t i = y * n + x;
      f.insert(f.end(), {i, i + 1, i + n, i + 1, i + n + 1, i + n});
    }
  return f;
}

/// Returns the sides of the squares of a cloth, and their diagonals.
inline std::vector<std::uint32_t> cloth_edges(std::uint32_t n) {
  std::vector<std::uint32_t> e;
  for (std::uint32_t i = 0; i < n * n; ++i) {
    if (i % n + 1 < n) e.insert(e.end(), {i, i + 1});
    if (i + n < n * n) e.insert(e.end(), {i, i + n});
    if (i % n + 1 < n && i + n < n * n) e.insert(e.end(), {i + 1, i + n});
  }
  return e;
}

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
