#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/median.hpp"
#include "core/contract/strategy.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// A choice's knowledge about the motion of a scene: the steps of some vertices, in sides of leaves.
template <class S>
class ObservedMotion {
 public:
  static constexpr std::uint32_t samples = 24;       ///< sampled vertices of a body, or pairs
  static constexpr std::uint32_t all_samples = 256;  ///< over all moving bodies, but at least some of each

  /// Measures the hierarchies: the median side of leaf boxes, and the number of vertices in leaves.
  ObservedMotion(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies)
      : scene_(scene), motion_(motion), velocities_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) measure(topologies[body], body);
    if (moving_ > 0) of_body_ = std::clamp(all_samples / moving_, 3u, samples);
  }

  /// Returns the vertices that a refit reads in a frame.
  double reads() const { return reads_; }
  /// Returns the number of primitives of moving bodies.
  double primitives() const { return primitives_; }
  /// Returns the number of bodies that move.
  std::uint32_t moving_bodies() const { return moving_; }

  /// Reads the plans. `step`: the length of a frame, in seconds. `touching`: some candidates of the last
  /// frame.
  void observe(double step, std::span<const PrimitivePair> touching, Observed& seen) {
    const bool plans_change = seen.changes_per_frame != 0;
    for (std::uint32_t body = 0; body < scene_.body_count(); ++body) sample(body, plans_change);
    const double spread = seen.spread;
    seen.step = seen.spread = 0;
    // Takes some of many pairs of bodies: similar bodies have similar largest steps.
    const auto pairs = scene_.pairs();
    seen.many_bodies = pairs.size() > many_pairs;
    const std::size_t apart = (pairs.size() + most_pairs - 1) / most_pairs;
    for (std::size_t i = 0; i < pairs.size(); i += apart) {
      pass(pairs[i].first, pairs[i].second, step, seen);
      pass(pairs[i].second, pairs[i].first, step, seen);
    }
    if (seen.step == 0) seen.spread = spread;  // a body that rests now, or whose moving part was not sampled
    seen.slide = touching.empty() ? seen.step : slide(touching, plans_change) * step;
  }

  std::size_t bytes() const {
    return leaf_size_.capacity() * sizeof(double) + velocities_.capacity() * sizeof(Velocities);
  }

 private:
  static constexpr std::size_t many_pairs = 1024, most_pairs = 128;  ///< pairs of bodies; the number sampled
  struct Velocities {
    std::uint32_t count = 0;  ///< none: the body rests
    double of[samples][3] = {}, mean[3] = {};
  };

  void measure(const Topology& topology, std::uint32_t body) {
    const Primitives& primitives = scene_.primitives(body);
    double reads = 0;
    std::vector<double> sides;
    std::vector<std::uint32_t> unique;
    for (const TopologyNode& node : topology.nodes) {
      if (!node.is_leaf()) continue;
      Box<S> box;
      unique.clear();
      for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
        for (const std::uint32_t v : primitives[topology.primitives[k]]) {
          box.extend(motion_.position(body, v));
          unique.push_back(v);
        }
      std::sort(unique.begin(), unique.end());
      reads += double(std::unique(unique.begin(), unique.end()) - unique.begin());
      double side = 0;
      for (int axis = 0; axis < 3; ++axis) side += (double(box.upper[axis]) - double(box.lower[axis])) / 3;
      sides.push_back(side);
    }
    leaf_size_.push_back(median(sides));
    if (!scene_.moving(body)) return;
    ++moving_;
    reads_ += reads;
    primitives_ += double(topology.primitives.size());
  }

  /// Samples the current velocities of some of a body's vertices.
  void sample(std::uint32_t body, bool plans_change) {
    Velocities& seen = velocities_[body];
    const std::uint32_t count = scene_.vertex_count(body);
    seen = {};
    if (count == 0 || (!scene_.moving(body) && !plans_change)) return;
    seen.count = std::min(of_body_, count);
    for (std::uint32_t i = 0; i < seen.count; ++i) {
      // Spreads the samples by the golden ratio: even steps could hit the same place in every row of a grid.
      const std::uint32_t share = 0x9e3779b9u * i;  // of 2^32
      const auto vertex = std::uint32_t(std::uint64_t(share) * count >> 32);
      for (int axis = 0; axis < 3; ++axis) {
        seen.of[i][axis] = velocity(body, vertex, axis, plans_change);
        seen.mean[axis] += seen.of[i][axis] / seen.count;
      }
    }
  }
  double velocity(std::uint32_t body, std::uint32_t vertex, int axis, bool plans_change) const {
    if (!scene_.moving(body) && !plans_change) return 0;
    const Piece<S> piece = motion_.piece(body, vertex, axis);
    return piece.kind == PieceKind::ray ? double(piece.x1)
                                        : (double(piece.x1) - double(piece.x0)) / (piece.t1 - piece.t0);
  }
  /// Returns the mean velocity of primitives relative to their candidates.
  double slide(std::span<const PrimitivePair> touching, bool plans_change) const {
    double sum = 0;
    for (const PrimitivePair& pair : touching) {
      const std::uint32_t a = scene_.primitives(pair.body_a)[pair.primitive_a][0];
      const std::uint32_t b = scene_.primitives(pair.body_b)[pair.primitive_b][0];
      double way[3];
      for (int axis = 0; axis < 3; ++axis)
        way[axis] =
            velocity(pair.body_a, a, axis, plans_change) - velocity(pair.body_b, b, axis, plans_change);
      const double leaf = std::max(leaf_size_[pair.body_a], leaf_size_[pair.body_b]);
      if (leaf > 0) sum += std::hypot(way[0], way[1], way[2]) / leaf;
    }
    return sum / double(touching.size());
  }
  /// Measures how a body's vertices move relative to another body as a whole. Common motion does not count,
  /// because moving bounds contain it.
  void pass(std::uint32_t body, std::uint32_t other, double step, Observed& seen) const {
    const Velocities &own = velocities_[body], &others = velocities_[other];
    if (own.count == 0 || leaf_size_[body] <= 0) return;
    double sum = 0, differences = 0;
    for (std::uint32_t i = 0; i < own.count; ++i) {
      sum += length(own.of[i], others.mean);
      differences += length(own.of[i], own.mean);
    }
    seen.step = std::max(seen.step, sum / own.count * step / leaf_size_[body]);
    if (sum > 0) seen.spread = std::max(seen.spread, std::min(1.0, differences * differences / (sum * sum)));
  }
  static double length(const double (&a)[3], const double (&b)[3]) {
    return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  }

  SceneView<S> scene_;
  SegmentMotion<S> motion_;
  std::vector<double> leaf_size_;  ///< [body]
  double reads_ = 0, primitives_ = 0;
  std::uint32_t moving_ = 0;            ///< number of moving bodies
  std::uint32_t of_body_ = samples;     ///< number of sampled vertices of a body
  std::vector<Velocities> velocities_;  ///< [body], per second
};

}  // namespace kbvh
