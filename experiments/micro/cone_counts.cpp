// Counts what the certificates of patches take (core/adr/0017-broad-phase-of-a-simulator.md, Cones) on linear
// segments of l frames: at each frame, with the failure of a certificate as an event, and by bisection.
// Runs no clock: repeated runs give equal counts. Prints two Markdown tables, of which the first is that of
// the ADR.
//   kbvh_cone_counts [SIDE]
// SIDE is the number of vertices along a side of the cloth (default: 182, which are 65,522 triangles).
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "cone_counts.hpp"
#include "folded_cloth.hpp"

namespace kbvh::experiments::micro {
namespace {

struct Row {
  const char* scene;
  int frames, segments;
  std::uint64_t faces;
  ConeWays ways;
  double per_segment(std::uint64_t count) const { return double(count) / segments; }
  double thousands(std::uint64_t count) const { return 1e-3 * per_segment(count); }
  /// Returns the certified faces of a frame, in percent.
  double certified(const ConeCounts& counts) const {
    return 100 * per_segment(counts.certified_faces) / (double(faces) * frames);
  }
};

/// Counts a scene of the bench of the broad phase, one segment between each two swings of its folds.
Row count_scene(const char* scene, std::uint32_t side, const std::vector<double>& swings, int frames) {
  const std::vector<std::uint32_t> f = cloth_faces(side);
  std::vector<std::vector<double>> keyframes;
  for (const double swing : swings) keyframes.push_back(folded_cloth(side, swing));
  constexpr std::uint32_t leaf_size = 16;  // that of the broad phase
  const PatchTree patches(keyframes[0], f, leaf_size);
  Row row{scene, frames, int(swings.size()) - 1, f.size() / 3, {}};
  for (std::size_t i = 1; i < keyframes.size(); ++i)
    count_cones(patches, {keyframes[i - 1], keyframes[i]}, frames, row.ways);
  return row;
}

void print_summary(const std::vector<Row>& rows) {
  std::printf(
      "| scene | l | each frame | events | events / each frame | roots | failures | bisected | bisected / "
      "each frame | certified faces: each frame, events, bisected "
      "|\n|---|--:|--:|--:|--:|--:|--:|--:|--:|---|\n");
  for (const Row& row : rows) {
    const ConeWays& ways = row.ways;
    const auto each_frame = double(ways.each_frame.determinants);
    std::printf("| %s | %d | %.0f | %.0f | %.2f | %.0f | %.0f | %.0f | %.2f | %.1f %%, %.1f %%, %.1f %% |\n",
                row.scene, row.frames, row.thousands(ways.each_frame.determinants),
                row.thousands(ways.events.determinants), double(ways.events.determinants) / each_frame,
                row.per_segment(ways.events.roots), row.per_segment(ways.events.failures),
                row.thousands(ways.bisected.determinants), double(ways.bisected.determinants) / each_frame,
                row.certified(ways.each_frame), row.certified(ways.events), row.certified(ways.bisected));
  }
}

void print_details(const std::vector<Row>& rows) {
  std::printf(
      "| scene | l | way | patches looked at | signs, thousands | determinants, thousands | certified "
      "patches per frame |\n|---|--:|---|--:|--:|--:|--:|\n");
  for (const Row& row : rows) {
    const ConeCounts* const ways[] = {&row.ways.each_frame, &row.ways.events, &row.ways.bisected};
    const char* const names[] = {"each frame", "events", "bisected"};
    for (int i = 0; i < 3; ++i)
      std::printf("| %s | %d | %s | %.0f | %.1f | %.1f | %.1f |\n", row.scene, row.frames, names[i],
                  row.per_segment(ways[i]->patches), row.thousands(ways[i]->signs),
                  row.thousands(ways[i]->determinants),
                  row.per_segment(ways[i]->certified_patches) / row.frames);
  }
}

int run(int argc, char** argv) {
  const int side = argc > 1 ? std::atoi(argv[1]) : 182;
  if (side < 16 || side > 1000)
    throw std::invalid_argument("SIDE is a number from 16 to 1000, not " + std::string(argv[1]));
  const auto n = std::uint32_t(side);
  std::vector<Row> rows;
  for (const int frames : {1, 10, 100}) rows.push_back(count_scene("flat cloth", n, {0, 0}, frames));
  for (const int frames : {1, 10, 100})
    rows.push_back(count_scene("folding cloth", n, {1.4, 1.6, 1.8, 2, 2.2, 2.4}, frames));
  // The motion of the bench's impacts.
  for (const int frames : {1, 10, 100})
    rows.push_back(count_scene("folding cloth, small motion", n, {1.6, 1.603}, frames));
  std::printf("%llu faces; per segment, determinants in thousands\n\n", (unsigned long long)rows[0].faces);
  print_summary(rows);
  std::printf("\n");
  print_details(rows);
  return 0;
}

}  // namespace
}  // namespace kbvh::experiments::micro

int main(int argc, char** argv) {
  try {
    return kbvh::experiments::micro::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kbvh_cone_counts: %s\n", error.what());
    return 1;
  }
}
