#include "experiments/scenes/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/library_gaps.hpp"
#include "experiments/scenes/mesh_parts.hpp"

namespace kbvh::scenes {
namespace {

/// Maps corners named by 64-bit keys to vertex ids; returns the distinct keys in rising order. Sorting
/// instead of hashing gives the same order of vertices on every platform.
std::vector<std::uint64_t> weld(const std::vector<std::uint64_t>& corner_keys,
                                std::vector<std::uint32_t>& corners) {
  std::vector<std::uint64_t> keys = corner_keys;
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  corners.resize(corner_keys.size());
  for (std::size_t i = 0; i < corner_keys.size(); ++i)
    corners[i] = std::uint32_t(std::lower_bound(keys.begin(), keys.end(), corner_keys[i]) - keys.begin());
  return keys;
}

/// Returns the rings between the poles and the segments around whose 2 s r triangles are nearest to the
/// request, with the ratio given by the shape's proportions.
std::pair<std::uint32_t, std::uint32_t> rings_and_segments(std::uint32_t triangles, double segments_per_ring,
                                                           std::uint32_t least_rings) {
  const double ideal = std::sqrt(double(triangles) / (2.0 * segments_per_ring));
  const std::uint32_t rings = std::max(least_rings, std::uint32_t(ideal + 0.5));
  const auto segments = std::uint32_t(double(triangles) / (2.0 * rings) + 0.5);
  return {rings, std::max(3u, segments)};
}

/// Copies mesh's first keyframe and fills the later ones with place(keyframe, x, y, z) of its positions.
template <class Place>
io::AnimatedMesh with_motion(const io::AnimatedMesh& mesh, std::uint32_t keyframes, double rate,
                             Place place) {
  io::AnimatedMesh result = mesh;
  const std::size_t size = std::size_t(mesh.vertex_count) * 3;
  result.keyframe_times = keyframe_times(keyframes, rate);
  result.positions.resize(size * keyframes);
  for (std::uint32_t k = 0; k < keyframes; ++k)
    for (std::size_t i = 0; i < size; i += 3) {
      const Point p = place(k, mesh.positions[i], mesh.positions[i + 1], mesh.positions[i + 2]);
      for (std::size_t axis = 0; axis < 3; ++axis)
        result.positions[k * size + i + axis] = rounded_to_float(p[axis]);
    }
  return result;
}

}  // namespace

double sine_of_turns(double turns) {
  double r = turns - std::floor(turns);
  if (r > 0.5) r -= 1.0;
  if (r > 0.25) r = 0.5 - r;
  if (r < -0.25) r = -0.5 - r;
  const double a = 2.0 * std::numbers::pi * r;
  const double square = a * a;
  // Taylor series by Horner's rule; the first omitted term is below 2e-18 at a quarter turn.
  double sum = 1.0;
  for (int n = 20; n >= 2; n -= 2) sum = 1.0 - square / double(n * (n + 1)) * sum;
  return a * sum;
}

double rounded_to_float(double value) {
  // GCC 12.2's superword vectoriser drops conversions to float and back (at -O2 and -O3: values keep their
  // double digits); it must store volatile values. Adding zero makes a negative zero positive.
  const volatile float single = float(value);
  return double(single) + 0.0;
}

double cosine_of_turns(double turns) {
  // Reduced before the quarter is added, so that large arguments lose no digits.
  return sine_of_turns(turns - std::floor(turns) + 0.25);
}

std::uint64_t SeededNoise::bits(std::uint64_t index) const {
  std::uint64_t z = seed_ * 0xd1342543de82ef95u + (index + 1) * 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

double SeededNoise::signed_unit(std::uint64_t index) const {
  return double(bits(index) >> 11) * 0x1p-52 - 1.0;
}

io::AnimatedMesh icosphere(std::uint32_t triangles, const Point& centre, double radius) {
  check_triangles(triangles, "icosphere");
  check_length(radius, "icosphere: the radius");
  const std::uint64_t f = nearest_frequency(triangles, 20);
  const double g = (1.0 + std::sqrt(5.0)) / 2.0;
  const Point vertices[12] = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                              {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  static constexpr int faces[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                       {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                       {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                       {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  // The key of a point of a face consists of its integer weights on the icosahedron's vertices, in the order
  // of the vertices and without zero weights: points on shared edges get the same key from both faces.
  const auto key = [&](const int(&face)[3], std::uint64_t u, std::uint64_t v) {
    std::pair<std::uint64_t, std::uint64_t> terms[3] = {
        {std::uint64_t(face[0]), f - u - v}, {std::uint64_t(face[1]), u}, {std::uint64_t(face[2]), v}};
    std::sort(std::begin(terms), std::end(terms));
    std::uint64_t name = 0;
    for (const auto& [vertex, weight] : terms)
      if (weight > 0) name = name << 20 | vertex << 16 | weight;
    return name;
  };
  std::vector<std::uint64_t> corner_keys;
  corner_keys.reserve(60 * f * f);
  for (const auto& face : faces)
    for (std::uint64_t v = 0; v < f; ++v)
      for (std::uint64_t u = 0; u + v < f; ++u) {
        corner_keys.insert(corner_keys.end(), {key(face, u, v), key(face, u + 1, v), key(face, u, v + 1)});
        if (u + v + 1 < f)
          corner_keys.insert(corner_keys.end(),
                             {key(face, u + 1, v), key(face, u + 1, v + 1), key(face, u, v + 1)});
      }
  std::vector<std::uint32_t> corners;
  const std::vector<std::uint64_t> keys = weld(corner_keys, corners);
  std::vector<double> positions;
  positions.reserve(3 * keys.size());
  for (std::uint64_t name : keys) {
    Point p{0, 0, 0};
    for (; name != 0; name >>= 20)
      for (std::size_t axis = 0; axis < 3; ++axis)
        p[axis] += double(name & 0xffff) * vertices[name >> 16 & 0xf][axis];
    const double scale = radius / std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    for (std::size_t axis = 0; axis < 3; ++axis) positions.push_back(centre[axis] + scale * p[axis]);
  }
  return triangle_mesh("icosphere", std::move(corners), std::move(positions));
}

io::AnimatedMesh uv_sphere(std::uint32_t triangles, const Point& centre, double radius) {
  check_triangles(triangles, "uv_sphere");
  check_length(radius, "uv_sphere: the radius");
  const auto [rings, segments] = rings_and_segments(triangles, 2.0, 1);
  std::vector<ProfilePoint> profile;
  for (std::uint32_t ring = 1; ring <= rings; ++ring) {
    const double turns = 0.5 * double(ring) / double(rings + 1);
    profile.push_back({radius * sine_of_turns(turns), centre[2] + radius * cosine_of_turns(turns)});
  }
  return revolve("uv-sphere", centre[0], centre[1], centre[2] + radius, centre[2] - radius, profile,
                 segments);
}

io::AnimatedMesh box(std::uint32_t triangles, const Point& lower, const Point& upper) {
  check_triangles(triangles, "box");
  for (std::size_t axis = 0; axis < 3; ++axis) check_length(upper[axis] - lower[axis], "box: an extent");
  const std::uint64_t f = nearest_frequency(triangles, 12);
  std::vector<std::uint64_t> corner_keys;
  corner_keys.reserve(36 * f * f);
  for (int axis = 0; axis < 3; ++axis)
    for (std::uint64_t side = 0; side < 2; ++side)
      for (std::uint64_t v = 0; v < f; ++v)
        for (std::uint64_t u = 0; u < f; ++u) {
          const auto key = [&](std::uint64_t du, std::uint64_t dv) {
            std::uint64_t at[3];
            at[axis] = side * f;
            at[(axis + 1) % 3] = u + du;
            at[(axis + 2) % 3] = v + dv;
            return at[2] << 40 | at[1] << 20 | at[0];
          };
          const std::uint64_t a = key(0, 0), b = key(1, 0), c = key(1, 1), d = key(0, 1);
          if (side == 1)
            corner_keys.insert(corner_keys.end(), {a, b, c, a, c, d});
          else
            corner_keys.insert(corner_keys.end(), {a, c, b, a, d, c});
        }
  std::vector<std::uint32_t> corners;
  const std::vector<std::uint64_t> keys = weld(corner_keys, corners);
  std::vector<double> positions;
  positions.reserve(3 * keys.size());
  for (const std::uint64_t name : keys)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double part = double(name >> (20 * axis) & 0xfffff) / double(f);
      positions.push_back(lower[axis] + part * (upper[axis] - lower[axis]));
    }
  return triangle_mesh("box", std::move(corners), std::move(positions));
}

std::uint32_t sheet_squares(std::uint32_t triangles) {
  return nearest_frequency(triangles, 2);
}

std::vector<std::uint32_t> sheet_triangles(std::uint32_t squares) {
  std::vector<std::uint32_t> corners;
  corners.reserve(6 * std::size_t(squares) * squares);
  const std::uint32_t row = squares + 1;
  for (std::uint32_t j = 0; j < squares; ++j)
    for (std::uint32_t i = 0; i < squares; ++i) {
      const std::uint32_t a = j * row + i, b = a + 1, c = a + row + 1, d = a + row;
      // Alternating diagonals: the mesh has no preferred direction.
      if ((i + j) % 2 == 0)
        corners.insert(corners.end(), {a, b, c, a, c, d});
      else
        corners.insert(corners.end(), {a, b, d, b, c, d});
    }
  return corners;
}

io::AnimatedMesh sheet(std::uint32_t triangles, const Point& centre, double side) {
  check_triangles(triangles, "sheet");
  check_length(side, "sheet: the side");
  const std::uint32_t f = sheet_squares(triangles);
  std::vector<double> positions;
  positions.reserve(3 * std::size_t(f + 1) * (f + 1));
  for (std::uint32_t j = 0; j <= f; ++j)
    for (std::uint32_t i = 0; i <= f; ++i)
      positions.insert(positions.end(), {centre[0] + side * (double(i) / double(f) - 0.5),
                                         centre[1] + side * (double(j) / double(f) - 0.5), centre[2]});
  return triangle_mesh("sheet", sheet_triangles(f), std::move(positions));
}

io::AnimatedMesh round_table(std::uint32_t triangles, const RoundTableShape& shape) {
  check_triangles(triangles, "round_table");
  check_length(shape.radius, "round_table: the radius");
  check_length(shape.thickness, "round_table: the thickness");
  check_length(shape.rim_radius, "round_table: the rim's radius");
  if (2.0 * shape.rim_radius > shape.thickness || shape.rim_radius >= shape.radius)
    throw io::InputError("round_table: the rim's radius " + shortest_text(shape.rim_radius) +
                         " is more than half of the thickness or reaches the axis");
  const bool pedestal = shape.pedestal_radius > 0.0;
  const double inner = shape.radius - shape.rim_radius;
  if (pedestal && !(shape.pedestal_radius < inner && shape.base_radius > shape.pedestal_radius &&
                    shape.top > shape.thickness + shape.rim_radius))
    throw io::InputError("round_table: the pedestal does not fit under the table");

  const auto [rings, segments] = rings_and_segments(triangles, 4.0, pedestal ? 12 : 6);
  // Top and rim, where the cloth lies, get most rings; the underside only needs its outline.
  const std::uint32_t under = pedestal ? std::max(4u, rings / 4) : 1;
  const std::uint32_t rim = std::max(4u, rings / 3);
  const std::uint32_t flat = rings - under - rim;
  std::vector<ProfilePoint> profile;
  for (std::uint32_t i = 1; i <= flat; ++i)
    profile.push_back({inner * double(i) / double(flat + 1), shape.top});
  const double upper = shape.top - shape.rim_radius;
  const double lower = shape.top - shape.thickness + shape.rim_radius;
  const std::uint32_t upper_rim = rim / 2;
  for (std::uint32_t i = 0; i < rim; ++i) {
    const bool above = i < upper_rim;
    // Two quarter circles with a vertical wall between them.
    const double part =
        above ? double(i) / double(upper_rim - 1) : double(i - upper_rim) / double(rim - upper_rim - 1);
    const double turns = above ? 0.25 * part : 0.25 + 0.25 * part;
    profile.push_back({inner + shape.rim_radius * sine_of_turns(turns),
                       (above ? upper : lower) + shape.rim_radius * cosine_of_turns(turns)});
  }
  const double floor_of_disc = shape.top - shape.thickness;
  double bottom_z = floor_of_disc;
  if (pedestal) {
    const std::uint32_t column = under - 2;
    for (std::uint32_t i = 0; i < column; ++i) {
      const double part = double(i) / double(column - 1);
      profile.push_back({shape.pedestal_radius, floor_of_disc + part * (shape.rim_radius - floor_of_disc)});
    }
    profile.push_back({shape.base_radius, shape.rim_radius});
    profile.push_back({shape.base_radius, 0.0});
    bottom_z = 0.0;
  } else {
    profile.push_back({0.5 * inner, floor_of_disc});
  }
  return revolve("round-table", shape.centre_x, shape.centre_y, shape.top, bottom_z, profile, segments);
}

std::vector<double> keyframe_times(std::uint32_t keyframes, double keyframes_per_second) {
  if (keyframes == 0) throw io::InputError("0 keyframes asked for, at least 1 is needed");
  if (!(keyframes_per_second > 0.0) || !(keyframes_per_second < 1e9))
    throw io::InputError(shortest_text(keyframes_per_second) +
                         " keyframes per second asked for, must be positive");
  std::vector<double> times(keyframes);
  for (std::uint32_t k = 0; k < keyframes; ++k) times[k] = double(k) / keyframes_per_second;
  return times;
}

io::AnimatedMesh snapped(const io::AnimatedMesh& mesh, int fraction_bits) {
  if (fraction_bits < 0 || fraction_bits > 24)
    throw io::InputError("snapped: " + std::to_string(fraction_bits) +
                         " fraction bits asked for, must be 0 to 24");
  const double scale = double(1u << fraction_bits);
  const auto snap = [scale](double x) { return std::floor(x * scale + 0.5) / scale; };
  return with_motion(mesh, 1, 1.0, [&](std::uint32_t, double x, double y, double z) {
    return Point{snap(x), snap(y), snap(z)};
  });
}

io::AnimatedMesh translated(const io::AnimatedMesh& mesh, const Point& step, std::uint32_t keyframes,
                            double keyframes_per_second) {
  return with_motion(
      mesh, keyframes, keyframes_per_second, [&](std::uint32_t k, double x, double y, double z) {
        return Point{x + double(k) * step[0], y + double(k) * step[1], z + double(k) * step[2]};
      });
}

io::AnimatedMesh rotated(const io::AnimatedMesh& mesh, const Point& centre, double turns,
                         std::uint32_t keyframes, double keyframes_per_second) {
  std::vector<std::pair<double, double>> rotations(keyframes);  // cosine, sine
  for (std::uint32_t k = 0; k < keyframes; ++k)
    rotations[k] = {cosine_of_turns(double(k) * turns), sine_of_turns(double(k) * turns)};
  return with_motion(mesh, keyframes, keyframes_per_second,
                     [&](std::uint32_t k, double x, double y, double z) {
                       const auto [c, s] = rotations[k];
                       const double dx = x - centre[0], dy = y - centre[1];
                       return Point{centre[0] + c * dx - s * dy, centre[1] + s * dx + c * dy, z};
                     });
}

io::AnimatedMesh waving_sheet(std::uint32_t triangles, std::uint32_t keyframes, double keyframes_per_second) {
  io::AnimatedMesh flat = sheet(triangles, {0, 0, 0}, 2.0);
  flat.name = "waving-" + flat.name;
  const double squares = double(sheet_squares(triangles));
  struct Wave {
    double kx, ky, turns_per_second, height, sideways;  // kx, ky in waves per metre
  };
  // From one wave per sheet to one per eight squares, at equal steepness (height x frequency): fine waves are
  // lower, and affect bounding boxes of their size as much as coarse waves affect theirs.
  Wave waves[5];
  const double directions[5][2] = {{0.8, 0.6}, {-0.6, 0.8}, {0.28, -0.96}, {-0.96, -0.28}, {0.96, -0.28}};
  double frequency = 0.5;
  const double growth = std::sqrt(std::sqrt(std::max(1.0, squares / 16.0) / frequency));
  for (std::size_t i = 0; i < 5; ++i, frequency *= growth)
    waves[i] = {directions[i][0] * frequency, directions[i][1] * frequency, 0.5 * std::sqrt(frequency),
                0.06 / frequency, 0.01 / (frequency * frequency)};
  const std::vector<double> times = keyframe_times(keyframes, keyframes_per_second);
  return with_motion(flat, keyframes, keyframes_per_second,
                     [&](std::uint32_t k, double x, double y, double z) {
                       Point p{x, y, z};
                       for (const Wave& wave : waves) {
                         const double phase = wave.kx * x + wave.ky * y - wave.turns_per_second * times[k];
                         const double c = cosine_of_turns(phase);
                         p[0] += wave.sideways * wave.kx * c;
                         p[1] += wave.sideways * wave.ky * c;
                         p[2] += wave.height * sine_of_turns(phase);
                       }
                       return p;
                     });
}

io::AnimatedMesh random_soup(std::uint32_t triangles, std::uint64_t seed, std::uint32_t keyframes,
                             double keyframes_per_second) {
  check_triangles(triangles, "random_soup");
  const std::uint32_t count = std::max(1u, triangles);
  const SeededNoise noise(seed);
  const double size = cube_edge(1, count);  // of the cube that holds one triangle
  std::vector<std::uint32_t> corners(3 * std::size_t(count));
  std::vector<double> positions(9 * std::size_t(count));
  for (std::size_t v = 0; v < corners.size(); ++v) {
    corners[v] = std::uint32_t(v);
    for (std::size_t axis = 0; axis < 3; ++axis)
      positions[3 * v + axis] = 0.5 + 0.5 * noise.signed_unit(v / 3 * 3 + axis) +
                                0.5 * size * noise.signed_unit(corners.size() + 3 * v + axis);
  }
  io::AnimatedMesh mesh = triangle_mesh("random-soup", std::move(corners), std::move(positions));
  mesh.keyframe_times = keyframe_times(keyframes, keyframes_per_second);
  const std::size_t row = std::size_t(mesh.vertex_count) * 3;
  mesh.positions.resize(row * keyframes);
  for (std::size_t i = row; i < mesh.positions.size(); ++i)
    mesh.positions[i] =
        rounded_to_float(mesh.positions[i - row] + 0.1 * size * noise.signed_unit(4 * row + i));
  return mesh;
}

io::AnimatedMesh expanding_sphere(std::uint32_t triangles, const Point& centre, double first_radius,
                                  double last_radius, std::uint32_t keyframes, double keyframes_per_second) {
  check_length(first_radius, "expanding_sphere: the first radius");
  check_length(last_radius, "expanding_sphere: the last radius");
  io::AnimatedMesh mesh = icosphere(triangles, {0, 0, 0}, 1.0);
  mesh.name = "expanding-" + mesh.name;
  const double step = keyframes > 1 ? (last_radius - first_radius) / double(keyframes - 1) : 0.0;
  return with_motion(mesh, keyframes, keyframes_per_second,
                     [&](std::uint32_t k, double x, double y, double z) {
                       const double radius = first_radius + double(k) * step;
                       return Point{centre[0] + radius * x, centre[1] + radius * y, centre[2] + radius * z};
                     });
}

}  // namespace kbvh::scenes
