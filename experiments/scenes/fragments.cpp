// Bodies of separate triangles: a ball that bursts, and a soup in a flow.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "experiments/scenes/ageing.hpp"
#include "experiments/scenes/mesh_parts.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::cross;
using cloth::dot;
using cloth::length;
using cloth::Vec;

namespace {

/// Rotates p about a unit axis.
Vec turned(const Vec& p, const Vec& axis, double turns) {
  const double c = cosine_of_turns(turns), s = sine_of_turns(turns);
  return p * c + cross(axis, p) * s + axis * (dot(axis, p) * (1 - c));
}

/// Returns a unit vector, from the numbers n to n + 2 of the noise.
Vec direction(const SeededNoise& noise, std::uint64_t n) {
  const Vec p{noise.signed_unit(n), noise.signed_unit(n + 1), noise.signed_unit(n + 2)};
  const double size = length(p);
  return size > 1e-3 ? p * (1 / size) : Vec{0, 0, 1};
}

/// A triangle as a rigid body.
struct Fragment {
  std::array<Vec, 3> corners;  // relative to the centre, at rest
  Vec centre, velocity, axis;
  double turns = 0, spin = 0;  // angle, and its change per second
  double thickness = 0;        // height of the centre when it lies on the floor
};

void append(const std::vector<Fragment>& fragments, io::AnimatedMesh& mesh) {
  std::vector<Vec> positions;
  positions.reserve(mesh.vertex_count);
  for (const Fragment& f : fragments)
    for (const Vec& corner : f.corners) positions.push_back(f.centre + turned(corner, f.axis, f.turns));
  append_keyframe(mesh, positions);
}

constexpr double ball_radius = 0.5, ball_height = 1.3, ball_speed = 4;  // metres, metres per second

/// One of two balls that collide at x = 0 and burst.
class BurstingBall {
 public:
  /// `side` is -1 or 1; `approach` is the time before the collision, in seconds.
  BurstingBall(std::uint32_t triangles, std::uint64_t seed, double side, double approach)
      : noise_(seed), side_(side) {
    const io::AnimatedMesh ball = icosphere(triangles, {0, 0, 0}, ball_radius);
    mesh = separate_triangles("shattering-ball", std::uint32_t(ball.primitive_count()));
    fragments_.resize(ball.primitive_count());
    for (std::size_t i = 0; i < fragments_.size(); ++i) {
      Fragment& f = fragments_[i];
      for (std::size_t c = 0; c < 3; ++c) {
        const double* p = &ball.positions[3 * std::size_t(ball.primitive_vertices[3 * i + c])];
        f.corners[c] = {p[0], p[1], p[2]};
      }
      f.centre = (f.corners[0] + f.corners[1] + f.corners[2]) * (1.0 / 3);
      // A hairline between fragments: they touch no neighbour before the ball bursts.
      for (Vec& corner : f.corners) corner = (corner - f.centre) * 0.97;
      f.thickness = length(f.corners[1] - f.corners[0]) * (0.3 + 0.25 * draw(i, 0));
      f.axis = direction(noise_, numbers * i + 1);
      f.centre += Vec{side * (ball_radius + ball_speed * approach), side * 0.06, ball_height};
      f.velocity = {-side * ball_speed, 0, 0};
    }
  }

  /// Moves the whole ball.
  void approach(double dt) {
    for (Fragment& f : fragments_) f.centre += f.velocity * dt;
  }

  void burst() {
    const Vec centre{side_ * ball_radius, side_ * 0.06, ball_height};
    for (std::size_t i = 0; i < fragments_.size(); ++i) {
      Fragment& f = fragments_[i];
      // Outwards, and at random: fragments push each other in all directions. Part of the motion stays.
      const Vec outwards = (f.centre - centre) * (1 / ball_radius);
      f.velocity = f.velocity * (0.35 + 0.25 * draw(i, 11)) + outwards * (1.4 + 1.0 * draw(i, 4)) +
                   direction(noise_, numbers * i + 5) * (1.3 * (1 + draw(i, 8)));
      f.velocity.z += 0.5 * (1 + draw(i, 9));
      f.spin = 3 * draw(i, 10);
    }
  }

  /// Lets every fragment fly, bounce on the floor z = 0 and come to rest.
  void fly(double dt) {
    for (Fragment& f : fragments_) {
      f.velocity.z -= cloth::gravity * dt;
      f.velocity = f.velocity * (1 - 0.4 * dt);  // air
      f.centre += f.velocity * dt;
      f.turns += f.spin * dt;
      if (f.centre.z >= f.thickness) continue;
      f.centre.z = f.thickness;
      const bool rests = std::fabs(f.velocity.z) < 0.3;
      f.velocity.z = rests ? 0 : 0.5 * std::fabs(f.velocity.z);
      const double slides = rests ? std::max(0.0, 1 - 8 * dt) : 0.75;  // friction
      f.velocity.x *= slides;
      f.velocity.y *= slides;
      f.spin *= rests ? 0 : 0.6;
    }
  }

  void record() { append(fragments_, mesh); }

  io::AnimatedMesh mesh;

 private:
  static constexpr std::uint64_t numbers = 16;  // random ones of a fragment
  double draw(std::size_t fragment, std::uint64_t n) const {
    return noise_.signed_unit(numbers * fragment + n);
  }

  SeededNoise noise_;
  double side_;
  std::vector<Fragment> fragments_;
};

}  // namespace

std::pair<io::AnimatedMesh, io::AnimatedMesh> shattering_balls(const AgeingConfig& config,
                                                               std::uint32_t second_triangles) {
  check_triangles(config.triangles, "shattering ball");
  check_triangles(second_triangles, "shattering ball");
  constexpr double rate = 30;
  constexpr std::uint32_t steps = 4;
  const std::uint32_t burst = (config.keyframes - 1) / 10;
  BurstingBall balls[2] = {{config.triangles, 2 * config.seed, -1, burst / rate},
                           {second_triangles, 2 * config.seed + 1, 1, burst / rate}};
  for (BurstingBall& ball : balls) {
    ball.mesh.keyframe_times = keyframe_times(config.keyframes, rate);
    for (std::uint32_t k = 0; k < config.keyframes; ++k) {
      if (k > 0 && k <= burst) ball.approach(1 / rate);
      if (k == burst) ball.burst();
      for (std::uint32_t n = 0; n < steps && k > burst; ++n) ball.fly(1 / (rate * steps));
      ball.record();
    }
  }
  return {std::move(balls[0].mesh), std::move(balls[1].mesh)};
}

namespace {

/// The velocity of the soup at a point of the unit cube: two systems of eddies, across z and across y, whose
/// strengths alternate. Free of divergence, and along the walls at the walls.
Vec flow(const Vec& p, double t) {
  const double first = 1.2 + 0.6 * sine_of_turns(0.5 * t), second = 1.2 - 0.6 * sine_of_turns(0.5 * t);
  const auto s = [](double x) { return sine_of_turns(x); };
  const auto c = [](double x) { return cosine_of_turns(x); };
  // Stream functions s(x) s(y / 2) across z and s(x / 2) s(z) across y, waves in turns.
  return {first * s(p.x) * c(0.5 * p.y) * 0.5 + second * s(0.5 * p.x) * c(p.z),
          -first * c(p.x) * s(0.5 * p.y), -second * 0.5 * c(0.5 * p.x) * s(p.z)};
}

}  // namespace

io::AnimatedMesh flowing_soup(const AgeingConfig& config) {
  check_triangles(config.triangles, "flowing soup");
  constexpr double rate = 30;
  constexpr std::uint32_t steps = 2;
  const std::uint32_t count = std::max(1u, config.triangles);
  // As many cells as triangles fill the cube; a triangle is smaller than its cell.
  const double size = 0.45 * cube_edge(1, count);
  io::AnimatedMesh mesh = separate_triangles("flowing-soup", count);
  mesh.keyframe_times = keyframe_times(config.keyframes, rate);
  const SeededNoise noise(config.seed);
  std::vector<Fragment> fragments(count);
  for (std::size_t i = 0; i < count; ++i) {
    Fragment& f = fragments[i];
    const std::uint64_t n = 32 * i;
    const double inside = 0.5 - size;
    f.centre = {0.5 + inside * noise.signed_unit(n), 0.5 + inside * noise.signed_unit(n + 1),
                0.5 + inside * noise.signed_unit(n + 2)};
    f.axis = direction(noise, n + 3);
    f.spin = noise.signed_unit(n + 6);
    for (std::size_t corner = 0; corner < 3; ++corner)
      f.corners[corner] = direction(noise, n + 8 + 4 * corner) * size;
  }
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    for (Fragment& f : fragments)
      for (std::uint32_t n = 0; n < steps && k > 0; ++n) {
        const double dt = 1 / (rate * steps), t = mesh.keyframe_times[k - 1] + n * dt;
        const Vec half = f.centre + flow(f.centre, t) * (0.5 * dt);
        f.centre += flow(half, t + 0.5 * dt) * dt;
        f.turns += f.spin * dt;
      }
    append(fragments, mesh);
  }
  return mesh;
}

}  // namespace kbvh::scenes
