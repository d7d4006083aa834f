#include "experiments/scenes/garment_solver.hpp"

#include <algorithm>
#include <cmath>

#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::dot;
using cloth::length;
using cloth::Vec;

namespace {

Gait gait_of(const GarmentConfig& config) {
  const SeededNoise noise(config.seed);
  Gait gait;
  if (config.kind == GarmentKind::dress) {
    gait.hip_swing = 17;
    gait.metres_per_second = 1.0;
  }
  gait.phase = 0.08 * noise.signed_unit(0);
  gait.cycles_per_second *= 1 + 0.04 * noise.signed_unit(1);
  gait.hip_swing *= 1 + 0.08 * noise.signed_unit(2);
  gait.arm_swing *= 1 + 0.15 * noise.signed_unit(3);
  return gait;
}

}  // namespace

WalkingFigure::WalkingFigure(const GarmentConfig& config)
    : shape_(config.kind == GarmentKind::shirt ? man() : woman()),
      gait_(gait_of(config)),
      walker_(shape_, gait_) {}

double WalkingFigure::walking(double t) {
  const double s = std::min(1.0, std::max(0.0, (t + lead_in - 0.1) / 0.8));
  return s * s * s * (s * (s * 6 - 15) + 10);
}

void WalkingFigure::move_to(double t) {
  walker_.mark();
  walker_.pose(t, walking(t));
}

Guide::Guide(const GarmentPattern& coarse, const GarmentPattern& fine)
    : coarse_(coarse), mean_(coarse.rest.size()), weight_(coarse.rest.size(), 0.0) {
  vertices_.reserve(fine.rest.size());
  for (const GarmentPattern::Place& place : fine.places) {
    const GarmentPattern::Piece &from = fine.pieces[place.piece], &to = coarse.pieces[place.piece];
    // Rows and columns between corresponding marks correspond linearly.
    std::size_t m = 0;
    while (m + 2 < from.marks.size() && place.column >= from.marks[m + 1]) ++m;
    const double share = double(place.column - from.marks[m]) / double(from.marks[m + 1] - from.marks[m]);
    const double column = double(to.marks[m]) + share * double(to.marks[m + 1] - to.marks[m]);
    const double row = double(place.row) * double(to.rows) / double(from.rows);
    Vertex vertex{};
    vertex.piece = place.piece;
    vertex.column = std::min(std::uint32_t(column), to.columns - 1);
    vertex.row = std::min(std::uint32_t(row), to.rows - 1);
    vertex.u = column - double(vertex.column);
    vertex.v = row - double(vertex.row);
    const std::uint32_t next = (vertex.column + 1) % to.stride();
    vertex.corners = {to.at(vertex.row, vertex.column), to.at(vertex.row, next),
                      to.at(vertex.row + 1, vertex.column), to.at(vertex.row + 1, next)};
    vertex.weights = {(1 - vertex.u) * (1 - vertex.v), vertex.u * (1 - vertex.v), (1 - vertex.u) * vertex.v,
                      vertex.u * vertex.v};
    for (std::size_t i = 0; i < 4; ++i) weight_[vertex.corners[i]] += vertex.weights[i];
    vertices_.push_back(vertex);
  }
}

void Guide::interpolate(const std::vector<Vec>& coarse, std::vector<Vec>& fine) const {
  const auto spline = [](const std::array<Vec, 4>& p, double t) {
    // Catmull-Rom.
    const double t2 = t * t, t3 = t2 * t;
    return p[0] * (0.5 * (-t3 + 2 * t2 - t)) + p[1] * (0.5 * (3 * t3 - 5 * t2 + 2)) +
           p[2] * (0.5 * (-3 * t3 + 4 * t2 + t)) + p[3] * (0.5 * (t3 - t2));
  };
  fine.resize(vertices_.size());
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const Vertex& vertex = vertices_[i];
    const GarmentPattern::Piece& piece = coarse_.pieces[vertex.piece];
    const auto along_row = [&](std::uint32_t row) {
      const std::uint32_t n = piece.columns, c = vertex.column;
      const auto at = [&](std::uint32_t column) { return coarse[piece.at(row, column)]; };
      if (piece.closed)
        return spline({at((c + n - 1) % n), at(c), at((c + 1) % n), at((c + 2) % n)}, vertex.u);
      const Vec a = at(c), b = at(c + 1);
      return spline({c > 0 ? at(c - 1) : a * 2 - b, a, b, c + 2 <= n ? at(c + 2) : b * 2 - a}, vertex.u);
    };
    const std::uint32_t r = vertex.row;
    const Vec a = along_row(r), b = along_row(r + 1);
    fine[i] = spline(
        {r > 0 ? along_row(r - 1) : a * 2 - b, a, b, r + 2 <= piece.rows ? along_row(r + 2) : b * 2 - a},
        vertex.v);
  }
}

void Guide::hold(std::vector<Vec>& x, const std::vector<Vec>& wanted) {
  std::fill(mean_.begin(), mean_.end(), Vec{});
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec off = x[i] - wanted[i];
    const Vertex& vertex = vertices_[i];
    for (std::size_t k = 0; k < 4; ++k) mean_[vertex.corners[k]] += off * vertex.weights[k];
  }
  for (std::size_t c = 0; c < mean_.size(); ++c)
    if (weight_[c] > 0.0) mean_[c] = mean_[c] * (1.0 / weight_[c]);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vertex& vertex = vertices_[i];
    for (std::size_t k = 0; k < 4; ++k) x[i] -= mean_[vertex.corners[k]] * vertex.weights[k];
  }
}

GarmentSolver::GarmentSolver(const GarmentConfig& config, const GarmentPattern& pattern, Layers layers)
    : config_(config),
      pattern_(pattern),
      mass_(config.area_density * pattern.spacing * pattern.spacing),
      layer_distance_(layers == Layers::apart ? config.layer_distance * pattern.spacing : 0.0),
      x_(pattern.rest),
      previous_(x_.size()),
      v_(x_.size()),
      smooth_(x_.size()),
      layers_(layer_distance_),
      clear_(x_.size()) {}

void GarmentSolver::step(WalkingFigure& figure, double t, double dt, std::uint32_t sweeps, Guide* guide,
                         const std::vector<Vec>& wanted) {
  figure.move_to(t + dt);
  apply_forces(dt, figure.metres_per_second() * WalkingFigure::walking(t));
  smooth_velocities(dt);
  for (std::size_t p = 0; p < x_.size(); ++p) {
    previous_[p] = x_[p];
    x_[p] += v_[p] * dt;
  }
  for (std::uint32_t sweep = 0; sweep < sweeps; ++sweep) {
    if (guide != nullptr) guide->hold(x_, wanted);
    solve_bending(dt);
    solve_threads(dt);
  }
  // Threads and bending hold vertices that are near each other in the pattern.
  const double near = 1.6 * layer_distance_;
  layers_.solve(x_, previous_, config_.friction, [&](std::uint32_t p, std::uint32_t q) {
    const Vec d = pattern_.rest[q] - pattern_.rest[p];
    return dot(d, d) < near * near;
  });
  // Last, so that no keyframe leaves a vertex inside the solid.
  solve_figure(figure.walker());
  for (std::size_t p = 0; p < x_.size(); ++p) v_[p] = (x_[p] - previous_[p]) * (1.0 / dt);
}

void GarmentSolver::apply_forces(double dt, double wind) {
  for (std::size_t p = 0; p < x_.size(); ++p) {
    Vec& v = v_[p];
    v.z -= dt * cloth::gravity;
    const auto& [left, right, below, above] = pattern_.neighbours[p];
    const Vec n = cloth::cross(x_[right] - x_[left], x_[above] - x_[below]);
    const double square = dot(n, n);
    if (!(square > 0.0)) continue;
    // The figure walks on the spot, so the air moves towards it.
    const double across = (dot(v, n) + wind * n.x) / std::sqrt(square);
    v -= n * (cloth::dragged_speed(across, config_.air_drag, dt) / std::sqrt(square));
  }
}

void GarmentSolver::smooth_velocities(double dt) {
  const double share = std::min(0.2, config_.viscosity * dt / (pattern_.spacing * pattern_.spacing));
  if (!(share > 0.0)) return;
  for (std::size_t p = 0; p < x_.size(); ++p) {
    const auto& [left, right, below, above] = pattern_.neighbours[p];
    const Vec sum = v_[left] + v_[right] + v_[below] + v_[above] - v_[p] * 4.0;
    smooth_[p] = v_[p] + sum * share;
  }
  v_.swap(smooth_);
}

void GarmentSolver::solve_threads(double dt) {
  const double thread = mass_ / (config_.stretch_stiffness * dt * dt);
  const double diagonal = mass_ / (config_.shear_stiffness * dt * dt);
  for (const auto& d : pattern_.diagonals) cloth::solve_distance(x_[d.a], x_[d.b], d.rest, diagonal);
  for (const auto& d : pattern_.threads) cloth::solve_distance(x_[d.a], x_[d.b], d.rest, thread);
}

void GarmentSolver::solve_bending(double dt) {
  if (!(config_.bending_rigidity > 0.0)) return;
  for (const auto& b : pattern_.bends) {
    const double softness = mass_ * b.spacing * b.spacing / (config_.bending_rigidity * dt * dt);
    cloth::solve_bend(x_[b.a], x_[b.b], x_[b.c], 1.0 / (6.0 + softness));
  }
}

void GarmentSolver::solve_figure(const Walker& walker) {
  constexpr double reach = 0.05;
  travel_ += walker.travel();
  for (std::size_t p = 0; p < x_.size(); ++p) {
    Vec& x = x_[p];
    Clearance& clear = clear_[p];
    const double left = clear.distance - (travel_ - clear.travel);
    const Vec way = x - clear.at;
    if (left > 0.0 && dot(way, way) < left * left) continue;
    Walker::Contact near = walker.nearest(x, reach);
    if (near.distance < 0.0) {
      x -= near.normal * near.distance;
      cloth::resist_sliding(x, x - previous_[p] - near.moved, near.normal, -near.distance, config_.friction);
      // One projection does not suffice on curved surfaces or where two parts of the figure meet.
      for (int again = 0; again < 3; ++again) {
        near = walker.nearest(x, reach);
        if (!(near.distance < 0.0)) break;
        x -= near.normal * near.distance;
      }
    }
    clear = {x, std::max(0.0, near.distance), travel_};
  }
}

}  // namespace kbvh::scenes
