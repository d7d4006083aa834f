#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/scene/scene.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/primitives.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/scenes/scripted.hpp"

namespace kbvh::experiments {

/// Where a body is put: scaled, then turned by each rotation in turn, then moved.
struct Placement {
  struct Rotation {
    double axis[3];  ///< need not be of unit length
    double degrees;
  };
  double scale = 1;
  std::vector<Rotation> rotations;
  double translate[3] = {0, 0, 0};
  bool identity() const;
};

/// One body of a scene from files, or by formula.
struct BodySpec {
  std::string name;                    ///< empty: from the file or the shape
  std::filesystem::path file, motion;  ///< file is empty for shapes
  std::string clip;
  double frames_per_second = 0;
  nlohmann::json shape;  ///< for make_shape; null for files
  io::TakeAs as = io::TakeAs::given;
  Placement placement;
  bool self = false;  ///< pairs within it are asked for, too
  std::string place;  ///< for messages
};

/// In which order a scene stores its vertices (and, renumbered, its primitives).
enum class VertexOrder : std::uint8_t {
  given,       ///< as the file or the generator has them
  shuffled,    ///< at random, as a careless exporter leaves them
  renumbered,  ///< as the leaves of the default topology meet them (core/topology/renumber.hpp)
};

/// A scene as a plan says it.
struct SceneSpec {
  std::string name;     ///< empty: from what is in it
  std::string builtin;  ///< or empty: the bodies
  BuiltinOptions options;
  std::vector<BodySpec> bodies;
  std::optional<ScriptSpec> script;  ///< plan changes of the user's own
  VertexOrder order = VertexOrder::given;
  bool self = false;      ///< pairs within every body are asked for, too
  bool optional = false;  ///< skipped with a note if a file does not exist
  std::string said;       ///< all that decides what it is, as text: equal texts are equal scenes
};

/// The name that results will show if the plan gives one ("cloth", shuffled: "cloth-shuffled"), else "".
std::string given_name(const SceneSpec& spec);

/// "given", "shuffled" or "renumbered".
const char* word(VertexOrder order);

/// Turns "cloth.obj,motion=cloth.pc2,translate=0:0:1" or "sphere:triangles=2000,radius=0.5" into the object
/// that a plan would hold. Numbers in vectors and after axes are separated by colons; a file name with a
/// comma in it can only be said in a plan. Throws io::InputError.
nlohmann::json body_from_text(const std::string& text);

/// Reads one scene of a plan: its `triangles`, `seed` and `order` may be lists, so it can be several.
/// Relative files are relative to `folder`, "data:" begins those in the data folder. Throws io::InputError
/// that begins with `place`.
std::vector<SceneSpec> read_scenes(const nlohmann::json& scene, const std::string& place,
                                   const std::filesystem::path& folder);

/// Where the bodies of a scene are from.
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
  std::vector<std::string> sources;      ///< of each: its file, or how it was made
  std::vector<bool> self;                ///< of each: are pairs within it asked for? Empty: of none
  SceneOrigin origin = SceneOrigin::shapes;
  VertexOrder order = VertexOrder::given;  ///< `renumbered` is left to `assemble`
  std::optional<ReversalRule> reversal;    ///< of scenes that record their plan changes
  std::optional<ScriptSpec> script;        ///< plan changes of the user's own
  std::vector<std::string> notes;          ///< what readers noticed, one sentence each
};

/// Reads or makes all bodies. Throws io::InputError.
LoadedScene load(const SceneSpec& spec, const MakeProgress& progress = {});

/// Is an optional scene's file missing? Then its name, else "".
std::string missing_file(const SceneSpec& spec);

/// Applies a placement to all keyframes, in double. Right angles are exact.
void place(io::AnimatedMesh& mesh, const Placement& placement);

/// Gives the vertices another order, drawn from the seed; the geometry is the same.
void shuffle_vertices(io::AnimatedMesh& mesh, std::uint64_t seed);

/// The scene in one scalar: every coordinate rounded once. Body pairs: all with at least one that moves, then
/// those of bodies with themselves that are asked for.
/// Throws io::InputError that names the body, e.g. if a coordinate does not fit the scalar.
template <class S>
Scene<S> assemble(const LoadedScene& loaded);

}  // namespace kbvh::experiments
