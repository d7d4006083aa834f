#pragma once
#include <string>
#include <vector>

#include "experiments/common/json_reader.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

/// A body made by formula, as plans and --body name it.
struct ShapeKind {
  std::string name;
  std::string meaning;  ///< with its keys
  /// Reads its keys and makes the mesh. `triangles` is the plan's value or a default.
  io::AnimatedMesh (*make)(JsonReader& keys);
  std::string size_key = "triangles";  ///< the key that says how large it is
};

/// All of them; what else there is to say about them (`step`, `turns`, `keyframes`) is in `make_shape`.
const std::vector<ShapeKind>& shape_kinds();

/// The kind of that name. Throws io::InputError, naming those that there are.
const ShapeKind& shape_kind(const std::string& name, const std::string& place);

/// The names of all of them.
std::vector<std::string> shape_names();

bool is_shape(const std::string& name);

/// Makes the shape that `keys` describes ("shape" and the keys of its kind). Shapes that do not move of
/// themselves take a motion: `keyframes` (1: static), `rate` (keyframes per second, 30), `step` (metres per
/// keyframe, three numbers) or `turns` (per keyframe, about the vertical axis through `centre` or the
/// origin). Throws io::InputError.
io::AnimatedMesh make_shape(JsonReader& keys);

}  // namespace kbvh::experiments
