#pragma once
#include <filesystem>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "experiments/io/primitives.hpp"

namespace kbvh::io {

/// The free-form statements of OBJ files that define B-spline or NURBS surfaces: `cstype [rat] bspline`,
/// `deg`, and `surf ... parm u ... parm v ... end`. Other kinds of surface, trimmed surfaces and connected
/// surfaces are refused; curves are skipped. Weights are only checked to be positive: boxes of control nets
/// do not depend on them.
class ObjSurfaces {
 public:
  explicit ObjSurfaces(const std::filesystem::path& file) : file_(file) {}

  /// Processes a statement if it is one of these; `words` follow `word`. Throws InputError. Returns whether
  /// it was one of these.
  bool take(std::string_view word, std::string_view words, std::size_t line, std::uint32_t vertices_so_far);
  /// Records that the vertex (by id) has a weight that is not positive.
  void bad_weight(std::uint32_t vertex) { not_positive_.insert(vertex); }
  bool empty() const { return surfaces_.empty(); }
  /// Adds the control nets of all surfaces to a mesh that has all its vertices. Throws InputError.
  void add_to(AnimatedMesh& mesh) const;

 private:
  struct Surface : SplineSurface {
    std::size_t line = 0;
    bool rational = false;
    std::vector<std::int64_t> indices;
  };
  void begin(std::string_view words, std::size_t line, std::uint32_t vertices_so_far);
  void parameters(std::string_view words, std::size_t line);
  void end(std::size_t line);
  void check(const Surface& surface, const AnimatedMesh& mesh) const;

  std::filesystem::path file_;
  bool rational_ = false, spline_ = false;
  std::string type_ = "none";
  std::vector<std::int64_t> degrees_;
  bool open_ = false;        ///< between `surf` and `end`
  bool other_open_ = false;  ///< between a curve and `end`
  std::vector<Surface> surfaces_;
  std::unordered_set<std::uint32_t> not_positive_;
};

}  // namespace kbvh::io
