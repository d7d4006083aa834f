// A cloth that is pulled through a funnel.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "experiments/scenes/ageing.hpp"
#include "experiments/scenes/mesh_parts.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::Vec;

namespace {

/// The funnel: a plate with a hole, a cone and a tube, inside. The plate's upper surface is z = 0.
constexpr double plate = 0.95, mouth = 0.42, neck = 0.085, cone = 0.4, outlet = 0.65, wall = 0.012;
constexpr double cloth_side = 1.3;

/// A meridian of the cloth without its pleats: from the tip, which hangs at `depth`, to the flat part.
class Meridian {
 public:
  explicit Meridian(double depth) {
    add(0, -depth);
    // A gathered bundle below the outlet is a little wider than in the tube.
    if (depth > outlet) {
      add(std::min(neck, 0.25 * (depth - outlet)), -std::max(outlet, depth - 0.25));
      add(neck, -outlet);
    }
    if (depth > cone) add(neck, -cone);
    add(mouth, 0);
    add(mouth + 2 * cloth_side, 0);
  }

  /// Radius and height, and the unit normal, inwards and up.
  struct Place {
    double r, z, normal_r, normal_z;
  };
  /// Returns the place at a length from the tip, with rounded corners.
  Place at(double gone) const {
    constexpr double reach = 0.02;
    const Place a = on_line(std::max(0.0, gone - reach)), b = on_line(gone), c = on_line(gone + reach);
    const double nr = a.normal_r + b.normal_r + c.normal_r, nz = a.normal_z + b.normal_z + c.normal_z;
    const double size = std::max(1e-9, std::sqrt(nr * nr + nz * nz));
    const double ends = gone < reach ? 0 : 0.25;  // the tip stays where it is
    return {b.r + ends * (a.r + c.r - 2 * b.r), b.z + ends * (a.z + c.z - 2 * b.z), nr / size, nz / size};
  }

 private:
  struct Point {
    double r, z, gone;
  };
  Place on_line(double gone) const {
    std::size_t i = 1;
    while (i + 1 < points_.size() && gone > points_[i].gone) ++i;
    const Point &a = points_[i - 1], &b = points_[i];
    const double size = std::max(1e-9, b.gone - a.gone), part = (gone - a.gone) / size;
    const double dr = (b.r - a.r) / size, dz = (b.z - a.z) / size;
    return {a.r + part * (b.r - a.r), a.z + part * (b.z - a.z), -dz, dr};
  }
  void add(double r, double z) {
    double gone = 0;
    if (!points_.empty()) {
      const double dr = r - points_.back().r, dz = z - points_.back().z;
      gone = points_.back().gone + std::sqrt(dr * dr + dz * dz);
    }
    points_.push_back({r, z, gone});
  }
  std::vector<Point> points_;
};

}  // namespace

io::AnimatedMesh funnel_cloth(const AgeingConfig& config) {
  check_triangles(config.triangles, "funnel cloth");
  constexpr int pleats = 22;
  constexpr double first_depth = 0.02, last_depth = 1.5, bite = 0.002;
  io::AnimatedMesh mesh = sheet(config.triangles, {0, 0, 0}, cloth_side);
  mesh.name = "funnel-cloth-" + std::to_string(mesh.primitive_count());
  const std::vector<double> flat = std::exchange(mesh.positions, {});
  mesh.keyframe_times = keyframe_times(config.keyframes, 30);
  const SeededNoise noise(config.seed);
  const auto wave = [&](std::uint64_t i) { return noise.signed_unit(i); };
  std::vector<Vec> positions(mesh.vertex_count);
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    const double done = config.keyframes > 1 ? double(k) / double(config.keyframes - 1) : 0;
    const Meridian meridian(first_depth + (last_depth - first_depth) * (0.4 * done + 0.6 * done * done));
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const double x = flat[3 * v], y = flat[3 * v + 1], rho = std::sqrt(x * x + y * y);
      const Meridian::Place place = meridian.at(rho);
      if (!(rho > 0)) {
        positions[v] = {0, 0, place.z};
        continue;
      }
      const double c = x / rho, s = y / rho;
      // The angle's multiple as a power of c + i s; then its phase, which makes the pleats uneven.
      double re = 1, im = 0;
      for (int i = 0; i < pleats; ++i) {
        const double before = re;
        re = re * c - im * s;
        im = before * s + im * c;
      }
      const double phase = 0.8 * (wave(0) * c + wave(1) * s) +
                           0.5 * (wave(2) * (c * c - s * s) + wave(3) * c * s) + 0.6 * wave(4) * rho +
                           0.6 * wave(5) * rho * c;
      const double ripple = re * cosine_of_turns(phase) - im * sine_of_turns(phase);
      // The circle has a length of 2 pi r only, the cloth 2 pi rho: pleats of this depth take up the rest.
      const double excess = std::sqrt(std::max(0.0, rho * rho - place.r * place.r));
      const double depth = std::min(excess * std::numbers::pi / pleats, 0.88 * place.r);
      const double inwards = 0.5 * depth * (1 - ripple) - bite;
      const double r = place.r + inwards * place.normal_r;
      positions[v] = {c * r, s * r, place.z + inwards * place.normal_z};
    }
    append_keyframe(mesh, positions);
  }
  return mesh;
}

io::AnimatedMesh funnel(std::uint32_t triangles) {
  check_triangles(triangles, "funnel");
  // The closed outline of its wall, once around.
  static constexpr double outline[][2] = {{plate, 0},
                                          {mouth, 0},
                                          {neck, -cone},
                                          {neck, -outlet},
                                          {neck + wall, -outlet},
                                          {neck + wall, -cone - 0.5 * wall},
                                          {mouth + wall, -wall},
                                          {plate, -wall}};
  constexpr std::size_t corners_of_outline = std::size(outline);
  const auto rings =
      std::max<std::uint32_t>(corners_of_outline, std::uint32_t(0.8 * std::sqrt(0.5 * triangles)));
  const std::uint32_t segments = std::max(3u, std::uint32_t(double(triangles) / (2.0 * rings) + 0.5));
  // Every edge of the outline gets its share of the rings, at least one.
  std::vector<ProfilePoint> profile;
  double sizes[corners_of_outline], all = 0;
  for (std::size_t i = 0; i < corners_of_outline; ++i) {
    const double *a = outline[i], *b = outline[(i + 1) % corners_of_outline];
    sizes[i] = std::sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]));
    all += sizes[i];
  }
  std::uint32_t made = 0;
  double gone = 0;
  for (std::size_t i = 0; i < corners_of_outline; ++i) {
    const double *a = outline[i], *b = outline[(i + 1) % corners_of_outline];
    gone += sizes[i];
    const auto later = std::uint32_t(corners_of_outline - 1 - i);
    const auto wanted = std::uint32_t(gone / all * rings + 0.5);
    const std::uint32_t until =
        i + 1 == corners_of_outline ? rings : std::clamp(wanted, made + 1, rings - later);
    for (std::uint32_t n = 0; n < until - made; ++n) {
      const double part = double(n) / double(until - made);
      profile.push_back({a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])});
    }
    made = until;
  }
  std::vector<std::uint32_t> corners;
  std::vector<double> positions;
  for (std::uint32_t ring = 0; ring < rings; ++ring)
    for (std::uint32_t s = 0; s < segments; ++s) {
      const double turns = double(s) / double(segments);
      positions.insert(positions.end(), {profile[ring].r * cosine_of_turns(turns),
                                         profile[ring].r * sine_of_turns(turns), profile[ring].z});
      const std::uint32_t upper = ring * segments, lower = (ring + 1) % rings * segments,
                          next = (s + 1) % segments;
      corners.insert(corners.end(),
                     {upper + s, lower + next, lower + s, upper + s, upper + next, lower + next});
    }
  return triangle_mesh("funnel", std::move(corners), std::move(positions));
}

}  // namespace kbvh::scenes
