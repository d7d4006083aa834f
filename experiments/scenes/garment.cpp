#include "experiments/scenes/garment.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/interruption.hpp"
#include "experiments/scenes/garment_solver.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {
namespace {

using cloth::Vec;

/// Part of every cache key: raise it with every change that can alter a bit of the result.
constexpr int solver_version = 1;

constexpr double cloth_margin = 0.004;  // between cloth and figure at the start
constexpr std::uint32_t fine_lead = 8;  // keyframes before the first in which the second level folds

const char* name(GarmentKind kind) {
  return kind == GarmentKind::shirt ? "shirt" : "dress";
}

void check(const GarmentConfig& c) {
  const auto check = [&c](double value, double lowest, double highest, const char* what) {
    cloth::check_range(name(c.kind), value, lowest, highest, what);
  };
  check(double(c.triangles), 1, 1 << 22, "the number of triangles");
  check(double(c.keyframes), 1, 1e6, "the number of keyframes");
  check(c.keyframes_per_second, 1, 1e6, "the number of keyframes per second");
  check(double(c.full_triangles), 1, 1 << 22, "the number of triangles simulated in full");
  check(double(c.fine_steps), 1, 1e6, "the number of steps per keyframe of the second level");
  cloth::check_cloth(c, check);
  check(c.skin_bite, -0.01, 0.01, "the skin's bite");
}

/// Keyframes are numbered from the first kept keyframe; those of the lead-in are negative.
class Timeline {
 public:
  explicit Timeline(const GarmentConfig& c)
      : rate_(c.keyframes_per_second), first_(-std::int64_t(std::ceil(WalkingFigure::lead_in * rate_))) {}
  std::int64_t first() const { return first_; }
  double time(std::int64_t keyframe) const { return double(keyframe) / rate_; }

 private:
  double rate_;
  std::int64_t first_;
};

/// Simulates the whole motion of a garment in full: calls keep(keyframe, positions) from the first keyframe
/// of the lead-in to `last`.
template <class Keep>
void simulate_in_full(const GarmentConfig& config, const GarmentPattern& pattern, std::int64_t last,
                      Keep keep) {
  const Timeline line(config);
  WalkingFigure figure(config);
  figure.move_to(line.time(line.first()));
  GarmentSolver solver(config, pattern, GarmentSolver::Layers::apart);
  const std::uint32_t steps = cloth::steps_per_keyframe(config, pattern.spacing);
  const double dt = 1.0 / (config.keyframes_per_second * double(steps));
  keep(line.first(), solver.positions());
  for (std::int64_t k = line.first(); k < last; ++k) {
    for (std::uint32_t s = 0; s < steps; ++s) {
      Interruptible::check();
      solver.step(figure, line.time(k) + dt * double(s), dt, 1);
    }
    keep(k + 1, solver.positions());
  }
}

/// Simulates the second level, guided by coarse(keyframe), which is known from the lead-in to the keyframe
/// after `last`.
template <class Coarse, class Keep>
void simulate_guided(const GarmentConfig& config, const GarmentPattern& coarse_pattern,
                     const GarmentPattern& pattern, std::int64_t last, Coarse coarse, Keep keep) {
  const Timeline line(config);
  const std::int64_t start = std::max(line.first() + 1, -std::int64_t(fine_lead));
  WalkingFigure figure(config);
  figure.move_to(line.time(start));
  Guide guide(coarse_pattern, pattern);
  // Keyframes k - 1 to k + 2 of the guide.
  std::array<std::vector<Vec>, 4> knots;
  for (std::size_t i = 0; i < 4; ++i)
    guide.interpolate(coarse(std::min(last + 1, start + std::int64_t(i) - 1)), knots[i]);
  GarmentSolver solver(config, pattern, GarmentSolver::Layers::ignored);
  std::vector<Vec> wanted(pattern.rest.size());
  for (std::size_t p = 0; p < wanted.size(); ++p)
    wanted[p] = (knots[2][p] - knots[0][p]) * (0.5 * config.keyframes_per_second);
  solver.start(knots[1], wanted);
  const double dt = 1.0 / (config.keyframes_per_second * double(config.fine_steps));
  keep(start, solver.positions());
  for (std::int64_t k = start; k < last; ++k) {
    for (std::uint32_t s = 0; s < config.fine_steps; ++s) {
      Interruptible::check();
      const double t = double(s + 1) / double(config.fine_steps), t2 = t * t, t3 = t2 * t;
      const double weights[4] = {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2),
                                 0.5 * (-3 * t3 + 4 * t2 + t), 0.5 * (t3 - t2)};
      for (std::size_t p = 0; p < wanted.size(); ++p)
        wanted[p] = knots[0][p] * weights[0] + knots[1][p] * weights[1] + knots[2][p] * weights[2] +
                    knots[3][p] * weights[3];
      solver.step(figure, line.time(k) + dt * double(s), dt, 2, &guide, wanted);
    }
    keep(k + 1, solver.positions());
    std::rotate(knots.begin(), knots.begin() + 1, knots.end());
    guide.interpolate(coarse(std::min(last + 1, k + 3)), knots[3]);
  }
}

/// Records keyframes as the scene has them: rounded to float, with the figure's displacement.
class Recorder {
 public:
  Recorder(const GarmentConfig& config, double metres_per_second)
      : rate_(config.keyframes_per_second), speed_(metres_per_second) {}
  void append(std::int64_t keyframe, const std::vector<Vec>& positions, io::AnimatedMesh& mesh) const {
    const double gone = speed_ * double(keyframe) / rate_;
    for (const Vec& p : positions)
      for (const double x : {p.x + gone, p.y, p.z}) mesh.positions.push_back(rounded_to_float(x));
  }

 private:
  double rate_, speed_;
};

}  // namespace

std::vector<io::AnimatedMesh> simulate_garment(const GarmentConfig& config, const Progress& progress) {
  check(config);
  const GarmentShape shape = garment_shape(config.kind);
  WalkingFigure figure(config);
  const GarmentPattern pattern =
      sew(shape, garment_counts(shape, config.triangles), figure.walker(), cloth_margin);
  const Recorder recorder(config, figure.metres_per_second());

  std::vector<io::AnimatedMesh> bodies(2);
  io::AnimatedMesh& garment = bodies[0];
  const std::size_t count = pattern.triangles.size() / 3;
  garment.name = std::string(name(config.kind)) + "-" + std::to_string(count);
  garment.vertex_count = std::uint32_t(pattern.rest.size());
  garment.primitive_vertices = pattern.triangles;
  for (std::size_t t = 1; t <= count; ++t) garment.primitive_offsets.push_back(std::uint32_t(3 * t));
  garment.keyframe_times = keyframe_times(config.keyframes, config.keyframes_per_second);
  garment.positions.reserve(std::size_t(garment.vertex_count) * 3 * config.keyframes);

  const Skin skin(figure.walker(), figure.shape(), config.avatar_triangles, config.skin_bite);
  bodies[1] = skin.mesh();
  bodies[1].keyframe_times = garment.keyframe_times;
  std::vector<Vec> skin_positions;
  const std::int64_t last = std::int64_t(config.keyframes) - 1;
  for (std::int64_t k = 0; k <= last; ++k) {
    figure.move_to(Timeline(config).time(k));
    skin.positions(figure.walker(), skin_positions);
    recorder.append(k, skin_positions, bodies[1]);
  }

  const std::int64_t first = Timeline(config).first();
  const auto record = [&](std::int64_t k, const std::vector<Vec>& positions) {
    if (k >= 0) recorder.append(k, positions, garment);
  };
  const auto tell = [&](double from, double to, std::int64_t k) {
    if (progress)
      progress(from + (to - from) * double(k - first) / double(std::max<std::int64_t>(1, last - first)));
  };
  if (config.triangles <= config.full_triangles) {
    simulate_in_full(config, pattern, last, [&](std::int64_t k, const std::vector<Vec>& positions) {
      record(k, positions);
      tell(0, 1, k);
    });
    return bodies;
  }
  const GarmentPattern coarse =
      sew(shape, garment_counts(shape, config.full_triangles), WalkingFigure(config).walker(), cloth_margin);
  // The cost of either level by its steps and vertices, for the progress only.
  const double coarse_work = double(coarse.rest.size()) * cloth::steps_per_keyframe(config, coarse.spacing);
  const double fine_work = double(pattern.rest.size()) * 2 * config.fine_steps;
  const double share = coarse_work / (coarse_work + fine_work);
  std::vector<std::vector<Vec>> frames;
  simulate_in_full(config, coarse, last + 1, [&](std::int64_t k, const std::vector<Vec>& positions) {
    frames.push_back(positions);
    if (k <= last) tell(0, share, k);
  });
  simulate_guided(
      config, coarse, pattern, last,
      [&](std::int64_t k) -> const std::vector<Vec>& { return frames[std::size_t(k - first)]; },
      [&](std::int64_t k, const std::vector<Vec>& positions) {
        record(k, positions);
        tell(share, 1, k);
      });
  return bodies;
}

std::string cache_key(const GarmentConfig& c) {
  cloth::ConfigHash hash;
  for (const std::uint64_t value :
       {std::uint64_t(solver_version), std::uint64_t(c.kind), std::uint64_t(c.triangles), c.seed,
        std::uint64_t(c.keyframes), std::uint64_t(c.avatar_triangles), std::uint64_t(c.full_triangles),
        std::uint64_t(c.fine_steps), std::uint64_t(c.substeps_per_keyframe)})
    hash.add(value);
  for (const double value :
       {c.keyframes_per_second, c.area_density, c.stretch_stiffness, c.shear_stiffness, c.bending_rigidity,
        c.air_drag, c.viscosity, c.friction, c.layer_distance, c.skin_bite})
    hash.add(value);
  return std::string(name(c.kind)) + "-v" + std::to_string(solver_version) + "-" +
         std::to_string(c.triangles) + "-seed" + std::to_string(c.seed) + "-" + std::to_string(c.keyframes) +
         "kf-" + hash.digits();
}

}  // namespace kbvh::scenes
