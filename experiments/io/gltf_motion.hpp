#pragma once
#include <array>
#include <string>
#include <vector>

#include "experiments/io/gltf_document.hpp"

namespace kbvh::io::gltf {

/// Three rows of four: x -> linear * x + translation.
struct Affine {
  std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

  std::array<double, 3> apply(const double* p) const {
    std::array<double, 3> out;
    for (std::size_t r = 0; r < 3; ++r)
      out[r] = m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3];
    return out;
  }
};

Affine operator*(const Affine& a, const Affine& b);

/// Returns the affine part of a 4x4 matrix stored column by column.
Affine affine_of(const double* columns);

/// Values over time of one property of one node.
class Track {
 public:
  /// Reads and checks the sampler of a channel; `width` numbers make a value (3, 4, or the number of morph
  /// targets). Throws InputError if the counts do not fit, or times decrease, or are equal with different
  /// values.
  Track(const Document& document, const Channel& channel, std::size_t width);

  const std::vector<double>& times() const { return times_; }  ///< strictly increasing
  std::size_t merged() const { return merged_; }               ///< keys that repeated their predecessor

  /// Returns the keys at which the value jumps.
  std::vector<double> jumps() const;

  /// Computes the value at a time, held constant beyond the ends. `out` has `width` numbers. Rotations have
  /// length one.
  void evaluate(double time, double* out) const;

 private:
  const double* value(std::size_t key) const;
  void interpolate(std::size_t key, double time, double* out) const;

  Interpolation interpolation_;
  Path path_;
  std::size_t width_;
  std::vector<double> times_, values_;
  std::size_t merged_ = 0;
};

/// The pose of all nodes under one animation (or none).
class Pose {
 public:
  /// Checks all channels of `animation` (may be null: the file's own pose).
  Pose(const Document& document, const Animation* animation);

  /// Returns the union of all key times, increasing. Empty without an animation.
  const std::vector<double>& times() const { return times_; }

  /// Returns those of them at which a property jumps, increasing.
  const std::vector<double>& jumps() const { return jumps_; }

  /// Returns whether the animation changes the morph weights of a node.
  bool morphs(std::size_t node) const;

  /// Returns the number of sampler keys that repeated their predecessor in time and value.
  std::size_t merged_keyframes() const;

  /// Moves all nodes to `time`.
  void evaluate(double time);

  const Affine& global(std::size_t node) const { return globals_[node]; }                ///< node to scene
  const std::vector<double>& weights(std::size_t node) const { return weights_[node]; }  ///< of morph targets

 private:
  struct Bound {
    Path path;
    std::uint32_t node;
    Track track;
  };

  const Document* document_;
  std::vector<Bound> tracks_;
  std::vector<double> times_, jumps_;
  std::vector<Node> nodes_;  // as in the file, with the animated properties of the last evaluate()
  std::vector<std::vector<double>> weights_;
  std::vector<Affine> globals_;
};

}  // namespace kbvh::io::gltf
