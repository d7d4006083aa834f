#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "experiments/io/bytes.hpp"
#include "experiments/io/gltf_container.hpp"
#include "experiments/io/gltf_document.hpp"
#include "experiments/io/json_text.hpp"

namespace kbvh::io::gltf {
namespace {

using Json = nlohmann::json;

/// A JSON value that knows its path, so that every message names the place.
class Value {
 public:
  Value(const std::filesystem::path& file, const Json& json, std::string path)
      : file_(&file), json_(&json), path_(std::move(path)) {}

  const std::string& path() const { return path_; }

  [[noreturn]] void reject(const std::string& what) const { fail(*file_, path_, what); }

  [[noreturn]] void reject_value(const std::string& expected) const {
    reject(printable(json_->dump(-1, ' ', false, Json::error_handler_t::replace)) + " is not " + expected);
  }

  std::optional<Value> find(const char* key) const {
    if (!json_->is_object()) reject_value("an object");
    const auto it = json_->find(key);
    if (it == json_->end()) return std::nullopt;
    return Value(*file_, *it, path_.empty() ? key : path_ + "." + key);
  }

  Value at(const char* key) const {
    std::optional<Value> value = find(key);
    if (!value) reject(std::string("has no '") + key + "'");
    return *value;
  }

  std::vector<Value> items() const {
    if (!json_->is_array()) reject_value("an array");
    std::vector<Value> out;
    out.reserve(json_->size());
    for (const Json& item : *json_)
      out.emplace_back(*file_, item, path_ + "[" + std::to_string(out.size()) + "]");
    return out;
  }

  /// Returns the items of a member; none if the member is missing.
  std::vector<Value> items(const char* key) const {
    const std::optional<Value> value = find(key);
    return value ? value->items() : std::vector<Value>{};
  }

  double number() const {
    if (!json_->is_number()) reject_value("a number");
    const auto value = json_->get<double>();
    if (!std::isfinite(value)) reject_value("a finite number");
    return value;
  }

  std::uint64_t count() const {
    constexpr double most = 9007199254740992.0;  // 2^53: beyond it JSON numbers are not exact
    const double value = number();
    if (value < 0 || value != std::floor(value) || value > most) reject_value("a count");
    return static_cast<std::uint64_t>(value);
  }

  std::uint64_t count(const char* key, std::uint64_t otherwise) const {
    const std::optional<Value> value = find(key);
    return value ? value->count() : otherwise;
  }

  /// Reads an index into an array of `size` items.
  std::uint32_t index(std::size_t size, const char* of) const {
    const std::uint64_t value = count();
    if (value >= size) {
      reject("index " + std::to_string(value) + " is out of range (" + std::to_string(size) + " " + of + ")");
    }
    return static_cast<std::uint32_t>(value);
  }

  Index index(const char* key, std::size_t size, const char* of) const {
    const std::optional<Value> value = find(key);
    if (!value) return std::nullopt;
    return value->index(size, of);
  }

  bool flag(const char* key) const {
    const std::optional<Value> value = find(key);
    if (value && !value->json_->is_boolean()) value->reject_value("true or false");
    return value && value->json_->get<bool>();
  }

  std::string text() const {
    if (!json_->is_string()) reject_value("a text");
    return json_->get<std::string>();
  }

  std::string text(const char* key, const std::string& otherwise) const {
    const std::optional<Value> value = find(key);
    return value ? value->text() : otherwise;
  }

  std::vector<double> numbers(const char* key) const {
    std::vector<double> out;
    for (const Value& item : items(key)) out.push_back(item.number());
    return out;
  }

  template <std::size_t n>
  std::array<double, n> numbers(const char* key, std::array<double, n> otherwise) const {
    const std::optional<Value> value = find(key);
    if (!value) return otherwise;
    const std::vector<Value> list = value->items();
    if (list.size() != n)
      value->reject("has " + std::to_string(list.size()) + " numbers instead of " + std::to_string(n));
    for (std::size_t i = 0; i < n; ++i) otherwise[i] = list[i].number();
    return otherwise;
  }

 private:
  const std::filesystem::path* file_;
  const Json* json_;
  std::string path_;
};

class Parser {
 public:
  Parser(const std::filesystem::path& file, Container container) : container_(std::move(container)) {
    document_.file = file;
  }

  Document parse() {
    const Json json = parse_json_text(container_.json, document_.file.string());
    const Value root(document_.file, json, "");
    if (!json.is_object()) root.reject_value("an object");
    check_version(root);
    check_extensions(root);
    if (container_.bytes_behind > 0)
      document_.notes.push_back(std::to_string(container_.bytes_behind) +
                                " bytes beyond the length that its header states are skipped");
    for (const Value& v : root.items("buffers")) parse_buffer(v);
    for (const Value& v : root.items("bufferViews")) parse_view(v);
    for (const Value& v : root.items("accessors")) parse_accessor(v);
    for (const Value& v : root.items("meshes")) parse_mesh(v);
    const std::vector<Value> nodes = root.items("nodes");
    const std::vector<Value> skins = root.items("skins");
    for (const Value& v : skins) parse_skin(v, nodes.size());
    for (const Value& v : nodes) parse_node(v, nodes.size());
    order_nodes();
    parse_scene(root);
    for (const Value& v : root.items("animations")) parse_animation(v);
    return std::move(document_);
  }

 private:
  void check_version(const Value& root) const {
    const Value version = root.at("asset").at("version");
    if (!version.text().starts_with("2.")) version.reject(printable(version.text()) + ", only 2.x is known");
  }

  void check_extensions(const Value& root) {
    // Extensions that do not change the shape may be required; others would silently be read wrongly.
    const auto harmless = [](const std::string& name) {
      return name == "KHR_mesh_quantization" || name.starts_with("KHR_materials_") ||
             name.starts_with("KHR_texture_") || name.starts_with("EXT_texture_") ||
             name.starts_with("KHR_lights_") || name.starts_with("KHR_xmp");
    };
    for (const Value& v : root.items("extensionsRequired")) {
      const std::string name = v.text();
      if (!harmless(name)) v.reject("the extension " + printable(name) + " is required, but not supported");
    }
    // Compressed geometry is refused if it has no uncompressed copy; the other extensions have notes of their
    // own.
    const std::array<std::string_view, 5> handled{"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                                  "KHR_meshopt_compression", "EXT_mesh_gpu_instancing",
                                                  "KHR_animation_pointer"};
    for (const Value& v : root.items("extensionsUsed")) {
      const std::string name = v.text();
      if (!harmless(name) && std::find(handled.begin(), handled.end(), name) == handled.end())
        document_.notes.push_back("the extension " + printable(name) +
                                  " is not supported: its data are skipped");
    }
  }

  /// Returns the extension whose decoder would fill the buffer; none: null.
  static const char* is_fallback(const Value& buffer) {
    const std::optional<Value> extensions = buffer.find("extensions");
    if (!extensions) return nullptr;
    for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
      if (const std::optional<Value> found = extensions->find(name); found && found->flag("fallback"))
        return name;
    return nullptr;
  }

  void parse_buffer(const Value& v) {
    const std::uint64_t length = v.at("byteLength").count();
    std::string bytes;
    if (const std::optional<Value> uri = v.find("uri")) {
      bytes = read_uri(document_.file, uri->path(), uri->text());
    } else if (const char* name = is_fallback(v)) {
      v.reject(std::string("is the empty fallback of ") + name +
               ": the geometry is compressed, which is not supported");
    } else if (document_.buffers.empty() && container_.has_binary) {
      bytes = std::move(container_.binary);
    } else {
      v.reject("has neither a 'uri' nor a binary chunk of the file");
    }
    if (bytes.size() < length) {
      v.reject("byteLength is " + std::to_string(length) + ", but only " + std::to_string(bytes.size()) +
               " bytes are there");
    }
    bytes.resize(static_cast<std::size_t>(length));
    document_.buffers.push_back(std::move(bytes));
  }

  void parse_view(const Value& v) {
    BufferView view;
    view.buffer = v.at("buffer").index(document_.buffers.size(), "buffers");
    view.offset = v.count("byteOffset", 0);
    view.length = v.at("byteLength").count();
    view.stride = v.count("byteStride", 0);
    const std::uint64_t size = document_.buffers[view.buffer].size();
    if (view.offset > size || view.length > size - view.offset) {
      v.reject(std::to_string(view.length) + " bytes from byte " + std::to_string(view.offset) +
               " leave buffers[" + std::to_string(view.buffer) + "], which has " + std::to_string(size) +
               " bytes");
    }
    if (view.stride > 65536)
      v.reject("byteStride is " + std::to_string(view.stride) + " (at most 252 is allowed)");
    document_.views.push_back(view);
  }

  static Component component_of(const Value& v) {
    const std::uint64_t code = v.count();
    if (code < 5120 || code > 5126 || code == 5124)
      v.reject(std::to_string(code) + " is not a component type");
    return static_cast<Component>(code);
  }

  static std::uint32_t components_of(const Value& v) {
    const std::string name = v.text();
    const std::array<std::pair<const char*, std::uint32_t>, 7> types{
        {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}}};
    for (const auto& [type, n] : types) {
      if (name == type) return n;
    }
    v.reject(printable(name) + " is not an accessor type");
  }

  void parse_accessor(const Value& v) {
    const std::size_t views = document_.views.size();
    Accessor accessor;
    accessor.view = v.index("bufferView", views, "buffer views");
    accessor.offset = v.count("byteOffset", 0);
    accessor.count = v.at("count").count();
    accessor.component = component_of(v.at("componentType"));
    accessor.components = components_of(v.at("type"));
    accessor.normalized = v.flag("normalized");
    if (const std::optional<Value> s = v.find("sparse")) {
      const Value indices = s->at("indices"), values = s->at("values");
      Sparse sparse;
      sparse.count = s->at("count").count();
      sparse.index_view = indices.at("bufferView").index(views, "buffer views");
      sparse.index_offset = indices.count("byteOffset", 0);
      sparse.index_type = component_of(indices.at("componentType"));
      if (sparse.index_type == Component::int8 || sparse.index_type == Component::int16 ||
          sparse.index_type == Component::float32) {
        indices.at("componentType").reject_value("a type of unsigned integers");
      }
      sparse.value_view = values.at("bufferView").index(views, "buffer views");
      sparse.value_offset = values.count("byteOffset", 0);
      accessor.sparse = sparse;
    }
    document_.accessors.push_back(accessor);
  }

  void parse_mesh(const Value& v) {
    Mesh mesh;
    for (const Value& p : v.items("primitives")) mesh.primitives.push_back(parse_primitive(p));
    mesh.weights = v.numbers("weights");
    document_.meshes.push_back(std::move(mesh));
  }

  Primitive parse_primitive(const Value& v) const {
    const std::size_t accessors = document_.accessors.size();
    Primitive primitive;
    primitive.place = v.path();
    const std::uint64_t mode = v.count("mode", 4);
    if (mode > 6) v.at("mode").reject(std::to_string(mode) + " is not a mode of primitives");
    primitive.mode = static_cast<Mode>(mode);
    primitive.indices = v.index("indices", accessors, "accessors");
    const Value attributes = v.at("attributes");
    primitive.position = attributes.index("POSITION", accessors, "accessors");
    for (std::size_t set = 0;; ++set) {
      const std::string joints = "JOINTS_" + std::to_string(set), weights = "WEIGHTS_" + std::to_string(set);
      const Index j = attributes.index(joints.c_str(), accessors, "accessors");
      const Index w = attributes.index(weights.c_str(), accessors, "accessors");
      if (!j && !w) break;
      if (!j || !w) attributes.reject("has only one of " + joints + " and " + weights);
      primitive.joints.push_back(*j);
      primitive.weights.push_back(*w);
    }
    for (const Value& target : v.items("targets")) {
      primitive.targets.push_back(target.index("POSITION", accessors, "accessors"));
    }
    const std::optional<Value> extensions = v.find("extensions");
    if (extensions && extensions->find("KHR_draco_mesh_compression") && primitive.position &&
        !document_.accessors[*primitive.position].view) {
      v.reject("its geometry is compressed (KHR_draco_mesh_compression), which is not supported");
    }
    return primitive;
  }

  void parse_skin(const Value& v, std::size_t nodes) {
    Skin skin;
    skin.inverse_bind_matrices = v.index("inverseBindMatrices", document_.accessors.size(), "accessors");
    for (const Value& joint : v.at("joints").items()) skin.joints.push_back(joint.index(nodes, "nodes"));
    if (skin.joints.empty()) v.reject("has no joints");
    document_.skins.push_back(std::move(skin));
  }

  void parse_node(const Value& v, std::size_t nodes) {
    Node node;
    node.mesh = v.index("mesh", document_.meshes.size(), "meshes");
    node.skin = v.index("skin", document_.skins.size(), "skins");
    for (const Value& child : v.items("children")) node.children.push_back(child.index(nodes, "nodes"));
    if (v.find("matrix")) node.matrix = v.numbers<16>("matrix", {});
    node.translation = v.numbers<3>("translation", node.translation);
    node.rotation = v.numbers<4>("rotation", node.rotation);
    node.scale = v.numbers<3>("scale", node.scale);
    node.weights = v.numbers("weights");
    if (const auto extensions = v.find("extensions"); node.mesh && extensions)
      if (extensions->find("EXT_mesh_gpu_instancing"))
        document_.notes.push_back(
            v.path() +
            " has instances (EXT_mesh_gpu_instancing), which are not supported: its mesh is "
            "read once, at the node's own place");
    document_.nodes.push_back(std::move(node));
  }

  [[noreturn]] void reject_node(std::size_t node, const std::string& what) const {
    fail(document_.file, "nodes[" + std::to_string(node) + "]", what);
  }

  void order_nodes() {
    const std::size_t n = document_.nodes.size();
    document_.parent.assign(n, std::nullopt);
    for (std::uint32_t i = 0; i < n; ++i) {
      for (std::uint32_t child : document_.nodes[i].children) {
        if (document_.parent[child]) {
          reject_node(child, "is a child of both nodes[" + std::to_string(*document_.parent[child]) +
                                 "] and nodes[" + std::to_string(i) + "]");
        }
        document_.parent[child] = i;
      }
    }
    // Breadth first with the result as the queue: no recursion that a deep file could overflow.
    for (std::uint32_t i = 0; i < n; ++i) {
      if (!document_.parent[i]) document_.order.push_back(i);
    }
    for (std::size_t at = 0; at < document_.order.size(); ++at) {
      const Node& node = document_.nodes[document_.order[at]];
      document_.order.insert(document_.order.end(), node.children.begin(), node.children.end());
    }
    if (document_.order.size() == n) return;
    std::vector<bool> reached(n, false);
    for (std::uint32_t i : document_.order) reached[i] = true;
    reject_node(static_cast<std::size_t>(std::find(reached.begin(), reached.end(), false) - reached.begin()),
                "is its own ancestor");
  }

  void parse_scene(const Value& root) {
    const std::vector<Value> scenes = root.items("scenes");
    const Index chosen = root.index("scene", scenes.size(), "scenes");
    if (scenes.empty()) {
      document_.in_scene = document_.order;
      return;
    }
    std::vector<bool> inside(document_.nodes.size(), false);
    for (const Value& node : scenes[chosen.value_or(0)].items("nodes")) {
      inside[node.index(document_.nodes.size(), "nodes")] = true;
    }
    for (std::uint32_t i : document_.order) {
      if (document_.parent[i] && inside[*document_.parent[i]]) inside[i] = true;
      if (inside[i]) document_.in_scene.push_back(i);
    }
  }

  void parse_animation(const Value& v) {
    Animation animation;
    animation.name = v.text("name", "");
    const std::vector<Value> samplers = v.items("samplers");
    for (const Value& c : v.items("channels")) {
      const Value target = c.at("target");
      const Index node = target.index("node", document_.nodes.size(), "nodes");
      const std::string path = target.at("path").text();
      const std::array<const char*, 4> paths{"translation", "rotation", "scale", "weights"};
      const auto known = std::find(paths.begin(), paths.end(), path);
      if (!node || known == paths.end()) {  // extensions animate other properties, such as materials
        ++animation.others;
        continue;
      }
      const Value sampler = samplers[c.at("sampler").index(samplers.size(), "samplers")];
      Channel channel;
      channel.place = c.path();
      channel.node = *node;
      channel.path = static_cast<Path>(known - paths.begin());
      channel.input = sampler.at("input").index(document_.accessors.size(), "accessors");
      channel.output = sampler.at("output").index(document_.accessors.size(), "accessors");
      const std::string kind = sampler.text("interpolation", "LINEAR");
      const std::array<const char*, 3> kinds{"LINEAR", "STEP", "CUBICSPLINE"};
      const auto at = std::find(kinds.begin(), kinds.end(), kind);
      if (at == kinds.end()) sampler.reject("unknown interpolation " + printable(kind));
      channel.interpolation = static_cast<Interpolation>(at - kinds.begin());
      animation.channels.push_back(std::move(channel));
    }
    document_.animations.push_back(std::move(animation));
  }

  Container container_;
  Document document_;
};

}  // namespace

Document read_document(const std::filesystem::path& file) {
  return Parser(file, read_container(file)).parse();
}

}  // namespace kbvh::io::gltf
