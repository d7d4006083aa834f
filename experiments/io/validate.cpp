#include "experiments/io/validate.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "experiments/io/bytes.hpp"

namespace kbvh::io {
namespace {

/// hi + lo is exactly the result of the operation.
struct Exact {
  double hi, lo;
};

Exact difference(double a, double b) {
  const double hi = a - b, bb = a - hi;
  return {hi, (a - (hi + bb)) + (bb - b)};
}

Exact product(double a, double b) {
  const double hi = a * b;
  return {hi, std::fma(a, b, -hi)};
}

/// A sum of doubles without rounding (Shewchuk's growing expansion), for exact tests against zero.
class ExactSum {
 public:
  void add(double value) {
    for (std::size_t i = 0; i < size_; ++i) {
      const double sum = part_[i] + value, other = sum - part_[i];
      part_[i] = (part_[i] - (sum - other)) + (value - other);
      value = sum;
    }
    part_[size_++] = value;
  }
  bool is_zero() const {
    return std::all_of(part_.begin(), part_.begin() + static_cast<std::ptrdiff_t>(size_),
                       [](double p) { return p == 0; });
  }

 private:
  std::array<double, 16> part_{};
  std::size_t size_ = 0;
};

void add_product(ExactSum& sum, Exact a, Exact b, double sign) {
  for (double x : {a.hi, a.lo}) {
    for (double y : {b.hi, b.lo}) {
      const Exact p = product(sign * x, y);
      sum.add(p.hi);
      sum.add(p.lo);
    }
  }
}

/// Tests whether component (i, j) of (b - a) x (c - a) is exactly zero.
bool cross_is_zero(const double* a, const double* b, const double* c, int i, int j) {
  const Exact bi = difference(b[i], a[i]), bj = difference(b[j], a[j]);
  const Exact ci = difference(c[i], a[i]), cj = difference(c[j], a[j]);
  const double left = bi.hi * cj.hi, right = bj.hi * ci.hi;
  if (std::abs(left - right) > 1e-14 * (std::abs(left) + std::abs(right))) return false;
  ExactSum sum;
  add_product(sum, bi, cj, 1);
  add_product(sum, bj, ci, -1);
  return sum.is_zero();
}

void check_structure(const AnimatedMesh& mesh, const std::filesystem::path& file) {
  const auto& offsets = mesh.primitive_offsets;
  if (mesh.vertex_count == 0) fail(file, "", "holds no vertices");
  if (offsets.size() < 2) fail(file, "", "holds no faces");
  if (mesh.keyframe_times.empty()) fail(file, "", "holds no frames");
  if (offsets.front() != 0 || offsets.back() != mesh.primitive_vertices.size()) {
    fail(file, "primitive offsets",
         "do not span the " + std::to_string(mesh.primitive_vertices.size()) + " corners");
  }
  if (mesh.positions.size() / mesh.keyframe_times.size() != std::size_t{3} * mesh.vertex_count ||
      mesh.positions.size() % mesh.keyframe_times.size() != 0) {
    fail(file, "positions",
         std::to_string(mesh.positions.size()) + " numbers are not " +
             std::to_string(mesh.keyframe_times.size()) + " keyframes of " +
             std::to_string(mesh.vertex_count) + " vertices");
  }
  const bool polygons = mesh.kind == MeshKind::polygons;
  const char* const noun = polygons ? "face " : mesh.kind == MeshKind::points ? "point " : "control net ";
  const std::uint32_t least = polygons ? 3 : 1;
  for (std::size_t p = 0; p + 1 < offsets.size(); ++p) {
    const std::string place = noun + std::to_string(p);
    if (offsets[p + 1] < offsets[p] || offsets[p + 1] - offsets[p] < least) {
      fail(file, place, polygons ? "has fewer than 3 vertices" : "has no vertex");
    }
    if (offsets[p + 1] > mesh.primitive_vertices.size()) {  // and a later offset would decrease
      fail(file, place, "ends beyond the last corner");
    }
    for (std::size_t c = offsets[p]; c < offsets[p + 1]; ++c) {
      if (mesh.primitive_vertices[c] >= mesh.vertex_count) {
        fail(file, place,
             "vertex index " + std::to_string(mesh.primitive_vertices[c]) + " is out of range (" +
                 std::to_string(mesh.vertex_count) + " vertices)");
      }
    }
  }
}

void check_coordinates(AnimatedMesh& mesh, const std::filesystem::path& file) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    double& x = mesh.positions[i];
    if (std::abs(x) <= largest_coordinate) {  // false for NaN
      x += 0.0;                               // no negative zero
      continue;
    }
    const std::size_t vertex = i / 3 % mesh.vertex_count, keyframe = i / 3 / mesh.vertex_count;
    std::string place = "vertex " + std::to_string(vertex);
    if (mesh.moving()) place = "keyframe " + std::to_string(keyframe) + ", " + place;
    const std::string name(1, "xyz"[i % 3]);
    fail(
        file, place,
        "coordinate " + name + " is " + text_of(x) + (std::isfinite(x) ? ", beyond the limit of 1e+30" : ""));
  }
}

void merge_equal_times(AnimatedMesh& mesh, const std::filesystem::path& file) {
  auto& times = mesh.keyframe_times;
  const std::size_t stride = std::size_t{3} * mesh.vertex_count;
  const auto frame = [&](std::size_t k) {
    return mesh.positions.begin() + static_cast<std::ptrdiff_t>(k * stride);
  };
  std::size_t kept = 0;
  for (std::size_t k = 0; k < times.size(); ++k) {
    const std::string place = "keyframe " + std::to_string(k);
    if (!std::isfinite(times[k])) fail(file, place, "time is " + text_of(times[k]));
    if (k > 0 && times[k] < times[kept - 1]) {
      fail(file, place,
           "time " + text_of(times[k]) + " s is before the previous keyframe's " + text_of(times[kept - 1]) +
               " s");
    }
    if (k > 0 && times[k] == times[kept - 1]) {
      const auto [here, there] = std::mismatch(frame(k), frame(k + 1), frame(kept - 1));
      if (here != frame(k + 1)) {
        const auto at = static_cast<std::size_t>(here - frame(k));
        fail(file, place,
             "has the same time " + text_of(times[k]) + " s as the keyframe before it, but vertex " +
                 std::to_string(at / 3) + " has coordinate " + "xyz"[at % 3] + " = " + text_of(*here) +
                 " instead of " + text_of(*there));
      }
      ++mesh.merged_keyframes;
      continue;
    }
    if (kept != k) {
      std::copy(frame(k), frame(k + 1), frame(kept));
      times[kept] = times[k];
    }
    ++kept;
  }
  times.resize(kept);
  mesh.positions.resize(kept * stride);
}

}  // namespace

bool is_degenerate(const std::uint32_t* vertices, std::size_t count, const double* positions) {
  const auto at = [&](std::size_t i) { return positions + std::size_t{3} * vertices[i]; };
  std::size_t other = 1;
  while (other < count && std::equal(at(0), at(0) + 3, at(other))) ++other;
  for (std::size_t i = other + 1; i < count; ++i) {
    const double *a = at(0), *b = at(other), *c = at(i);
    if (!cross_is_zero(a, b, c, 0, 1) || !cross_is_zero(a, b, c, 1, 2) || !cross_is_zero(a, b, c, 2, 0))
      return false;
  }
  return true;
}

void count_degenerate(AnimatedMesh& mesh) {
  mesh.degenerate_primitives = 0;
  if (mesh.kind != MeshKind::polygons) return;  // other primitives have no area
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    const std::uint32_t begin = mesh.primitive_offsets[p], end = mesh.primitive_offsets[p + 1];
    if (is_degenerate(&mesh.primitive_vertices[begin], end - begin, mesh.positions.data()))
      ++mesh.degenerate_primitives;
  }
}

void finish(AnimatedMesh& mesh, const std::filesystem::path& file) {
  check_structure(mesh, file);
  check_coordinates(mesh, file);
  merge_equal_times(mesh, file);
  count_degenerate(mesh);
}

}  // namespace kbvh::io
