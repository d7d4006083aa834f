// Many small bodies in one mesh: swarms that mix, and a crowd.
#include <algorithm>
#include <cmath>
#include <string>
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

/// The vertices and triangles of one of many equal bodies.
struct Template {
  std::vector<Vec> vertices;
  std::vector<std::uint32_t> corners;

  std::uint32_t triangles() const { return std::uint32_t(corners.size() / 3); }
  void add(const io::AnimatedMesh& mesh) {
    const auto first = std::uint32_t(vertices.size());
    for (std::size_t i = 0; i < 3 * std::size_t(mesh.vertex_count); i += 3)
      vertices.push_back({mesh.positions[i], mesh.positions[i + 1], mesh.positions[i + 2]});
    for (const std::uint32_t v : mesh.primitive_vertices) corners.push_back(first + v);
  }
};

/// Returns the number of copies whose triangles are nearest to the request.
std::uint32_t copies(std::uint32_t triangles, const Template& one) {
  return std::max(1u, std::uint32_t(double(triangles) / double(one.triangles()) + 0.5));
}

/// Makes a mesh of equal bodies without positions.
io::AnimatedMesh repeated(const std::string& shape, const Template& one, std::uint32_t count) {
  std::vector<std::uint32_t> corners;
  corners.reserve(one.corners.size() * count);
  for (std::uint32_t copy = 0; copy < count; ++copy)
    for (const std::uint32_t v : one.corners)
      corners.push_back(copy * std::uint32_t(one.vertices.size()) + v);
  io::AnimatedMesh mesh = triangle_mesh(shape, std::move(corners), {});
  mesh.vertex_count = count * std::uint32_t(one.vertices.size());
  return mesh;
}

/// Draws a uniform point of the unit ball; `n` is moved past the numbers drawn.
Vec in_unit_ball(const SeededNoise& noise, std::uint64_t& n) {
  for (;;) {
    const Vec p{noise.signed_unit(n), noise.signed_unit(n + 1), noise.signed_unit(n + 2)};
    n += 3;
    if (dot(p, p) < 1 && dot(p, p) > 1e-4) return p;
  }
}

/// Bodies that attract each other, and repel each other when they touch. Total mass and gravity are 1.
class Swarms {
 public:
  Swarms(std::uint64_t seed, std::uint32_t first, std::uint32_t second) : noise_(seed) {
    const double bodies = double(first) + double(second);
    mass_ = 1 / bodies;
    for (std::uint32_t i = 0; i < first + second; ++i) {
      const double side = i < first ? -1 : 1;
      const double share = double(i < first ? first : second) / bodies;
      const Vec in_ball = in_unit_ball(noise_, draws_), direction = in_unit_ball(noise_, draws_);
      const double radius = swarm_radius * std::sqrt(std::sqrt(2 * share));
      x_.push_back(Vec{side * 0.75, side * 0.18, 0} + in_ball * radius);
      // In the mean the swarm neither collapses nor expands (virial theorem for a uniform ball).
      v_.push_back(Vec{side * -0.25, 0, 0} + direction * std::sqrt(share / radius));
      Shape shape;
      shape.radius = radius * fill(i < first ? first : second) * (1 + 0.25 * draw());
      const Vec axis = in_unit_ball(noise_, draws_), other = in_unit_ball(noise_, draws_);
      shape.axis = axis * (1 / length(axis));
      const Vec across = other - shape.axis * dot(other, shape.axis);
      shape.across = length(across) > 1e-6 ? across * (1 / length(across)) : Vec{0, 0, 0};
      shape.phase = draw();
      shape.turns = draw();
      shapes_.push_back(shape);
    }
    a_.resize(x_.size());
    attract();
  }

  void advance(double dt) {
    for (std::size_t i = 0; i < x_.size(); ++i) {
      v_[i] += a_[i] * (0.5 * dt);
      x_[i] += v_[i] * dt;
    }
    attract();
    for (std::size_t i = 0; i < x_.size(); ++i) v_[i] += a_[i] * (0.5 * dt);
    time_ += dt;
  }

  /// Appends the vertices of bodies [begin, end).
  void append(const Template& one, std::size_t begin, std::size_t end, std::vector<Vec>& out) const {
    for (std::size_t i = begin; i < end; ++i) {
      const Shape& shape = shapes_[i];
      const double turned = shape.turns * time_;
      const Vec axis = shape.axis * cosine_of_turns(turned) + shape.across * sine_of_turns(turned);
      const double stretch = 1 + 0.35 * sine_of_turns(0.8 * time_ + shape.phase);
      const double narrow = 1 / std::sqrt(stretch);  // the volume stays the same
      for (const Vec& p : one.vertices)
        out.push_back(x_[i] + (p * narrow + axis * (dot(axis, p) * (stretch - narrow))) * shape.radius);
    }
  }

 private:
  static constexpr double swarm_radius = 0.6;

  struct Shape {
    double radius, phase, turns;
    Vec axis, across;
  };

  double draw() { return noise_.signed_unit(draws_++); }

  /// Returns a body's radius as a share of its swarm's: the bodies fill a fifth of it.
  static double fill(std::uint32_t count) { return std::min(0.4, cube_edge(0.2, count)); }

  void attract() {
    std::fill(a_.begin(), a_.end(), Vec{});
    for (std::size_t i = 0; i < x_.size(); ++i)
      for (std::size_t j = i + 1; j < x_.size(); ++j) {
        const Vec d = x_[j] - x_[i];
        const double reach = 0.9 * (shapes_[i].radius + shapes_[j].radius);
        const double square = dot(d, d), soft = square + reach * reach;
        double pull = mass_ / (soft * std::sqrt(soft));
        if (square < reach * reach) {
          const double distance = std::sqrt(square);
          pull -= stiffness * (reach - distance) / std::max(distance, 1e-9);
        }
        a_[i] += d * pull;
        a_[j] -= d * pull;
      }
  }

  static constexpr double stiffness = 20;

  SeededNoise noise_;
  std::uint64_t draws_ = 0;
  double mass_ = 1, time_ = 0;
  std::vector<Vec> x_, v_, a_;
  std::vector<Shape> shapes_;
};

}  // namespace

std::pair<io::AnimatedMesh, io::AnimatedMesh> mixing_swarms(const AgeingConfig& config,
                                                            std::uint32_t second_triangles) {
  check_triangles(config.triangles, "mixing swarm");
  check_triangles(second_triangles, "mixing swarm");
  constexpr std::uint32_t fewest = 400, steps = 6;
  std::uint32_t f = 1;
  while (config.triangles / (20 * (f + 1) * (f + 1)) >= fewest) ++f;
  Template one;
  one.add(icosphere(20 * f * f, {0, 0, 0}, 1));
  const std::uint32_t first = copies(config.triangles, one), second = copies(second_triangles, one);
  auto meshes = std::pair{repeated("mixing-swarm", one, first), repeated("mixing-swarm", one, second)};
  Swarms swarms(config.seed, first, second);
  std::vector<Vec> positions;
  meshes.first.keyframe_times = meshes.second.keyframe_times = keyframe_times(config.keyframes, 30);
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    for (std::uint32_t step = 0; step < steps && k > 0; ++step) swarms.advance(2.5 / (30 * steps));
    positions.clear();
    swarms.append(one, 0, first, positions);
    append_keyframe(meshes.first, positions);
    positions.clear();
    swarms.append(one, first, first + second, positions);
    append_keyframe(meshes.second, positions);
  }
  return meshes;
}

// --- the crowd -------------------------------------------------------------------------------------------

namespace {

constexpr double hip = 0.86;  // height of the legs' joints, metres

/// A person who faces +x and stands on z = 0: trunk with head, then two legs, which do not touch each other.
struct Person {
  Template body;
  std::size_t left_leg, right_leg;  // first vertices

  explicit Person(std::uint32_t detail) {
    // Height and radius of trunk, neck and head.
    static constexpr double knots[][2] = {{1.76, 0},    {1.72, 0.09}, {1.62, 0.115},
                                          {1.52, 0.07}, {1.46, 0.09}, {1.38, 0.23},
                                          {1.1, 0.19},  {0.95, 0.2},  {hip + 0.03, 0.1}};
    std::vector<ProfilePoint> trunk;
    const std::uint32_t rings = 3 * detail;
    for (std::uint32_t i = 0; i < rings; ++i) {
      const double z = 1.72 - (1.72 - 0.9) * double(i) / double(rings - 1);
      std::size_t knot = 1;
      while (knots[knot][0] > z) ++knot;
      const double part = (knots[knot - 1][0] - z) / (knots[knot - 1][0] - knots[knot][0]);
      trunk.push_back({knots[knot - 1][1] + part * (knots[knot][1] - knots[knot - 1][1]), z});
    }
    add("trunk", 0, 1.76, hip + 0.03, trunk, 2 + 2 * detail);
    for (Vec& p : body.vertices) p.x *= 0.65;
    const std::uint32_t leg_rings = 2 * detail - 1;
    std::vector<ProfilePoint> leg;
    for (std::uint32_t i = 1; i <= leg_rings; ++i) {
      const double part = double(i) / double(leg_rings + 1);
      leg.push_back({0.085 - 0.03 * part, (1 - part) * hip});
    }
    left_leg = body.vertices.size();
    add("leg", 0.1, hip, 0, leg, 2 + detail);
    right_leg = body.vertices.size();
    add("leg", -0.1, hip, 0, leg, 2 + detail);
  }

 private:
  void add(const char* part, double y, double top, double bottom, const std::vector<ProfilePoint>& profile,
           std::uint32_t segments) {
    body.add(revolve(part, 0, y, top, bottom, profile, segments));
  }
};

/// One person's way: straight across the square, again and again.
struct Way {
  double speed, start, phase, size;
  std::uint32_t direction;
};

}  // namespace

io::AnimatedMesh crossing_crowd(const AgeingConfig& config) {
  check_triangles(config.triangles, "crowd");
  constexpr std::uint32_t fewest = 300;
  constexpr double metres_per_person = 1.5, keyframes_per_second = 4;
  std::uint32_t detail = 1;
  while (config.triangles / Person(detail + 1).body.triangles() >= fewest) ++detail;
  const Person person(detail);
  const std::uint32_t count = copies(config.triangles, person.body);
  io::AnimatedMesh mesh = repeated("crowd", person.body, count);
  mesh.keyframe_times = keyframe_times(config.keyframes, keyframes_per_second);
  const double side = metres_per_person * std::sqrt(double(count));
  const SeededNoise noise(config.seed);
  std::vector<Way> ways(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto draw = [&](std::uint64_t n) { return noise.signed_unit(5 * std::uint64_t(i) + n); };
    ways[i] = {1.4 + 0.4 * draw(0), 0.5 * (1 + draw(1)), draw(2), 1 + 0.1 * draw(3),
               std::uint32_t(noise.bits(5 * std::uint64_t(i) + 4) % 4)};
  }
  std::vector<Vec> positions;
  for (const double t : mesh.keyframe_times) {
    positions.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
      const Way& way = ways[i];
      const double gone = way.start + way.speed * t / side, crossings = std::floor(gone);
      // Every crossing has a lane of its own.
      const double lane = side * 0.5 * noise.signed_unit((std::uint64_t(crossings) + 1) << 32 | i);
      const double along = side * (gone - crossings - 0.5);
      const double stride = way.speed * 0.62 * t + way.phase;
      const double swing = 0.075 * sine_of_turns(stride), bob = 0.03 * cosine_of_turns(2 * stride);
      const double c = cosine_of_turns(swing), s = sine_of_turns(swing);
      for (std::size_t v = 0; v < person.body.vertices.size(); ++v) {
        Vec p = person.body.vertices[v];
        if (v >= person.left_leg) {
          // Legs swing about their joints in opposite directions.
          const double sine = v >= person.right_leg ? -s : s, down = p.z - hip;
          p = {c * p.x + sine * down, p.y, hip + c * down - sine * p.x};
        }
        p = (p + Vec{0, 0, bob}) * way.size;
        const double x = along + p.x, y = lane + p.y;
        switch (way.direction) {
          case 0:
            positions.push_back({x, y, p.z});
            break;
          case 1:
            positions.push_back({-x, -y, p.z});
            break;
          case 2:
            positions.push_back({-y, x, p.z});
            break;
          default:
            positions.push_back({y, -x, p.z});
        }
      }
    }
    append_keyframe(mesh, positions);
  }
  return mesh;
}

}  // namespace kbvh::scenes
