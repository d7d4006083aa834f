#pragma once
// Small scenes that are difficult for hierarchies and for libraries' shortcuts: contact, offsets, scale,
// degeneracy.
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "core/scene/cut_polygons.hpp"

namespace adapters_test {

template <class S>
kbvh::FlightPlans<S> plans(std::uint32_t vertices, std::vector<std::vector<double>> keyframes) {
  std::vector<double> times;
  std::vector<S> positions;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    times.push_back(double(k));
    for (double x : keyframes[k]) positions.push_back(S(x));
  }
  return {vertices, times, positions};
}

inline kbvh::Primitives consecutive(std::uint32_t count, std::uint32_t size) {
  kbvh::Primitives primitives;
  for (std::uint32_t p = 0; p < count; ++p) {
    std::vector<std::uint32_t> primitive;
    for (std::uint32_t k = 0; k < size; ++k) primitive.push_back(p * size + k);
    primitives.add(primitive);
  }
  return primitives;
}

struct Soup {
  std::uint32_t primitives = 40, corners = 3, keyframes = 4;
  double scale = 1, offset = 0, size = .2;
  std::uint32_t seed = 1;
};

/// Primitives that jump between random places at every keyframe.
template <class S>
kbvh::Body<S> soup(const Soup& soup) {
  std::mt19937 random(soup.seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<std::vector<double>> keyframes(soup.keyframes);
  for (auto& keyframe : keyframes)
    for (std::uint32_t p = 0; p < soup.primitives; ++p) {
      const double centre[3] = {uniform(random), uniform(random), uniform(random)};
      for (std::uint32_t v = 0; v < soup.corners; ++v)
        for (double c : centre)
          keyframe.push_back(soup.offset + soup.scale * (c + soup.size * uniform(random)));
    }
  return {"soup " + std::to_string(soup.seed), consecutive(soup.primitives, soup.corners),
          plans<S>(soup.primitives * soup.corners, keyframes)};
}

/// A regular grid of n x n squares in the plane z = height, as triangles (corners = 3) or quads (4).
template <class S>
kbvh::Body<S> grid(std::uint32_t n, double spacing, std::uint32_t corners, std::vector<double> heights) {
  kbvh::Body<S> body;
  body.name = "grid";
  std::vector<std::vector<double>> keyframes;
  for (double height : heights) {
    keyframes.emplace_back();
    for (std::uint32_t y = 0; y <= n; ++y)
      for (std::uint32_t x = 0; x <= n; ++x) {
        const double p[3] = {x * spacing, y * spacing, height};
        keyframes.back().insert(keyframes.back().end(), p, p + 3);
      }
  }
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x, b = a + 1, c = b + n + 1, d = a + n + 1;
      if (corners == 4) {
        body.primitives.add(std::vector{a, b, c, d});
      } else {
        body.primitives.add(std::vector{a, b, c});
        body.primitives.add(std::vector{a, c, d});
      }
    }
  body.plans = plans<S>((n + 1) * (n + 1), keyframes);
  return body;
}

template <class S>
kbvh::Scene<S> scene(std::string name, std::vector<kbvh::Body<S>> bodies) {
  kbvh::Scene<S> result{std::move(name), std::move(bodies), {}};
  result.pairs = kbvh::all_pairs(result.bodies);
  kbvh::validate(result);
  kbvh::cut_polygons(result);
  return result;
}

/// Coordinates from a coarse lattice: most contacts are touching or coplanar.
template <class S>
kbvh::Scene<S> lattice(std::uint32_t seed, double scale, double offset) {
  std::vector<kbvh::Body<S>> bodies{soup<S>({.primitives = 50, .seed = 2 * seed}),
                                    soup<S>({.primitives = 40, .seed = 2 * seed + 1})};
  for (auto& body : bodies) {
    std::vector<std::vector<double>> keyframes(body.plans.keyframe_count());
    for (std::size_t k = 0; k < keyframes.size(); ++k)
      for (std::size_t i = 0; i < std::size_t(3) * body.plans.vertex_count(); ++i)
        keyframes[k].push_back(offset + scale * std::round(double(body.plans.keyframe(k)[i]) * 4) / 4);
    body.plans = plans<S>(body.plans.vertex_count(), keyframes);
  }
  return scene<S>("lattice", std::move(bodies));
}

template <class S>
std::vector<kbvh::Scene<S>> awkward_scenes() {
  std::vector<kbvh::Scene<S>> scenes;
  const auto two = [&](const std::string& name, Soup a) {
    Soup b = a;
    b.seed = a.seed + 100;
    b.primitives = a.primitives + 7;
    scenes.push_back(scene<S>(name, {soup<S>(a), soup<S>(b)}));
  };
  two("soup", {});
  two("dense soup", {.primitives = 60, .size = .7, .seed = 2});
  two("far away", {.offset = 1e6, .seed = 3});
  two("far away and small", {.scale = 1, .offset = 1e4, .size = .4, .seed = 4});
  two("tiny", {.scale = 1e-3, .seed = 5});
  two("very tiny", {.scale = 1e-30, .size = .5, .seed = 6});
  two("denormal", {.scale = sizeof(S) == 4 ? 1e-40 : 1e-310, .size = .5, .seed = 7});
  two("large", {.scale = 1e6, .size = .3, .seed = 8});
  two("segments", {.primitives = 60, .corners = 2, .size = .5, .seed = 9});
  two("hexagons", {.corners = 6, .seed = 10});
  two("points", {.primitives = 20, .corners = 1, .size = 0, .seed = 11});
  scenes.push_back(lattice<S>(12, 1, 0));
  // Sheets that touch exactly, at l = 1, in the last keyframe; one rests.
  scenes.push_back(scene<S>("touching sheets", {grid<S>(5, .25, 3, {1, .5, 0}), grid<S>(4, .5, 4, {0}),
                                                grid<S>(3, .5, 3, {-1, -.25, 0})}));
  // A body of one triangle, an empty one, and one of many.
  {
    auto small = soup<S>({.primitives = 1, .scale = 1, .size = 2, .seed = 14});
    auto large = soup<S>({.primitives = 300, .scale = 10, .size = .5, .seed = 15});
    kbvh::Body<S> empty{"empty", {}, plans<S>(0, {{}})};
    scenes.push_back(scene<S>("one, none, many", {small, empty, large}));
  }
  // Bodies at a distance, which never overlap, and one that comes from far away.
  {
    auto near = soup<S>({.seed = 16}), far = soup<S>({.offset = 50, .seed = 17});
    auto comet = soup<S>({.primitives = 20, .size = .4, .seed = 18});
    std::vector<std::vector<double>> path(3);
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t i = 0; i < std::size_t(3) * comet.plans.vertex_count(); ++i)
        path[k].push_back(double(comet.plans.keyframe(0)[i]) + (k == 0 ? 1000. : k == 1 ? 0. : -1000.));
    comet.plans = plans<S>(comet.plans.vertex_count(), path);
    scenes.push_back(scene<S>("comet", {near, far, comet}));
  }
  {
    auto a = soup<S>({.primitives = 15, .corners = 5, .seed = 19});
    auto b = soup<S>({.primitives = 25, .corners = 1, .size = .1, .seed = 20});
    auto c = soup<S>({.primitives = 15, .corners = 4, .seed = 21});
    a.primitives.kind = kbvh::PrimitiveKind::control_nets;
    b.primitives.kind = kbvh::PrimitiveKind::points;
    scenes.push_back(scene<S>("nets, points and quads", {a, b, c}));
  }
  return scenes;
}

}  // namespace adapters_test
