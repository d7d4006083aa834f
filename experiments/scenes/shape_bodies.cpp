#include "experiments/scenes/shape_bodies.hpp"

#include <algorithm>

#include "experiments/common/text.hpp"
#include "experiments/scenes/nurbs.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::experiments {

namespace {

using scenes::Point;

std::uint32_t triangles(JsonReader& keys) {
  return std::uint32_t(keys.whole("triangles", ranges::triangles).value_or(2000));
}

Point point(JsonReader& keys, const std::string& key, const Point& otherwise) {
  const auto given = keys.numbers(key, 3);
  return given ? Point{(*given)[0], (*given)[1], (*given)[2]} : otherwise;
}

double positive(JsonReader& keys, const std::string& key, double otherwise) {
  const double value = keys.number(key).value_or(otherwise);
  if (value <= 0) keys.fail(key, "must be positive, got " + std::to_string(value));
  return value;
}

std::uint32_t keyframes(JsonReader& keys, std::uint32_t otherwise) {
  return std::uint32_t(keys.whole("keyframes", 1, 1000000).value_or(otherwise));
}

double rate(JsonReader& keys) {
  return positive(keys, "rate", 30.0);
}

/// Gives a resting shape a motion, if the keys ask for one.
io::AnimatedMesh moved(JsonReader& keys, const io::AnimatedMesh& mesh, const Point& centre) {
  const bool step = keys.find("step") != nullptr, turns = keys.find("turns") != nullptr;
  const std::uint32_t count = keyframes(keys, step || turns ? 60 : 1);
  const double per_second = rate(keys);
  if (step && turns) keys.fail("turns", "a shape either steps or turns");
  if (!step && !turns) {
    if (count > 1) keys.fail("keyframes", "a motion is missing: step or turns");
    return mesh;
  }
  if (step) return scenes::translated(mesh, point(keys, "step", {0, 0, 0}), count, per_second);
  return scenes::rotated(mesh, centre, keys.number("turns").value_or(0), count, per_second);
}

io::AnimatedMesh sphere(JsonReader& keys) {
  const Point centre = point(keys, "centre", {0, 0, 0});
  return moved(keys, scenes::icosphere(triangles(keys), centre, positive(keys, "radius", 0.5)), centre);
}

io::AnimatedMesh uv_sphere(JsonReader& keys) {
  const Point centre = point(keys, "centre", {0, 0, 0});
  return moved(keys, scenes::uv_sphere(triangles(keys), centre, positive(keys, "radius", 0.5)), centre);
}

io::AnimatedMesh box(JsonReader& keys) {
  const Point lower = point(keys, "lower", {-0.5, -0.5, -0.5}), upper = point(keys, "upper", {0.5, 0.5, 0.5});
  return moved(keys, scenes::box(triangles(keys), lower, upper),
               {0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1]), 0.5 * (lower[2] + upper[2])});
}

io::AnimatedMesh sheet(JsonReader& keys) {
  const Point centre = point(keys, "centre", {0, 0, 0});
  return moved(keys, scenes::sheet(triangles(keys), centre, positive(keys, "side", 2.0)), centre);
}

io::AnimatedMesh round_table(JsonReader& keys) {
  scenes::RoundTableShape shape;
  const Point centre = point(keys, "centre", {shape.centre_x, shape.centre_y, 0});
  shape.centre_x = centre[0];
  shape.centre_y = centre[1];
  shape.radius = positive(keys, "radius", shape.radius);
  shape.top = positive(keys, "top", shape.top);
  return moved(keys, scenes::round_table(triangles(keys), shape), centre);
}

io::AnimatedMesh waving_sheet(JsonReader& keys) {
  return scenes::waving_sheet(triangles(keys), keyframes(keys, 60), rate(keys));
}

io::AnimatedMesh random_soup(JsonReader& keys) {
  const std::uint64_t seed = keys.whole("seed", ranges::any).value_or(1);
  return scenes::random_soup(triangles(keys), seed, keyframes(keys, 60), rate(keys));
}

io::AnimatedMesh expanding_sphere(JsonReader& keys) {
  const Point centre = point(keys, "centre", {0, 0, 0});
  return scenes::expanding_sphere(triangles(keys), centre, positive(keys, "first_radius", 0.25),
                                  positive(keys, "last_radius", 0.75), keyframes(keys, 60), rate(keys));
}

io::AnimatedMesh nurbs(JsonReader& keys) {
  scenes::NurbsConfig config;
  config.spans = std::uint32_t(keys.whole("spans", 1, 1u << 24).value_or(config.spans));
  config.degree = std::uint32_t(keys.whole("degree", 1, 16).value_or(config.degree));
  const std::string knots = keys.word("knots").value_or("clamped");
  if (knots != "clamped" && knots != "uniform")
    keys.fail("knots", "expected clamped or uniform, got '" + knots + "'");
  config.knots = knots == "clamped" ? scenes::KnotSpacing::clamped : scenes::KnotSpacing::uniform;
  config.centre = point(keys, "centre", {0, 0, 0});
  config.side = positive(keys, "side", config.side);
  config.keyframes = keyframes(keys, config.keyframes);
  config.keyframes_per_second = rate(keys);
  return scenes::nurbs_surface(config).mesh;
}

}  // namespace

const std::vector<ShapeKind>& shape_kinds() {
  static const std::vector<ShapeKind> kinds{
      {"sphere", "geodesic sphere: triangles, centre, radius", &sphere},
      {"uv_sphere", "sphere by longitude and latitude: triangles, centre, radius", &uv_sphere},
      {"box", "closed box: triangles, lower, upper", &box},
      {"sheet", "flat square: triangles, centre, side", &sheet},
      {"round_table", "disc on a pedestal: triangles, centre, radius, top", &round_table},
      {"waving_sheet", "square of 2 m in crossing waves: triangles, keyframes, rate", &waving_sheet},
      {"random_soup", "separate drifting triangles in the unit cube: triangles, seed, keyframes, rate",
       &random_soup},
      {"expanding_sphere", "triangles, centre, first_radius, last_radius, keyframes, rate",
       &expanding_sphere},
      {"nurbs",
       "spline surface in waves, a control net for each knot span: spans, degree, knots (clamped, uniform), "
       "centre, side, keyframes, rate",
       &nurbs, "spans"},
  };
  return kinds;
}

std::vector<std::string> shape_names() {
  std::vector<std::string> names;
  for (const ShapeKind& kind : shape_kinds()) names.push_back(kind.name);
  return names;
}

bool is_shape(const std::string& name) {
  const auto& kinds = shape_kinds();
  return std::any_of(kinds.begin(), kinds.end(), [&](const ShapeKind& kind) { return kind.name == name; });
}

const ShapeKind& shape_kind(const std::string& name, const std::string& place) {
  for (const ShapeKind& kind : shape_kinds())
    if (kind.name == name) return kind;
  throw io::InputError(place + ": shape: there is no shape '" + name + "'; known are " +
                       joined(shape_names()) + suggestion(name, shape_names()));
}

io::AnimatedMesh make_shape(JsonReader& keys) {
  return shape_kind(keys.word("shape").value_or(""), keys.place()).make(keys);
}

}  // namespace kbvh::experiments
