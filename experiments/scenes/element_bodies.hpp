#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

struct BodySpec;

/// The elements of a mesh of which a body may consist.
enum class MeshElements : std::uint8_t {
  vertices,  ///< all vertices of the mesh, in its order
  edges,     ///< the sides of its polygons, each once, by their larger and then by their smaller vertex
  faces,     ///< its polygons
};

/// Returns "vertices", "edges" or "faces".
const char* word(MeshElements elements);

/// A body that consists of elements of another body and shares its vertices (Body::vertex_set).
struct ElementsSpec {
  MeshElements elements = MeshElements::edges;
  std::string of;          ///< the name of the other body
  std::uint32_t body = 0;  ///< its number, set by `find_meshes_of_elements`
};

/// Reads the keys `elements` and `of`, which go together. Throws io::InputError.
ElementsSpec read_elements(JsonReader& keys);

/// Finds the body of each `ElementsSpec`: by its name, before the body that consists of its elements. Names
/// unnamed bodies of elements after it ("cloth-edges"). Throws io::InputError that begins with the place of
/// the body, e.g. for an unknown name, a later body, and one that consists of elements itself.
void find_meshes_of_elements(std::vector<BodySpec>& bodies);

/// Reads the key `pairs`: two names of bodies each, or one name twice for pairs within a body. Returns
/// nothing without the key. Throws io::InputError.
std::optional<std::vector<BodyPair>> read_body_pairs(JsonReader& keys, const std::vector<BodySpec>& bodies);

/// Makes a mesh of the elements of another mesh: the same vertices and motion, other primitives. They are
/// polygons of one, two or more corners, so their pairs are exact intersections. Throws io::InputError that
/// begins with `place` if edges or faces of points or control nets are requested. O(corners log corners).
io::AnimatedMesh mesh_of_elements(const io::AnimatedMesh& mesh, MeshElements elements,
                                  const std::string& place);

}  // namespace kbvh::experiments
