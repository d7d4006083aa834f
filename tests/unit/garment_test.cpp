// The garment scenes: counts, determinism, and that cloth stays whole, outside of the figure, and on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "experiments/scenes/garment.hpp"
#include "experiments/scenes/garment_solver.hpp"

namespace kbvh::scenes::garment_test {
namespace {

using cloth::length;
using cloth::Vec;

constexpr GarmentKind kinds[] = {GarmentKind::shirt, GarmentKind::dress};

GarmentConfig small(GarmentKind kind) {
  GarmentConfig config;
  config.kind = kind;
  config.triangles = 1000;
  config.avatar_triangles = 800;
  config.keyframes = 20;
  return config;
}

/// Simulated once for all tests that only read it.
const std::vector<io::AnimatedMesh>& small_scene(GarmentKind kind) {
  static const std::vector<io::AnimatedMesh> scenes[] = {simulate_garment(small(GarmentKind::shirt)),
                                                         simulate_garment(small(GarmentKind::dress))};
  return scenes[std::size_t(kind)];
}

std::uint64_t hash(const std::vector<double>& values) {
  std::uint64_t h = 0xcbf29ce484222325u;
  for (const double v : values) h = (h ^ std::bit_cast<std::uint64_t>(v)) * 0x100000001b3u;
  return h;
}

Vec at(const io::AnimatedMesh& mesh, std::size_t keyframe, std::size_t vertex) {
  const double* p = &mesh.positions[3 * (keyframe * mesh.vertex_count + vertex)];
  return {p[0], p[1], p[2]};
}

void expect_sound(const io::AnimatedMesh& mesh, std::size_t keyframes) {
  SCOPED_TRACE(mesh.name);
  ASSERT_EQ(mesh.keyframe_times.size(), keyframes);
  ASSERT_EQ(mesh.positions.size(), keyframes * mesh.vertex_count * 3);
  ASSERT_EQ(mesh.primitive_vertices.size(), 3 * mesh.primitive_count());
  EXPECT_TRUE(mesh.name.ends_with("-" + std::to_string(mesh.primitive_count())));
  EXPECT_EQ(mesh.keyframe_times.front(), 0.0);
  for (std::size_t k = 1; k < keyframes; ++k)
    EXPECT_NEAR(mesh.keyframe_times[k] - mesh.keyframe_times[k - 1], 1.0 / 30, 1e-12);
  std::vector<bool> used(mesh.vertex_count, false);
  for (std::size_t t = 0; t < mesh.primitive_count(); ++t) {
    const std::uint32_t* v = &mesh.primitive_vertices[3 * t];
    ASSERT_LT(std::max({v[0], v[1], v[2]}), mesh.vertex_count);
    EXPECT_TRUE(v[0] != v[1] && v[1] != v[2] && v[2] != v[0]);
    for (int i = 0; i < 3; ++i) used[v[i]] = true;
  }
  EXPECT_TRUE(std::all_of(used.begin(), used.end(), [](bool u) { return u; }));
  for (const double x : mesh.positions) {
    ASSERT_TRUE(std::isfinite(x));
    const volatile float single = float(x);
    ASSERT_EQ(double(single), x);
    ASSERT_FALSE(x == 0 && std::signbit(x));
  }
}

/// Counts edges with only one triangle; every edge has one or two, and neighbours agree on which side is
/// outside.
std::size_t border_edges(const io::AnimatedMesh& mesh) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> directed;
  for (std::size_t t = 0; t < mesh.primitive_count(); ++t)
    for (std::size_t i = 0; i < 3; ++i)
      directed.emplace_back(mesh.primitive_vertices[3 * t + i], mesh.primitive_vertices[3 * t + (i + 1) % 3]);
  std::sort(directed.begin(), directed.end());
  EXPECT_EQ(std::adjacent_find(directed.begin(), directed.end()), directed.end()) << mesh.name;
  std::size_t border = 0;
  for (const auto& [a, b] : directed)
    border += !std::binary_search(directed.begin(), directed.end(), std::pair(b, a));
  return border;
}

TEST(Garment, SewnWholeAndFacingOutwards) {
  for (const GarmentKind kind : kinds) {
    const auto& bodies = small_scene(kind);
    ASSERT_EQ(bodies.size(), 2u);
    for (const io::AnimatedMesh& mesh : bodies) expect_sound(mesh, 20);
    EXPECT_EQ(border_edges(bodies[1]), 0u) << "the skin is closed";
    // Hem, neck, and two cuffs or armholes.
    const GarmentShape shape = garment_shape(kind);
    const GarmentCounts counts = garment_counts(shape, 1000);
    const std::size_t hem = (counts.doubled > 0 ? 4 : 2) * counts.columns;
    const std::size_t neck = 2 * (counts.columns - 2 * counts.shoulder);
    EXPECT_EQ(border_edges(bodies[0]), hem + neck + 4 * counts.armhole);
    EXPECT_EQ(bodies[0].primitive_count(), counts.triangles());
  }
}

TEST(Garment, EveryNumberOfTriangles) {
  for (const GarmentKind kind : kinds) {
    const GarmentShape shape = garment_shape(kind);
    for (const std::uint32_t n :
         {500u, 2000u, 8000u, 32000u, 65000u, 145000u, 163000u, 290000u, 326000u, 580000u}) {
      const double off = double(garment_counts(shape, n).triangles()) - n;
      EXPECT_LT(std::fabs(off), n < 5000 ? 0.05 * n : 0.01 * n) << n;
    }
    for (const std::uint32_t n : {1u, 100u}) {
      GarmentConfig config = small(kind);
      config.triangles = config.avatar_triangles = n;
      config.keyframes = 2;
      for (const io::AnimatedMesh& mesh : simulate_garment(config)) expect_sound(mesh, 2);
    }
  }
}

TEST(Garment, SameConfigSameBits) {
  // The same bits on every machine and with every compiler. If the solver was changed on purpose, raise its
  // version and put the new numbers here; if not, some flag breaks the numeric policy.
  const std::uint64_t expected[2][2] = {{5260572430908201125u, 4241357780628607813u},
                                        {11317845340094885893u, 10656394749474729173u}};
  for (const GarmentKind kind : kinds) {
    const auto again = simulate_garment(small(kind));
    for (std::size_t body = 0; body < 2; ++body) {
      EXPECT_EQ(again[body].positions, small_scene(kind)[body].positions);
      EXPECT_EQ(again[body].primitive_vertices, small_scene(kind)[body].primitive_vertices);
      EXPECT_EQ(hash(again[body].positions), expected[std::size_t(kind)][body]);
    }
  }
}

TEST(Garment, SameBitsWithTwoLevels) {
  GarmentConfig config = small(GarmentKind::dress);
  config.full_triangles = 500;
  config.triangles = 1500;
  config.keyframes = 4;
  const auto first = simulate_garment(config);
  EXPECT_EQ(first[0].positions, simulate_garment(config)[0].positions);
  EXPECT_EQ(hash(first[0].positions), 13779276792411937189u);
}

TEST(Garment, SeedChangesTheMotion) {
  GarmentConfig config = small(GarmentKind::shirt);
  config.keyframes = 2;
  const auto first = simulate_garment(config);
  config.seed = 2;
  const auto second = simulate_garment(config);
  EXPECT_NE(first[0].positions, second[0].positions);
  EXPECT_NE(first[1].positions, second[1].positions);
}

TEST(Garment, CacheKeyTellsConfigsApart) {
  std::vector<GarmentConfig> configs(21);
  std::size_t i = 1;  // the first stays as it is
  configs[i++].kind = GarmentKind::dress;
  configs[i++].triangles = 32001;
  configs[i++].seed = 2;
  configs[i++].keyframes = 61;
  configs[i++].keyframes_per_second = 31;
  configs[i++].avatar_triangles = 12001;
  configs[i++].full_triangles = 66001;
  configs[i++].fine_steps = 13;
  configs[i++].area_density = 0.3;
  configs[i++].stretch_stiffness = 3999;
  configs[i++].shear_stiffness = 399;
  configs[i++].bending_rigidity = 3e-5;
  configs[i++].air_drag = 3;
  configs[i++].viscosity = 0.005;
  configs[i++].friction = 0.6;
  configs[i++].layer_distance = 0.7;
  configs[i++].skin_bite = 0.003;
  configs[i++].substeps_per_keyframe = 7;
  configs.resize(i);
  std::set<std::string> keys;
  for (const GarmentConfig& config : configs) {
    keys.insert(cache_key(config));
    EXPECT_EQ(cache_key(config).find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-"),
              std::string::npos);
  }
  EXPECT_EQ(keys.size(), configs.size());
}

TEST(Garment, RefusesWhatIsOutOfRange) {
  GarmentConfig config = small(GarmentKind::shirt);
  config.friction = std::nan("");
  EXPECT_THROW(simulate_garment(config), io::InputError);
  config = small(GarmentKind::dress);
  config.triangles = 0;
  EXPECT_THROW(simulate_garment(config), io::InputError);
  config = small(GarmentKind::dress);
  config.avatar_triangles = 0;
  EXPECT_THROW(simulate_garment(config), io::InputError);
}

TEST(Garment, ProgressRisesToOne) {
  for (const std::uint32_t full : {300u, 30000u}) {
    GarmentConfig config = small(GarmentKind::shirt);
    config.triangles = 400;
    config.full_triangles = full;
    config.keyframes = 3;
    std::vector<double> fractions;
    simulate_garment(config, [&](double fraction) { fractions.push_back(fraction); });
    EXPECT_GE(fractions.size(), 3u);
    EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
    EXPECT_EQ(fractions.back(), 1.0);
  }
}

/// Properties of any garment at every keyframe.
void expect_worn(const GarmentConfig& config, const io::AnimatedMesh& garment) {
  SCOPED_TRACE(garment.name);
  WalkingFigure figure(config);
  const GarmentShape shape = garment_shape(config.kind);
  const GarmentPattern pattern = sew(shape, garment_counts(shape, config.triangles), figure.walker(), 0.004);
  ASSERT_EQ(pattern.rest.size(), garment.vertex_count);
  for (std::size_t k = 0; k < config.keyframes; ++k) {
    const double t = double(k) / config.keyframes_per_second;
    figure.move_to(t);
    double deepest = 0, highest = 0, lowest = 10;
    std::size_t touching = 0, inside = 0;
    for (std::size_t v = 0; v < garment.vertex_count; ++v) {
      Vec p = at(garment, k, v);
      p.x -= figure.metres_per_second() * t;
      const double d = figure.walker().nearest(p, 1.0).distance;
      deepest = std::min(deepest, d);
      touching += d < 0.002;
      inside += d < -0.0001;
      highest = std::max(highest, p.z);
      lowest = std::min(lowest, p.z);
      // Nothing is further from the figure than the skirt is wide.
      EXPECT_LT(d, config.kind == GarmentKind::shirt ? 0.20 : 0.45);
    }
    // Where it is pinched between arm and trunk it may be inside of one of them.
    EXPECT_GT(deepest, -0.006) << "keyframe " << k;
    EXPECT_LT(inside, garment.vertex_count / 50) << "keyframe " << k;
    EXPECT_GT(touching, garment.vertex_count / 50) << "keyframe " << k;
    // It hangs from the shoulders, with its full length.
    const double shoulder = figure.shape().shoulder.z;
    EXPECT_NEAR(highest, shoulder + 0.05, 0.08) << "keyframe " << k;
    EXPECT_GT(lowest, shape.levels.front().z - 0.25) << "keyframe " << k;
    std::size_t stretched = 0;
    double most = 0;
    for (const auto& thread : pattern.threads) {
      const double ratio = length(at(garment, k, thread.a) - at(garment, k, thread.b)) / thread.rest;
      most = std::max(most, ratio);
      stretched += ratio > 1.1;
    }
    // Short threads around the armholes stretch most.
    EXPECT_LT(most, 1.6) << "keyframe " << k;
    EXPECT_LT(double(stretched), 0.03 * double(pattern.threads.size())) << "keyframe " << k;
  }
}

TEST(Garment, IsWornAndWhole) {
  for (const GarmentKind kind : kinds) expect_worn(small(kind), small_scene(kind)[0]);
}

TEST(Garment, IsWornAndWholeWithTwoLevels) {
  for (const GarmentKind kind : kinds) {
    GarmentConfig config = small(kind);
    config.full_triangles = 2000;
    config.triangles = 6000;
    config.keyframes = 5;
    expect_worn(config, simulate_garment(config)[0]);
  }
}

TEST(Garment, GuideHoldsWhatItAverages) {
  const GarmentShape shape = garment_shape(GarmentKind::dress);
  const Walker walker(woman(), {});
  const GarmentPattern coarse = sew(shape, garment_counts(shape, 800), walker, 0.004);
  const GarmentPattern fine = sew(shape, garment_counts(shape, 6000), walker, 0.004);
  Guide guide(coarse, fine);
  // Patterns of all counts lie in the same place (the figure's rest pose).
  std::vector<Vec> wanted;
  guide.interpolate(coarse.rest, wanted);
  double most = 0;
  for (std::size_t v = 0; v < wanted.size(); ++v) most = std::max(most, length(wanted[v] - fine.rest[v]));
  EXPECT_LT(most, 1.5 * coarse.spacing);
  // A shift of everything is undone; a ripple finer than the coarse squares mostly remains.
  std::vector<Vec> x = wanted;
  for (Vec& p : x) p.z += 0.01;
  guide.hold(x, wanted);
  for (std::size_t v = 0; v < x.size(); ++v) EXPECT_LT(length(x[v] - wanted[v]), 1e-9);
  x = wanted;
  for (std::size_t v = 0; v < x.size(); ++v) x[v].z += fine.places[v].row % 2 == 0 ? 0.01 : -0.01;
  guide.hold(x, wanted);
  double kept = 0;
  for (std::size_t v = 0; v < x.size(); ++v)
    kept += std::fabs(x[v].z - wanted[v].z) / (0.01 * double(x.size()));
  EXPECT_GT(kept, 0.5);
}

TEST(Walker, DistanceIsSignedAndNormalsAreItsGradient) {
  const GarmentConfig config = small(GarmentKind::shirt);
  WalkingFigure figure(config);
  for (const double t : {-1.2, 0.1, 0.9}) {
    figure.move_to(t);
    for (int i = 0; i < 2000; ++i) {
      const Vec p{0.3 * std::sin(i * 1.1), 0.4 * std::sin(i * 0.7), 0.9 + 0.8 * std::sin(i * 0.37)};
      const auto near = figure.walker().nearest(p, 0.5);
      EXPECT_NEAR(length(near.normal), 1, 1e-9);
      // Distances change by no more than the displacement, and outside, along the normal, by nearly all of
      // it.
      const Vec q = p + near.normal * 1e-4;
      EXPECT_LE(std::fabs(figure.walker().nearest(q, 0.5).distance - near.distance), 1.0001e-4);
    }
  }
}

TEST(Walker, SkinLiesOnTheSolid) {
  for (const GarmentKind kind : kinds) {
    const GarmentConfig config = small(kind);
    WalkingFigure figure(config);
    const io::AnimatedMesh& skin = small_scene(kind)[1];
    std::size_t proud = 0;
    for (std::size_t k = 0; k < config.keyframes; ++k) {
      const double t = double(k) / config.keyframes_per_second;
      figure.move_to(t);
      for (std::size_t v = 0; v < skin.vertex_count; ++v) {
        Vec p = at(skin, k, v);
        p.x -= figure.metres_per_second() * t;
        // Where limbs join the trunk, one part's surface lies inside another part.
        const double d = figure.walker().nearest(p, 1.0).distance;
        EXPECT_LT(d, config.skin_bite + 1e-4);
        proud += d > 0.0005;
      }
    }
    EXPECT_GT(proud, 0u) << "the cloth cuts the skin where it stands proud";
  }
}

}  // namespace
}  // namespace kbvh::scenes::garment_test
