// Uses kbvh from a simulator: positions come frame by frame, from the simulator's own array, without a copy.
// Pairs within the cloth are requested, too. Needs no template of the library and no keyframes.

#include <cstdint>
#include <cstdio>
#include <exception>
#include <vector>

#include "core/facade/world.hpp"

namespace {

constexpr std::uint32_t side = 9;  // vertices

/// Makes a square cloth of triangles.
std::vector<std::uint32_t> cloth_triangles() {
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t j = 0; j + 1 < side; ++j)
    for (std::uint32_t i = 0; i + 1 < side; ++i) {
      const std::uint32_t a = j * side + i;
      for (const std::uint32_t v : {a, a + 1, a + side, a + side, a + 1, a + side + 1})
        triangles.push_back(v);
    }
  return triangles;
}

/// Folds the right half of the cloth over the left one, by `share`, and tilts it: at the end it passes
/// through.
void simulate(float share, std::vector<float>& positions) {
  for (std::uint32_t v = 0; v < side * side; ++v) {
    const float x = float(v % side) / (side - 1) - 0.5F, y = float(v / side) / (side - 1);
    positions[3 * v + 0] = x > 0 ? x * (1 - 2 * share) : x;
    positions[3 * v + 1] = y + (x > 0 ? 0.01F : 0);
    positions[3 * v + 2] = x > 0 ? x * (1 - share) + x * (y - 0.5F) * share : 0;
  }
}

}  // namespace

int main() try {
  const std::vector<std::uint32_t> cloth = cloth_triangles(), table{0, 1, 2};
  std::vector<float> positions(3 * side * side + 1);  // one more than needed, so that it is not copied
  simulate(0, positions);

  kbvh::World world;
  const std::uint32_t body =
      world.add_body("cloth", {cloth}, std::vector<float>(positions.begin(), positions.end() - 1));
  world.add_body("table", {table}, std::vector<double>{0},
                 std::vector<float>{-1, -1, -0.1F, 2, -1, -0.1F, -1, 2, -0.1F});
  world.add_pair(0, 1);
  world.add_pair(0, 0);  // pairs within the cloth
  world.start("bottom_up");

  std::vector<kbvh::WorldPair> pairs;
  for (int frame = 1; frame <= 4; ++frame) {
    simulate(0.25F * float(frame), positions);
    world.set_positions(body, positions);
    world.advance(frame);
    world.pairs(pairs);
    std::size_t within = 0;
    for (const kbvh::WorldPair& pair : pairs) within += pair.body_a == pair.body_b ? 1 : 0;
    std::printf("frame %d: %s within the cloth, %s with the table\n", frame, within > 0 ? "pairs" : "none",
                pairs.size() > within ? "pairs" : "none");
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
