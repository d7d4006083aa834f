#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "experiments/scenes/garment.hpp"

namespace kbvh::scenes {

/// The walking figure of a config; time 0 is the first keyframe.
class WalkingFigure {
 public:
  explicit WalkingFigure(const GarmentConfig& config);
  static constexpr double lead_in = 1.2;  ///< seconds before the first keyframe, from the rest pose

  const FigureShape& shape() const { return shape_; }
  const Walker& walker() const { return walker_; }
  double metres_per_second() const { return gait_.metres_per_second; }
  /// Stores the current pose and takes that of time t.
  void move_to(double t);
  /// Returns the blend from the rest pose (0) to the gait (1).
  static double walking(double t);

 private:
  FigureShape shape_;
  Gait gait_;
  Walker walker_;
};

/// Interpolates positions between the keyframes of a coarser simulation of the same garment, for every vertex
/// of a finer one.
class Guide {
 public:
  Guide(const GarmentPattern& coarse, const GarmentPattern& fine);

  /// Places all fine vertices on the smooth surface through the coarse ones.
  void interpolate(const std::vector<cloth::Vec>& coarse, std::vector<cloth::Vec>& fine) const;
  /// Removes from x - wanted, and so from x, the part that remains after averaging over the coarse squares.
  void hold(std::vector<cloth::Vec>& x, const std::vector<cloth::Vec>& wanted);

 private:
  struct Vertex {
    std::array<std::uint32_t, 4> corners;  // of the coarse square that contains it
    std::array<double, 4> weights;
    std::uint32_t piece, row, column;
    double u, v;  // in the square
  };
  const GarmentPattern& coarse_;
  std::vector<Vertex> vertices_;
  std::vector<cloth::Vec> mean_;
  std::vector<double> weight_;
};

/// Simulates cloth on the figure.
class GarmentSolver {
 public:
  /// Starts at rest. `layers`: whether layers of cloth repel each other.
  enum class Layers : std::uint8_t { apart, ignored };
  GarmentSolver(const GarmentConfig& config, const GarmentPattern& pattern, Layers layers);

  const std::vector<cloth::Vec>& positions() const { return x_; }
  void start(const std::vector<cloth::Vec>& x, const std::vector<cloth::Vec>& v) {
    x_ = x;
    v_ = v;
  }
  /// Advances the figure and the cloth from t to t + dt, in `sweeps` sweeps over all constraints. With a
  /// guide, averages are constrained to `wanted`, the guide's positions at t + dt.
  void step(WalkingFigure& figure, double t, double dt, std::uint32_t sweeps, Guide* guide = nullptr,
            const std::vector<cloth::Vec>& wanted = {});

 private:
  void apply_forces(double dt, double wind);
  void smooth_velocities(double dt);
  void solve_threads(double dt);
  void solve_bending(double dt);
  void solve_figure(const Walker& walker);

  const GarmentConfig& config_;
  const GarmentPattern& pattern_;
  double mass_, layer_distance_;
  std::vector<cloth::Vec> x_, previous_, v_, smooth_;
  cloth::LayerContacts layers_;
  // A lower bound on each vertex's distance to the figure: at least `distance` when it was measured, at that
  // travel of the figure.
  struct Clearance {
    cloth::Vec at;
    double distance = -1, travel = 0;
  };
  std::vector<Clearance> clear_;
  double travel_ = 0;
};

}  // namespace kbvh::scenes
