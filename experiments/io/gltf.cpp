#include "experiments/io/gltf.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "experiments/io/bytes.hpp"
#include "experiments/io/gltf_motion.hpp"
#include "experiments/io/keyframe_times.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/weld.hpp"

namespace kbvh::io {
namespace {

using namespace gltf;

constexpr std::uint64_t most_baked_numbers = std::uint64_t{1} << 30;  // 8 GiB of doubles
constexpr std::uint64_t most_keyframes = 1'000'000;

/// Returns the lower and the upper corner of the box of points.
std::array<double, 6> box_of(const std::vector<double>& points) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::array<double, 6> box{infinity, infinity, infinity, -infinity, -infinity, -infinity};
  for (std::size_t i = 0; i < points.size(); ++i) {
    box[i % 3] = std::min(box[i % 3], points[i]);
    box[3 + i % 3] = std::max(box[3 + i % 3], points[i]);
  }
  return box;
}

double diagonal(const std::vector<double>& points) {
  const auto box = box_of(points);
  return points.empty() ? 0 : std::hypot(box[3] - box[0], box[4] - box[1], box[5] - box[2]);
}

std::vector<double> corners(const std::vector<double>& points) {
  const auto box = box_of(points);
  std::vector<double> list;
  for (std::size_t corner = 0; corner < 8; ++corner)
    for (std::size_t axis = 0; axis < 3; ++axis) list.push_back(box[axis + 3 * (corner >> axis & 1)]);
  return list;
}

struct Influence {
  std::uint32_t joint;
  double weight;
};

/// One glTF primitive below one node.
struct Part {
  std::uint32_t node;
  Index skin;                                // none: moves with its node
  std::size_t first_vertex;                  // in the merged mesh
  std::vector<double> rest;                  // [vertex][3]
  std::vector<std::vector<double>> targets;  // [target][vertex][3], empty: zero
  std::vector<std::size_t> influence_offsets;
  std::vector<Influence> influences;

  std::size_t vertex_count() const { return rest.size() / 3; }
};

class Baker {
 public:
  Baker(const Document& document, const Animation* animation)
      : document_(document), animation_(animation), pose_(document, animation) {}

  AnimatedMesh bake(std::vector<double> times) {
    AnimatedMesh mesh;
    mesh.name = document_.file.stem().string();
    mesh.notes = document_.notes;
    add_parts(mesh);
    for (const Skin& skin : document_.skins) read_inverse_binds(skin);
    check_animation(mesh);
    if (times.empty()) times = animation_ != nullptr ? chosen_times(mesh) : std::vector<double>{0.0};
    mesh.keyframe_times = std::move(times);
    mesh.vertex_count = static_cast<std::uint32_t>(vertices_);
    mesh.primitive_vertices = std::move(corners_);
    const std::size_t each = mesh.kind == MeshKind::points ? 1 : 3;
    for (std::size_t c = each; c <= mesh.primitive_vertices.size(); c += each) {
      mesh.primitive_offsets.push_back(static_cast<std::uint32_t>(c));
    }
    const std::uint64_t numbers = std::uint64_t{3} * vertices_ * mesh.keyframe_times.size();
    if (numbers > most_baked_numbers) {
      fail(document_.file, "",
           std::to_string(vertices_) + " vertices at " + std::to_string(mesh.keyframe_times.size()) +
               " keyframes would take " + std::to_string(numbers * 8) + " bytes (at most 8 GiB are baked)");
    }
    const std::vector<double> rest = rest_positions();
    mesh.positions.resize(static_cast<std::size_t>(numbers));
    for (std::size_t k = 0; k < mesh.keyframe_times.size(); ++k) {
      pose_.evaluate(mesh.keyframe_times[k]);
      bake_keyframe(mesh.positions.data() + k * 3 * vertices_);
    }
    if (mesh.kind == MeshKind::polygons) mesh.welded_vertices = weld(mesh, rest);
    drop_unused_vertices(mesh);
    mesh.merged_keyframes = pose_.merged_keyframes();
    return mesh;
  }

 private:
  /// Takes all triangles of the scene; if there are none, its points.
  void add_parts(AnimatedMesh& mesh) {
    std::vector<std::pair<std::uint32_t, const Primitive*>> found;
    for (const std::uint32_t node : document_.in_scene) {
      if (!document_.nodes[node].mesh) continue;
      for (const Primitive& p : document_.meshes[*document_.nodes[node].mesh].primitives)
        found.emplace_back(node, &p);
    }
    const auto count = [&](auto is) {
      return std::count_if(found.begin(), found.end(), [&](const auto& one) { return is(one.second->mode); });
    };
    const auto triangles = count([](Mode mode) { return mode >= Mode::triangles; }),
               points = count([](Mode mode) { return mode == Mode::points; }),
               lines = std::ptrdiff_t(found.size()) - triangles - points;
    if (triangles == 0 && points > 0) mesh.kind = MeshKind::points;
    for (const auto& [node, primitive] : found) {
      const bool wanted =
          triangles > 0 ? primitive->mode >= Mode::triangles : primitive->mode == Mode::points;
      if (wanted) add_part(node, *primitive);
    }
    const auto note = [&](std::ptrdiff_t skipped, const std::string& of) {
      if (skipped == 0) return;
      mesh.notes.push_back("skipped " + std::to_string(skipped) +
                           (skipped == 1 ? " primitive" : " primitives") + " of " + of);
    };
    note(triangles > 0 ? points : 0, "points");
    note(lines, "lines");
    if (corners_.empty()) fail(document_.file, "", "holds no triangles and no points in its scene");
    if (corners_.size() > std::numeric_limits<std::uint32_t>::max())
      fail(document_.file, "", "has too many triangles or points");
  }

  void check_animation(AnimatedMesh& mesh) const {
    if (animation_ == nullptr) return;
    const std::string name = "the animation " + printable(animation_->name);
    const std::string others = std::to_string(animation_->others) +
                               (animation_->others == 1 ? " channel sets" : " channels set") +
                               " other properties, or nodes by pointers (KHR_animation_pointer), ";
    if (pose_.times().empty())
      fail(document_.file, "",
           name + (animation_->others > 0 ? " moves no node: " + others + "which is not supported"
                                          : " has no keyframes"));
    if (animation_->others > 0)
      mesh.notes.push_back(name + ": " + others + "and " + (animation_->others == 1 ? "is" : "are") +
                           " skipped");
  }

  void add_part(std::uint32_t node, const Primitive& primitive) {
    if (!primitive.position) fail(document_.file, primitive.place + ".attributes", "has no POSITION");
    Part part;
    part.node = node;
    part.first_vertex = vertices_;
    part.rest = read_numbers(document_, *primitive.position, 3);
    const std::size_t n = part.vertex_count();
    if (n > std::numeric_limits<std::uint32_t>::max() - vertices_)
      fail(document_.file, primitive.place, "too many vertices");
    if (primitive.targets.size() != pose_.weights(node).size()) {
      fail(document_.file, primitive.place,
           "has " + std::to_string(primitive.targets.size()) + " morph targets, but its node has " +
               std::to_string(pose_.weights(node).size()) + " weights");
    }
    for (const Index& target : primitive.targets) {
      part.targets.push_back(target ? read_numbers(document_, *target, 3) : std::vector<double>{});
      if (target) check_count(*target, n, primitive.place);
    }
    if (document_.nodes[node].skin && !primitive.joints.empty()) read_influences(part, primitive);
    add_primitives(primitive, n);
    vertices_ += n;
    parts_.push_back(std::move(part));
  }

  void check_count(std::uint32_t accessor, std::size_t vertices, const std::string& place) const {
    const std::uint64_t count = document_.accessors[accessor].count;
    if (count == vertices) return;
    fail(document_.file, place,
         "accessors[" + std::to_string(accessor) + "] has " + std::to_string(count) + " elements for " +
             std::to_string(vertices) + " vertices");
  }

  void read_influences(Part& part, const Primitive& primitive) const {
    part.skin = document_.nodes[part.node].skin;
    const std::size_t joints = document_.skins[*part.skin].joints.size(), n = part.vertex_count();
    std::vector<std::vector<std::uint32_t>> joint_sets;
    std::vector<std::vector<double>> weight_sets;
    for (std::size_t set = 0; set < primitive.joints.size(); ++set) {
      check_count(primitive.joints[set], n, primitive.place);
      check_count(primitive.weights[set], n, primitive.place);
      joint_sets.push_back(read_unsigned(document_, primitive.joints[set], 4));
      weight_sets.push_back(read_numbers(document_, primitive.weights[set], 4));
    }
    part.influence_offsets.push_back(0);
    std::vector<Influence> list;
    for (std::size_t v = 0; v < n; ++v) {
      list.clear();
      double sum = 0;
      for (std::size_t set = 0; set < joint_sets.size(); ++set) {
        for (std::size_t i = 4 * v; i < 4 * v + 4; ++i) {
          const double weight = weight_sets[set][i];
          if (weight < 0)
            fail(document_.file, place_in(primitive.weights[set], v), "weight is " + text_of(weight));
          if (joint_sets[set][i] >= joints) {
            fail(document_.file, place_in(primitive.joints[set], v),
                 "joint index " + std::to_string(joint_sets[set][i]) + " is out of range (" +
                     std::to_string(joints) + " joints)");
          }
          if (weight > 0) list.push_back({joint_sets[set][i], weight});
          sum += weight;
        }
      }
      if (list.empty()) list.push_back({joint_sets[0][4 * v], sum = 1});
      // Uses one order, so that the sums on both sides of a seam are equal to the last bit.
      std::sort(list.begin(), list.end(), [](const Influence& a, const Influence& b) {
        return a.joint != b.joint ? a.joint < b.joint : a.weight < b.weight;
      });
      for (Influence influence : list) part.influences.push_back({influence.joint, influence.weight / sum});
      part.influence_offsets.push_back(part.influences.size());
    }
  }

  void add_primitives(const Primitive& primitive, std::size_t n) {
    std::vector<std::uint32_t> list;
    if (primitive.indices) {
      list = read_unsigned(document_, *primitive.indices, 1);
      for (std::size_t i = 0; i < list.size(); ++i) {
        if (list[i] >= n) {
          fail(document_.file, place_in(*primitive.indices, i),
               "vertex index " + std::to_string(list[i]) + " is out of range (" + std::to_string(n) +
                   " vertices)");
        }
      }
    } else {
      list.resize(n);
      for (std::size_t i = 0; i < n; ++i) list[i] = static_cast<std::uint32_t>(i);
    }
    const auto push = [&](std::size_t a, std::size_t b, std::size_t c) {
      for (std::size_t i : {a, b, c}) corners_.push_back(static_cast<std::uint32_t>(vertices_ + list[i]));
    };
    if (primitive.mode == Mode::points) {
      for (const std::uint32_t v : list) corners_.push_back(static_cast<std::uint32_t>(vertices_ + v));
      return;
    }
    if (primitive.mode == Mode::triangles) {
      if (list.size() % 3 != 0) {
        fail(document_.file, primitive.place,
             std::to_string(list.size()) + " corners are not a multiple of 3");
      }
      for (std::size_t i = 0; i < list.size(); i += 3) push(i, i + 1, i + 2);
      return;
    }
    for (std::size_t i = 2; i < list.size(); ++i) {
      if (primitive.mode == Mode::triangle_fan) {
        push(0, i - 1, i);
      } else if (i % 2 == 0) {
        push(i - 2, i - 1, i);
      } else {
        push(i - 1, i - 2, i);  // every second triangle of a strip has reversed orientation
      }
    }
  }

  void read_inverse_binds(const Skin& skin) {
    std::vector<Affine> matrices(skin.joints.size());
    if (skin.inverse_bind_matrices) {
      const std::uint32_t id = *skin.inverse_bind_matrices;
      const std::vector<double> numbers = read_numbers(document_, id, 16);
      if (numbers.size() < 16 * skin.joints.size()) {
        fail(document_.file, "accessors[" + std::to_string(id) + "]",
             "has " + std::to_string(numbers.size() / 16) + " inverse bind matrices for " +
                 std::to_string(skin.joints.size()) + " joints");
      }
      for (std::size_t j = 0; j < matrices.size(); ++j) matrices[j] = affine_of(&numbers[16 * j]);
    }
    inverse_binds_.push_back(std::move(matrices));
  }

  /// Returns the times of keyframes that follow the animation, and records notes about them.
  std::vector<double> chosen_times(AnimatedMesh& mesh) {
    const std::vector<Rigid> rigid = rigid_groups();
    CurvedMotion motion{pose_.times(), pose_.jumps(),
                        [&](double time, std::vector<double>& out) { place_probes(rigid, time, out); }};
    double tolerance = 0;
    std::vector<double> baked(3 * vertices_);
    for (const double key : motion.keys) {
      pose_.evaluate(key);
      bake_keyframe(baked.data());
      tolerance = std::max(tolerance, gltf_tolerance * diagonal(baked));
      for (const double x : baked) tolerance = std::max(tolerance, 1e-9 * std::abs(x));
    }
    const std::size_t most = std::min<std::uint64_t>(most_keyframes, most_baked_numbers / (3 * vertices_));
    std::optional<KeyframeTimes> found = follow(motion, tolerance, std::max(most, motion.keys.size()));
    if (!found) {
      fail(document_.file, "",
           "the animation " + printable(animation_->name) +
               " turns so fast between its keys that 4096 keyframes between two of them, or " +
               std::to_string(most) + " in all, do not follow it within " + text_of(tolerance));
    }
    mesh.added_keyframes = found->added;
    mesh.jumps = found->jumps;
    return std::move(found->times);
  }

  /// Vertices that move with one node or joint. The corners of their box represent them, because the distance
  /// between two affine images is largest at a corner. A blend of joints is nowhere further from its chord
  /// than one of them. If weights of morph targets change, every vertex represents itself.
  struct Rigid {
    const Part* part;
    Index joint;                  // in the part's skin; none: the part's node
    bool morphs = false;          // then without corners
    std::vector<double> corners;  // [8][3]
  };

  std::vector<Rigid> rigid_groups() {
    std::vector<Rigid> groups;
    for (const Part& part : parts_) {
      if (pose_.morphs(part.node)) {
        groups.push_back({&part, {}, true, {}});
        continue;
      }
      const std::vector<double> rest = morphed(part);
      std::map<std::uint32_t, std::vector<double>> members;  // positions, by joint
      if (part.skin) {
        for (std::size_t v = 0; v < part.vertex_count(); ++v)
          for (std::size_t i = part.influence_offsets[v]; i < part.influence_offsets[v + 1]; ++i) {
            auto& list = members[part.influences[i].joint];
            list.insert(list.end(), &rest[3 * v], &rest[3 * v] + 3);
          }
        for (const auto& [joint, points] : members) groups.push_back({&part, joint, false, corners(points)});
      } else if (!rest.empty()) {
        groups.push_back({&part, {}, false, corners(rest)});
      }
    }
    return groups;
  }

  void place_probes(const std::vector<Rigid>& groups, double time, std::vector<double>& out) {
    pose_.evaluate(time);
    const std::vector<std::vector<Affine>> skins = posed_skins();
    out.clear();
    for (const Rigid& group : groups) {
      const Part& part = *group.part;
      if (group.morphs) {
        out.resize(out.size() + 3 * part.vertex_count());
        bake_part(part, skins, out.data() + out.size() - 3 * part.vertex_count());
        continue;
      }
      const Affine& move = group.joint ? skins[*part.skin][*group.joint] : pose_.global(part.node);
      for (std::size_t i = 0; i < group.corners.size(); i += 3) {
        const auto p = move.apply(&group.corners[i]);
        out.insert(out.end(), p.begin(), p.end());
      }
    }
  }

  /// Returns positions in bind space for skinned parts, and in scene space under the file's own pose for all
  /// others.
  std::vector<double> rest_positions() const {
    Pose own(document_, nullptr);
    own.evaluate(0);
    std::vector<double> rest;
    rest.reserve(3 * vertices_);
    for (const Part& part : parts_) {
      if (part.skin) {
        rest.insert(rest.end(), part.rest.begin(), part.rest.end());
        continue;
      }
      for (std::size_t v = 0; v < part.vertex_count(); ++v) {
        const auto p = own.global(part.node).apply(&part.rest[3 * v]);
        rest.insert(rest.end(), p.begin(), p.end());
      }
    }
    return rest;
  }

  /// Returns the maps from joint space to scene space, after the inverse bind: [skin][joint].
  std::vector<std::vector<Affine>> posed_skins() const {
    std::vector<std::vector<Affine>> skins;
    for (std::size_t s = 0; s < document_.skins.size(); ++s) {
      skins.emplace_back();
      const auto& joints = document_.skins[s].joints;
      for (std::size_t j = 0; j < joints.size(); ++j)
        skins[s].push_back(pose_.global(joints[j]) * inverse_binds_[s][j]);
    }
    return skins;
  }

  void bake_keyframe(double* out) const {
    const std::vector<std::vector<Affine>> skins = posed_skins();
    for (const Part& part : parts_) bake_part(part, skins, out + 3 * part.first_vertex);
  }

  std::vector<double> morphed(const Part& part) const {
    std::vector<double> positions = part.rest;
    const std::vector<double>& weights = pose_.weights(part.node);
    for (std::size_t t = 0; t < part.targets.size(); ++t) {
      if (weights[t] == 0) continue;
      for (std::size_t i = 0; i < part.targets[t].size(); ++i)
        positions[i] += weights[t] * part.targets[t][i];
    }
    return positions;
  }

  void bake_part(const Part& part, const std::vector<std::vector<Affine>>& skins, double* out) const {
    const std::vector<double> positions = morphed(part);
    for (std::size_t v = 0; v < part.vertex_count(); ++v) {
      const Affine transform = part.skin ? blended(part, v, skins[*part.skin]) : pose_.global(part.node);
      const auto p = transform.apply(&positions[3 * v]);
      std::copy(p.begin(), p.end(), out + 3 * v);
    }
  }

  static Affine blended(const Part& part, std::size_t v, const std::vector<Affine>& joints) {
    Affine sum;
    sum.m.fill(0);
    for (std::size_t i = part.influence_offsets[v]; i < part.influence_offsets[v + 1]; ++i) {
      const auto [joint, weight] = part.influences[i];
      for (std::size_t e = 0; e < 12; ++e) sum.m[e] += weight * joints[joint].m[e];
    }
    return sum;
  }

  const Document& document_;
  const Animation* animation_;
  Pose pose_;
  std::vector<Part> parts_;
  std::vector<std::vector<Affine>> inverse_binds_;  // [skin][joint]
  std::vector<std::uint32_t> corners_;
  std::size_t vertices_ = 0;
};

std::string list_of(const std::vector<Animation>& animations) {
  std::string out;
  for (std::size_t i = 0; i < animations.size(); ++i) {
    out += (i == 0 ? "" : ", ") + std::to_string(i) + " " + printable(animations[i].name);
  }
  return out;
}

const Animation* choose(const Document& document, const std::string& clip) {
  const auto& all = document.animations;
  if (clip.empty()) {
    if (all.size() > 1) {
      fail(document.file, "",
           "has " + std::to_string(all.size()) + " animations, choose a clip of: " + list_of(all));
    }
    return all.empty() ? nullptr : &all[0];
  }
  if (all.empty())
    fail(document.file, "", "has no animation, the clip " + printable(clip) + " was asked for");
  for (const Animation& animation : all) {
    if (animation.name == clip) return &animation;
  }
  const std::optional<std::int64_t> index = parse_integer(clip);
  if (index && *index >= 0 && static_cast<std::uint64_t>(*index) < all.size())
    return &all[static_cast<std::size_t>(*index)];
  fail(document.file, "", "has no animation " + printable(clip) + ", but: " + list_of(all));
}

}  // namespace

AnimatedMesh read_gltf(const std::filesystem::path& file, const std::string& clip,
                       std::vector<double> times) {
  const Document document = read_document(file);
  return Baker(document, choose(document, clip)).bake(std::move(times));
}

}  // namespace kbvh::io
