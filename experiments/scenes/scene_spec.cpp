#include "experiments/scenes/scene_spec.hpp"

#include <algorithm>
#include <functional>
#include <set>

#include "core/geometry/polygon_cut.hpp"
#include "core/motion/admissible.hpp"
#include "core/scene/cut_polygons.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/names.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/frames.hpp"
#include "experiments/io/load.hpp"
#include "experiments/scenes/curves.hpp"
#include "experiments/scenes/shape_bodies.hpp"

namespace kbvh::experiments {

using nlohmann::json;
namespace fs = std::filesystem;

// --- from text and JSON ---------------------------------------------------------------------------------

namespace {

double number_of(const std::string& text, const std::string& where) {
  const auto value = parse_number(text);
  if (!value) throw io::InputError(where + ": expected a finite number, got '" + text + "'");
  return *value;
}

/// Parses "z:90" or "1:1:0:45".
Placement::Rotation rotation_of(const std::string& text, const std::string& where) {
  const auto parts = split(text, ':');
  Placement::Rotation rotation{{0, 0, 0}, 0};
  if (parts.size() == 2 && (parts[0] == "x" || parts[0] == "y" || parts[0] == "z")) {
    rotation.axis[parts[0][0] - 'x'] = 1;
  } else if (parts.size() == 4) {
    for (std::size_t d = 0; d < 3; ++d) rotation.axis[d] = number_of(parts[d], where);
    if (rotation.axis[0] == 0 && rotation.axis[1] == 0 && rotation.axis[2] == 0)
      throw io::InputError(where + ": the axis of '" + text + "' has no direction");
  } else {
    throw io::InputError(where + ": expected axis:degrees (as z:90, or 1:1:0:45), got '" + text + "'");
  }
  rotation.degrees = number_of(parts.back(), where);
  return rotation;
}

/// Formats JSON as text. Bytes that are not UTF-8, for example in file names, are escaped.
std::string text_of(json value) {
  const std::function<void(json&)> mend = [&](json& part) {
    if (part.is_string()) part = readable(part.get_ref<const std::string&>());
    if (part.is_structured())
      for (json& inner : part) mend(inner);
  };
  mend(value);
  return value.dump();
}

fs::path resolved(const std::string& text, const fs::path& folder) {
  constexpr std::string_view data = "data:";
  if (text.starts_with(data)) return data_folder() / text.substr(data.size());
  const fs::path path = text;
  return path.is_absolute() || folder.empty() ? path : folder / path;
}

io::TakeAs take_as_of(JsonReader& keys) {
  const std::string word = keys.word("as").value_or("given");
  if (word == "given") return io::TakeAs::given;
  if (word == "triangles") return io::TakeAs::triangles;
  if (word == "points") return io::TakeAs::points;
  keys.fail("as", "expected given, triangles or points, got '" + word + "'");
}

Paths paths_of(JsonReader& keys) {
  const std::string word = keys.word("curves").value_or("given");
  if (word == "given") return Paths::given;
  if (word == "lines") return Paths::lines;
  if (word == "smooth") return Paths::smooth;
  keys.fail("curves", "expected given, lines or smooth, got '" + word + "'");
}

void take_paths(io::AnimatedMesh& mesh, Paths paths) {
  if (paths == Paths::lines) mesh.bends.clear();
  if (paths == Paths::smooth) scenes::smooth(mesh);
}

BodySpec read_body(const json& value, const std::string& place, const fs::path& folder) {
  const json object = value.is_string() ? body_from_text(value.get<std::string>()) : value;
  JsonReader keys(object, place);
  BodySpec body;
  body.place = place;
  body.name = keys.word("name").value_or("");
  check_name(body.name, place + ": name");
  body.self = keys.truth("self").value_or(false);
  if (keys.has("elements") || keys.has("of")) {
    body.elements = read_elements(keys);
    keys.finish();
    return body;
  }
  body.placement.scale = keys.number("scale").value_or(1);
  if (body.placement.scale == 0) keys.fail("scale", "must not be 0");
  for (const std::string& rotation : keys.words("rotate"))
    body.placement.rotations.push_back(rotation_of(rotation, place + ": rotate"));
  if (const auto move = keys.numbers("translate", 3))
    std::copy(move->begin(), move->end(), body.placement.translate);
  body.as = take_as_of(keys);
  body.paths = paths_of(keys);
  if (keys.has("file") == keys.has("shape"))
    throw io::InputError(place +
                         ": a body has either a file or a shape, or consists of elements of another body");
  if (keys.has("shape")) {
    if (const json* triangles = keys.find("triangles"); triangles != nullptr && triangles->is_array())
      keys.fail("triangles", "a sweep belongs to the scene, a body has one number");
    body.shape = object;
    for (const char* common : {"name", "scale", "rotate", "translate", "as", "self", "curves"})
      body.shape.erase(common);
    // Made once in a small size for its error messages, so that a wrong key is reported before hours of work.
    json probe = body.shape;
    const auto& name = probe["shape"];
    const std::string size = name.is_string() ? shape_kind(name, place).size_key : "triangles";
    if (!probe.contains(size) || (probe[size].is_number_unsigned() && probe[size].get<std::uint64_t>() > 100))
      probe[size] = 100;
    JsonReader shape_keys(probe, place);
    make_shape(shape_keys);
    shape_keys.finish();
    return body;
  }
  body.file = resolved(keys.word("file").value_or(""), folder);
  if (body.file.empty()) keys.fail("file", "is empty");
  if (const auto motion = keys.word("motion")) {
    if (motion->empty()) keys.fail("motion", "is empty");
    body.motion = resolved(*motion, folder);
  }
  body.clip = keys.word("clip").value_or("");
  body.frames_per_second = keys.number("fps").value_or(0);
  if (body.frames_per_second < 0) keys.fail("fps", "must not be negative");
  body.weld = keys.truth("weld");
  if (body.weld == false && io::lower_extension(body.file).starts_with(".gl"))
    keys.fail("weld", "glTF files are always welded: their vertices have no numbers outside");
  keys.finish();
  return body;
}

/// Returns the scene of a plan as an object whose files are found from the working folder. Files in the data
/// folder keep their prefix.
json located(json scene, const fs::path& folder) {
  const auto locate = [&](json& text) {
    const std::string& file = text.get_ref<const std::string&>();
    if (!file.starts_with("data:")) text = resolved(file, folder).lexically_normal().string();
  };
  if (scene.contains("script") && scene["script"].is_string()) locate(scene["script"]);
  if (!scene.contains("bodies")) return scene;
  for (json& body : scene["bodies"]) {
    if (body.is_string()) body = body_from_text(body.get<std::string>());
    for (const char* key : {"file", "motion"})
      if (body.contains(key) && body[key].is_string()) locate(body[key]);
  }
  return scene;
}

/// Rejects a word that is neither a file nor the beginning of a file name: it was probably meant as a shape.
void check_is_a_file(const BodySpec& body) {
  std::error_code error;
  const std::string word = body.file.filename().string();
  if (body.file.empty() || body.file.has_extension() || fs::exists(body.file, error)) return;
  throw io::InputError(body.place + ": there is no file or folder " + body.file.string() + " and no shape '" +
                       word + "'; shapes are " + joined(shape_names()) + suggestion(word, shape_names()));
}

/// Reads the radius, which nothing must contradict: a scene with one consists of boxes on straight lines.
std::optional<double> radius_of(JsonReader& keys, const SceneSpec& scene) {
  const auto radius = keys.number("radius");
  if (!radius) return {};
  if (*radius < 0) keys.fail("radius", "must not be negative, got " + io::text_of(*radius));
  if (scene.script)
    keys.fail("radius", "a scene with a script has none: boxes do not follow changes of plans");
  if (!scene.builtin.empty() && find_builtin_scene(scene.builtin).changes_plans())
    keys.fail("radius", "the scene '" + scene.builtin + "' has none: it changes plans at run time");
  const bool smooth = scene.paths == Paths::smooth ||
                      std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                  [](const BodySpec& body) { return body.paths == Paths::smooth; });
  if (smooth) keys.fail("radius", "a scene with smooth curves has none: corners of boxes move on lines");
  return radius;
}

bool has_elements(const SceneSpec& scene) {
  return std::any_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const BodySpec& body) { return body.elements.has_value(); });
}

VertexOrder order_of(const std::string& word, const JsonReader& keys) {
  if (word == "given") return VertexOrder::given;
  if (word == "shuffled") return VertexOrder::shuffled;
  if (word == "renumbered") return VertexOrder::renumbered;
  keys.fail("order", "expected given, shuffled or renumbered, got '" + word + "'");
}

/// Returns the suffix that an order adds to the name of a scene.
std::string suffix(VertexOrder order) {
  return order == VertexOrder::given ? "" : std::string("-") + word(order);
}

}  // namespace

const char* word(VertexOrder order) {
  switch (order) {
    case VertexOrder::shuffled:
      return "shuffled";
    case VertexOrder::renumbered:
      return "renumbered";
    case VertexOrder::given:
      break;
  }
  return "given";
}

bool has_own_frames(const SceneSpec& spec) {
  return (spec.script && spec.script->frames > 0) ||
         (!spec.builtin.empty() && find_builtin_scene(spec.builtin).changes_plans());
}

std::string given_name(const SceneSpec& spec) {
  return spec.name.empty() ? "" : spec.name + suffix(spec.order);
}

json body_from_text(const std::string& text) {
  const std::string where = "body '" + text + "'";
  static const std::set<std::string> words{"name",  "motion", "clip",     "as",
                                           "knots", "curves", "elements", "of"},
      wholes{"triangles", "keyframes", "seed", "spans", "degree"},
      vectors{"translate", "centre", "step", "lower", "upper"};
  json body = json::object();
  auto parts = split(text, ',');
  const std::size_t colon = parts[0].find(':');
  const std::string head = parts[0].substr(0, colon);
  // "name:key=value" means a shape, even if there is no shape of that name.
  const bool means_a_shape = colon != std::string::npos && head.find_first_of("./\\") == std::string::npos &&
                             head != "data" && parse_assignment(parts[0].substr(colon + 1));
  if (parts[0].starts_with("elements=") || parts[0].starts_with("of=")) {
    // A body of elements has neither a file nor a shape.
  } else if (is_shape(head) || means_a_shape) {
    shape_kind(head, where);
    body["shape"] = head;
    if (colon == std::string::npos)
      parts.erase(parts.begin());
    else
      parts[0] = parts[0].substr(colon + 1);
  } else {
    if (parts[0].empty()) throw io::InputError(where + ": it must begin with a file or a shape");
    body["file"] = parts[0];
    parts.erase(parts.begin());
  }
  for (const std::string& part : parts) {
    const auto assignment = parse_assignment(part);
    if (!assignment) throw io::InputError(where + ": expected key=value, got '" + part + "'");
    const auto& [key, value] = *assignment;
    const std::string at = where + ": " + key;
    if (value.empty()) throw io::InputError(at + ": is empty, but needs a value");
    if (key == "rotate") {
      body[key].push_back(value);
      continue;
    }
    if (body.contains(key)) throw io::InputError(at + ": is given twice");
    if (key == "self" || key == "weld") {
      if (value != "true" && value != "false")
        throw io::InputError(at + ": expected true or false, got '" + value + "'");
      body[key] = value == "true";
    } else if (words.contains(key)) {
      body[key] = value;
    } else if (wholes.contains(key)) {
      const auto number = parse_whole(value);
      if (!number) throw io::InputError(at + ": expected a whole number, got '" + value + "'");
      body[key] = *number;
    } else if (vectors.contains(key)) {
      json numbers = json::array();
      for (const std::string& number : split(value, ':')) numbers.push_back(number_of(number, at));
      if (numbers.size() != 3) throw io::InputError(at + ": expected x:y:z, got '" + value + "'");
      body[key] = numbers;
    } else {
      // The reader of the object refuses unknown keys, and decides between numbers and words.
      const auto number = parse_number(value);
      body[key] = number ? json(*number) : json(value);
    }
  }
  return body;
}

std::vector<SceneSpec> read_scenes(const json& scene, const std::string& place, const fs::path& folder) {
  const json object = scene.is_string() ? json{{"builtin", scene}} : scene;
  JsonReader keys(object, place);
  SceneSpec base;
  base.name = keys.word("name").value_or("");
  check_name(base.name, place + ": name");
  base.optional = keys.truth("optional").value_or(false);
  base.self = keys.truth("self").value_or(false);
  base.builtin = keys.word("builtin").value_or("");
  if (keys.has("bodies") != base.builtin.empty())
    throw io::InputError(place + ": a scene is either builtin or has bodies");
  if (base.builtin.empty()) {
    const auto bodies = keys.list("bodies");
    for (std::size_t i = 0; i < bodies.size(); ++i)
      base.bodies.push_back(read_body(bodies[i], place + ": bodies[" + std::to_string(i) + "]", folder));
    if (!base.optional)
      for (const BodySpec& body : base.bodies) check_is_a_file(body);
    find_meshes_of_elements(base.bodies);
    base.pairs = read_body_pairs(keys, base.bodies);
    for (const char* key : {"triangles", "keyframes", "obstacle", "curves"})
      if (keys.has(key)) keys.fail(key, "is for built-in scenes; bodies have their own numbers");
  } else {
    try {
      find_builtin_scene(base.builtin);
    } catch (const io::InputError& problem) {
      throw io::InputError(place + ": " + problem.what());
    }
    if (keys.has("pairs")) keys.fail("pairs", "is for scenes with bodies; built-in scenes ask for their own");
  }
  if (const json* script = keys.find("script")) {
    if (!base.builtin.empty() && find_builtin_scene(base.builtin).changes_plans())
      keys.fail("script", "the scene '" + base.builtin + "' records its own");
    base.script = read_script_spec(*script, place + ": script", folder);
  }
  auto triangles = keys.wholes("triangles", ranges::triangles);
  auto seeds = keys.wholes("seed", ranges::any);
  auto orders = keys.words("order");
  base.options.keyframes =
      std::uint32_t(keys.whole("keyframes", ranges::keyframes).value_or(base.options.keyframes));
  base.options.obstacle_triangles = std::uint32_t(keys.whole("obstacle", ranges::triangles).value_or(0));
  base.paths = paths_of(keys);
  base.radius = radius_of(keys, base);
  if (base.options.obstacle_triangles > 0 && find_builtin_scene(base.builtin).bodies == BodiesOf::one)
    keys.fail("obstacle", "the scene '" + base.builtin + "' has one body");
  keys.finish();
  if (triangles.empty()) triangles = {base.options.triangles};
  if (seeds.empty()) seeds = {base.options.seed};
  if (orders.empty()) orders = {"given"};
  const json located_object = located(object, folder);
  std::vector<SceneSpec> scenes;
  for (const std::uint64_t count : triangles)
    for (const std::uint64_t seed : seeds)
      for (const std::string& order : orders) {
        SceneSpec spec = base;
        spec.options.triangles = std::uint32_t(count);
        spec.options.seed = seed;
        spec.order = order_of(order, keys);
        if (spec.script && spec.order != VertexOrder::given)
          keys.fail("order", "a script names vertices in the given order");
        spec.said = text_of(json{object, count, seed, order}) + " in " + folder.string();
        spec.object = located_object;
        if (!spec.builtin.empty()) spec.object["triangles"] = count;
        spec.object["seed"] = seed;
        spec.object["order"] = order;
        scenes.push_back(std::move(spec));
      }
  return scenes;
}

// --- loading --------------------------------------------------------------------------------------------

std::string missing_file(const SceneSpec& spec) {
  std::error_code error;
  for (const BodySpec& body : spec.bodies)
    for (const fs::path& file : {body.file, body.motion})
      if (!file.empty() && !fs::exists(file, error)) return file.string();
  return {};
}

namespace {
/// Reports which polygons of more than three corners are unusual at the first keyframe, by which they are
/// cut.
void add_notes_on_polygons(const io::AnimatedMesh& mesh, const std::string& source,
                           std::vector<std::string>& notes) {
  if (mesh.kind != io::MeshKind::polygons) return;
  PolygonCutter cutter;
  CutFindings found;
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    const std::uint32_t begin = mesh.primitive_offsets[p], corners = mesh.primitive_offsets[p + 1] - begin;
    if (corners > 3 && corners <= most_corners)
      found.add(
          cutter.cut(std::span(mesh.primitive_vertices).subspan(begin, corners), mesh.positions.data()));
  }
  const auto note = [&](std::uint64_t count, const std::string& what) {
    if (count > 0)
      notes.push_back(source + ": " + counted(count, "polygon") + " of " + std::to_string(found.cut) +
                      " with more than three corners " + what +
                      ", taken as the triangles into which they are cut at the first keyframe");
  };
  note(found.bent, "not planar");
  note(found.crossing, "crossing themselves or without an area vector");
}
}  // namespace

LoadedScene load(const SceneSpec& spec, const MakeProgress& progress) {
  LoadedScene loaded;
  loaded.seed = spec.options.seed;
  if (!spec.builtin.empty()) {
    const BuiltinScene& builtin = find_builtin_scene(spec.builtin);
    loaded.origin = SceneOrigin::built_in;
    loaded.meshes = builtin.make(spec.options, progress);
    for (io::AnimatedMesh& mesh : loaded.meshes) take_paths(mesh, spec.paths);
    if (builtin.bodies == BodiesOf::one) loaded.self.assign(loaded.meshes.size(), true);
    if (builtin.reversal != nullptr) loaded.reversal = builtin.reversal(spec.options);
    if (builtin.drag != nullptr) loaded.drag = builtin.drag(spec.options, loaded.meshes);
    loaded.name = spec.builtin;
    // Shapes end their names with the number of triangles that their pattern allowed.
    if (!loaded.meshes.empty()) loaded.name += "-" + std::to_string(loaded.meshes[0].primitive_count());
    if (spec.options.obstacle_triangles > 0 && loaded.meshes.size() > 1)
      loaded.name += "-" + std::to_string(loaded.meshes[1].primitive_count());
    if (spec.options.seed != BuiltinOptions{}.seed)
      loaded.name += "-seed" + std::to_string(spec.options.seed);
  }
  std::vector<std::string> names;
  loaded.sources.assign(loaded.meshes.size(), "built-in scene " + spec.builtin);
  const bool shares_vertices = has_elements(spec);
  for (const BodySpec& body : spec.bodies) {
    if (shares_vertices)
      loaded.vertices_of.push_back(body.elements ? body.elements->body : std::uint32_t(loaded.meshes.size()));
    loaded.self.push_back(body.self);
    io::AnimatedMesh mesh;
    if (body.elements) {  // made below, from a mesh in its final order
      loaded.sources.push_back(body.elements->of);
      names.push_back(body.name);
      loaded.meshes.push_back(std::move(mesh));
      continue;
    }
    if (!body.shape.is_null()) {
      JsonReader keys(body.shape, body.place);
      mesh = make_shape(keys);
    } else {
      if (progress) progress("reading " + body.file.string(), 0);
      loaded.origin = SceneOrigin::files;
      using Seams = io::LoadRequest::Seams;
      mesh = io::load_animated_mesh({body.file, body.motion, body.clip, body.frames_per_second,
                                     body.weld.value_or(!spec.script) ? Seams::weld : Seams::keep_apart});
    }
    mesh.name = body.name.empty() ? readable(mesh.name) : body.name;
    const std::string source = body.shape.is_null() ? body.file.string() : mesh.name;
    if (body.as != io::TakeAs::points) add_notes_on_polygons(mesh, source, loaded.notes);
    io::take_as(mesh, body.as);
    if (mesh.degenerate_primitives > 0)
      loaded.notes.push_back(source + ": " + counted(mesh.degenerate_primitives, "degenerate primitive") +
                             " at the first keyframe, kept");
    if (mesh.welded_vertices > 0)
      loaded.notes.push_back(source + ": welded " + counted(mesh.welded_vertices, "vertex") +
                             " to others that have the same positions at every keyframe");
    for (const std::string& text : mesh.notes) loaded.notes.push_back(source + ": " + text);
    if (mesh.merged_keyframes > 0)
      loaded.notes.push_back(source + ": merged " + counted(mesh.merged_keyframes, "keyframe") +
                             " with time and positions of the one before");
    if (mesh.added_keyframes > 0)
      loaded.notes.push_back(source + ": " + counted(mesh.added_keyframes, "keyframe") +
                             " added between those of the file, so that straight lines follow its turns and "
                             "splines within a thousandth of the body's size");
    if (mesh.jumps > 0)
      loaded.notes.push_back(source + ": " + counted(mesh.jumps, "jump") +
                             " of STEP samplers, each within one rounding of time: no frame lies within, but "
                             "contacts between keyframes are found on the way");
    if (mesh.kind != io::MeshKind::polygons)
      loaded.notes.push_back(
          source + ": " +
          (mesh.kind == io::MeshKind::points && body.as == io::TakeAs::given ? "has no polygons, only "
                                                                             : "") +
          counted(mesh.primitive_count(), mesh.kind == io::MeshKind::points ? "point" : "control net") +
          "; pairs with them are overlaps of boxes, not intersections");
    take_paths(mesh, body.paths);
    place(mesh, body.placement);
    loaded.sources.push_back(source);
    names.push_back(mesh.name);
    loaded.meshes.push_back(std::move(mesh));
  }
  if (spec.self) loaded.self.assign(loaded.meshes.size(), true);
  if (loaded.name.empty()) loaded.name = name_of_bodies(names);
  if (spec.radius) loaded.name += "-radius" + io::text_of(*spec.radius);
  if (!spec.name.empty()) loaded.name = spec.name;
  loaded.order = spec.order;
  loaded.script = spec.script;
  loaded.pairs = spec.pairs;
  loaded.radius = spec.radius;
  loaded.name += suffix(spec.order);
  if (spec.order == VertexOrder::shuffled)
    for (std::size_t i = 0; i < loaded.meshes.size(); ++i)
      if (loaded.vertices_of.empty() || loaded.vertices_of[i] == i)
        shuffle_vertices(loaded.meshes[i], hash_of(std::to_string(i), spec.options.seed));
  for (std::size_t i = 0; i < spec.bodies.size(); ++i) {
    const BodySpec& body = spec.bodies[i];
    if (!body.elements) continue;
    loaded.meshes[i] =
        mesh_of_elements(loaded.meshes[body.elements->body], body.elements->elements, body.place);
    loaded.meshes[i].name = body.name;
  }
  if (loaded.meshes.empty()) throw io::InputError("the scene has no body");
  return loaded;
}

}  // namespace kbvh::experiments
