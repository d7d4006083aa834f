#include "experiments/scenes/element_bodies.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <utility>

#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments {

using nlohmann::json;

const char* word(MeshElements elements) {
  switch (elements) {
    case MeshElements::vertices:
      return "vertices";
    case MeshElements::edges:
      return "edges";
    case MeshElements::faces:
      break;
  }
  return "faces";
}

ElementsSpec read_elements(JsonReader& keys) {
  ElementsSpec spec;
  const auto elements = keys.word("elements");
  if (!elements) keys.fail("elements", "is missing next to of: vertices, edges or faces");
  const std::array all{MeshElements::vertices, MeshElements::edges, MeshElements::faces};
  const auto found =
      std::find_if(all.begin(), all.end(), [&](MeshElements known) { return *elements == word(known); });
  if (found == all.end())
    keys.fail("elements", "expected vertices, edges or faces, got " + io::printable(*elements));
  spec.elements = *found;
  spec.of = keys.word("of").value_or("");
  if (spec.of.empty()) keys.fail("of", "is missing: the name of the body that has these elements");
  return spec;
}

namespace {

/// Finds the only body of that name. Throws io::InputError that begins with `place`.
std::uint32_t body_named(const std::string& name, const std::vector<BodySpec>& bodies,
                         const std::string& place) {
  std::vector<std::string> known;
  std::optional<std::uint32_t> found;
  for (std::uint32_t body = 0; body < bodies.size(); ++body) {
    if (!bodies[body].name.empty()) known.push_back(bodies[body].name);
    if (bodies[body].name != name) continue;
    if (found) throw io::InputError(place + ": several bodies have the name " + io::printable(name));
    found = body;
  }
  if (!found && known.empty())
    throw io::InputError(place + ": there is no body " + io::printable(name) +
                         ": no body of the scene has the key name");
  if (!found) throw io::InputError(place + ": " + no_such("body", name, known));
  return *found;
}

}  // namespace

void find_meshes_of_elements(std::vector<BodySpec>& bodies) {
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    BodySpec& body = bodies[i];
    if (!body.elements) continue;
    ElementsSpec& spec = *body.elements;
    const std::string place = body.place + ": of";
    spec.body = body_named(spec.of, bodies, place);
    const BodySpec& mesh = bodies[spec.body];
    if (spec.body == i)
      throw io::InputError(place + ": the body " + io::printable(spec.of) +
                           " cannot consist of elements of itself");
    if (mesh.elements)
      throw io::InputError(place + ": the body " + io::printable(spec.of) + " has no mesh, only the " +
                           word(mesh.elements->elements) + " of " + io::printable(mesh.elements->of));
    if (spec.body > i)
      throw io::InputError(place + ": the body " + io::printable(spec.of) +
                           " must come before the body of its " + word(spec.elements));
    if (mesh.as == io::TakeAs::points && spec.elements != MeshElements::vertices)
      throw io::InputError(place + ": the body " + io::printable(spec.of) +
                           " is taken as points and has no " + word(spec.elements));
    if (body.name.empty()) body.name = spec.of + "-" + word(spec.elements);
  }
}

std::optional<std::vector<BodyPair>> read_body_pairs(JsonReader& keys, const std::vector<BodySpec>& bodies) {
  if (!keys.has("pairs")) return {};
  std::vector<BodyPair> pairs;
  for (const json& value : keys.list("pairs")) {
    if (!value.is_array() || value.size() != 2 || !value[0].is_string() || !value[1].is_string())
      keys.fail("pairs", "expected a list of two names each, as [[\"cloth\", \"table\"]]");
    const auto body_at = [&](std::size_t i) {
      return body_named(value[i].get<std::string>(), bodies, keys.place() + ": pairs");
    };
    const auto [first, second] = std::minmax({body_at(0), body_at(1)});
    for (const BodyPair& known : pairs)
      if (known.first == first && known.second == second)
        keys.fail("pairs", "the bodies " + io::printable(bodies[first].name) + " and " +
                               io::printable(bodies[second].name) + " are a pair twice");
    pairs.push_back({first, second});
  }
  return pairs;
}

namespace {

/// Makes every vertex a polygon of one corner.
void take_vertices(io::AnimatedMesh& mesh) {
  mesh.primitive_offsets.resize(std::size_t{mesh.vertex_count} + 1);
  mesh.primitive_vertices.resize(mesh.vertex_count);
  std::iota(mesh.primitive_offsets.begin(), mesh.primitive_offsets.end(), 0u);
  std::iota(mesh.primitive_vertices.begin(), mesh.primitive_vertices.end(), 0u);
}

/// Makes every side of a polygon one polygon of two corners, the smaller vertex first.
void take_edges(io::AnimatedMesh& mesh, const std::string& place) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;  // larger vertex, smaller vertex
  edges.reserve(mesh.primitive_vertices.size());
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    const std::uint32_t begin = mesh.primitive_offsets[p], end = mesh.primitive_offsets[p + 1];
    for (std::uint32_t i = begin; i < end; ++i) {
      const std::uint32_t v = mesh.primitive_vertices[i];
      const std::uint32_t w = mesh.primitive_vertices[i + 1 < end ? i + 1 : begin];
      if (v != w) edges.emplace_back(std::max(v, w), std::min(v, w));
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  if (edges.empty()) throw io::InputError(place + ": the body '" + mesh.name + "' has no edges");
  if (edges.size() > std::numeric_limits<std::uint32_t>::max() / 2)
    throw io::InputError(place + ": the body '" + mesh.name + "' has too many edges");
  mesh.primitive_offsets.assign(1, 0);
  mesh.primitive_vertices.clear();
  mesh.primitive_offsets.reserve(edges.size() + 1);
  mesh.primitive_vertices.reserve(2 * edges.size());
  for (const auto& [larger, smaller] : edges) {
    mesh.primitive_vertices.push_back(smaller);
    mesh.primitive_vertices.push_back(larger);
    mesh.primitive_offsets.push_back(std::uint32_t(mesh.primitive_vertices.size()));
  }
}

}  // namespace

io::AnimatedMesh mesh_of_elements(const io::AnimatedMesh& mesh, MeshElements elements,
                                  const std::string& place) {
  if (elements != MeshElements::vertices && mesh.kind != io::MeshKind::polygons)
    throw io::InputError(place + ": the body '" + mesh.name + "' consists of " +
                         (mesh.kind == io::MeshKind::points ? "points" : "control nets") + " and has no " +
                         word(elements));
  io::AnimatedMesh made = mesh;
  made.kind = io::MeshKind::polygons;
  if (elements == MeshElements::vertices) take_vertices(made);
  if (elements == MeshElements::edges) take_edges(made, place);
  if (elements != MeshElements::faces) made.degenerate_primitives = 0;
  return made;
}

}  // namespace kbvh::experiments
