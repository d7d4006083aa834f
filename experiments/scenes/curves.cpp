#include "experiments/scenes/curves.hpp"

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "experiments/scenes/cloth_parts.hpp"
#include "experiments/scenes/mesh_parts.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::Vec;

namespace {

constexpr double flight_seconds = 2, gravity = -9.81;

/// A vertex's flight: start + velocity t + acceleration t^2 / 2 + growth t^3 / 6.
struct Flight {
  Vec start, velocity, acceleration, growth;
};

/// Appends the keyframes of all flights, and their exact curves in between.
void append_flights(const std::vector<Flight>& flights, std::uint32_t keyframes, io::AnimatedMesh& mesh) {
  mesh.keyframe_times.clear();
  mesh.positions.clear();
  mesh.vertex_count = std::uint32_t(flights.size());
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    const double t = keyframes == 1 ? 0 : flight_seconds * k / (keyframes - 1);
    mesh.keyframe_times.push_back(t);
    std::vector<Vec> positions;
    for (const Flight& f : flights)
      positions.push_back(f.start + f.velocity * t + f.acceleration * (0.5 * t * t) +
                          f.growth * (t * t * t / 6));
    append_keyframe(mesh, positions);
  }
  for (std::uint32_t k = 0; k + 1 < keyframes; ++k) {
    const double t = mesh.keyframe_times[k], d = mesh.keyframe_times[k + 1] - t;
    io::AnimatedMesh::Bends& bends = mesh.bends.emplace_back();
    for (const Flight& f : flights) {
      // In powers of s the piece has c2 s^2 + c3 s^3: twist = -c3, bend = twist - c2.
      const Vec c3 = f.growth * (d * d * d / 6), c2 = (f.acceleration + f.growth * t) * (0.5 * d * d);
      for (const auto& [square, cube] : {std::pair{c2.x, c3.x}, {c2.y, c3.y}, {c2.z, c3.z}}) {
        bends.twist.push_back(rounded_to_float(-cube));
        bends.bend.push_back(rounded_to_float(-cube - square));
      }
    }
  }
}

}  // namespace

void smooth(io::AnimatedMesh& mesh) {
  const std::vector<double>& times = mesh.keyframe_times;
  const std::size_t scalars = std::size_t(3) * mesh.vertex_count;
  mesh.bends.clear();
  if (times.size() < 3) return;
  const auto position = [&](std::size_t k, std::size_t i) { return mesh.positions[k * scalars + i]; };
  // The slope at a keyframe of the parabola through it and both neighbours.
  const auto velocity = [&](std::size_t k, std::size_t i) {
    const std::size_t before = k == 0 ? 0 : k - 1, after = k + 1 == times.size() ? k : k + 1;
    if (before == k || after == k)
      return (position(after, i) - position(before, i)) / (times[after] - times[before]);
    const double past = times[k] - times[before], next = times[after] - times[k];
    const double past_slope = (position(k, i) - position(before, i)) / past,
                 next_slope = (position(after, i) - position(k, i)) / next;
    return (past_slope * next + next_slope * past) / (past + next);
  };
  mesh.bends.assign(times.size() - 1, {});
  for (std::size_t k = 0; k + 1 < times.size(); ++k)
    for (std::size_t i = 0; i < scalars; ++i) {
      const double duration = times[k + 1] - times[k], way = position(k + 1, i) - position(k, i);
      const double bend = velocity(k, i) * duration - way;
      mesh.bends[k].bend.push_back(rounded_to_float(bend));
      mesh.bends[k].twist.push_back(rounded_to_float(way - velocity(k + 1, i) * duration - bend));
    }
}

io::AnimatedMesh thrown_cloth(const ThrownConfig& config) {
  io::AnimatedMesh mesh = sheet(config.triangles, {0, 0, 0}, 2.0);
  mesh.name = "thrown-" + mesh.name;
  const SeededNoise noise(config.seed);
  const double shift[2] = {noise.signed_unit(0), noise.signed_unit(1)};
  std::vector<Flight> flights;
  for (std::size_t i = 0; i < mesh.positions.size(); i += 3) {
    const double x = mesh.positions[i], y = mesh.positions[i + 1];
    // Gusts, in turns per metre: wide ones that lift, and narrow ones that fold.
    const double wide = sine_of_turns(0.3 * x + 0.2 * y + shift[0]),
                 across = cosine_of_turns(0.25 * y - 0.35 * x),
                 narrow = sine_of_turns(1.1 * x - 0.7 * y + shift[1]),
                 fold = cosine_of_turns(0.9 * x + 1.3 * y);
    flights.push_back({{x, y, mesh.positions[i + 2]},
                       {0.1 * fold, 0.1 * narrow, -0.5 * gravity * flight_seconds + 0.2 * narrow},
                       {0.25 * wide, 0.2 * across, gravity + 0.5 * wide + 0.2 * fold},
                       {0.3 * narrow, -0.25 * fold, 0.6 * across - 0.3 * narrow}});
  }
  append_flights(flights, config.keyframes, mesh);
  return mesh;
}

io::AnimatedMesh thrown_shards(const ThrownConfig& config) {
  check_triangles(config.triangles, "thrown_shards");
  const std::uint32_t count = config.triangles < 1 ? 1 : config.triangles;
  const SeededNoise noise(config.seed);
  io::AnimatedMesh mesh = separate_triangles("thrown-shards", count);
  // Triangles of about the size that fills the ball; cube roots of libm differ between platforms.
  double size = 0.4;
  while (size * size * size * double(count) > 0.05) size *= 0.75;
  std::vector<Flight> flights;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint64_t first = std::uint64_t(i) * 64;
    Vec place{1, 1, 1};
    for (std::uint64_t n = 0; dot(place, place) > 1 && n < 16; ++n)
      place = {noise.signed_unit(first + 3 * n), noise.signed_unit(first + 3 * n + 1),
               noise.signed_unit(first + 3 * n + 2)};
    place = place * 0.5;
    const double drag = 0.3 + 0.25 * noise.signed_unit(first + 48);  // per second
    const Vec velocity = place * (1.6 + 0.8 * noise.signed_unit(first + 49)) +
                         Vec{0, 0, -0.5 * gravity * flight_seconds + 0.5 * noise.signed_unit(first + 50)};
    const Vec acceleration = velocity * -drag + Vec{0, 0, gravity};
    for (std::uint64_t corner = 0; corner < 3; ++corner) {
      const std::uint64_t at = first + 51 + 3 * corner;
      const Vec offset{noise.signed_unit(at), noise.signed_unit(at + 1), noise.signed_unit(at + 2)};
      flights.push_back({place + offset * size, velocity, acceleration, {0, 0, 0}});
    }
  }
  append_flights(flights, config.keyframes, mesh);
  return mesh;
}

}  // namespace kbvh::scenes
