#include "experiments/stress/families.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/geometry/predicates.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/stress/family_parts.hpp"

namespace kbvh::experiments::stress {

template <class S>
ScalarLimits scalar_limits() {
  using Limits = std::numeric_limits<S>;
  return {double(admissible_magnitude<S>), double(Limits::denorm_min()), double(Limits::min()),
          double(Limits::epsilon())};
}
template ScalarLimits scalar_limits<float>();
template ScalarLimits scalar_limits<double>();

namespace {

// --- sizes of numbers -----------------------------------------------------------------------------------

StressScene soups_scaled_to(const FamilySetting& setting, double largest) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 30, keyframes_for(setting));
  scale_to(scene, largest);
  return scene;
}
StressScene tiny(const FamilySetting& s) {
  return soups_scaled_to(s, 1e-30);
}
StressScene unit(const FamilySetting& s) {
  return soups_scaled_to(s, 1);
}
StressScene million(const FamilySetting& s) {
  return soups_scaled_to(s, 1e6);
}
StressScene huge(const FamilySetting& s) {
  return soups_scaled_to(s, 1e30);
}

StressScene mixed(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 12, keyframes_for(setting));
  // A scale for each triangle, or for each vertex.
  const std::uint32_t together = random.among({1u, 3u});
  for (StressBody& body : scene.bodies)
    for (std::uint32_t v = 0; v < body.vertex_count; v += together) {
      const double scale = random.among({1e-30, 1e-10, 1.0, 1.0, 1e6, 1e20, 4e29});
      for (std::uint32_t i = v; i < std::min(v + together, body.vertex_count); ++i)
        for (std::size_t k = 0; k < body.times.size(); ++k)
          for (int axis = 0; axis < 3; ++axis) body.position(k, i)[axis] *= scale;
    }
  return scene;
}

/// Steps of one unit in the last place of the coordinates, far from the origin.
StressScene far_away(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const double offset = std::ldexp(1.0, int(10 + random.below(30)));
  const double step = offset * setting.limits.epsilon * random.among({1.0, 1.0, 8.0});
  double shift[3];
  for (double& s : shift) s = offset * random.among({1.0, -1.5, 1.25});
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(
        soup_of(20 + random.below(20), keyframes_for(setting), [&](std::uint32_t, std::uint32_t, int axis) {
          return shift[axis] + step * double(random.below(24));
        }));
  return scene;
}

StressScene denormals(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const double most = random.among({3.0, 40.0});
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(
        soup_of(12 + random.below(12), keyframes_for(setting), [&](std::uint32_t, std::uint32_t v, int) {
          const double steps = std::floor(most * random.unit());
          // Some vertices on the border between denormal and normal numbers.
          return v % 7 == 3 ? setting.limits.normal + steps * setting.limits.smallest
                            : steps * setting.limits.smallest;
        }));
  return scene;
}

StressScene signed_zeros(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(
        soup_of(8 + random.below(8), keyframes_for(setting), [&](std::uint32_t, std::uint32_t, int) {
          return random.among(
              {0.0, -0.0, 0.0, -0.0, 1.0, -1.0, setting.limits.smallest, -setting.limits.smallest});
        }));
  return scene;
}

/// Motion across the whole admissible range from keyframe to keyframe, or by the smallest possible step.
StressScene largest(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 10, keyframes_for(setting));
  for (StressBody& body : scene.bodies)
    for (std::uint32_t p = 0; p < body.primitives.size(); ++p) {
      const std::uint32_t kind = random.below(3);
      for (std::size_t k = 0; kind != 2 && k < body.times.size(); ++k)
        for (std::uint32_t i = 0; i < 3; ++i)
          for (int axis = 0; axis < 3; ++axis)
            body.position(k, 3 * p + i)[axis] = kind == 0 ? random.among({1.0, -1.0}) * setting.limits.largest
                                                          : double(random.below(5)) * setting.limits.smallest;
    }
  return scene;
}

/// Coordinates on both sides of the limit: such a scene may be refused, never answered wrongly.
StressScene beyond_range(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 8, keyframes_for(setting));
  scale_to(scene, setting.limits.largest * random.among({0.999999, 1.0, 1.0000002, 1.5, 1e9}));
  return scene;
}

// --- trajectories ---------------------------------------------------------------------------------------

/// Vertices that move side by side with slopes that differ in the last places only.
StressScene near_parallel(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const double ulp = setting.limits.epsilon;
  for (int b = 0; b < 2; ++b) {
    scene.bodies.push_back(soup_of(
        20 + random.below(16), keyframes_for(setting), [&](std::uint32_t k, std::uint32_t v, int axis) {
          // These draws have no effect; they preserve the seeds of recorded scenes.
          if (v % 6 == 0 && axis == 0 && k == 0)
            for (int i = 0; i < 3; ++i) random.unit();
          // The same positions at every keyframe up to some ulps, and much further along each time.
          const double place = 1 + 0.0625 * double((v * 7 + std::uint32_t(axis) * 3) % 5);
          return place + 0.25 * k + ulp * 4 * double(random.below(7)) - ulp * 12;
        }));
  }
  return scene;
}

/// Vertices that return at every other keyframe to the same height, up to one ulp: their paths touch the
/// highest one, or nearly.
StressScene near_tangent(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const double ulp = setting.limits.epsilon;
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(
        soup_of(20 + random.below(16), keyframes_for(setting), [&](std::uint32_t k, std::uint32_t v, int) {
          const double side = v % 2 == 0 ? 1.0 : -1.0;
          if (v % 5 == 0) return side;
          if (k % 2 == 1) return side * (1 + ulp * double(int(random.below(3)) - 1));
          return side * (0.5 + 0.4 * random.unit());
        }));
  return scene;
}

/// Mirrored in a point or a plane between two keyframes: all vertices meet at one instant.
StressScene all_cross_at_once(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const bool in_a_point = random.one_in(2);
  scene.bodies.push_back(
      sheet(6, keyframes_for(setting), [&](std::uint32_t x, std::uint32_t y, std::uint32_t k, int axis) {
        const double at[3] = {0.25 * x, 0.25 * y, 0.125 * ((x + y) % 3)};
        const bool mirrored = k % 2 == 1 && (in_a_point || axis == 0);
        return mirrored ? 2.0 - at[axis] : at[axis];
      }));
  scene.bodies.push_back(soup(random, 30, keyframes_for(setting)));
  for (double& t : scene.bodies[1].times) t *= 4;
  return scene;
}

/// Every triangle has a twin that moves with it, separate only in some of the segments.
StressScene coincident(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 30, std::max(3u, keyframes_for(setting)));
  for (StressBody& body : scene.bodies)
    for (std::size_t k = 0; k < body.times.size(); ++k)
      for (std::size_t p = 0; p + 1 < body.primitives.size(); p += 2) {
        if (random.one_in(3)) continue;
        std::copy_n(body.position(k, 3 * p), 9, body.position(k, 3 * p + 3));
      }
  return scene;
}

/// Whole numbers, so that ties are exact; later every vertex moves differently.
StressScene ties_that_separate(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const std::uint32_t keyframes = std::max(3u, keyframes_for(setting));
  for (int b = 0; b < 2; ++b) {
    const std::uint32_t until = 1 + random.below(keyframes);
    scene.bodies.push_back(
        soup_of(20 + random.below(20), keyframes, [&](std::uint32_t k, std::uint32_t, int) {
          return k < until ? double(random.below(3)) : random.among({0.0, 1.0, 2.0}) + 0.5 * random.unit();
        }));
  }
  return scene;
}

/// One vertex moves far out and returns.
StressScene spikes(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 30, std::max(3u, keyframes_for(setting)));
  for (StressBody& body : scene.bodies) {
    const std::uint32_t count = 1 + random.below(3);
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::size_t k = random.below(std::uint32_t(body.times.size()));
      const double height = random.among({1e3, 1e6, 1e15, 1e29, setting.limits.largest});
      body.position(k, random.below(body.vertex_count))[random.below(3)] = height * random.among({1, -1});
    }
  }
  return scene;
}

// --- time -----------------------------------------------------------------------------------------------

StressScene uneven_keyframes(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 30, std::max(3u, keyframes_for(setting)));
  for (StressBody& body : scene.bodies) {
    double t = random.among({0.0, -0.5, 5e-7});
    for (double& time : body.times) {
      time = t;
      t += random.among({1e-6, 1e-6, 5e-7, 1.0, 3.0, 1000.0, std::nextafter(t, 1e9) - t});
      if (!(t > time)) t = std::nextafter(time, 1e9);
    }
  }
  return scene;
}

/// Many keyframes, so that any drift becomes visible; few triangles.
StressScene many_keyframes(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  for (int b = 0; b < 2; ++b) {
    StressBody body = soup(random, 2 + random.below(3), 1);
    const std::vector<double> start = body.positions;
    body.times.clear();
    body.positions.clear();
    const double rate = random.among({1.0 / 30, 0.1, 1e-3});
    for (std::uint32_t k = 0; k < setting.many_keyframes; ++k) {
      body.times.push_back(rate * k);
      for (const double x : start) body.positions.push_back(x + 0.3 * random.unit());
    }
    scene.bodies.push_back(std::move(body));
  }
  const auto& times = scene.bodies[random.below(2)].times;
  // l frames in a few of the segments, else one in each.
  for (std::size_t k = 0; k + 1 < times.size(); ++k) {
    const std::uint32_t here = setting.l > 1 && k % 500 == 0 ? setting.l : 1;
    for (std::uint32_t j = 0; j < here; ++j)
      scene.frames.push_back(times[k] + (times[k + 1] - times[k]) * double(j) / double(here));
  }
  scene.compare_every = std::max<std::uint64_t>(1, scene.frames.size() / 150);
  return scene;
}

/// The same scene forward in steps of every size: within an ulp, over many keyframes, from before the first
/// to after the last, and twice to the same time.
StressScene odd_steps(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 30, 10);
  double t = random.among({0.0, -1.0, 0.1});
  const std::uint32_t frames = 20 + setting.l;
  for (std::uint32_t f = 0; f < frames; ++f) {
    scene.frames.push_back(t);
    switch (random.below(6)) {
      case 0:
        break;  // the same time again
      case 1:
        t = std::nextafter(t, 1e9);
        break;
      case 2:
        t = 0.25 * std::floor(4 * t + 1);  // the next keyframe
        break;
      case 3:
        t += 0.25 * random.below(4);
        break;
      default:
        t += std::abs(random.unit()) * random.among({1e-9, 0.01, 0.1, 1.5});
    }
  }
  return scene;
}

// --- changes of plans -----------------------------------------------------------------------------------

PlanChange<double> random_change(Random& random, const StressScene& scene, double t) {
  PlanChange<double> change;
  change.body = random.below(std::uint32_t(scene.bodies.size()));
  change.vertex = random.below(scene.bodies[change.body].vertex_count);
  const std::uint32_t kind = random.below(4);
  if (kind != 0)
    for (double& v : change.velocity) v = random.among({0.5 * random.unit(), 0.0, 0.25});
  if (kind >= 2)
    for (std::uint32_t k = 1; k <= 2; ++k) {
      change.times.push_back(t + 0.25 * k);
      for (int axis = 0; axis < 3; ++axis)
        change.positions.push_back(kind == 2 ? random.unit() : double(random.below(3)));
    }
  return change;
}

StressScene::Step changes_at(Random& random, const StressScene& scene, double t, std::uint32_t count) {
  StressScene::Step step{t, {}};
  for (std::uint32_t i = 0; i < count; ++i) step.changes.push_back(random_change(random, scene, t));
  return step;
}

/// Many changes of the same vertices: the last one counts.
StressScene changes_at_once(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 40, keyframes_for(setting));
  const double end = scene.bodies[0].times.back();
  scene.steps.push_back(changes_at(random, scene, end * random.among({0.0, 0.25, 1.0 / 3}), 2000));
  return scene;
}

/// Changes at instants at which many certificates fail: halfway between keyframes between which the scene is
/// mirrored, so that times are exact.
StressScene changes_at_events(const FamilySetting& setting) {
  StressScene scene = all_cross_at_once(setting);
  Random random(setting.seed + 1);
  const auto& times = scene.bodies[0].times;
  for (std::size_t k = 0; k + 1 < times.size(); ++k)
    scene.steps.push_back(changes_at(random, scene, 0.5 * (times[k] + times[k + 1]), 1 + random.below(40)));
  return scene;
}

StressScene changes_at_keyframes(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 30, keyframes_for(setting));
  const auto& times = scene.bodies[0].times;
  for (std::size_t k = 0; k < times.size(); ++k)
    scene.steps.push_back(changes_at(random, scene, times[k], 1 + random.below(30)));
  // A strategy cannot know in advance that a body with one keyframe will move.
  if (random.one_in(3)) {
    StressBody& still = scene.bodies[1];
    still.times.resize(1);
    still.positions.resize(std::size_t(3) * still.vertex_count);
  }
  return scene;
}

// --- shapes ---------------------------------------------------------------------------------------------

StressScene with_triangles(const FamilySetting& setting,
                           const std::function<void(Random&, double* corners)>& change) {
  Random random(setting.seed);
  StressScene scene = two_soups(random, 40, keyframes_for(setting));
  for (StressBody& body : scene.bodies)
    for (std::size_t k = 0; k < body.times.size(); ++k)
      for (std::size_t p = 0; p < body.primitives.size(); ++p) change(random, body.position(k, 3 * p));
  return scene;
}

StressScene slivers(const FamilySetting& setting) {
  return with_triangles(setting, [&](Random& random, double* corners) {
    // The third corner lies near the line through the others, or near one of them.
    const double u = random.among({0.0, 0.5, 1.0, std::abs(random.unit())});
    const double width = random.among({0.0, setting.limits.epsilon, 1e-7, 1e-3});
    for (int i = 0; i < 3; ++i)
      corners[6 + i] = corners[i] + u * (corners[3 + i] - corners[i]) + width * random.unit();
  });
}

StressScene zero_area(const FamilySetting& setting) {
  return with_triangles(setting, [](Random& random, double* corners) {
    const std::uint32_t kind = random.below(4);
    if (kind == 0) return;
    if (kind >= 1) std::copy_n(corners, 3, corners + 6);  // a segment
    if (kind >= 2) std::copy_n(corners, 3, corners + 3);  // a point
    if (kind >= 3)
      for (int i = 0; i < 9; ++i) corners[i] = std::round(corners[i]);
  });
}

/// The same triangles many times: copies of vertices, of lists of vertices, and across the bodies.
StressScene duplicates(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const StressBody one = soup(random, 4, keyframes_for(setting), 0.8);
  const std::uint32_t copies = 4 + random.below(6);
  for (int b = 0; b < 2; ++b) {
    StressBody body = unmoved(one.vertex_count * copies);
    body.times = one.times;
    body.positions.clear();
    for (std::size_t k = 0; k < one.times.size(); ++k)
      for (std::uint32_t c = 0; c < copies; ++c)
        body.positions.insert(body.positions.end(), one.position(k, 0),
                              one.position(k, 0) + std::size_t(3) * one.vertex_count);
    for (std::uint32_t c = 0; c < copies; ++c)
      for (const auto& primitive : one.primitives) {
        auto ids = primitive;
        for (std::uint32_t& v : ids) v += c % 2 == 0 ? c * one.vertex_count : 0;
        body.primitives.push_back(ids);
        // A repeated corner.
        if (random.one_in(4)) body.primitives.push_back({ids[0], ids[1], ids[1]});
      }
    scene.bodies.push_back(std::move(body));
  }
  return scene;
}

StressScene one_or_none(const FamilySetting& setting) {
  Random random(setting.seed);
  StressScene scene;
  const std::uint32_t bodies = 2 + random.below(2);
  for (std::uint32_t b = 0; b < bodies; ++b) {
    const std::uint32_t kind = random.below(4);
    if (kind == 0)
      scene.bodies.push_back(unmoved(random.below(3)));  // number of unused vertices
    else
      scene.bodies.push_back(soup(random, kind == 3 ? 20 : 1, random.among({1u, keyframes_for(setting)})));
  }
  return scene;
}

}  // namespace

const std::vector<Family>& families() {
  static const std::vector<Family> all{
      {"tiny", "coordinates of 1e-30", tiny},
      {"unit", "coordinates of 1", unit},
      {"million", "coordinates of 1e6", million},
      {"huge", "coordinates of 1e30", huge},
      {"mixed", "coordinates from 1e-30 to 1e30 in one scene", mixed},
      {"largest", "across the whole admissible range from keyframe to keyframe", largest},
      {"beyond_range", "on both sides of the admissible range", beyond_range},
      {"far_away", "far offset, motion in the last places", far_away},
      {"far_sheets", "a gap between two sheets, far from the origin", far_sheets},
      {"far_vertices", "the same, with a far vertex or a large ground in one body", far_vertices},
      {"denormals", "coordinates between zero and the smallest normal number", denormals},
      {"signed_zeros", "zeros of both signs", signed_zeros},
      {"near_parallel", "trajectories whose slopes differ in the last places", near_parallel},
      {"near_tangent", "trajectories that touch the highest one, up to one ulp", near_tangent},
      {"all_cross_at_once", "all vertices cross at one instant", all_cross_at_once},
      {"coincident", "vertices that coincide for whole segments", coincident},
      {"ties_that_separate", "exact ties that separate later", ties_that_separate},
      {"spikes", "single vertices move far out and back", spikes},
      {"uneven_keyframes", "segments of a millionth of a second next to long ones", uneven_keyframes},
      {"many_keyframes", "up to 1e5 keyframes of a few triangles", many_keyframes},
      {"odd_steps", "a clip played forward in irregular steps", odd_steps},
      {"changes_at_once", "thousands of changes of plans at one instant", changes_at_once},
      {"changes_at_events", "changes of plans at times of events", changes_at_events},
      {"changes_at_keyframes", "changes of plans at keyframes", changes_at_keyframes},
      {"slivers", "needles and caps", slivers},
      {"zero_area", "triangles that are segments or points", zero_area},
      {"duplicates", "the same triangles many times", duplicates},
      {"one_or_none", "bodies of one triangle, or of none", one_or_none},
  };
  return all;
}

const Family& find_family(const std::string& name) {
  std::vector<std::string> known;
  for (const Family& family : families()) {
    if (family.name == name) return family;
    known.push_back(family.name);
  }
  throw io::InputError(no_such("family", name, known, "`kbvh stress --list` shows them"));
}

StressScene make_scene(const Family& family, const FamilySetting& setting) {
  StressScene scene = family.make(setting);
  scene.family = family.name;
  if (!scene.frames.empty()) return scene;
  std::vector<double> knots;
  for (const StressBody& body : scene.bodies)
    if (body.times.size() > 1) knots.insert(knots.end(), body.times.begin(), body.times.end());
  if (knots.empty()) knots = {0.0, 0.5};
  std::sort(knots.begin(), knots.end());
  knots.erase(std::unique(knots.begin(), knots.end()), knots.end());
  for (std::size_t k = 0; k + 1 < knots.size(); ++k)
    for (std::uint32_t j = 0; j < setting.l; ++j)
      scene.frames.push_back(knots[k] + (knots[k + 1] - knots[k]) * double(j) / double(setting.l));
  scene.frames.push_back(knots.back());
  for (const StressScene::Step& step : scene.steps) scene.frames.push_back(step.time);
  std::sort(scene.frames.begin(), scene.frames.end());
  scene.frames.erase(std::unique(scene.frames.begin(), scene.frames.end()), scene.frames.end());
  // The keyframes of several bodies, overlaid, give more segments than l was chosen for.
  if (scene.frames.size() > 200) scene.compare_every = scene.frames.size() / 100;
  return scene;
}

}  // namespace kbvh::experiments::stress
