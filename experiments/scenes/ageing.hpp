#pragma once
#include <cstdint>
#include <utility>

#include "experiments/io/animated_mesh.hpp"

/// Bodies whose motion degrades a hierarchy that keeps its first topology: parts that lie together at the
/// first keyframe are far apart at the last. All are made by formula or by a short simulation, in any size,
/// and are deterministic to the last bit on every machine with IEEE doubles (see shapes.hpp). Metres,
/// seconds; z points up. Requests above 2^27 triangles throw io::InputError.
namespace kbvh::scenes {

/// The common parameters of these bodies.
struct AgeingConfig {
  std::uint32_t triangles = 2000;  ///< the nearest number that the pattern allows is made
  std::uint64_t seed = 1;
  std::uint32_t keyframes = 60;
};

/// Makes two swarms of small soft bodies that fall into each other and swap places: gravity with a
/// short-range repulsion, integrated by leapfrog; every body stretches and shrinks along an axis that turns.
/// Each swarm is one mesh of 400 or more geodesic spheres (fewer below 8000 triangles); `second_triangles` is
/// the size of the second. Time O(bodies^2 x keyframes).
std::pair<io::AnimatedMesh, io::AnimatedMesh> mixing_swarms(const AgeingConfig& config,
                                                            std::uint32_t second_triangles);

/// Makes one mesh of 300 or more people (fewer below 11 000 triangles) that cross a square in four
/// directions, each at a speed of its own. A person who reaches the far side starts again at a random place
/// of the near side: one keyframe interval takes the person back. 4 keyframes per second.
io::AnimatedMesh crossing_crowd(const AgeingConfig& config);

/// Makes two hollow balls of separate triangles that collide in the air at a tenth of the clip and burst:
/// every triangle tumbles, falls to the floor z = 0 (which is no body), bounces and comes to rest by itself.
std::pair<io::AnimatedMesh, io::AnimatedMesh> shattering_balls(const AgeingConfig& config,
                                                               std::uint32_t second_triangles);

/// Makes separate small triangles that drift in the unit cube with a stirred, divergence-free flow.
io::AnimatedMesh flowing_soup(const AgeingConfig& config);

/// Makes a rod that is twisted at one end until it buckles: its ends approach, and its middle winds up into a
/// double helix (a plectoneme).
io::AnimatedMesh twisted_rod(const AgeingConfig& config);

/// Makes a rope with a loose overhand knot that is pulled tight: the rope slides out of the knot.
io::AnimatedMesh tightening_knot(const AgeingConfig& config);

/// Makes two balls of yarn that roll along curves on the floor z = 0 (which is no body) without slipping, and
/// leave their threads there: the threads cross. 12 keyframes per second.
std::pair<io::AnimatedMesh, io::AnimatedMesh> unrolling_yarns(const AgeingConfig& config,
                                                              std::uint32_t second_triangles);

/// Makes a square cloth that is pulled by its centre through a funnel and gathers into pleats.
io::AnimatedMesh funnel_cloth(const AgeingConfig& config);

/// Makes the funnel of that cloth: a closed surface of genus 1.
io::AnimatedMesh funnel(std::uint32_t triangles);

/// Makes two people who run on the spot, so close that their limbs cut. 25 keyframes per second, as captured
/// figures have: a vertex moves by about a triangle's edge from one to the next.
std::pair<io::AnimatedMesh, io::AnimatedMesh> running_figures(const AgeingConfig& config,
                                                              std::uint32_t second_triangles);

}  // namespace kbvh::scenes
