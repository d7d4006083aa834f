#include "experiments/scenes/tablecloth.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/interruption.hpp"
#include "experiments/scenes/mesh_parts.hpp"

namespace kbvh::scenes {
namespace {

/// Part of every cache key: raise it with every change that can alter a bit of the result.
constexpr int solver_version = 3;

using cloth::dot;
using cloth::length;
using cloth::Vec;

/// The signed distance to the solid that stops the cloth, and its outward unit normal.
class TableSolid {
 public:
  explicit TableSolid(const TableclothConfig& config)
      : centre_{config.table.centre_x, config.table.centre_y,
                config.table.top + config.rest_gap - 0.5 * config.table.thickness},
        inner_radius_(config.table.radius - config.rim_bite - config.table.rim_radius),
        inner_half_height_(0.5 * config.table.thickness - config.table.rim_radius),
        rim_radius_(config.table.rim_radius) {}

  double distance(const Vec& point, Vec& normal) const {
    const Vec p = point - centre_;
    const double r = std::sqrt(p.x * p.x + p.y * p.y);
    const double qr = r - inner_radius_;
    const double qz = std::fabs(p.z) - inner_half_height_;
    const double vertical = p.z < 0 ? -1.0 : 1.0;
    double nr = 0, nz = 0, d = 0;
    if (qr > 0 && qz > 0) {
      d = std::sqrt(qr * qr + qz * qz);
      nr = qr / d;
      nz = qz / d;
    } else if (qr > qz) {
      d = qr;
      nr = 1;
    } else {
      d = qz;
      nz = 1;
    }
    const double along = r > 0 ? nr / r : 0.0;
    normal = {p.x * along, p.y * along, vertical * nz};
    return d - rim_radius_;
  }

  /// Returns false for points that are too far from the solid's axis or height to touch it.
  bool may_touch(const Vec& point) const {
    const double reach = inner_radius_ + rim_radius_;
    const double dx = point.x - centre_.x, dy = point.y - centre_.y;
    return std::fabs(point.z - centre_.z) < inner_half_height_ + rim_radius_ &&
           dx * dx + dy * dy < reach * reach;
  }

 private:
  Vec centre_;
  double inner_radius_, inner_half_height_, rim_radius_;
};

class ClothSolver {
 public:
  ClothSolver(const TableclothConfig& config, std::uint32_t squares)
      : config_(config),
        squares_(squares),
        row_(squares + 1),
        spacing_(config.side / double(squares)),
        table_(config),
        x_(std::size_t(row_) * row_),
        previous_(x_.size()),
        v_(x_.size()),
        smooth_(x_.size()),
        layers_(config.layer_distance * spacing_) {
    place();
  }

  const std::vector<Vec>& positions() const { return x_; }

  void advance_keyframe() {
    const std::uint32_t count = cloth::steps_per_keyframe(config_, spacing_);
    const double dt = 1.0 / (config_.keyframes_per_second * double(count));
    for (std::uint32_t s = 0; s < count; ++s) {
      Interruptible::check();
      step(dt);
    }
  }

 private:
  void place();
  void step(double dt);
  void apply_forces(double dt);
  void smooth_velocities(double dt);
  void solve_threads(double dt);
  void solve_bending(double dt);
  void solve_layers();
  void solve_table();

  std::size_t at(std::uint32_t i, std::uint32_t j) const { return std::size_t(j) * row_ + i; }

  void solve_distance(std::size_t a, std::size_t b, double rest, double softness) {
    cloth::solve_distance(x_[a], x_[b], rest, softness);
  }

  const TableclothConfig& config_;
  std::uint32_t squares_, row_;
  double spacing_;
  TableSolid table_;
  std::vector<Vec> x_, previous_, v_, smooth_;
  cloth::LayerContacts layers_;
};

/// Sets the start: flat, slightly rotated, tilted, shifted and uneven, drawn from the seed.
void ClothSolver::place() {
  const SeededNoise noise(config_.seed);
  std::uint64_t draws = 0;
  const auto draw = [&](double amplitude) { return amplitude * noise.signed_unit(draws++); };
  // Rotation from the tangent of half of the angle: no trigonometry.
  const double half_yaw = draw(0.08);
  const double c = (1 - half_yaw * half_yaw) / (1 + half_yaw * half_yaw);
  const double s = 2 * half_yaw / (1 + half_yaw * half_yaw);
  const double slope_x = draw(0.02), slope_y = draw(0.02);
  const double tilt = std::sqrt(1.0 + slope_x * slope_x + slope_y * slope_y);
  const double shift_x = draw(0.015), shift_y = draw(0.015);
  // Unevenness as waves across the cloth: the same at every resolution, unlike noise per vertex.
  struct Wave {
    double kx, ky, phase, height;
  };
  Wave waves[12];
  for (Wave& wave : waves) {
    wave = {draw(3.0), draw(3.0), draw(1.0), 0.0};
    wave.height = 0.0015 / (1.0 + std::sqrt(wave.kx * wave.kx + wave.ky * wave.ky));
  }
  for (std::uint32_t j = 0; j < row_; ++j)
    for (std::uint32_t i = 0; i < row_; ++i) {
      const double u = config_.side * (double(i) / double(squares_) - 0.5);
      const double w = config_.side * (double(j) / double(squares_) - 0.5);
      double uneven = 0;
      for (const Wave& wave : waves)
        uneven += wave.height * sine_of_turns(wave.kx * u + wave.ky * w + wave.phase);
      // Shortened by the tilt, so that threads start at rest length to first order.
      const double x = (c * u - s * w) / tilt, y = (s * u + c * w) / tilt;
      x_[at(i, j)] = {config_.table.centre_x + shift_x + x, config_.table.centre_y + shift_y + y,
                      config_.table.top + config_.drop_height + slope_x * x + slope_y * y + uneven};
    }
  // Keyframes hold floats; the simulation starts from these values.
  for (Vec& p : x_) p = {rounded_to_float(p.x), rounded_to_float(p.y), rounded_to_float(p.z)};
}

void ClothSolver::step(double dt) {
  apply_forces(dt);
  smooth_velocities(dt);
  for (std::size_t p = 0; p < x_.size(); ++p) {
    previous_[p] = x_[p];
    x_[p] += v_[p] * dt;
  }
  solve_threads(dt);
  solve_bending(dt);
  solve_layers();
  // Last, so that no keyframe leaves a vertex inside the solid.
  solve_table();
  for (std::size_t p = 0; p < x_.size(); ++p) v_[p] = (x_[p] - previous_[p]) * (1.0 / dt);
}

void ClothSolver::apply_forces(double dt) {
  for (std::uint32_t j = 0; j < row_; ++j) {
    const std::uint32_t below = j > 0 ? j - 1 : j, above = j < squares_ ? j + 1 : j;
    for (std::uint32_t i = 0; i < row_; ++i) {
      const std::uint32_t left = i > 0 ? i - 1 : i, right = i < squares_ ? i + 1 : i;
      Vec& v = v_[at(i, j)];
      v.z -= dt * cloth::gravity;
      const Vec n = cloth::cross(x_[at(right, j)] - x_[at(left, j)], x_[at(i, above)] - x_[at(i, below)]);
      const double square = dot(n, n);
      if (!(square > 0.0)) continue;
      const double across = dot(v, n) / std::sqrt(square);
      v -= n * (cloth::dragged_speed(across, config_.air_drag, dt) / std::sqrt(square));
    }
  }
}

void ClothSolver::smooth_velocities(double dt) {
  const double share = std::min(0.2, config_.viscosity * dt / (spacing_ * spacing_));
  if (!(share > 0.0)) return;
  for (std::uint32_t j = 0; j < row_; ++j)
    for (std::uint32_t i = 0; i < row_; ++i) {
      const std::size_t p = at(i, j);
      Vec sum;
      if (i > 0) sum += v_[p - 1] - v_[p];
      if (i < squares_) sum += v_[p + 1] - v_[p];
      if (j > 0) sum += v_[p - row_] - v_[p];
      if (j < squares_) sum += v_[p + row_] - v_[p];
      smooth_[p] = v_[p] + sum * share;
    }
  v_.swap(smooth_);
}

void ClothSolver::solve_threads(double dt) {
  // Every vertex has the mass of a full square, which makes the hem a seam of double thickness.
  const double mass = config_.area_density * spacing_ * spacing_;
  const double thread = mass / (config_.stretch_stiffness * dt * dt);
  const double diagonal = mass / (config_.shear_stiffness * dt * dt);
  const double diagonal_rest = spacing_ * std::sqrt(2.0);
  // Diagonals first and threads last, so that the stiffest constraints are corrected last. Constraints are
  // processed by colours of independent ones, so that no sweep drags the cloth towards one side.
  for (std::uint32_t colour = 0; colour < 2; ++colour)
    for (std::uint32_t j = colour; j < squares_; j += 2)
      for (std::uint32_t i = 0; i < squares_; ++i) {
        const std::uint32_t k = (j / 2) % 2 == 0 ? i : squares_ - 1 - i;
        solve_distance(at(k, j), at(k + 1, j + 1), diagonal_rest, diagonal);
        solve_distance(at(k + 1, j), at(k, j + 1), diagonal_rest, diagonal);
      }
  for (std::uint32_t colour = 0; colour < 2; ++colour)
    for (std::uint32_t j = 0; j < row_; ++j)
      for (std::uint32_t i = colour; i < squares_; i += 2)
        solve_distance(at(i, j), at(i + 1, j), spacing_, thread);
  for (std::uint32_t colour = 0; colour < 2; ++colour)
    for (std::uint32_t j = colour; j < squares_; j += 2)
      for (std::uint32_t i = 0; i < row_; ++i) solve_distance(at(i, j), at(i, j + 1), spacing_, thread);
}

void ClothSolver::solve_bending(double dt) {
  if (!(config_.bending_rigidity > 0.0)) return;
  // Energy 1/2 B (curvature)^2 per area, curvature = |a - 2 b + c| / spacing^2.
  const double mass = config_.area_density * spacing_ * spacing_;
  const double softness = mass * spacing_ * spacing_ / (config_.bending_rigidity * dt * dt);
  const double share = 1.0 / (6.0 + softness);
  const auto solve = [&](std::size_t a, std::size_t b, std::size_t c) {
    cloth::solve_bend(x_[a], x_[b], x_[c], share);
  };
  for (std::uint32_t j = 0; j < row_; ++j)
    for (std::uint32_t i = 1; i < squares_; ++i) solve(at(i - 1, j), at(i, j), at(i + 1, j));
  for (std::uint32_t j = 1; j < squares_; ++j)
    for (std::uint32_t i = 0; i < row_; ++i) solve(at(i, j - 1), at(i, j), at(i, j + 1));
}

void ClothSolver::solve_layers() {
  layers_.solve(x_, previous_, config_.friction, [this](std::uint32_t p, std::uint32_t q) {
    const std::int64_t di = std::int64_t(q % row_) - std::int64_t(p % row_);
    const std::int64_t dj = std::int64_t(q / row_) - std::int64_t(p / row_);
    return di >= -1 && di <= 1 && dj <= 1;  // of one square: held by its threads
  });
}

void ClothSolver::solve_table() {
  for (std::size_t p = 0; p < x_.size(); ++p) {
    Vec& x = x_[p];
    if (x.z < 0.0) {  // the floor
      x = {previous_[p].x, previous_[p].y, 0.0};
      continue;
    }
    if (!table_.may_touch(x)) continue;
    Vec n;
    const double d = table_.distance(x, n);
    if (!(d < 0.0)) continue;
    x -= n * d;
    cloth::resist_sliding(x, x - previous_[p], n, -d, config_.friction);
  }
}

void check(const TableclothConfig& c) {
  const auto check = [](double value, double lowest, double highest, const char* what) {
    cloth::check_range("tablecloth", value, lowest, highest, what);
  };
  check(double(c.triangles), 2, 1 << 24, "the number of triangles");
  check(double(c.keyframes), 1, 1e6, "the number of keyframes");
  check(c.keyframes_per_second, 1, 1e6, "the number of keyframes per second");
  check(c.side, 1e-3, 1e3, "the side");
  check(c.drop_height, 0.0, 1e3, "the drop height");
  cloth::check_cloth(c, check);
  check(c.rest_gap, -0.01, 0.01, "the rest gap");
  check(c.rim_bite, -0.01, 0.01, "the rim bite");
}

}  // namespace

std::vector<io::AnimatedMesh> simulate_tablecloth(const TableclothConfig& config, const Progress& progress) {
  check(config);
  const std::uint32_t squares = sheet_squares(config.triangles);
  std::vector<io::AnimatedMesh> bodies(2);
  io::AnimatedMesh& cloth = bodies[0];
  cloth = sheet(config.triangles, {0, 0, 0}, config.side);
  cloth.name = "tablecloth-" + std::to_string(cloth.primitive_count());
  cloth.keyframe_times = keyframe_times(config.keyframes, config.keyframes_per_second);
  cloth.positions.clear();
  cloth.positions.reserve(std::size_t(cloth.vertex_count) * 3 * config.keyframes);
  bodies[1] = round_table(config.table_triangles, config.table);

  ClothSolver solver(config, squares);
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    if (k > 0) solver.advance_keyframe();
    append_keyframe(cloth, solver.positions());
    if (progress) progress(double(k + 1) / double(config.keyframes));
  }
  return bodies;
}

std::string cache_key(const TableclothConfig& c) {
  cloth::ConfigHash hash;
  for (const std::uint64_t value :
       {std::uint64_t(solver_version), std::uint64_t(c.triangles), c.seed, std::uint64_t(c.keyframes),
        std::uint64_t(c.table_triangles), std::uint64_t(c.substeps_per_keyframe)})
    hash.add(value);
  for (const double value : {c.keyframes_per_second,
                             c.side,
                             c.drop_height,
                             c.area_density,
                             c.stretch_stiffness,
                             c.shear_stiffness,
                             c.bending_rigidity,
                             c.air_drag,
                             c.viscosity,
                             c.friction,
                             c.layer_distance,
                             c.rest_gap,
                             c.rim_bite,
                             c.table.centre_x,
                             c.table.centre_y,
                             c.table.radius,
                             c.table.top,
                             c.table.thickness,
                             c.table.rim_radius,
                             c.table.pedestal_radius,
                             c.table.base_radius})
    hash.add(value);
  return "tablecloth-v" + std::to_string(solver_version) + "-" + std::to_string(c.triangles) + "-seed" +
         std::to_string(c.seed) + "-" + std::to_string(c.keyframes) + "kf-" + hash.digits();
}

}  // namespace kbvh::scenes
