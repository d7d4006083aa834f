#pragma once
#include <cstdint>
#include <vector>

#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// The motion of one body as few displacement fields, found from its keyframes: the position of vertex v at
/// keyframe k is exactly
///   translation[k] + rest[v] + sum over modes m of coordinate[k][m] * shape[m][v] + remainder[k][v],
/// in real numbers, where the remainder is what the modes leave, roundings included. The shapes are the
/// principal components of the keyframes without their translations (method of snapshots, Sirovich 1987).
/// Between keyframes all coordinates, and the remainder, are interpolated linearly, as positions are: the
/// model is as exact between keyframes as at them. Units: those of the scene.
template <class S>
struct ReducedModel {
  /// Sets how many modes a model gets: the fewest for which the root mean square of the remainder, over all
  /// vertices and keyframes, is at most `tolerance`; but at most `most_modes`.
  struct Settings {
    std::uint32_t most_modes = 16;
    double tolerance = 0;  ///< a length
  };
  /// The coordinates at one time, with bounds on magnitudes that hold throughout the segment.
  struct Coordinates {
    double translation[3];
    std::vector<double> modes;
    double remainder;  ///< the remainder of vertex v lies between remainder * low[v] and remainder * high[v]
    double translated[3];  ///< bounds the magnitude of the translation
    /// Bounds the magnitudes over the segment of its step, of all modes' displacements and of the remainder,
    /// together.
    double displaced;
  };

  std::uint32_t mode_count = 0;
  std::vector<S> rest;                 ///< [vertex][3], and one scalar of padding
  std::vector<std::vector<S>> shapes;  ///< [mode], as `rest`
  /// Ranges of the remainder per unit of its size, over all keyframes; as `rest`. In exact numbers the
  /// remainder exceeds them by less than mode_count + 6 units of rounding of the terms' magnitudes.
  std::vector<S> low, high;
  double rms = 0;  ///< root mean square of the remainder's length

  /// Makes the model of a body without vertices' own plans. O(vertices x keyframes x (samples + modes)), for
  /// at most `samples` keyframes from which shapes are taken.
  ReducedModel(const FlightPlans<S>& plans, const Settings& settings);

  /// Computes the coordinates at a time; `out.modes` keeps its memory. O(modes), and a search for the
  /// segment.
  void at(const FlightPlans<S>& plans, double t, Coordinates& out) const;
  /// Discards the fields, once the ranges below nodes are known; `at` still works.
  void forget_fields();
  std::size_t bytes() const;

  static constexpr std::size_t samples = 64;

 private:
  void measure();
  std::size_t row() const { return 4 + std::size_t(mode_count); }
  /// [keyframe]: translation x, y, z, size of the remainder, modes.
  std::vector<double> coordinates_;
  double remainder_largest_ = 0;
  std::vector<double> shape_largest_;  ///< [mode]
};

extern template struct ReducedModel<float>;
extern template struct ReducedModel<double>;

}  // namespace kbvh
