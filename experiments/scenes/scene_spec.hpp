#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/scene.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/primitives.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/scenes/element_bodies.hpp"
#include "experiments/scenes/placement.hpp"
#include "experiments/scenes/scripted.hpp"

namespace kbvh::experiments {

/// How vertices move between keyframes.
enum class Paths : std::uint8_t {
  given,   ///< as in the file or from the generator
  lines,   ///< on straight lines
  smooth,  ///< on cubics through the keyframes (curves.hpp)
};

/// One body of a scene from files, by formula, or of elements of another body.
struct BodySpec {
  std::string name;                    ///< empty: from the file or the shape
  std::filesystem::path file, motion;  ///< file is empty for shapes and elements
  std::string clip;
  double frames_per_second = 0;
  nlohmann::json shape;                  ///< for make_shape; null for files and elements
  std::optional<ElementsSpec> elements;  ///< it then has the vertices and the motion of another body
  io::TakeAs as = io::TakeAs::given;
  Placement placement;
  bool self = false;  ///< pairs within it are requested, too
  Paths paths = Paths::given;
  std::optional<bool> weld;  ///< of files (io/weld.hpp); by default where no script changes single vertices
  std::string place;         ///< for messages
};

/// The order in which a scene stores its vertices (and, renumbered, its primitives).
enum class VertexOrder : std::uint8_t {
  given,       ///< as in the file or from the generator
  shuffled,    ///< at random, as some exporters leave them
  renumbered,  ///< in the order of the leaves of the default topology (core/topology/renumber.hpp)
};

/// A scene as described in a plan.
struct SceneSpec {
  std::string name;     ///< empty: derived from its content
  std::string builtin;  ///< or empty: the bodies
  BuiltinOptions options;
  Paths paths = Paths::given;  ///< of a built-in scene
  std::vector<BodySpec> bodies;
  std::optional<std::vector<BodyPair>> pairs;  ///< of the bodies; nothing: all with a moving body
  std::optional<double> radius;      ///< pairs are those of boxes grown by half of it; nothing: exact pairs
  std::optional<ScriptSpec> script;  ///< user-defined plan changes
  VertexOrder order = VertexOrder::given;
  bool self = false;      ///< pairs within every body are requested, too
  bool optional = false;  ///< skipped with a note if a file does not exist
  std::string said;       ///< everything that defines the scene, as text: equal texts are equal scenes
  nlohmann::json
      object;  ///< this scene alone as an object of a plan; files are relative to the working folder
};

/// Returns the name that results will show if the plan gives one ("cloth", shuffled: "cloth-shuffled"), else
/// "".
std::string given_name(const SceneSpec& spec);

/// Returns whether the scene defines its own frames, so that l does not apply. It need not be loaded.
bool has_own_frames(const SceneSpec& spec);

/// Returns "given", "shuffled" or "renumbered".
const char* word(VertexOrder order);

/// Converts "cloth.obj,motion=cloth.pc2,translate=0:0:1" or "sphere:triangles=2000,radius=0.5" to the
/// equivalent object of a plan. Numbers in vectors and after axes are separated by colons; a file name with a
/// comma can only be given in a plan. Throws io::InputError.
nlohmann::json body_from_text(const std::string& text);

/// Reads one scene of a plan: its `triangles`, `seed` and `order` may be lists, so the result may be several
/// scenes. Relative files are relative to `folder`; "data:" is the prefix of files in the data folder. Throws
/// io::InputError that begins with `place`.
std::vector<SceneSpec> read_scenes(const nlohmann::json& scene, const std::string& place,
                                   const std::filesystem::path& folder);

/// The origin of a scene's bodies.
enum class SceneOrigin : std::uint8_t {
  built_in,  ///< a scene that the program knows by name
  files,     ///< at least one body is read from a file
  shapes,    ///< all bodies are made by formula
};

/// A scene before it is given a scalar.
struct LoadedScene {
  std::string name;
  std::uint64_t seed = 1;
  std::vector<io::AnimatedMesh> meshes;  ///< placed, in double
  std::vector<std::string> sources;      ///< of each: its file, or its generator
  std::vector<bool> self;                ///< whether pairs within each body are requested; empty: of none
  /// For each body the one whose vertices it has: itself, or an earlier body, of which its mesh is a copy
  /// with other primitives; empty: all have their own.
  std::vector<std::uint32_t> vertices_of;
  std::optional<std::vector<BodyPair>> pairs;  ///< without those of `self`; nothing: all with a moving body
  std::optional<double> radius;                ///< as in SceneSpec
  SceneOrigin origin = SceneOrigin::shapes;
  VertexOrder order = VertexOrder::given;  ///< `renumbered` is done by `assemble`
  std::optional<ReversalRule> reversal;    ///< of scenes that record their plan changes
  std::optional<DragRule> drag;            ///< of scenes in which a hand drags a part
  std::optional<ScriptSpec> script;        ///< user-defined plan changes
  std::vector<std::string> notes;          ///< notes of the readers, one sentence each
};

/// Reads or generates all bodies. Throws io::InputError.
LoadedScene load(const SceneSpec& spec, const MakeProgress& progress = {});

/// Returns the name of a missing file of an optional scene, else "".
std::string missing_file(const SceneSpec& spec);

/// Makes the scene in one scalar: every coordinate is rounded once. Body pairs: the listed ones, or all pairs
/// with at least one moving body; then the requested pairs of bodies with themselves. A scene with a radius
/// consists of grown boxes: each vertex is two, the corners of its box (core/scene/with_radius.hpp). Throws
/// io::InputError that names the body, e.g. if a coordinate does not fit the scalar.
template <class S>
Scene<S> assemble(const LoadedScene& loaded);

/// Makes the scene as if it had no radius: its meshes themselves.
template <class S>
Scene<S> assemble_meshes(const LoadedScene& loaded);

}  // namespace kbvh::experiments
