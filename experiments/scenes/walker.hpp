#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "experiments/io/animated_mesh.hpp"
#include "experiments/scenes/cloth_parts.hpp"

/// A walking figure: bones with a gait cycle, a solid of rounded cones around them that stops cloth, and a
/// skinned triangle mesh that is drawn. Metres, seconds; z points up, the figure walks along +x, its left is
/// +y.
namespace kbvh::scenes {

/// The joints in the rest pose (arms spread, legs straight) and the thickness of the figure there. Left side;
/// the right side is its mirror image.
struct FigureShape {
  cloth::Vec hip{0, 0.09, 0.92}, knee{0, 0.095, 0.50}, ankle{-0.02, 0.095, 0.085}, toe{0.15, 0.105, 0.035};
  cloth::Vec shoulder{0, 0.185, 1.41};
  double upper_arm = 0.29, forearm = 0.34;  ///< lengths; the forearm's includes the hand
  /// Bars across the trunk: height, half length, radius, and distance in front of the spine.
  struct Bar {
    double z, half, radius, front;
  };
  Bar pelvis{0.95, 0.075, 0.105, 0}, waist{1.10, 0.055, 0.095, 0}, chest{1.28, 0.08, 0.115, 0};
  Bar bust{1.32, 0.09, 0.07, 0.02}, shoulders{1.42, 0.16, 0.055, 0};
  double neck_radius = 0.056, head_radius = 0.095, head_z = 1.62;
  double hip_radius = 0.088, knee_radius = 0.058, ankle_radius = 0.042;
  double shoulder_radius = 0.052, elbow_radius = 0.042, hand_radius = 0.03;
};
FigureShape man();
FigureShape woman();

/// The gait.
struct Gait {
  double cycles_per_second = 0.9;
  double metres_per_second = 1.2;
  double hip_swing = 20;  ///< degrees to each side of the mean
  double arm_swing = 22;
  double phase = 0;  ///< of the cycle at time 0, in turns
};

inline constexpr double rest_arm_degrees = 52;  ///< between arm and vertical in the rest pose

/// The figure at one time.
class Walker {
 public:
  Walker(const FigureShape& shape, const Gait& gait);

  /// Takes the pose of time t; `walking` blends from the rest pose (0) to the gait (1). The figure walks on
  /// the spot: the caller adds metres_per_second x t.
  void pose(double t, double walking);

  /// Stores the current pose: `moved` of later contacts is relative to it.
  void mark();
  /// Returns an upper bound on the displacement of any point of the solid since mark().
  double travel() const { return travel_; }

  struct Contact {
    double distance;    ///< signed, to the surface of the solid; exact or too small
    cloth::Vec normal;  ///< outward, of unit length
    cloth::Vec moved;   ///< displacement of the nearest surface since mark()
  };
  /// Returns the nearest surface of the solid, if it is nearer than `reach`; else distance = reach. The
  /// trunk's cones blend (polynomial smooth minimum); limbs are joined without blending.
  Contact nearest(const cloth::Vec& point, double reach) const;

  /// Bones, for skinning: pelvis, abdomen, chest, head, then left and right thigh, shin, foot, upper arm,
  /// forearm.
  static constexpr std::size_t bone_count = 14;
  /// Returns the current position of a point that is fixed to a bone, given its position in the rest pose.
  cloth::Vec carried(std::size_t bone, const cloth::Vec& rest) const;

 private:
  friend class SkinPart;
  using Matrix = std::array<cloth::Vec, 3>;  // rows
  struct Bone {
    Matrix turn{};           // since the rest pose
    cloth::Vec joint, rest;  // position of the joint now, and in the rest pose
  };
  struct Cone {
    std::size_t bone_a, bone_b, part;
    cloth::Vec rest_a, rest_b;
    double ra, rb;
    // Of the current pose:
    cloth::Vec a, b, marked_a, marked_b, along, centre;
    double size, sine, cosine, reach;
  };
  struct Hit {
    double distance;
    cloth::Vec normal;
    double share;  // of b
  };
  static Hit hit(const Cone& cone, const cloth::Vec& p);
  Contact nearest_of_part(const cloth::Vec& point, std::size_t part) const;
  void add_cone(std::size_t part, std::size_t bone_a, const cloth::Vec& a, double ra, std::size_t bone_b,
                const cloth::Vec& b, double rb);
  void set_bone(std::size_t bone, std::size_t parent, const Matrix& turn);
  void place_cones();

  FigureShape shape_;
  Gait gait_;
  std::array<Bone, bone_count> bones_;
  std::vector<Cone> cones_;  // by part: trunk, legs, feet, arms
  double travel_ = 0;
};

/// The drawn surface: one closed mesh each for trunk with head, two legs, two feet and two arms, which cut
/// each other at their joints. One or two bones move each vertex (linear blend skinning); it is then
/// projected onto its part of the solid: 1 mm below the surface, but in patches above it by up to `bite`.
/// Cloth therefore lies on the figure, and cuts it at the rims of the patches that it rests on.
class Skin {
 public:
  /// The number of triangles is the nearest that the pattern allows, at least 7 x 24. `walker` must be in the
  /// rest pose. Throws io::InputError above 2^22 triangles.
  Skin(const Walker& walker, const FigureShape& shape, std::uint32_t triangles, double bite);

  /// Returns the mesh without keyframes: triangles only.
  const io::AnimatedMesh& mesh() const { return mesh_; }
  /// Computes the positions of all vertices in the walker's current pose.
  void positions(const Walker& walker, std::vector<cloth::Vec>& out) const;

 private:
  struct Vertex {
    cloth::Vec rest;
    std::size_t part, bone_a, bone_b;
    double share;   // of bone_b
    double offset;  // from the solid's surface
  };
  std::vector<Vertex> vertices_;
  io::AnimatedMesh mesh_;
  friend class SkinPart;
};

}  // namespace kbvh::scenes
