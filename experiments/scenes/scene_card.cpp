#include "experiments/scenes/scene_card.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/hasher.hpp"
#include "core/topology/builders.hpp"
#include "experiments/common/names.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/io/pc2.hpp"

namespace kbvh::experiments {

namespace {

/// Tracks the vertices that realise the sides of every node, from keyframe to keyframe.
class Realisers {
 public:
  Realisers(const Topology& topology, const LeafVertices& leaves)
      : topology_(topology), leaves_(leaves), of_(std::size_t(6) * topology.size(), 0) {}

  /// Finds the realisers at a keyframe; returns the number of sides whose realiser changed.
  std::size_t update(const float* x) {
    std::size_t changed = 0;
    for (std::uint32_t node = topology_.size(); node-- > 0;)
      for (std::size_t side = 0; side < 6; ++side) {
        const std::size_t axis = side / 2;
        const auto ahead = [&](std::uint32_t v, std::uint32_t w) {
          const float a = x[3 * std::size_t(v) + axis], b = x[3 * std::size_t(w) + axis];
          return side % 2 == 0 ? a < b : a > b;
        };
        const TopologyNode& n = topology_.nodes[node];
        std::uint32_t& realiser = of_[6 * std::size_t(node) + side];
        std::uint32_t best = n.is_leaf() ? leaves_[node][0] : of_[6 * std::size_t(n.first()) + side];
        if (n.is_leaf()) {
          for (const std::uint32_t v : leaves_[node])
            if (ahead(v, best)) best = v;
        } else {
          for (std::uint32_t c = n.first(); c < n.first() + n.count(); ++c)
            if (const std::uint32_t v = of_[6 * std::size_t(c) + side]; ahead(v, best)) best = v;
        }
        if (known_ && !ahead(best, realiser)) continue;
        changed += known_;
        realiser = best;
      }
    known_ = true;
    return changed;
  }

 private:
  const Topology& topology_;
  const LeafVertices& leaves_;
  std::vector<std::uint32_t> of_;
  bool known_ = false;
};

double mean_edge(const Body<float>& body, const float* x) {
  double sum = 0;
  std::size_t edges = 0;
  for (std::uint32_t p = 0; p < body.primitives.count(); ++p) {
    const auto vertices = body.primitives[p];
    for (std::size_t i = 0; i < vertices.size() && vertices.size() > 1; ++i, ++edges) {
      double square = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double d = double(x[3 * std::size_t(vertices[i]) + axis]) -
                         double(x[3 * std::size_t(vertices[(i + 1) % vertices.size()]) + axis]);
        square += d * d;
      }
      sum += std::sqrt(square);
    }
  }
  return edges > 0 ? sum / double(edges) : 0;
}

BodyCard card_of(const Body<float>& body) {
  BodyCard card;
  card.name = body.name;
  card.vertices = body.plans.vertex_count();
  card.primitives = body.primitives.live_count();
  card.keyframes = std::uint32_t(body.plans.keyframe_count());
  card.seconds = body.plans.keyframe_times().back() - body.plans.keyframe_times().front();
  const Topology topology =
      build_topology(body.primitives, body.plans.keyframe(0), {BuildMethod::median, 2, 1});
  card.nodes = topology.size();
  if (card.keyframes < 2 || topology.empty()) return card;
  const LeafVertices leaves = unique_leaf_vertices(topology, body.primitives);
  Realisers realisers(topology, leaves);
  realisers.update(body.plans.keyframe(0));
  const double sides = 6.0 * card.nodes;
  double steps = 0;
  for (std::uint32_t k = 1; k < card.keyframes; ++k) {
    const float *from = body.plans.keyframe(k - 1), *to = body.plans.keyframe(k);
    const double share = double(realisers.update(to)) / sides;
    card.sides_changed += share / double(card.keyframes - 1);
    card.most_sides_changed = std::max(card.most_sides_changed, share);
    for (std::size_t v = 0; v < card.vertices; ++v) {
      double square = 0;
      for (std::size_t i = 3 * v; i < 3 * v + 3; ++i) {
        const double d = double(to[i]) - double(from[i]);
        square += d * d;
      }
      steps += std::sqrt(square);
      card.largest_step = std::max(card.largest_step, std::sqrt(square));
    }
  }
  const double edge = mean_edge(body, body.plans.keyframe(0));
  if (!(edge > 0)) return card;
  card.mean_step = steps / (double(card.vertices) * double(card.keyframes - 1) * edge);
  card.largest_step /= edge;
  return card;
}

}  // namespace

std::vector<BodyCard> cards(const LoadedScene& scene) {
  std::vector<BodyCard> list;
  for (const Body<float>& body : assemble_meshes<float>(scene).bodies) list.push_back(card_of(body));
  return list;
}

nlohmann::json as_json(const BodyCard& c) {
  return {{"name", c.name},
          {"vertices", c.vertices},
          {"primitives", c.primitives},
          {"keyframes", c.keyframes},
          {"seconds", c.seconds},
          {"nodes", c.nodes},
          {"sides_changed_per_keyframe", c.sides_changed},
          {"sides_changed_at_most", c.most_sides_changed},
          {"mean_step_in_edges", c.mean_step},
          {"largest_step_in_edges", c.largest_step}};
}

nlohmann::json as_json(const std::string& scene, const std::vector<BodyCard>& list) {
  nlohmann::json bodies = nlohmann::json::array();
  for (const BodyCard& card : list) bodies.push_back(as_json(card));
  return {{"scene", scene}, {"bodies", bodies}};
}

namespace {

/// Returns a subset of the keyframes, a second apart: pictures need no times.
io::AnimatedMesh thinned(const io::AnimatedMesh& mesh, std::size_t most_keyframes) {
  const std::size_t all = mesh.keyframe_times.size();
  if (most_keyframes == 0 || all <= 1) return mesh;
  io::AnimatedMesh few = mesh;
  few.keyframe_times.clear();
  few.positions.clear();
  few.bends.clear();  // files hold keyframes alone
  const std::size_t kept = std::min(most_keyframes, all), size = std::size_t(3) * mesh.vertex_count;
  for (std::size_t i = 0; i < kept; ++i) {
    const std::size_t k = kept == 1 ? 0 : i * (all - 1) / (kept - 1);
    few.keyframe_times.push_back(double(i));
    few.positions.insert(few.positions.end(), mesh.positions.begin() + std::ptrdiff_t(k * size),
                         mesh.positions.begin() + std::ptrdiff_t((k + 1) * size));
  }
  return few;
}

}  // namespace

std::uint64_t card_hash(const LoadedScene& scene) {
  Hasher hasher;
  hasher.mix(std::uint64_t(scene.order));
  for (const io::AnimatedMesh& mesh : scene.meshes) {
    hasher.mix(hash_of(mesh.name));
    hasher.mix(std::uint64_t(mesh.kind));
    hasher.list(mesh.primitive_offsets);
    hasher.list(mesh.primitive_vertices);
    hasher.list(mesh.keyframe_times);
    hasher.list(mesh.positions);
    for (const io::AnimatedMesh::Bends& segment : mesh.bends) {
      hasher.list(segment.bend);
      hasher.list(segment.twist);
    }
  }
  if (!scene.vertices_of.empty()) hasher.list(scene.vertices_of);
  if (scene.radius) hasher.bytes(&*scene.radius, sizeof(double));
  return hasher.value();
}

std::string folder_name(const LoadedScene& scene) {
  return file_name(scene.name) + "-" + hexadecimal(card_hash(scene));
}

void export_scene(const LoadedScene& scene, const std::filesystem::path& folder, std::size_t most_keyframes) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    // Elements of another body lie on its surface, which is drawn.
    if (!scene.vertices_of.empty() && scene.vertices_of[i] != i) continue;
    const io::AnimatedMesh mesh = thinned(scene.meshes[i], most_keyframes);
    const std::string file = std::to_string(i) + "-" + file_name(mesh.name);
    io::save_obj(mesh, folder / (file + ".obj"));
    if (mesh.moving()) io::save_pc2(mesh, folder / (file + ".pc2"), 1);
  }
  nlohmann::json card = as_json(scene.name, cards(scene));
  card["hash"] = hexadecimal(card_hash(scene));
  io::write_file_atomically(folder / "card.json",
                            card.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace kbvh::experiments
