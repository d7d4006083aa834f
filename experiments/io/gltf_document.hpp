#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

/// The supported part of glTF 2.0 as plain data with checked cross references.
namespace kbvh::io::gltf {

using Index = std::optional<std::uint32_t>;

/// A range of bytes of a buffer, checked to lie inside it.
struct BufferView {
  std::uint32_t buffer = 0;
  std::uint64_t offset = 0, length = 0;
  std::uint64_t stride = 0;  ///< bytes between elements; 0: tightly packed
};

enum class Component : std::uint16_t { int8 = 5120, uint8, int16, uint16, uint32 = 5125, float32 };

struct Sparse {
  std::uint64_t count = 0;
  std::uint32_t index_view = 0, value_view = 0;
  std::uint64_t index_offset = 0, value_offset = 0;
  Component index_type = Component::uint16;
};

/// Typed numbers in a buffer view; reading them checks the ranges.
struct Accessor {
  Index view;  ///< none: all zero
  std::uint64_t offset = 0, count = 0;
  Component component = Component::float32;
  std::uint32_t components = 1;  ///< 1 (SCALAR) to 16 (MAT4)
  bool normalized = false;
  std::optional<Sparse> sparse;
};

enum class Mode : std::uint8_t {
  points,
  lines,
  line_loop,
  line_strip,
  triangles,
  triangle_strip,
  triangle_fan
};

struct Primitive {
  std::string place;  ///< JSON path, for messages
  Mode mode = Mode::triangles;
  Index indices, position;
  std::vector<std::uint32_t> joints, weights;  ///< sets 0, 1, ... of the same length
  std::vector<Index> targets;                  ///< morph displacements of the position, none: zero
};

struct Mesh {
  std::vector<Primitive> primitives;
  std::vector<double> weights;
};

struct Node {
  Index mesh, skin;
  std::vector<std::uint32_t> children;
  std::optional<std::array<double, 16>> matrix;  ///< column by column
  std::array<double, 3> translation{0, 0, 0}, scale{1, 1, 1};
  std::array<double, 4> rotation{0, 0, 0, 1};
  std::vector<double> weights;
};

struct Skin {
  Index inverse_bind_matrices;
  std::vector<std::uint32_t> joints;
};

enum class Interpolation { linear, step, cubic_spline };
enum class Path { translation, rotation, scale, weights };

struct Channel {
  std::string place;  ///< JSON path, for messages
  std::uint32_t node = 0, input = 0, output = 0;
  Interpolation interpolation = Interpolation::linear;
  Path path = Path::translation;
};

struct Animation {
  std::string name;
  std::vector<Channel> channels;  ///< channels that move a node
  std::size_t others = 0;         ///< channels that do not, or by a pointer
};

struct Document {
  std::filesystem::path file;
  std::vector<std::string> buffers;
  std::vector<BufferView> views;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Node> nodes;
  std::vector<Skin> skins;
  std::vector<Animation> animations;
  std::vector<std::uint32_t> order;     ///< all nodes, parents before children
  std::vector<Index> parent;            ///< of each node
  std::vector<std::uint32_t> in_scene;  ///< nodes of the default scene, parents before children
  std::vector<std::string> notes;       ///< about parts of the file that are not read
};

/// Reads and checks a .gltf or .glb with its buffers. Throws InputError with the JSON path and the value.
Document read_document(const std::filesystem::path& file);

/// Returns all numbers of an accessor, [element][component], integers converted (normalised ones as the
/// specification requires), sparse replacements applied. Throws InputError if it has another number of
/// components, leaves its buffer view, or holds a number that is not finite.
std::vector<double> read_numbers(const Document& document, std::uint32_t accessor, std::uint32_t components);

/// Returns all numbers of an accessor of unsigned integers, [element][component].
std::vector<std::uint32_t> read_unsigned(const Document& document, std::uint32_t accessor,
                                         std::uint32_t components);

/// Composes "accessors[i], element e", for messages.
std::string place_in(std::uint32_t accessor, std::uint64_t element);

}  // namespace kbvh::io::gltf
