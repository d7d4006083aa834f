// Gaps among numbers far beyond their size: any error relative to a body's largest coordinate closes them.

#include "experiments/stress/family_parts.hpp"

namespace kbvh::experiments::stress {
namespace {

/// Two sheets, one over the other, with a gap between them; flat, or in equal waves; the lower one moves.
StressScene sheets_with_a_gap(Random& random, const FamilySetting& setting, double gap) {
  StressScene scene;
  const double wave = random.among({0.0, 0.4 * gap, 0.4}), shear = 0.05 * random.unit();
  const bool falls = random.one_in(2);
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(sheet(6 + random.below(4), keyframes_for(setting),
                                 [&](std::uint32_t x, std::uint32_t y, std::uint32_t k, int axis) {
                                   if (axis == 0)
                                     return 0.25 * x + (b == 0 ? shear * k * (1 + 0.1 * y) : 0.0);
                                   if (axis == 1) return 0.25 * y;
                                   return b * gap + wave * std::sin(1.5 * x + y + 0.3 * k) -
                                          (b == 0 && falls ? 0.05 * gap * k : 0.0);
                                 }));
  return scene;
}

}  // namespace

StressScene far_sheets(const FamilySetting& setting) {
  Random random(setting.seed);
  const double gap = random.among({0.1, 0.01}),
               far = random.among({0.1, 1.0, 8.0}) * gap / setting.limits.epsilon;
  StressScene scene = sheets_with_a_gap(random, setting, gap);
  double shift[3];
  for (double& s : shift) s = far * random.among({1.0, -1.0, 0.0});
  for (StressBody& body : scene.bodies)
    for (std::size_t i = 0; i < body.positions.size(); ++i) body.positions[i] += shift[i % 3];
  return scene;
}

StressScene far_vertices(const FamilySetting& setting) {
  Random random(setting.seed);
  const double gap = random.among({0.1, 0.01}),
               far = random.among({0.1, 1.0, 1e3}) * gap / setting.limits.epsilon;
  StressScene scene = sheets_with_a_gap(random, setting, gap);
  StressBody& body = scene.bodies[0];
  if (random.one_in(2)) {
    // A ground below the sheet, as part of the same body.
    const double ground[9] = {-far, -far, -1, far, -far, -1, 0, far, -1};
    std::vector<double> positions;
    for (std::size_t k = 0; k < body.times.size(); ++k) {
      positions.insert(positions.end(), body.position(k, 0), body.position(k, 0) + 3 * body.vertex_count);
      positions.insert(positions.end(), ground, ground + 9);
    }
    body.positions = std::move(positions);
    body.primitives.push_back({body.vertex_count, body.vertex_count + 1, body.vertex_count + 2});
    body.vertex_count += 3;
    return scene;
  }
  const std::uint32_t vertex = random.below(body.vertex_count), still = random.below(2);
  for (std::size_t k = 0; k < body.times.size(); ++k) {
    double* const corner = body.position(k, vertex);
    corner[random.below(2)] = far * (still == 1 ? 1.0 : 1 + 0.1 * random.unit());
    corner[2] = -far;
  }
  return scene;
}

}  // namespace kbvh::experiments::stress
