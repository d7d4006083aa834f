#include "experiments/io/obj_surfaces.hpp"

#include <cmath>
#include <set>
#include <string>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"

namespace kbvh::io {
namespace {

std::string at(std::size_t line) {
  return "line " + std::to_string(line);
}

constexpr std::int64_t largest_degree = 16;

}  // namespace

bool ObjSurfaces::take(std::string_view word, std::string_view words, std::size_t line,
                       std::uint32_t vertices_so_far) {
  static const std::set<std::string_view> inside_only{"parm", "trim", "hole", "scrv", "sp"};
  if (word == "cstype") {
    std::string_view name = next_token(words);
    rational_ = name == "rat";
    if (rational_) name = next_token(words);
    type_ = name;
    spline_ = name == "bspline";
  } else if (word == "deg") {
    degrees_.clear();
    for (auto token = next_token(words); !token.empty(); token = next_token(words)) {
      const auto degree = parse_integer(token);
      if (!degree || *degree < 1 || *degree > largest_degree)
        fail(file_, at(line),
             "degree " + printable(token) + " is not a number from 1 to " + std::to_string(largest_degree));
      degrees_.push_back(*degree);
    }
  } else if (word == "surf") {
    begin(words, line, vertices_so_far);
  } else if (word == "curv" || word == "curv2") {
    if (open_) fail(file_, at(line), "a curve begins before the surface ends");
    other_open_ = true;
  } else if (word == "end" && (open_ || other_open_)) {
    if (open_) end(line);
    open_ = other_open_ = false;
  } else if (open_ && word == "parm") {
    parameters(words, line);
  } else if (open_ && inside_only.contains(word)) {
    fail(file_, at(line), "surfaces with " + printable(word) + " (trimmed or marked ones) are not known");
  } else if (word == "con" && !surfaces_.empty()) {
    fail(file_, at(line), "surfaces that are pieced together (con) are not known");
  } else {
    return inside_only.contains(word);
  }
  return true;
}

void ObjSurfaces::begin(std::string_view words, std::size_t line, std::uint32_t vertices_so_far) {
  if (open_) fail(file_, at(line), "a surface begins before the one before it ends");
  if (!spline_)
    fail(file_, at(line),
         "a surface of cstype " + printable(type_) + "; only bspline and rat bspline are known");
  if (degrees_.size() != 2)
    fail(file_, at(line), "a surface needs two degrees (deg), here are " + std::to_string(degrees_.size()));
  Surface surface;
  surface.line = line;
  surface.rational = rational_;
  surface.degree_u = std::uint32_t(degrees_[0]);
  surface.degree_v = std::uint32_t(degrees_[1]);
  for (double* bound : {&surface.first_u, &surface.last_u, &surface.first_v, &surface.last_v}) {
    const std::string_view token = next_token(words);
    const auto value = parse_double(token);
    if (!value || !std::isfinite(*value))
      fail(file_, at(line),
           "the parameter range holds " + printable(token) + ", which is not a finite number");
    *bound = *value;
  }
  for (auto token = next_token(words); !token.empty(); token = next_token(words)) {
    const auto index = parse_corner(token);
    if (!index || *index == 0) fail(file_, at(line), printable(token) + " is not a vertex index");
    surface.indices.push_back(*index < 0 ? *index + std::int64_t{vertices_so_far} + 1 : *index);
  }
  surfaces_.push_back(std::move(surface));
  open_ = true;
}

void ObjSurfaces::parameters(std::string_view words, std::size_t line) {
  const std::string_view direction = next_token(words);
  if (direction != "u" && direction != "v")
    fail(file_, at(line), "parm goes with u or v, not with " + printable(direction));
  auto& knots = direction == "u" ? surfaces_.back().knots_u : surfaces_.back().knots_v;
  for (auto token = next_token(words); !token.empty(); token = next_token(words)) {
    const auto value = parse_double(token);
    if (!value || !std::isfinite(*value))
      fail(file_, at(line), "knot " + printable(token) + " is not a finite number");
    if (!knots.empty() && *value < knots.back())
      fail(file_, at(line),
           "knot " + text_of(*value) + " is below the one before it, " + text_of(knots.back()));
    knots.push_back(*value);
  }
}

void ObjSurfaces::end(std::size_t line) {
  const Surface& s = surfaces_.back();
  for (const auto& [name, knots, degree] :
       {std::tuple{"u", &s.knots_u, s.degree_u}, std::tuple{"v", &s.knots_v, s.degree_v}})
    if (knots->size() < 2 * (std::size_t{degree} + 1))
      fail(file_, at(line),
           std::string("direction ") + name + " has " + std::to_string(knots->size()) + " knots; degree " +
               std::to_string(degree) + " needs at least " + std::to_string(2 * (degree + 1)));
  const std::size_t expected = std::size_t{s.points_u()} * s.points_v();
  if (s.indices.size() != expected)
    fail(file_, at(s.line),
         "the knots are for " + std::to_string(s.points_u()) + " x " + std::to_string(s.points_v()) +
             " control points, here are " + std::to_string(s.indices.size()));
  if (spans_of(s.knots_u, s.degree_u, s.first_u, s.last_u).empty() ||
      spans_of(s.knots_v, s.degree_v, s.first_v, s.last_v).empty())
    fail(file_, at(s.line), "no knot span lies in the surface's parameter range");
}

void ObjSurfaces::check(const Surface& surface, const AnimatedMesh& mesh) const {
  for (const std::int64_t index : surface.indices) {
    if (index < 1 || index > std::int64_t{mesh.vertex_count})
      fail(file_, at(surface.line),
           "vertex index " + std::to_string(index) + " is out of range (" +
               std::to_string(mesh.vertex_count) + " vertices)");
    if (surface.rational && not_positive_.contains(std::uint32_t(index - 1)))
      fail(file_, at(surface.line),
           "control point " + std::to_string(index) +
               " has a weight that is not positive: its patch can leave the hull of its control points");
  }
}

void ObjSurfaces::add_to(AnimatedMesh& mesh) const {
  if (open_) fail(file_, at(surfaces_.back().line), "the surface has no end");
  for (const Surface& surface : surfaces_) {
    check(surface, mesh);
    SplineSurface spline = surface;
    for (const std::int64_t index : surface.indices) spline.points.push_back(std::uint32_t(index - 1));
    add_control_nets(mesh, spline);
  }
}

}  // namespace kbvh::io
