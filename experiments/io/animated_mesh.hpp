#pragma once
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace kbvh::io {

/// The kind of a mesh's primitives.
enum class MeshKind : std::uint8_t {
  polygons,      ///< of three or more vertices each
  points,        ///< of one vertex
  control_nets,  ///< each the control points of one patch of a spline surface
};

/// A mesh and its keyframes as read from files or generated, before it becomes a body of a scene. Positions
/// are kept in double so that no file format loses digits here; a scene rounds them once.
struct AnimatedMesh {
  std::string name;
  MeshKind kind = MeshKind::polygons;
  std::uint32_t vertex_count = 0;
  std::vector<std::uint32_t> primitive_offsets{0};  ///< CSR, size primitives + 1
  std::vector<std::uint32_t> primitive_vertices;    ///< vertex ids, concatenated
  std::vector<double> keyframe_times;               ///< seconds, strictly increasing, at least one
  std::vector<double> positions;                    ///< [keyframe][vertex][3]

  /// The curves of a segment between two keyframes: coefficients of core/motion/curved_piece.hpp,
  /// [vertex][3].
  struct Bends {
    std::vector<double> bend, twist;
  };
  std::vector<Bends> bends;  ///< by segment; empty: vertices move on lines

  // Findings of the reader that were kept or repaired (printed for the user, never an error).
  std::size_t degenerate_primitives = 0;  ///< corners on one line at the first keyframe; kept
  std::size_t merged_keyframes = 0;       ///< equal times with equal positions, merged into one
  std::size_t added_keyframes = 0;        ///< between those of the file, so that chords follow curves
  std::size_t jumps = 0;                  ///< positions that change within one rounding of time
  std::size_t welded_vertices = 0;        ///< copies at seams whose faces use one vertex now (weld.hpp)
  std::vector<std::string> notes;         ///< about skipped and doubtful parts, without the file's name

  std::size_t primitive_count() const { return primitive_offsets.size() - 1; }
  bool moving() const { return keyframe_times.size() > 1; }
};

/// Reports an error of a file or a request, in one sentence with file, place and value.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace kbvh::io
