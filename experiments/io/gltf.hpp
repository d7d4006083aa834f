#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// The largest distance of a baked vertex from the animation between keyframes, relative to the body's size
/// (the largest diagonal of its box at any key).
inline constexpr double gltf_tolerance = 1e-3;

/// Reads a glTF 2.0 file (.gltf or .glb) and bakes one animation into keyframes in scene space.
///
/// Geometry: all triangles (lists, strips, fans) of all meshes below the default scene's nodes (or all root
/// nodes if there is no scene), as one mesh. Points and lines are skipped, and so are vertices that no
/// triangle uses; a scene with points and without triangles is a cloud of points. Seams are welded
/// (`welded_vertices` counts): vertices of equal rest position (bind space if skinned, else scene space)
/// whose baked positions are equal at all keyframes become one. Notes report what is skipped: points and
/// lines next to triangles, instances, channels that do not move nodes, unknown extensions.
///
/// Motion: node translation, rotation, scale, morph weights and skins, with LINEAR, STEP and CUBICSPLINE
/// samplers, evaluated at the union of the key times of all samplers that the clip uses. Between keyframes
/// the baked motion is linear: where rotations and splines deviate from it by more than `gltf_tolerance`,
/// keyframes are added (`added_keyframes` counts). A STEP sampler jumps: a keyframe at the double before its
/// key has the positions before the jump (`jumps` counts). Skin weights are scaled to sum 1 (a vertex without
/// any weight follows its first joint). Without an animation: one keyframe at time 0. All arithmetic in
/// double.
///
/// `clip`: an animation's name, or else its index; empty takes the only one. Buffers: the binary chunk,
/// base64, or files in or below the folder of `file`. Compressed geometry (Draco, meshopt) is refused.
///
/// Throws InputError with the JSON path or the accessor and element. Does not call finish(). O(bytes +
/// keyframes * vertices * (influences + targets)); refuses to bake more than 8 GiB.
///
/// `times`: if given, keyframes at these seconds (strictly increasing) instead of the key times, the pose
/// held beyond the clip's ends; for finely resampled clips.
AnimatedMesh read_gltf(const std::filesystem::path& file, const std::string& clip,
                       std::vector<double> times = {});

}  // namespace kbvh::io
