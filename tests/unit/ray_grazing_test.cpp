// Rays that graze: at vertices, edges and planes of doubled faces, next to them by a few units in the last
// place, near to and far from the origin, at sizes up to where squares overflow or underflow. The wide
// traversal, whose filter of triangles computes in the scalar, must give the answers of all faces, with every
// set of kernels.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "core/families/wide/wide_rays.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/topology/builders.hpp"

namespace kbvh::ray_grazing_test {
namespace {

/// The rays of each kind on each scene. The variable KBVH_GRAZING_RAYS asks for more.
std::uint32_t rays_of_a_kind() {
  const char* const asked = std::getenv("KBVH_GRAZING_RAYS");
  return asked != nullptr ? std::uint32_t(std::atoi(asked)) : 150;
}

enum class Shape : std::uint8_t { flat, waves, folds };

/// A sheet of 2 n^2 triangles, each of them once in either direction, in two bodies at the same place that
/// move together: at time 1 they are shifted.
template <class S>
Scene<S> doubled_sheet(Shape shape, double size, double shift) {
  constexpr std::uint32_t n = 5;
  Scene<S> scene;
  for (int copy = 0; copy < 2; ++copy) {
    Body<S> body;
    std::vector<S> positions;
    for (const double later : {0.0, 0.375}) {
      for (std::uint32_t j = 0; j <= n; ++j)
        for (std::uint32_t i = 0; i <= n; ++i) {
          const double x = double(i), y = double(j);
          const double height = shape == Shape::flat    ? 0.5
                                : shape == Shape::waves ? 0.4 * std::sin(2 * x + 1.5 * y)
                                                        : double(i % 2) * 2.25;
          const double wide = shape == Shape::folds ? 0.125 * x : x;
          for (const double coordinate : {wide + later, y, height})
            positions.push_back(S(size * (coordinate + shift)));
        }
    }
    for (std::uint32_t j = 0; j < n; ++j)
      for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
        body.primitives.add(std::vector{a, b, c});
        body.primitives.add(std::vector{b, d, c});
        body.primitives.add(std::vector{c, b, a});
        body.primitives.add(std::vector{d, b, c});
      }
    body.plans = FlightPlans<S>((n + 1) * (n + 1), {0, 1}, std::move(positions));
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

template <class S>
class GrazingRays {
 public:
  GrazingRays(const Playback<S>& playback, double size, std::uint32_t seed)
      : playback_(playback), size_(size), random_(seed) {}

  std::vector<Ray<S>> make(std::uint32_t of_a_kind) {
    std::vector<Ray<S>> rays;
    for (std::uint32_t i = 0; i < of_a_kind; ++i) {
      Ray<S> ray{};
      S target[3];
      // At a vertex, and no further than there; at a point of an edge; next to these.
      ray.origin[0] = ray.origin[1] = ray.origin[2] = 0;
      from_somewhere(ray);
      std::copy_n(vertex(), 3, target);
      towards(ray, target);
      rays.push_back(ray);
      ray.length = S(1);
      rays.push_back(ray);
      ray.length = std::numeric_limits<S>::infinity();
      nudge(ray.direction);
      rays.push_back(ray);
      on_an_edge(target);
      towards(ray, target);
      rays.push_back(ray);
      nudge(ray.direction);
      rays.push_back(ray);
      // Along an axis through a vertex or a point of an edge, or next to it.
      random_() % 2 == 0 ? on_an_edge(ray.origin) : void(std::copy_n(vertex(), 3, ray.origin));
      const std::uint32_t axis = below(3);
      std::fill_n(ray.direction, 3, S(0));
      ray.direction[axis] = S(below(2) == 0 ? 1 : -1);
      ray.origin[axis] -= S(size_ * 16) * ray.direction[axis];
      rays.push_back(ray);
      nudge(ray.origin);
      rays.push_back(ray);
      // In the plane of faces: along edges and diagonals, and next to them.
      const S *from = vertex(), *to = vertex();
      for (int a = 0; a < 3; ++a) {
        ray.direction[a] = to[a] - from[a];
        ray.origin[a] = S(from[a] - 2 * ray.direction[a]);
      }
      rays.push_back(ray);
      nudge(ray.direction);
      rays.push_back(ray);
      // From a vertex or an edge.
      random_() % 2 == 0 ? on_an_edge(ray.origin) : void(std::copy_n(vertex(), 3, ray.origin));
      for (S& d : ray.direction) d = S(size_ * (share() - 0.5));
      rays.push_back(ray);
    }
    return rays;
  }

 private:
  std::uint32_t below(std::uint32_t n) { return std::uint32_t(random_() % n); }
  double share() { return double(random_() >> 8) / double(1 << 24); }
  const S* vertex() { return playback_.positions(0) + std::size_t(3) * below(36); }
  void on_an_edge(S* point) {
    const std::uint32_t i = below(5), j = below(5), a = j * 6 + i;
    const std::uint32_t ends[3][2] = {{a, a + 1}, {a, a + 6}, {a + 1, a + 6}};
    const auto& [p, q] = ends[below(3)];
    const double at = below(2) == 0 ? 0.5 : share();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double low = double(playback_.positions(0)[3 * p + axis]);
      point[axis] = S(low + at * (double(playback_.positions(0)[3 * q + axis]) - low));
    }
  }
  void from_somewhere(Ray<S>& ray) {
    const S* const near = vertex();
    const double far = std::ldexp(size_, int(below(8)));
    for (int axis = 0; axis < 3; ++axis) ray.origin[axis] = S(double(near[axis]) + far * (share() * 2 - 1));
    ray.length = std::numeric_limits<S>::infinity();
  }
  static void towards(Ray<S>& ray, const S* target) {
    for (int axis = 0; axis < 3; ++axis) ray.direction[axis] = target[axis] - ray.origin[axis];
  }
  void nudge(S* values) {
    for (int axis = 0; axis < 3; ++axis)
      for (std::uint32_t steps = below(3); steps-- > 0;)
        values[axis] =
            std::nextafter(values[axis], std::numeric_limits<S>::infinity() * S(below(2) == 0 ? 1 : -1));
  }

  const Playback<S>& playback_;
  double size_;
  std::mt19937 random_;
};

/// Returns the answer of all faces, and counts the faces that a filter would lose which trusts each computed
/// sign of a side.
template <class S>
RayHit answer_of_all(const Scene<S>& scene, const Playback<S>& playback, const Ray<S>& ray,
                     std::uint64_t& lost) {
  TriangleTestStats stats;
  RaySearch<S> search(ray, RayQuery::closest);
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body) {
    const Primitives& primitives = scene.bodies[body].primitives;
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      search.offer(body, p, primitives.triangles(p), playback.positions(body), stats);
      if (body != 0 || search.hit() != RayHit{body, p, search.hit().parameter}) continue;
      S x[3], y[3];
      std::size_t along = 0;
      for (std::size_t axis = 1; axis < 3; ++axis)
        if (std::abs(ray.direction[axis]) > std::abs(ray.direction[along])) along = axis;
      const std::size_t u = (along + 1) % 3, v = (along + 2) % 3;
      for (std::size_t c = 0; c < 3; ++c) {
        const S* const corner = playback.positions(body) + std::size_t(3) * primitives[p][c];
        const S z = corner[along] - ray.origin[along];
        x[c] = corner[u] - ray.origin[u] - z * (ray.direction[u] / ray.direction[along]);
        y[c] = corner[v] - ray.origin[v] - z * (ray.direction[v] / ray.direction[along]);
      }
      const S sides[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
      lost += *std::min_element(sides, sides + 3) < 0 && *std::max_element(sides, sides + 3) > 0 ? 1 : 0;
    }
  }
  return search.hit();
}

/// Hierarchies of one set of kernels, and the traversal that is kept while bodies move.
template <class S>
class Wide {
 public:
  Wide(const Scene<S>& scene, const Playback<S>& playback, Playback<S>& moving, const BuilderConfig& builder,
       KernelSet set)
      : view_(scene), playback_(moving), probes_(view_, SampledMotion<S>(moving)) {
    trees_.resize(scene.bodies.size());
    for (std::uint32_t body = 0; body < trees_.size(); ++body) {
      const auto boxes = primitive_boxes(view_.primitives(body), playback.positions(body));
      trees_[body].assign(build_topology<S>(boxes, builder), view_.primitives(body), set);
    }
  }
  void refit() {
    for (std::uint32_t body = 0; body < trees_.size(); ++body) {
      trees_[body].positions_changed();
      trees_[body].refit(playback_.positions(body));
    }
  }
  std::vector<RayHit> ask(RayQuery query, std::span<const Ray<S>> rays) {
    std::vector<RayHit> hits(rays.size());
    std::uint64_t tests = 0;
    probes_.answer(
        RayProbes<S>{query, rays, hits},
        [&](std::uint32_t body) -> WideSide<S> {
          return {&trees_[body], body};
        },
        stats_, tests);
    return hits;
  }
  const TriangleTestStats& stats() const { return stats_; }

 private:
  SceneView<S> view_;
  Playback<S>& playback_;
  std::vector<WideHierarchy<S>> trees_;
  WideProbes<S> probes_;
  TriangleTestStats stats_;
};

struct Totals {
  std::uint64_t rays = 0, hits = 0, lost = 0, offered = 0, faces = 0;
};

template <class S>
void check_scene(Shape shape, double size, double shift, std::uint32_t seed, Totals& totals) {
  const Scene<S> scene = doubled_sheet<S>(shape, size, shift);
  Playback<S> playback(scene);
  playback.evaluate_all();
  std::vector<std::vector<Ray<S>>> rays;
  std::vector<std::vector<RayHit>> truth;
  for (const double t : {0.0, 1.0}) {
    playback.seek(t);
    playback.evaluate_all();
    rays.push_back(GrazingRays<S>(playback, size, seed).make(rays_of_a_kind()));
    truth.emplace_back();
    for (const Ray<S>& ray : rays.back()) {
      truth.back().push_back(answer_of_all(scene, playback, ray, totals.lost));
      totals.hits += truth.back().back() ? 1 : 0;
    }
  }
  std::uint32_t variant = seed;
  for (const KernelSet set : supported_kernel_sets()) {
    const BuilderConfig builder{.method = BuildMethod::median,
                                .width = variant % 2 == 0 ? 8U : 4U,
                                .leaf_size = variant % 3 == 0   ? 4U
                                             : variant % 3 == 1 ? 7U
                                                                : 16U};
    ++variant;
    playback.seek(0);
    playback.evaluate_all();
    Wide<S> wide(scene, playback, playback, builder, set);
    for (std::size_t frame = 0; frame < 2; ++frame) {
      playback.seek(double(frame));
      playback.evaluate_all();
      wide.refit();
      const std::span<const Ray<S>> all(rays[frame]);
      const std::vector<RayHit> found = wide.ask(RayQuery::closest, all), any = wide.ask(RayQuery::any, all);
      totals.rays += 2 * all.size();
      totals.faces += 2 * all.size() * 200;
      for (std::size_t i = 0; i < all.size(); ++i) {
        ASSERT_EQ(found[i], truth[frame][i])
            << name(set) << ", size " << size << ", shift " << shift << ", ray " << i % 10 << ", " << i;
        ASSERT_EQ(bool(any[i]), bool(truth[frame][i])) << name(set) << ", " << i;
      }
      // One at a time: too few rays to copy corners.
      for (std::size_t i = 0; i < all.size(); i += 37)
        ASSERT_EQ(wide.ask(RayQuery::closest, all.subspan(i, 1))[0], truth[frame][i])
            << name(set) << ", " << i;
    }
    totals.offered += wide.stats().tests;
  }
}

template <class S>
void check_grazing_rays() {
  Totals totals;
  std::uint32_t seed = sizeof(S);
  const bool in_float = sizeof(S) == 4;
  // Squares are far from the limits; below the filter's smallest bound; near overflow, and beyond it.
  const double sizes[] = {1, in_float ? 1e-17 : 1e-140, in_float ? 1e-25 : 1e-160, in_float ? 1e17 : 1e90,
                          in_float ? 1e25 : 1e95};
  for (const Shape shape : {Shape::flat, Shape::waves, Shape::folds}) {
    for (const double size : sizes) check_scene<S>(shape, size, 0, ++seed, totals);
    for (const double shift : {100.0, 1000.3, in_float ? 70000.5 : 1e12})
      check_scene<S>(shape, 1, shift, ++seed, totals);
  }
  std::printf(
      "%llu rays, %llu hits of %llu; a filter without bounds loses %llu; %.3g faces a ray are decided\n",
      static_cast<unsigned long long>(totals.rays), static_cast<unsigned long long>(totals.hits),
      static_cast<unsigned long long>(2 * 24 * 10 * std::uint64_t(rays_of_a_kind())),
      static_cast<unsigned long long>(totals.lost), double(totals.offered) / double(totals.rays));
  // The rays are hard, and the filter leaves out most faces all the same.
  EXPECT_GT(totals.hits, totals.rays / 100);
  EXPECT_GT(totals.lost, 24U * rays_of_a_kind() / 10);
  EXPECT_LT(totals.offered, totals.faces / 10);
}

TEST(GrazingRays, HitWhatAllFacesSayInFloat) {
  check_grazing_rays<float>();
}
TEST(GrazingRays, HitWhatAllFacesSayInDouble) {
  check_grazing_rays<double>();
}

}  // namespace
}  // namespace kbvh::ray_grazing_test
