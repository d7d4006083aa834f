#include "experiments/scenes/placement.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "experiments/scenes/shapes.hpp"

namespace kbvh::experiments {

bool Placement::identity() const {
  return scale == 1 && rotations.empty() && translate[0] == 0 && translate[1] == 0 && translate[2] == 0;
}

namespace {
struct Matrix {
  double m[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
};

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j];
  return c;
}

/// Rodrigues' formula with our own sines, so that every machine computes the same rotation.
Matrix matrix_of(const Placement::Rotation& rotation) {
  const double turns = rotation.degrees / 360.0;
  double sine = scenes::sine_of_turns(turns), cosine = scenes::cosine_of_turns(turns);
  if (std::fmod(rotation.degrees, 90.0) == 0) {
    sine = std::round(sine);
    cosine = std::round(cosine);
  }
  // Scaled first: squares of the user's numbers could overflow or underflow.
  const double largest =
      std::max({std::abs(rotation.axis[0]), std::abs(rotation.axis[1]), std::abs(rotation.axis[2])});
  const double a[3] = {rotation.axis[0] / largest, rotation.axis[1] / largest, rotation.axis[2] / largest};
  const double length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  const double x = a[0] / length, y = a[1] / length, z = a[2] / length, rest = 1 - cosine;
  return {{{cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine},
           {y * x * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine},
           {z * x * rest - y * sine, z * y * rest + x * sine, cosine + z * z * rest}}};
}
}  // namespace

void place(io::AnimatedMesh& mesh, const Placement& placement) {
  if (placement.identity()) return;
  Matrix matrix;
  for (const Placement::Rotation& rotation : placement.rotations)
    matrix = product(matrix_of(rotation), matrix);
  for (std::size_t i = 0; i + 2 < mesh.positions.size(); i += 3) {
    double* p = mesh.positions.data() + i;
    const double scaled[3] = {placement.scale * p[0], placement.scale * p[1], placement.scale * p[2]};
    for (int d = 0; d < 3; ++d)
      p[d] = matrix.m[d][0] * scaled[0] + matrix.m[d][1] * scaled[1] + matrix.m[d][2] * scaled[2] +
             placement.translate[d];
  }
  // Curves are relative to the chords of their ends.
  for (io::AnimatedMesh::Bends& segment : mesh.bends)
    for (std::vector<double>* values : {&segment.bend, &segment.twist})
      for (std::size_t i = 0; i + 2 < values->size(); i += 3) {
        double* b = values->data() + i;
        const double scaled[3] = {placement.scale * b[0], placement.scale * b[1], placement.scale * b[2]};
        for (int d = 0; d < 3; ++d)
          b[d] = matrix.m[d][0] * scaled[0] + matrix.m[d][1] * scaled[1] + matrix.m[d][2] * scaled[2];
      }
}

void shuffle_vertices(io::AnimatedMesh& mesh, std::uint64_t seed) {
  std::vector<std::uint32_t> place_of(mesh.vertex_count);
  std::iota(place_of.begin(), place_of.end(), 0u);
  const scenes::SeededNoise noise(seed);
  for (std::uint32_t i = mesh.vertex_count; i > 1; --i)
    std::swap(place_of[i - 1], place_of[noise.bits(i) % i]);
  for (std::uint32_t& v : mesh.primitive_vertices) v = place_of[v];
  const auto shuffle = [&](std::vector<double>& values) {
    std::vector<double> moved(values.size());
    for (std::size_t begin = 0; begin < values.size(); begin += std::size_t(3) * mesh.vertex_count)
      for (std::uint32_t v = 0; v < mesh.vertex_count; ++v)
        for (std::size_t d = 0; d < 3; ++d)
          moved[begin + 3 * std::size_t(place_of[v]) + d] = values[begin + 3 * std::size_t(v) + d];
    values = std::move(moved);
  };
  shuffle(mesh.positions);
  for (io::AnimatedMesh::Bends& segment : mesh.bends) {
    shuffle(segment.bend);
    shuffle(segment.twist);
  }
}

}  // namespace kbvh::experiments
