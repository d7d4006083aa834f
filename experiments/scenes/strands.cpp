// Tubes around a moving curve: a rod that buckles under twist, a knot that is pulled tight, a ball of yarn.
#include <algorithm>
#include <cmath>
#include <numbers>
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

constexpr double pi = std::numbers::pi;

Vec unit(const Vec& v) {
  return v * (1 / length(v));
}

/// Returns 0 below 0, 1 above 1, and a smooth step between.
double smooth(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Returns the finished share of the clip at a keyframe.
double share(std::uint32_t keyframe, std::uint32_t keyframes) {
  return keyframes > 1 ? double(keyframe) / double(keyframes - 1) : 0;
}

/// A closed tube: `rings` circles of `sides` vertices around a curve, and a pole at each end.
class Tube {
 public:
  Tube(const std::string& shape, std::uint32_t rings, std::uint32_t sides, double radius)
      : rings_(rings), sides_(sides), radius_(radius), centres(rings), normals(rings) {
    mesh = triangle_mesh(shape, revolved_triangles(rings, sides), {});
    mesh.vertex_count = rings * sides + 2;
  }

  /// Chooses normals by parallel transport from the first ring, whose normal is nearest to `first`, and turns
  /// the last ring by `twist` turns, the others in proportion.
  void transport(const Vec& first, double twist) {
    Vec normal = first;
    for (std::uint32_t i = 0; i < rings_; ++i) {
      const Vec t = tangent(i);
      normal = unit(normal - t * dot(normal, t));
      const double turns = twist * double(i) / double(rings_ - 1);
      normals[i] = normal * cosine_of_turns(turns) + cross(t, normal) * sine_of_turns(turns);
    }
  }

  /// Appends a keyframe with the current centres and normals.
  void append() {
    positions_.clear();
    for (std::uint32_t i = 0; i < rings_; ++i) {
      const Vec t = tangent(i), normal = unit(normals[i] - t * dot(normals[i], t)), across = cross(normal, t);
      for (std::uint32_t s = 0; s < sides_; ++s) {
        const double turns = double(s) / double(sides_);
        positions_.push_back(centres[i] +
                             (normal * cosine_of_turns(turns) + across * sine_of_turns(turns)) * radius_);
      }
    }
    positions_.push_back(centres[0] - tangent(0) * (0.6 * radius_));
    positions_.push_back(centres[rings_ - 1] + tangent(rings_ - 1) * (0.6 * radius_));
    append_keyframe(mesh, positions_);
  }

  std::uint32_t rings() const { return rings_; }

 private:
  Vec tangent(std::uint32_t i) const {
    return unit(centres[std::min(i + 1, rings_ - 1)] - centres[i > 0 ? i - 1 : 0]);
  }

  std::uint32_t rings_, sides_;
  double radius_;
  std::vector<Vec> positions_;

 public:
  io::AnimatedMesh mesh;
  std::vector<Vec> centres, normals;  ///< of the rings, for the next keyframe
};

/// Returns a tube of nearly equilateral triangles.
Tube tube(const std::string& shape, std::uint32_t triangles, double length, double radius) {
  check_triangles(triangles, shape.c_str());
  const double ideal = std::sqrt(double(triangles) * pi * radius / length);
  const std::uint32_t sides = std::max(3u, std::uint32_t(ideal + 0.5));
  const std::uint32_t rings = std::max(2u, std::uint32_t(double(triangles) / (2.0 * sides) + 0.5));
  return {shape, rings, sides, radius};
}

/// A curve of dense points, parametrised by its length.
class Curve {
 public:
  void clear() { points_.clear(); }
  void add(const Vec& p) { points_.push_back(p); }

  /// Replaces every point by the mean of the points around it, twice; rounds corners off.
  void round_off(std::size_t reach) {
    for (int pass = 0; pass < 2; ++pass) {
      sums_.assign(points_.size() + 1, Vec{});
      for (std::size_t i = 0; i < points_.size(); ++i) sums_[i + 1] = sums_[i] + points_[i];
      for (std::size_t i = 0; i < points_.size(); ++i) {
        const std::size_t r = std::min({reach, i, points_.size() - 1 - i});
        points_[i] = (sums_[i + r + 1] - sums_[i - r]) * (1 / double(2 * r + 1));
      }
    }
  }

  /// Measures the curve; `at` needs it.
  void measure() {
    gone_.assign(points_.size(), 0);
    for (std::size_t i = 1; i < points_.size(); ++i)
      gone_[i] = gone_[i - 1] + length(points_[i] - points_[i - 1]);
  }
  double size() const { return gone_.back(); }
  /// Returns the point at a length from the start; straight on beyond the ends.
  Vec at(double gone) const {
    const auto found = std::upper_bound(gone_.begin(), gone_.end(), gone) - gone_.begin();
    const auto i = std::size_t(std::clamp<std::ptrdiff_t>(found, 1, std::ptrdiff_t(gone_.size()) - 1));
    const double part = (gone - gone_[i - 1]) / std::max(1e-12, gone_[i] - gone_[i - 1]);
    return points_[i - 1] + (points_[i] - points_[i - 1]) * part;
  }

 private:
  std::vector<Vec> points_, sums_;
  std::vector<double> gone_;
};

}  // namespace

io::AnimatedMesh twisted_rod(const AgeingConfig& config) {
  constexpr double rod = 3, radius = 0.03, helix = 1.6 * radius, pitch_turns = 1 / (9 * helix), twist = 14;
  Tube made = tube("twisted-rod", config.triangles, rod, radius);
  made.mesh.keyframe_times = keyframe_times(config.keyframes, 30);
  const SeededNoise noise(config.seed);
  const double lean = 0.06 * noise.signed_unit(0);  // the place where it buckles, as a share of the rod
  const double steep = 2 * pi * helix * pitch_turns, stretch = std::sqrt(1 + steep * steep);
  constexpr int samples = 4000;
  Curve curve;
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    const double done = share(k, config.keyframes);
    const double half = 0.5 * rod * 0.84 * smooth((done - 0.3) / 0.75);  // rod in the helix, each side
    const double depth = half / stretch;
    curve.clear();
    for (int i = 0; i <= samples; ++i) {
      const double s = rod * (double(i) / samples - 0.5 - lean);
      if (std::fabs(s) >= half) {
        const double beyond = std::fabs(s) - half;
        const double root = helix * std::min(1.0, depth / (6 * helix));
        curve.add({(s < 0 ? -1 : 1) * (root + beyond), 0, 0});
        continue;
      }
      // Down one strand to the loop at the lower end, and up the other.
      const double down = (half - std::fabs(s)) / stretch, left = depth - down;
      const double r =
          helix * std::min(1.0, depth / (6 * helix)) * std::sqrt(std::min(1.0, left / (3 * helix)));
      const double turns = pitch_turns * down + (s < 0 ? 0.5 : 0);
      curve.add({r * cosine_of_turns(turns), r * sine_of_turns(turns), -down});
    }
    curve.round_off(std::size_t(1.2 * radius / rod * samples));
    curve.measure();
    // Compensates equally at both ends for the length that rounding off removes.
    for (std::uint32_t i = 0; i < made.rings(); ++i)
      made.centres[i] = curve.at(0.5 * (curve.size() - rod) + rod * double(i) / double(made.rings() - 1));
    // Twist becomes writhe: turns of the helix are taken from those of the rod.
    made.transport({0, 1, 0}, twist * smooth(done / 0.5) - 2 * pitch_turns * depth);
    made.append();
  }
  return made.mesh;
}

io::AnimatedMesh tightening_knot(const AgeingConfig& config) {
  constexpr double rope = 3, radius = 0.022, loose = 0.17, tight = 0.033;
  Tube made = tube("tightening-knot", config.triangles, rope, radius);
  made.mesh.keyframe_times = keyframe_times(config.keyframes, 30);
  const SeededNoise noise(config.seed);
  const double lean = 0.05 * noise.signed_unit(0);  // of the knot from the middle, as a share of the rope
  Curve curve;
  std::vector<Vec> knot;
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    const double done = share(k, config.keyframes);
    const double size = loose + (tight - loose) * smooth(1.1 * done);
    // A polynomial trefoil with ends (Shastri 1992), cut where its ends are nearly straight.
    constexpr int samples = 1500;
    constexpr double last = 2.12;
    curve.clear();
    knot.clear();
    for (int i = 0; i <= samples; ++i) {
      const double t = last * (2.0 * i / samples - 1), t2 = t * t;
      knot.push_back(Vec{t * (t2 - 3), t * (t2 * t2 - 10) * 0.25, t2 * (t2 - 4) * 0.5} * size);
    }
    // Its ends bend until they are pulled in opposite directions.
    constexpr int bend = 60;
    const double step = 4 * size / bend;
    const Vec from = unit(knot.front() - knot[1]), to = unit(knot.back() - knot[knot.size() - 2]);
    std::vector<Vec> ends[2] = {{knot.front()}, {knot.back()}};
    for (int i = 1; i <= bend; ++i) {
      const double part = smooth(double(i) / bend);
      ends[0].push_back(ends[0].back() + unit(from * (1 - part) + Vec{0, -part, 0}) * step);
      ends[1].push_back(ends[1].back() + unit(to * (1 - part) + Vec{0, part, 0}) * step);
    }
    for (std::size_t i = bend; i > 0; --i) curve.add(ends[0][i]);
    for (const Vec& p : knot) curve.add(p);
    for (std::size_t i = 1; i <= bend; ++i) curve.add(ends[1][i]);
    curve.measure();
    for (std::uint32_t i = 0; i < made.rings(); ++i)
      made.centres[i] =
          curve.at(0.5 * curve.size() + rope * (double(i) / double(made.rings() - 1) - 0.5 - lean));
    made.transport({1, 0, 0}, 0);
    made.append();
  }
  return made.mesh;
}

namespace {

/// A ball of yarn: its thread at the first keyframe, from the outer end inwards, as directions from the
/// ball's centre, and how far it is wound.
struct Windings {
  std::vector<Vec> outwards, along;  // unit vectors: to the thread, and its direction
  std::vector<double> radius;        // of the ball whose surface the thread is on

  /// `length` metres of thread in `rings` points; the ball is full.
  Windings(std::uint32_t rings, double length, double ball, std::uint64_t seed) {
    const SeededNoise noise(seed);
    const double phase = noise.signed_unit(0), sway = noise.signed_unit(1);
    double angle = 0;  // turns along great circles
    const double step = length / double(rings - 1);
    std::vector<double> angles;
    for (std::uint32_t i = 0; i < rings; ++i) {
      const double left = 1 - 0.97 * double(i) / double(rings - 1);
      // The volume of the ball is that of its thread.
      radius.push_back(ball * cube_edge(left, 1));
      angles.push_back(angle);
      angle += step / (2 * pi * radius.back());
    }
    for (std::uint32_t i = 0; i < rings; ++i) {
      outwards.push_back(wound(angles[i], phase, sway));
      along.push_back(wound(angles[i] + 1e-4, phase, sway) - wound(angles[i] - 1e-4, phase, sway));
      along.back() = unit(along.back() - outwards.back() * dot(along.back(), outwards.back()));
    }
  }

 private:
  /// A great circle whose plane turns slowly about two axes.
  static Vec wound(double turns, double phase, double sway) {
    const double c = cosine_of_turns(turns), s = sine_of_turns(turns);
    const double tilt = 0.25 * sine_of_turns(0.113 * turns + sway), about = 0.171 * turns + phase;
    const double ct = cosine_of_turns(tilt), st = sine_of_turns(tilt);
    const double ca = cosine_of_turns(about), sa = sine_of_turns(about);
    const Vec tilted{c, ct * s, st * s};
    return {ca * tilted.x - sa * tilted.z, tilted.y, sa * tilted.x + ca * tilted.z};
  }
};

/// The way of the ball on the floor: a rose curve of five petals.
void add_way(Curve& curve, double size, double turned) {
  constexpr int samples = 6000;
  for (int i = 0; i <= samples; ++i) {
    const double turns = double(i) / samples;
    const double r = size * (0.62 + 0.38 * cosine_of_turns(5 * turns * 2 / 3 + 0.5)), at = 2 * turns + turned;
    curve.add({r * cosine_of_turns(at), r * sine_of_turns(at), 0});
  }
}

/// Makes one ball of yarn; its way begins at an angle, in turns.
io::AnimatedMesh unrolling_yarn(const AgeingConfig& config, double begin) {
  check_triangles(config.triangles, "yarn");
  constexpr double ball = 0.15, fill = 0.55;
  // Five sides, at least 24 rings a winding, up to 30 windings; a longer thread is a thinner one.
  const std::uint32_t sides = config.triangles < 4000 ? 4 : 5;
  const std::uint32_t rings = std::max(8u, std::uint32_t(double(config.triangles) / (2.0 * sides) + 0.5));
  const double turns = std::max(1.5, std::min(30.0, double(rings) / 24));
  const double thread = turns * 2 * pi * ball * 0.75;
  const double radius = std::min(0.25 * ball, std::sqrt(4.0 / 3 * ball * ball * ball * fill / thread));
  Tube made("yarn", rings, sides, radius);
  made.mesh.keyframe_times = keyframe_times(config.keyframes, 12);
  const Windings wound(rings, thread, ball, config.seed);
  Curve way;
  add_way(way, thread / 9.5, begin);
  way.measure();
  const double step = thread / double(rings - 1);
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    const double done = share(k, config.keyframes);
    const double off = 0.9 * thread * (0.35 * done * done + 0.65 * smooth(done)) + 2 * step;  // unrolled
    const auto leaving = std::min(rings - 1, std::uint32_t(off / step));
    // The ball's frame where the thread leaves it lies on the way: the ball rolls without slipping.
    const Vec p = wound.outwards[leaving], d = wound.along[leaving], a = cross(p, d);
    const Vec here = way.at(double(leaving) * step),
              ahead = unit(way.at(double(leaving) * step + 1e-3) - here);
    const Vec down{0, 0, -1}, side = cross(down, ahead);
    const double ball_now = wound.radius[leaving];
    const Vec centre = here + Vec{0, 0, ball_now + radius};
    const auto placed = [&](const Vec& v) { return down * dot(v, p) + ahead * dot(v, d) + side * dot(v, a); };
    for (std::uint32_t i = 0; i < rings; ++i) {
      if (i < leaving) {
        made.centres[i] = way.at(double(i) * step) + Vec{0, 0, radius};
        made.normals[i] = down;
      } else {
        made.normals[i] = placed(wound.outwards[i]);
        made.centres[i] = centre + made.normals[i] * wound.radius[i];
      }
    }
    made.append();
  }
  return made.mesh;
}

}  // namespace

std::pair<io::AnimatedMesh, io::AnimatedMesh> unrolling_yarns(const AgeingConfig& config,
                                                              std::uint32_t second_triangles) {
  AgeingConfig first = config, second = config;
  first.seed = 2 * config.seed;
  second.seed = 2 * config.seed + 1;
  second.triangles = second_triangles;
  const double begin = SeededNoise(config.seed).signed_unit(0);
  return {unrolling_yarn(first, begin), unrolling_yarn(second, begin + 0.37)};
}

}  // namespace kbvh::scenes
