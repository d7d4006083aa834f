#pragma once
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "experiments/scenes/cloth_parts.hpp"
#include "experiments/scenes/walker.hpp"

/// The pattern of a garment: pieces of cloth, each a grid of threads, that share vertices along their seams,
/// and their placement around the figure's rest pose.
namespace kbvh::scenes {

enum class GarmentKind : std::uint8_t { shirt, dress };

/// Measures of a garment around the figure in the rest pose, metres.
struct GarmentShape {
  /// Half width (to the sides) and half depth of the body of the garment at heights, from hem to armpit.
  struct Level {
    double z, width, depth, front;
  };
  std::vector<Level> levels;
  double shoulder_y = 0, shoulder_z = 0;  ///< outer end of the shoulder seam
  double armhole_depth = 0;               ///< half of the armhole's width, front to back
  double neck_y = 0, neck_z = 0, neck_front = 0, neck_back = 0;  ///< neck end of the seam; hole fore and aft
  double neck_dip_front = 0, neck_dip_back = 0;                  ///< how far the hole's edge falls
  double sleeve = 0;  ///< length of a sleeve along the arm; 0: none
  double cuff_radius = 0;
  double doubled_below = 0;  ///< height below which there are twice as many columns; 0: nowhere
};
GarmentShape garment_shape(GarmentKind kind);

/// The numbers of grid squares.
struct GarmentCounts {
  std::uint32_t columns = 4;   ///< across the front, and across the back
  std::uint32_t shoulder = 1;  ///< of them under each shoulder seam
  std::uint32_t doubled = 0;   ///< rows with twice as many columns, from the hem on
  std::uint32_t rows = 2;      ///< from hem to armpit, the doubled ones included
  std::uint32_t armhole = 2;   ///< rows from armpit to shoulder
  std::uint32_t sleeve = 0;    ///< rows from armhole to cuff
  std::uint64_t triangles() const;
};
/// Returns the counts with nearly square grid squares whose number of triangles is nearest to the request.
GarmentCounts garment_counts(const GarmentShape& shape, std::uint32_t triangles);

/// The sewn garment at rest.
struct GarmentPattern {
  /// A grid of (rows + 1) x columns vertices if it closes around, or of (rows + 1) x (columns + 1) if not.
  struct Piece {
    std::uint32_t rows = 0, columns = 0;
    bool closed = false;
    std::vector<std::uint32_t> ids;    ///< [row][column]
    std::vector<std::uint32_t> marks;  ///< columns that correspond in patterns of other counts
    std::uint32_t stride() const { return closed ? columns : columns + 1; }
    std::uint32_t at(std::uint32_t row, std::uint32_t column) const { return ids[row * stride() + column]; }
  };
  struct Place {
    std::uint32_t piece, row, column;
  };
  struct Distance {
    std::uint32_t a, b;
    double rest;
    bool operator<(const Distance& o) const { return std::pair(a, b) < std::pair(o.a, o.b); }
  };
  struct Bend {
    std::uint32_t a, b, c;
    double spacing;
  };
  static constexpr std::uint32_t none = 0xffffffffu;

  GarmentCounts counts;
  std::vector<Piece> pieces;  ///< skirt (doubled rows; may have no rows), trunk, front, back, sleeves
  std::vector<cloth::Vec> rest;
  std::vector<Place> places;  ///< of each vertex, in the first piece that contains it
  std::vector<std::array<std::uint32_t, 4>>
      neighbours;                        ///< left, right, below, above; the vertex itself where none exists
  std::vector<std::uint32_t> triangles;  ///< three vertex ids each, facing outwards
  /// In solving order: groups without a common vertex, one after the other.
  std::vector<Distance> threads, diagonals;
  std::vector<Bend> bends;
  double spacing = 0;  ///< mean length of a thread between two vertices
};

/// Cuts and sews the garment. `walker` is in the rest pose; the cloth is laid out at least `margin` off its
/// solid.
GarmentPattern sew(const GarmentShape& shape, const GarmentCounts& counts, const Walker& walker,
                   double margin);

}  // namespace kbvh::scenes
