// Primitives other than triangles, through the program's own readers and shapes: polygons of more corners,
// points, and control nets of spline surfaces, whose patches stay within the boxes of every strategy.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "experiments/scenes/nurbs.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::primitives_test {
namespace {

using experiments::LoadedScene;
using scenes::NurbsConfig;
using scenes::NurbsSurface;

/// The B-spline basis functions of degree p that are not zero in span k, at parameter t (Cox, de Boor).
std::vector<double> basis(const std::vector<double>& knots, std::uint32_t k, std::uint32_t p, double t) {
  std::vector<double> values{1};
  for (std::uint32_t degree = 1; degree <= p; ++degree) {
    std::vector<double> next(degree + 1, 0.0);
    for (std::uint32_t i = 0; i < degree; ++i) {  // function k - degree + 1 + i of the degree below
      const double left = knots[k - degree + 1 + i], right = knots[k + 1 + i];
      const double share = (t - left) / (right - left);
      next[i] += (1 - share) * values[i];
      next[i + 1] += share * values[i];
    }
    values = std::move(next);
  }
  return values;
}

/// A point of the patch of span (ku, kv), of control points at `positions`.
template <class S>
std::array<double, 3> point_of(const NurbsSurface& surface, std::uint32_t ku, std::uint32_t kv, double u,
                               double v, const S* positions) {
  const auto& s = surface.spline;
  const auto along_u = basis(s.knots_u, ku, s.degree_u, u), along_v = basis(s.knots_v, kv, s.degree_v, v);
  std::array<double, 3> sum{};
  double weights = 0;
  for (std::uint32_t j = 0; j <= s.degree_v; ++j)
    for (std::uint32_t i = 0; i <= s.degree_u; ++i) {
      const std::uint32_t point = s.points[(kv - s.degree_v + j) * s.points_u() + ku - s.degree_u + i];
      const double share = along_u[i] * along_v[j] * surface.weights[point];
      weights += share;
      for (std::size_t d = 0; d < 3; ++d) sum[d] += share * double(positions[3 * std::size_t(point) + d]);
    }
  for (double& x : sum) x /= weights;
  return sum;
}

TEST(Basis, SumsToOneAndReproducesLines) {
  for (const auto spacing : {scenes::KnotSpacing::clamped, scenes::KnotSpacing::uniform})
    for (const std::uint32_t degree : {1u, 2u, 3u, 5u}) {
      NurbsConfig config{.spans = 25, .degree = degree, .knots = spacing, .side = 5, .keyframes = 1};
      const NurbsSurface surface = scenes::nurbs_surface(config);
      EXPECT_EQ(surface.mesh.primitive_count(), 25u);
      EXPECT_EQ(surface.mesh.vertex_count, (5 + degree) * (5 + degree));
      for (std::uint32_t k = degree; k < degree + 5; ++k)
        for (const double t : {surface.spline.knots_u[k], surface.spline.knots_u[k] + 0.3}) {
          const auto values = basis(surface.spline.knots_u, k, degree, t);
          double sum = 0, x = 0;
          for (std::uint32_t i = 0; i <= degree; ++i) {
            EXPECT_GE(values[i], -1e-15);
            sum += values[i];
            x += values[i] * surface.mesh.positions[3 * (k - degree + i)];
          }
          EXPECT_NEAR(sum, 1, 1e-14);
          EXPECT_NEAR(x, t - 2.5, 1e-6);  // Greville: the parameter is the place
        }
    }
}

LoadedScene surface_and_sphere(const NurbsSurface& surface) {
  LoadedScene loaded;
  loaded.name = "nurbs";
  loaded.meshes = {surface.mesh, scenes::icosphere(320, {0.1, -0.2, 0.1}, 0.4)};
  loaded.sources = {"surface", "sphere"};
  return loaded;
}

class Primitives : public testing::TestWithParam<std::string> {
 protected:
  template <class S>
  void conforms(const LoadedScene& loaded, std::uint32_t l) {
    const StrategyEntry& entry = find_strategy(GetParam());
    if (entry.factory<S>() == nullptr) return;
    TestScene<S> test;
    test.scene = experiments::assemble<S>(loaded);
    const std::string violation = check(entry, test, l, {}, entry.info.topology.preferred);
    if (violation.starts_with("skipped")) return;
    EXPECT_EQ(violation, "") << GetParam() << " on " << loaded.name
                             << (sizeof(S) == 4 ? ", float" : ", double");
  }

  /// Points evaluated on every patch lie in the boxes of its leaf and of all nodes above.
  template <class S>
  void patches_stay_in_boxes(const NurbsSurface& surface, std::uint64_t& points) {
    const StrategyEntry& entry = find_strategy(GetParam());
    if (entry.factory<S>() == nullptr) return;
    const Scene<S> scene = experiments::assemble<S>(surface_and_sphere(surface));
    if (!unsuitable_bodies(entry.info, scene).empty()) return;
    Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes times;
    PairBuffer pairs;
    const auto spans = io::spans_of(surface.spline.knots_u, surface.spline.degree_u, surface.spline.first_u,
                                    surface.spline.last_u);
    const std::vector<double> frames = frame_times(scene, 7);
    for (std::size_t f = 0; f < frames.size(); ++f) {
      f == 0 ? session.reset(frames[0]) : session.advance(frames[f], times);
      session.query(pairs, times);
      session.playback().evaluate_all();
      const auto view = session.strategy().audit_view(0);
      if (!view) return;
      const S* const positions = session.playback().positions(0);
      for (std::uint32_t node = 0; node < view->topology.size(); ++node) {
        const TopologyNode leaf = view->topology.nodes[node];
        if (!leaf.is_leaf()) continue;
        for (std::uint32_t i = leaf.first(); i < leaf.first() + leaf.count(); ++i) {
          const std::uint32_t patch = view->topology.primitives[i];
          const std::uint32_t ku = spans[patch % spans.size()], kv = spans[patch / spans.size()];
          for (const double a : {0.0, 0.37, 1.0})
            for (const double b : {0.0, 0.81, 1.0}) {
              const auto& [knots_u, knots_v] = std::pair(surface.spline.knots_u, surface.spline.knots_v);
              const auto point = point_of(surface, ku, kv, knots_u[ku] + a * (knots_u[ku + 1] - knots_u[ku]),
                                          knots_v[kv] + b * (knots_v[kv + 1] - knots_v[kv]), positions);
              for (std::uint32_t above = node;; above = view->topology.parents[above]) {
                const bool stale = !view->stale.empty() && view->stale[above] != 0;
                for (std::size_t d = 0; !stale && d < 3; ++d) {
                  // The evaluation above rounds, but the boxes do not.
                  ASSERT_GE(point[d], view->boxes[above].lower[d] - 1e-13) << GetParam() << " frame " << f;
                  ASSERT_LE(point[d], view->boxes[above].upper[d] + 1e-13) << GetParam() << " frame " << f;
                }
                if (above == 0) break;
              }
              ++points;
            }
        }
      }
    }
  }
};

TEST_P(Primitives, PatchesStayInTheBoxesOfTheirControlNets) {
  std::uint64_t points = 0;
  for (const auto spacing : {scenes::KnotSpacing::clamped, scenes::KnotSpacing::uniform}) {
    const NurbsSurface surface = scenes::nurbs_surface({.spans = 81, .knots = spacing, .keyframes = 4});
    conforms<float>(surface_and_sphere(surface), 7);
    if (in_both_scalars()) conforms<double>(surface_and_sphere(surface), 7);
    patches_stay_in_boxes<float>(surface, points);
    if (in_both_scalars()) patches_stay_in_boxes<double>(surface, points);
  }
  std::printf("%s: %llu points of patches\n", GetParam().c_str(), (unsigned long long)points);
}

TEST_P(Primitives, SoupsOfPolygonsAndPoints) {
  const auto scene = [](const char* as) {
    LoadedScene loaded;
    const nlohmann::json plan{{"bodies",
                               {{{"shape", "waving_sheet"}, {"triangles", 400}, {"keyframes", 5}, {"as", as}},
                                {{"shape", "sphere"}, {"triangles", 320}, {"radius", 0.4}}}}};
    return experiments::load(experiments::read_scenes(plan, "test", {}).at(0));
  };
  conforms<float>(scene("points"), 7);
  if (in_both_scalars()) conforms<double>(scene("points"), 7);
  // Quadrilaterals and hexagons that are neither flat nor convex all the time: two and four triangles each.
  for (const std::size_t joined : {std::size_t(2), std::size_t(4)}) {
    LoadedScene polygons = scene("given");
    polygons.name = "polygons";
    io::AnimatedMesh& mesh = polygons.meshes[0];
    std::vector<std::uint32_t> offsets{0}, corners;
    for (std::size_t p = 0; p + joined <= mesh.primitive_count(); p += joined) {
      std::vector<std::uint32_t> polygon;
      for (std::size_t c = 3 * p; c < 3 * (p + joined); ++c)
        if (std::find(polygon.begin(), polygon.end(), mesh.primitive_vertices[c]) == polygon.end())
          polygon.push_back(mesh.primitive_vertices[c]);
      corners.insert(corners.end(), polygon.begin(), polygon.end());
      offsets.push_back(std::uint32_t(corners.size()));
    }
    mesh.primitive_offsets = offsets;
    mesh.primitive_vertices = corners;
    conforms<float>(polygons, 7);
    if (in_both_scalars()) conforms<double>(polygons, 7);
  }
}

std::vector<std::string> ids() {
  std::vector<std::string> ids;
  for (const StrategyEntry& entry : registry()) ids.push_back(entry.info.id);
  return ids;
}

INSTANTIATE_TEST_SUITE_P(Registry, Primitives, testing::ValuesIn(ids()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace kbvh::test::primitives_test
