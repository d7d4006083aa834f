#include "tests/support/synthetic_scenes.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>

#include "core/geometry/predicates.hpp"
#include "core/scene/cut_polygons.hpp"
#include "tests/support/geometry_scripts.hpp"

namespace kbvh::test {

namespace {

/// The data of a body, in double, before it is rounded to the scene's scalar.
struct RawBody {
  Primitives primitives;
  std::uint32_t vertex_count = 0;
  std::vector<double> times{0.0};
  std::vector<double> positions;
};

RawBody soup(std::uint32_t triangles, std::uint64_t seed, std::uint32_t keyframes, double size,
             double travel) {
  Random random(seed);
  RawBody body;
  body.vertex_count = 3 * triangles;
  for (std::uint32_t p = 0; p < triangles; ++p) {
    const std::uint32_t corners[3] = {3 * p, 3 * p + 1, 3 * p + 2};
    body.primitives.add(corners);
    double centre[3] = {random.unit(), random.unit(), random.unit()};
    for (int corner = 0; corner < 3; ++corner)
      for (double c : centre) body.positions.push_back(c + size * random.unit());
  }
  body.times.clear();
  for (std::uint32_t k = 0; k < keyframes; ++k) body.times.push_back(0.25 * k);
  for (std::uint32_t k = 1; k < keyframes; ++k)
    for (std::size_t i = 0; i < std::size_t(3) * body.vertex_count; ++i)
      body.positions.push_back(body.positions[body.positions.size() - std::size_t(3) * body.vertex_count] +
                               travel * random.unit());
  return body;
}

/// A connected sheet of 2 (n-1)^2 triangles whose vertices follow `move(vertex x, y, keyframe, axis)`.
RawBody sheet(std::uint32_t n, std::uint32_t keyframes,
              const std::function<double(int, int, int, int)>& move) {
  RawBody body;
  body.vertex_count = n * n;
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t v = y * n + x;
      const std::uint32_t lower[3] = {v, v + 1, v + n}, upper[3] = {v + 1, v + n + 1, v + n};
      body.primitives.add(lower);
      body.primitives.add(upper);
    }
  body.times.clear();
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    body.times.push_back(k);
    for (std::uint32_t y = 0; y < n; ++y)
      for (std::uint32_t x = 0; x < n; ++x)
        for (int axis = 0; axis < 3; ++axis) body.positions.push_back(move(int(x), int(y), int(k), axis));
  }
  return body;
}

void transform(RawBody& body, double scale, double offset) {
  for (double& x : body.positions) x = x * scale + offset;
}

/// Cuts `primitives` into k-gons of changing size over the same vertices.
void make_polygons(RawBody& body, std::uint32_t smallest, std::uint32_t largest, PrimitiveKind kind) {
  Primitives polygons;
  polygons.kind = kind;
  std::uint32_t at = 0, size = smallest;
  std::vector<std::uint32_t> corners;
  while (at < body.vertex_count) {
    corners.clear();
    for (std::uint32_t i = 0; i < size && at < body.vertex_count; ++i) corners.push_back(at++);
    polygons.add(corners);
    size = size == largest ? smallest : size + 1;
  }
  body.primitives = polygons;
}

/// The kinds of plan changes with which a scene is played.
enum class Script : std::uint8_t {
  none,
  random,     // at frames of every kind, with and without knots
  takes_off,  // the same, for bodies of which no keyframe moves
  extreme,    // velocities of the largest and the smallest magnitude
};

struct RawScene {
  std::vector<RawBody> bodies;
  Script script = Script::none;
  std::optional<GeometryScriptStyle> geometry{};
  std::vector<std::uint32_t> self{};  ///< bodies with pairs within them
};

/// The scalar's largest admissible coordinate or velocity, the smallest above zero, and the distance from 1
/// to the next number.
struct Range {
  double largest, smallest, epsilon;
};

/// One keyframe of a sheet of n x n vertices in the unit square.
struct FarSheet {
  std::uint32_t n;
  double height, wave, shear, fall;
  double at(int x, int y, int k, int axis) const {
    const double u = x / double(n - 1), v = y / double(n - 1);
    if (axis == 0) return u + shear * k * (1 + v);
    return axis == 1 ? v : height + wave * std::sin(6 * u + 4 * v + 0.3 * k) - fall * k;
  }
};

/// Two sheets, a gap of 0.1 apart, one over the other, with numbers far beyond their size: the rounding error
/// at `far` is 0.01, and single vertices are even further away. 0: the same scene without these numbers.
RawScene raw_far_scene(const std::string& name, std::uint32_t n, std::uint32_t keyframes, double far) {
  const bool wavy = name == "far_waves", translates = name == "far_translation";
  const double place = name == "far_sheets" || wavy || translates ? far : 0;
  RawScene scene{{}, Script::none};
  for (int b = 0; b < 2; ++b) {
    const FarSheet at{n, b == 0 ? 0.0 : 0.1, wavy ? 0.04 : 0.0, b == 0 && !translates ? 0.05 : 0.0,
                      b == 0 && !wavy ? 0.004 : 0.0};
    scene.bodies.push_back(sheet(n, keyframes, [&](int x, int y, int k, int axis) {
      const double drift = translates && b == 0 && axis == 0 ? k * 1.1 / 16 : 0;
      return place + drift + at.at(x, y, k, axis);
    }));
  }
  const double further = 8 * far;
  RawBody& body = scene.bodies[0];
  const auto first = [&](std::size_t k) {
    return body.positions.begin() + std::ptrdiff_t(3 * body.vertex_count * k);
  };
  if (name == "far_vertex" && far != 0)
    for (std::size_t k = 0; k < keyframes; ++k) {
      double* const corner = &*first(k) + 3 * (body.vertex_count - 1);
      corner[0] += further;
      corner[2] -= further;
    }
  if (name == "far_ground") {
    const double half = std::max(further, 2.0);
    const std::vector<double> ground{-half, -half, -1, half, -half, -1, 0, half, -1};
    for (std::size_t k = keyframes; k-- > 0;)
      body.positions.insert(first(k + 1), ground.begin(), ground.end());
    const std::uint32_t corners[3] = {body.vertex_count, body.vertex_count + 1, body.vertex_count + 2};
    body.primitives.add(corners);
    body.vertex_count += 3;
  }
  return scene;
}

RawScene raw_scene(const std::string& name, const Range& range) {
  const auto wave = [](double lift) {
    return [lift](int x, int y, int k, int axis) {
      if (axis == 0) return 0.1 * x + 0.01 * ((x * 7 + y * 3 + k * 5) % 11);
      if (axis == 1) return 0.1 * y + 0.01 * ((x * 5 + y * 2 + k * 3) % 7);
      return lift + 0.07 * ((x * 3 + y * 5 + k * 4) % 9) - 0.05 * k;
    };
  };
  if (name == "soups") return {{soup(150, 1, 5, 0.2, 0.3), soup(120, 2, 5, 0.2, 0.3)}, Script::none};
  if (name == "sheets") return {{sheet(10, 6, wave(0.3)), sheet(8, 6, wave(0.0))}, Script::none};
  if (name == "static_obstacle") return {{sheet(10, 6, wave(0.2)), soup(60, 3, 1, 0.2, 0)}, Script::none};
  if (name == "nothing_moves") return {{soup(80, 4, 1, 0.3, 0), soup(80, 5, 1, 0.3, 0)}, Script::none};
  if (name == "four_bodies_own_keyframes") {
    RawScene scene{{soup(60, 6, 4, 0.3, 0.3), soup(50, 7, 3, 0.3, 0.3), soup(40, 8, 1, 0.3, 0),
                    soup(30, 9, 2, 0.3, 0.5)},
                   Script::none};
    scene.bodies[1].times = {0.1, 0.30000000000000004, 2.0};
    scene.bodies[3].times = {-0.5, 0.25};
    return scene;
  }
  if (name == "one_triangle_and_none") {
    RawScene scene{{soup(1, 10, 3, 0.5, 0.5), soup(40, 11, 3, 0.5, 0.5), RawBody{}}, Script::none};
    return scene;
  }
  // Integer coordinates: vertices coincide for whole segments, cross at one instant, touch without crossing.
  if (name == "integer_ties") {
    const auto grid = [](int shift) {
      return [shift](int x, int y, int k, int axis) {
        if (axis == 0) return double((x + k * (y % 3)) % 4 + shift);
        if (axis == 1) return double((y + k) % 3);
        return double((x * y + k * shift) % 3);
      };
    };
    return {{sheet(8, 5, grid(0)), sheet(7, 5, grid(1))}, Script::none};
  }
  // Mirrored in the plane x = 1 between two keyframes: every pair of vertices crosses at the same instant.
  if (name == "all_cross_at_once")
    return {{sheet(9, 3,
                   [](int x, int y, int k, int axis) {
                     if (axis == 0) return k % 2 == 0 ? 0.25 * x : 2.0 - 0.25 * x;
                     return axis == 1 ? 0.25 * y : 0.125 * ((x + y) % 3);
                   }),
             soup(50, 12, 3, 0.4, 0.2)},
            Script::none};
  if (name == "pure_translation_far")
    return {{sheet(10, 4,
                   [](int x, int y, int k, int axis) {
                     const double at[3] = {0.125 * x, 0.125 * y, 0.0625 * ((x * 3 + y) % 5)};
                     return 1e6 + at[axis] + (axis == 2 ? 0.0 : 0.5 * k);
                   }),
             sheet(10, 4,
                   [](int x, int y, int, int axis) {
                     const double at[3] = {0.15 * x, 0.15 * y, 0.0625 * ((x + y * 2) % 6)};
                     return 1e6 + at[axis];
                   })},
            Script::none};
  if (name == "tiny") {
    RawScene scene{{soup(80, 13, 4, 0.3, 0.3), soup(80, 14, 4, 0.3, 0.3)}, Script::none};
    for (RawBody& body : scene.bodies) transform(body, 1e-30, 0);
    return scene;
  }
  if (name == "huge") {
    RawScene scene{{soup(80, 15, 4, 0.3, 0.3), soup(80, 16, 4, 0.3, 0.3)}, Script::none};
    for (RawBody& body : scene.bodies) transform(body, 1e29, 0);
    return scene;
  }
  if (name == "keyframes_a_millionth_apart") {
    RawScene scene{{soup(80, 17, 6, 0.3, 0.3), soup(60, 18, 6, 0.3, 0.3)}, Script::none};
    scene.bodies[0].times = {0, 1, 1.000001, 1.000002, 5, 5.000001};
    scene.bodies[1].times = {0, 1.0000005, 1.000001, 3, 5, 5.0000005};
    return scene;
  }
  if (name == "degenerate_triangles") {
    RawScene scene{{soup(90, 19, 4, 0.4, 0.3), soup(90, 20, 4, 0.4, 0.3)}, Script::none};
    for (RawBody& body : scene.bodies)
      for (std::size_t k = 0; k < body.times.size(); ++k)
        for (std::uint32_t p = 0; p < body.primitives.count(); p += 3)
          for (std::size_t axis = 0; axis < 3; ++axis) {
            double* corner = body.positions.data() + 3 * (k * body.vertex_count + 3 * p) + axis;
            if (p % 2 == 0)
              corner[6] = corner[0];
            else
              corner[3] = corner[6] = corner[0];
          }
    return scene;
  }
  if (name == "polygons") {
    RawScene scene{{soup(90, 21, 4, 0.4, 0.3), soup(70, 22, 4, 0.4, 0.3)}, Script::none};
    make_polygons(scene.bodies[0], 1, 6, PrimitiveKind::polygons);
    make_polygons(scene.bodies[1], 3, 5, PrimitiveKind::polygons);
    return scene;
  }
  if (name == "points_against_nets") {
    RawScene scene{{soup(90, 23, 4, 0.4, 0.3), soup(70, 24, 4, 0.4, 0.3)}, Script::none};
    make_polygons(scene.bodies[0], 1, 1, PrimitiveKind::points);
    make_polygons(scene.bodies[1], 9, 16, PrimitiveKind::control_nets);
    return scene;
  }
  if (name == "plan_changes") return {{soup(70, 25, 5, 0.3, 0.3), soup(60, 26, 5, 0.3, 0.3)}, Script::random};
  if (name == "plan_changes_ties") {
    RawScene scene = raw_scene("integer_ties", range);
    scene.script = Script::random;
    return scene;
  }
  // Several keyframes, but nothing moves: every certificate is a tie for ever.
  if (name == "zero_motion") {
    RawScene scene{{soup(80, 27, 4, 0.3, 0), sheet(9, 4,
                                                   [](int x, int y, int, int axis) {
                                                     return axis == 2 ? 0.1 * ((x + y) % 3)
                                                                      : 0.2 * (axis == 0 ? x : y) - 0.8;
                                                   })},
                   Script::none};
    return scene;
  }
  // Every triangle has a twin that flies with it, apart only in some of the keyframe intervals: for a side of
  // a box neither twin is better while they are together, and either may be when they part.
  if (name == "coincident_intervals") {
    RawScene scene{{soup(60, 28, 7, 0.3, 0.3), soup(50, 29, 7, 0.3, 0.3)}, Script::none};
    for (RawBody& body : scene.bodies)
      for (std::size_t k = 0; k < body.times.size(); ++k)
        for (std::size_t p = 0; p + 1 < body.primitives.count(); p += 2)
          for (std::size_t i = 0; i < 9; ++i) {
            double* corner = body.positions.data() + 3 * (k * body.vertex_count + 3 * p) + i;
            const bool apart = k == 2 || (k == 5 && p % 4 == 0);
            corner[9] = apart ? corner[9] : corner[0];
          }
    return scene;
  }
  // Across the whole admissible range within a second, or by the smallest step of the scalar. Few triangles:
  // nearly every decision needs exact arithmetic.
  if (name == "extreme_velocities" || name == "extreme_plan_changes") {
    RawScene scene{{soup(14, 30, 5, 0.3, 0.3), soup(11, 31, 5, 0.3, 0.3)}, Script::none};
    if (name == "extreme_plan_changes") scene.script = Script::extreme;
    for (RawBody& body : scene.bodies) {
      body.times = {0, 1, 2, 3, 4};
      for (std::size_t k = 0; k < body.times.size(); ++k)
        for (std::uint32_t p = 0; p < body.primitives.count(); p += 3)
          for (std::size_t i = 0; i < 9; ++i) {
            double& x = body.positions[3 * (k * body.vertex_count + 3 * p) + i];
            if (p % 2 == 0)
              x = ((k + i + p) % 2 == 0 ? 1 : -1) * range.largest;
            else
              x = double((k * (i + 1)) % 5) * range.smallest;
          }
    }
    return scene;
  }
  // Single keyframes: no strategy can know that these bodies will move before their plans are changed.
  if (name == "plans_start_at_rest")
    return {{soup(70, 32, 1, 0.3, 0), soup(60, 33, 1, 0.3, 0)}, Script::takes_off};
  if (name == "plans_move_the_obstacle")
    return {{soup(70, 34, 5, 0.3, 0.3), soup(60, 35, 1, 0.3, 0), soup(20, 36, 1, 0.3, 0)}, Script::random};
  const auto with_geometry = [&range](const char* base, const GeometryScriptStyle& style) {
    RawScene scene = raw_scene(base, range);
    scene.geometry = style;
    return scene;
  };
  const auto within = [&range](const char* base, std::vector<std::uint32_t> bodies) {
    RawScene scene = raw_scene(base, range);
    scene.self = std::move(bodies);
    return scene;
  };
  // A cloth that is rolled up tighter from keyframe to keyframe, and cuts itself, against an obstacle.
  if (name == "self_rolled_cloth") {
    const auto roll = [](int x, int y, int k, int axis) {
      const double turn = 0.35 + 0.25 * k, radius = 0.5 - (0.02 + 0.008 * k) * x + 0.02 * ((x + y) % 3);
      if (axis == 1) return 0.15 * y + 0.03 * ((x * 3 + k) % 4);
      return axis == 0 ? radius * std::cos(turn * x) : radius * std::sin(turn * x);
    };
    return {{sheet(12, 6, roll), soup(40, 50, 1, 0.4, 0)}, Script::none, {}, {0}};
  }
  if (name == "self_soup_alone") return {{soup(120, 51, 4, 0.3, 0.3)}, Script::none, {}, {0}};
  if (name == "self_sheets_crumpled") return within("integer_ties", {0, 1});
  if (name == "self_coincident") return within("coincident_intervals", {0, 1});
  if (name == "self_degenerate") return within("degenerate_triangles", {0});
  if (name == "self_polygons") return within("polygons", {0, 1});
  if (name == "self_points_and_nets") return within("points_against_nets", {0, 1});
  if (name == "self_nothing_moves") return within("nothing_moves", {1});
  if (name == "self_one_triangle_and_none") return within("one_triangle_and_none", {0, 1, 2});
  if (name == "self_plan_changes") return within("plan_changes", {0});
  if (name == "self_geometry_changes") return within("geometry_changes", {0, 1});
  if (name == "self_geometry_to_nothing") return within("geometry_to_nothing", {1});
  if (name == "geometry_changes") return with_geometry("soups", {.seed = 31, .plans = true});
  if (name == "geometry_changes_shared") return with_geometry("sheets", {.seed = 32});
  if (name == "geometry_changes_ties")
    return with_geometry("integer_ties", {.seed = 33, .integers = true, .plans = true});
  if (name == "geometry_to_nothing")
    return with_geometry("one_triangle_and_none", {.seed = 34, .to_nothing = true});
  if (name == "geometry_changes_at_rest") return with_geometry("static_obstacle", {.seed = 35});
  if (name == "geometry_changes_polygons") return with_geometry("polygons", {.seed = 36, .plans = true});
  if (name == "geometry_changes_points")
    return with_geometry("points_against_nets", {.seed = 37, .to_nothing = true});
  if (const auto& far = far_scene_names(); std::find(far.begin(), far.end(), name) != far.end())
    return raw_far_scene(name, 9, 4, 0.01 / range.epsilon);
  throw std::invalid_argument("no synthetic scene '" + name + "'");
}

/// Changes at the first frame, at keyframes and in between; several at once; some with knots, some for ever,
/// some that stop; the same vertex repeatedly.
template <class S>
PlanScript<S> make_script(const Scene<S>& scene, const std::vector<double>& frames) {
  Random random(77);
  PlanScript<S> script;
  for (std::size_t f = 0; f + 1 < frames.size(); f += 1 + random.below(3)) {
    typename PlanScript<S>::Step step{frames[f], {}};
    const std::uint32_t changes = 1 + random.below(12);
    for (std::uint32_t i = 0; i < changes; ++i) {
      PlanChange<S> change;
      change.body = random.below(std::uint32_t(scene.bodies.size()));
      change.vertex = random.below(scene.bodies[change.body].plans.vertex_count());
      bool again = false;
      for (const auto& other : step.changes)
        again = again || (other.body == change.body && other.vertex == change.vertex);
      if (again) continue;
      const std::uint32_t kind = random.below(4);
      if (kind != 0)
        for (S& v : change.velocity) v = S(0.5 * random.unit());
      if (kind >= 2)
        for (std::uint32_t k = 1; k <= 2; ++k) {
          change.times.push_back(frames[f] + 0.2 * k);
          for (int axis = 0; axis < 3; ++axis)
            change.positions.push_back(kind == 2 ? S(random.unit()) : S(random.below(4)));
        }
      step.changes.push_back(change);
    }
    script.steps.push_back(step);
  }
  return script;
}

/// A third of the vertices, each changed once: even the fastest stays within the scalar's own range.
template <class S>
PlanScript<S> extreme_script(const Scene<S>& scene, const std::vector<double>& frames, const Range& range) {
  Random random(78);
  PlanScript<S> script;
  const std::size_t last = frames.size() < 2 ? 1 : frames.size() - 1;
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
    for (std::uint32_t v = 0; v < scene.bodies[body].plans.vertex_count(); v += 3) {
      PlanChange<S> change;
      change.body = body;
      change.vertex = v;
      for (S& speed : change.velocity) {
        const double sizes[4] = {range.largest, range.smallest, 0, 0.5};
        speed = S(sizes[random.below(4)] * (random.below(2) == 0 ? 1 : -1));
      }
      const std::size_t frame = (body + v) % std::min<std::size_t>(last, 5);
      while (script.steps.size() <= frame) script.steps.push_back({frames[script.steps.size()], {}});
      script.steps[frame].changes.push_back(change);
    }
  return script;
}

template <class S>
Scene<S> rounded(const std::string& name, const RawScene& raw) {
  Scene<S> scene;
  scene.name = name;
  for (std::size_t b = 0; b < raw.bodies.size(); ++b) {
    const RawBody& body = raw.bodies[b];
    std::vector<S> positions(body.positions.begin(), body.positions.end());
    scene.bodies.push_back({"body" + std::to_string(b), body.primitives,
                            FlightPlans<S>(body.vertex_count, body.times, std::move(positions))});
  }
  scene.pairs = all_pairs(scene.bodies);
  for (const std::uint32_t body : raw.self) scene.pairs.push_back({body, body});
  validate(scene);
  cut_polygons(scene);
  return scene;
}
}  // namespace

template <class S>
Scene<S> far_scene(const std::string& name, std::uint32_t n, std::uint32_t keyframes, FarPart part) {
  const double far = part == FarPart::far ? 0.01 / double(std::numeric_limits<S>::epsilon()) : 0;
  return rounded<S>(name, raw_far_scene(name, n, keyframes, far));
}
template Scene<float> far_scene(const std::string&, std::uint32_t, std::uint32_t, FarPart);
template Scene<double> far_scene(const std::string&, std::uint32_t, std::uint32_t, FarPart);

template <class S>
TestScene<S> synthetic_scene(const std::string& name, std::uint32_t frames_per_keyframe) {
  const Range range{double(admissible_magnitude<S>), double(std::numeric_limits<S>::denorm_min()),
                    double(std::numeric_limits<S>::epsilon())};
  const RawScene raw = raw_scene(name, range);
  TestScene<S> result;
  result.scene = rounded<S>(name, raw);
  result.frames = frame_times(result.scene, frames_per_keyframe);
  if (raw.script == Script::takes_off) {
    result.frames.clear();
    for (std::uint32_t f = 0; f < 4 * frames_per_keyframe; ++f)
      result.frames.push_back(0.25 * double(f) / double(frames_per_keyframe));
  }
  if (raw.script == Script::extreme)
    result.script = extreme_script(result.scene, result.frames, range);
  else if (raw.script != Script::none)
    result.script = make_script(result.scene, result.frames);
  if (raw.geometry) result.script = make_geometry_script(result.scene, frames_per_keyframe, *raw.geometry);
  return result;
}

template TestScene<float> synthetic_scene(const std::string&, std::uint32_t);
template TestScene<double> synthetic_scene(const std::string&, std::uint32_t);

}  // namespace kbvh::test
