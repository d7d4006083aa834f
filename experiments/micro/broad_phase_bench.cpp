// The time of kbvh::broad_phase relative to other ways to the same pairs, in one run and by turns: swept
// vertex-face and edge-edge candidates between two frames, from scratch and with a known tree; iterates
// within a bound; updates of few vertices; candidates between groups; self intersections of cloth with cones
// and without. Prints medians of processor time in ms and ratios, and compares them with targets; FILE
// receives all times, ratios and targets, for analysis/broad_phase_targets.py.
//   kbvh_broad_phase_bench [FRAMES] [REPETITIONS] [FILE]
// FRAMES is a folder with a pair of frames (default: cloth-ball of the data folder); without it, rows that
// need one are left out.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <list>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"
#include "core/contract/takes_moved_vertices.hpp"
#include "core/judge/session.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/study/box_candidates.hpp"
#include "experiments/study/contestants.hpp"
#include "frame_mesh.hpp"
#include "self_intersections.hpp"
#include "swept_rivals.hpp"
#include "turns_table.hpp"

namespace kbvh::experiments::micro {
namespace {

void swept(const FramePair& frames, int repetitions, Table& table) {
  const Mesh<double> mesh(frames);
  const Mesh<float> mesh_float(frames);
  BroadPhase<double> rebuilt, known;
  BroadPhase<float> known_float;
  known.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
  known_float.build(mesh_float.view(0), mesh_float.view(1), mesh_float.e, mesh_float.f);
  CandidateBuffer out[2];
  SortAndSweep sweep(frames);
  StrategySweep features(frames, "bottom_up");
  std::optional<PeerBoxes<double>> cgal;
  if (const StrategyEntry* const entry = known_strategy("cgal_box_intersection"))
    cgal.emplace(frames, *entry, std::vector<BodyPair>{{0, 1}, {2, 2}});
  std::vector<Contestant> contestants;
  contestants.push_back({"kbvh::broad_phase, double, new object and buffers", [&] {
                           BroadPhase<double> broad;
                           CandidateBuffer fresh[2];
                           broad.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
                           return detect_both(broad, fresh);
                         }});
  contestants.push_back({"kbvh::broad_phase, double, new trees in kept memory", [&] {
                           rebuilt.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
                           return detect_both(rebuilt, out);
                         }});
  contestants.push_back({"kbvh::broad_phase, double, known tree", [&] {
                           known.update(mesh.view(0), mesh.view(1));
                           return detect_both(known, out);
                         }});
  contestants.push_back({"kbvh::broad_phase, float, known tree", [&] {
                           known_float.update(mesh_float.view(0), mesh_float.view(1));
                           return detect_both(known_float, out);
                         }});
  contestants.push_back({"sort and sweep (SIMD), from scratch", [&] {
                           SortAndSweep fresh_sweep(frames);
                           CandidateBuffer fresh[2];
                           return fresh_sweep.find(mesh, fresh);
                         }});
  contestants.push_back({"sort and sweep (SIMD), known order", [&] { return sweep.find(mesh, out); }});
  contestants.push_back({"bottom_up on a scene of features, from scratch", [&] {
                           const BoxCandidates found = box_candidates(frames, BoxMargin::none);
                           return std::size_t(found.vertex_face + found.edge_edge);
                         }});
  contestants.push_back({"bottom_up on a scene of features, known tree", [&] { return features.find(); }});
  if (cgal)
    contestants.push_back({"CGAL's box_intersection_d", [&] {
                             cgal->advance();
                             return cgal->find();
                           }});
  table.compare("Swept vertex-face and edge-edge candidates between two frames", std::move(contestants),
                repetitions);
}

/// Vertex-face candidates alone, in float, on trees that stay: not every peer finds pairs within a body.
void swept_by_trees(const FramePair& frames, int repetitions, Table& table) {
  const Mesh<float> mesh(frames);
  BroadPhase<float> known;
  known.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
  CandidateBuffer out;
  std::vector<Contestant> contestants;
  contestants.push_back({"kbvh::broad_phase, vertex-face in float, known tree", [&] {
                           known.update(mesh.view(0), mesh.view(1));
                           known.detect_face_vertex_candidates(out);
                           return out.size();
                         }});
  std::list<PeerBoxes<float>> peers;
  for (const auto& [id, name] :
       {std::pair("bullet_dbvt", "Bullet's dynamic tree"), {"embree_refit", "Embree"}}) {
    const StrategyEntry* const entry = known_strategy(id);
    if (entry == nullptr) continue;
    PeerBoxes<float>& peer = peers.emplace_back(frames, *entry, std::vector<BodyPair>{{0, 1}});
    contestants.push_back({std::string(name) + ", vertex-face in float, known tree", [&peer] {
                             peer.advance();
                             return peer.find();
                           }});
  }
  table.compare("Swept vertex-face candidates between two frames", std::move(contestants), repetitions);
}

/// Candidates between the two largest connected parts of a mesh, chosen by groups within the search or
/// afterwards.
void between_parts(const FramePair& frames, int repetitions, Table& table) {
  const Mesh<double> mesh(frames);
  const auto vertices = std::uint32_t(mesh.v[0].size() / 3);
  std::vector<std::uint32_t> part(vertices), sizes(vertices, 0);
  std::iota(part.begin(), part.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (part[v] != v) v = part[v] = part[part[v]];
    return v;
  };
  for (const auto& face : frames.faces)
    for (const std::uint32_t v : face) part[root(v)] = root(face[0]);
  for (std::uint32_t v = 0; v < vertices; ++v) ++sizes[root(v)];
  const auto largest = std::uint32_t(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<GroupMask> groups;
  std::vector<std::uint32_t> groups_of_edges;
  for (std::uint32_t v = 0; v < vertices; ++v)
    groups.push_back(root(v) == largest ? GroupMask{1, 2} : GroupMask{2, 1});
  for (const auto& edge : frames.edges) groups_of_edges.push_back(groups[edge[0]].groups);
  BroadPhase<double> grouped, all;
  CandidateBuffer out[2];
  for (BroadPhase<double>* const broad : {&grouped, &all}) {
    broad->build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
    broad->candidates(CandidateKind::edge_edge);
  }
  grouped.set_vertex_groups(groups);
  table.compare("Edge-edge candidates between the largest connected part and the others",
                {{"groups",
                  [&] {
                    grouped.update(mesh.view(0), mesh.view(1));
                    grouped.detect_edge_edge_candidates(out[0]);
                    return out[0].size();
                  }},
                 {"a list of all candidates, sifted",
                  [&] {
                    all.update(mesh.view(0), mesh.view(1));
                    all.detect_edge_edge_candidates(out[1]);
                    std::erase_if(out[1], [&](const Candidate& pair) {
                      return groups_of_edges[pair.first] == groups_of_edges[pair.second];
                    });
                    return out[1].size();
                  }}},
                repetitions);
}

/// Solver iterates: 20 steps of a tenth of a mean edge, of which each vertex makes its own.
void iterates(const FramePair& frames, int repetitions, Table& table) {
  const Mesh<double> mesh(frames);
  double edge = 0;
  for (const auto& [a, b] : frames.edges) {
    double squared = 0;
    for (std::size_t k = 0; k < 3; ++k) squared += std::pow(mesh.v[0][3 * a + k] - mesh.v[0][3 * b + k], 2);
    edge += std::sqrt(squared) / double(frames.edges.size());
  }
  // Iterates converge: together they move each vertex by a tenth of an edge.
  std::vector<std::vector<double>> positions(20, mesh.v[0]);
  std::uint64_t state = 1;
  for (std::size_t i = 0; i < mesh.v[0].size(); ++i) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    const double way = 0.1 * edge * (double(state >> 11) * 0x1p-52 - 1);
    for (std::size_t k = 0; k < positions.size(); ++k)
      positions[k][i] += way * (1 - std::pow(0.7, double(k)));
  }
  const double radius = 0.1 * edge;
  BroadPhase<double> each, bounded;
  CandidateBuffer out[2];
  each.build(mesh.view(0), mesh.e, mesh.f, radius);
  bounded.build(mesh.view(0), mesh.e, mesh.f, radius);
  bounded.valid_for(0.1 * edge);
  std::size_t sum = 0;
  std::uint64_t detections = 0;
  table.compare("20 iterates of a solver step",
                {{"valid_for(a tenth of an edge)",
                  [&] {
                    sum = 0;
                    bounded.forget_trees();
                    const std::uint64_t before = bounded.detections();
                    for (const auto& v : positions) {
                      bounded.update(points_of(v));
                      sum += bounded.candidates(CandidateKind::face_vertex).size() +
                             bounded.candidates(CandidateKind::edge_edge).size();
                    }
                    detections = bounded.detections() - before;
                    return sum;
                  }},
                 {"detection at each",
                  [&] {
                    sum = 0;
                    for (const auto& v : positions) {
                      each.update(points_of(v));
                      sum += detect_both(each, out);
                    }
                    return sum;
                  }}},
                repetitions);
  std::printf("  searches of the first: %llu of 40\n", (unsigned long long)detections);
}

/// A sheet of n x n vertices, and the hundredth of them that moves: one patch, or scattered ones.
class MovingSheet {
 public:
  explicit MovingSheet(std::uint32_t n) : e_(cloth_edges(n)), f_(cloth_faces(n)) {
    for (std::uint32_t y = 0; y < n; ++y)
      for (std::uint32_t x = 0; x < n; ++x)
        v_.insert(v_.end(), {float(x), float(y), float(std::sin(0.05 * x) * std::cos(0.04 * y))});
    v_.push_back(0);  // readers may load four scalars
    const std::uint32_t count = n * n / 100, side = std::uint32_t(std::sqrt(double(count)));
    for (std::uint32_t y = 0; y < side; ++y)
      for (std::uint32_t x = 0; x < side; ++x) patch.push_back((n / 2 + y) * n + n / 3 + x);
    for (std::uint32_t i = 0; i < count; ++i)
      scattered.push_back(std::uint32_t((std::uint64_t(i) * 7919 * 100) % (n * n)));
  }
  MatrixView<float> view() const { return points_of(v_); }
  MatrixView<std::uint32_t> edges() const {
    return MatrixView<std::uint32_t>::by_rows(e_.data(), e_.size() / 2, 2);
  }
  MatrixView<std::uint32_t> faces() const {
    return MatrixView<std::uint32_t>::by_rows(f_.data(), f_.size() / 3, 3);
  }
  const float* positions() const { return v_.data(); }
  void shift(const std::vector<std::uint32_t>& vertices) {
    for (const std::uint32_t i : vertices) v_[3 * i + 2] += up_ ? 0.01F : -0.01F;
    up_ = !up_;
  }
  Body<float> body() const {
    Body<float> body;
    for (std::size_t i = 0; i < f_.size(); i += 3) body.primitives.add({f_.data() + i, 3});
    body.plans = FlightPlans<float>::handed_in(std::uint32_t(v_.size() / 3), {v_.begin(), v_.end() - 1});
    return body;
  }

  std::vector<std::uint32_t> patch, scattered;

 private:
  std::vector<float> v_;
  std::vector<std::uint32_t> e_, f_;
  bool up_ = true;
};

constexpr int frames_at_once = 10;  // one is too short for the clock

/// Updates of the three trees of a broad phase in which one percent of the vertices moved.
void moved(std::uint32_t n, int repetitions, Table& table) {
  struct Own {
    MovingSheet sheet;
    BroadPhase<float> broad{};
  };
  std::list<Own> own;
  CandidateBuffer out;
  const auto contestant = [&](const char* name, auto update) -> Contestant {
    Own& mine = own.emplace_back(MovingSheet(n));
    mine.broad.build(mine.sheet.view(), mine.sheet.edges(), mine.sheet.faces(), 0.1F);
    mine.broad.detect_face_vertex_candidates(out);
    mine.broad.detect_edge_edge_candidates(out);
    return {name, [&mine, update] {
              for (int frame = 0; frame < frames_at_once; ++frame) {
                update(mine);
                mine.broad.refresh();
              }
              return std::size_t(0);
            }};
  };
  std::vector<Contestant> contestants;
  contestants.push_back(contestant("update(V), whole refit", [](Own& mine) {
    mine.sheet.shift(mine.sheet.patch);
    mine.broad.update(mine.sheet.view());
  }));
  contestants.push_back(contestant("update(V, moved), one patch", [](Own& mine) {
    mine.sheet.shift(mine.sheet.patch);
    mine.broad.update(mine.sheet.view(), mine.sheet.patch);
  }));
  contestants.push_back(contestant("update(V, moved), scattered", [](Own& mine) {
    mine.sheet.shift(mine.sheet.scattered);
    mine.broad.update(mine.sheet.view(), mine.sheet.scattered);
  }));
  table.compare(
      "1 % of " + std::to_string(n * n) + " vertices moved, ten times, all three trees made current",
      std::move(contestants), repetitions);
}

/// The same of strategies on a scene of the sheet's faces, whose positions are handed in.
void moved_in_a_scene(std::uint32_t n, int repetitions, Table& table) {
  struct Own {
    MovingSheet sheet;
    Scene<float> scene{};
    std::optional<Session<float>> session{};
    double t = 0;
  };
  std::list<Own> own;
  const auto contestant = [&](const char* name, const char* strategy,
                              std::vector<std::uint32_t> MovingSheet::*vertices) -> Contestant {
    Own& mine = own.emplace_back(MovingSheet(n));
    mine.scene.bodies.push_back(mine.sheet.body());
    mine.scene.pairs = {{0, 0}};
    const StrategyEntry& entry = strategy_named(strategy);
    mine.session.emplace(mine.scene, kbvh::Contestant{&entry, {}, entry.info.topology.preferred}, Use::timed);
    mine.session->hand_in(0, mine.sheet.positions());
    mine.session->reset(0);
    return {name, [&mine, vertices] {
              PhaseTimes ignored;
              for (int frame = 0; frame < frames_at_once; ++frame) {
                mine.sheet.shift(mine.sheet.*vertices);
                tell_moved<float>(mine.session->strategy(), 0, mine.sheet.*vertices);
                mine.session->hand_in(0, mine.sheet.positions());
                mine.session->advance(++mine.t, ignored);
              }
              return std::size_t(0);
            }};
  };
  std::vector<Contestant> contestants;
  contestants.push_back(contestant("bottom_up, whole refit", "bottom_up", &MovingSheet::patch));
  contestants.push_back(contestant("dirty_refit, one patch", "dirty_refit", &MovingSheet::patch));
  contestants.push_back(contestant("dirty_refit, scattered", "dirty_refit", &MovingSheet::scattered));
  table.compare("1 % of " + std::to_string(n * n) + " vertices moved, ten times, strategies on the faces",
                std::move(contestants), repetitions);
}

/// The part of a search for edge-edge candidates that the right-most leaves of subtrees save elsewhere: a
/// tree with itself, each two subtrees once, and the same tree as two, in both orders.
void both_orders(const FramePair& frames, int repetitions, Table& table) {
  const Mesh<double> mesh(frames);
  const Elements elements = make_elements(mesh.v[0].size() / 3, mesh.e, mesh.f);
  std::vector<double> boxes;
  for (std::size_t i = 0; i < mesh.v[0].size(); i += 3)
    for (const bool upper : {false, true}) {
      for (std::size_t k = i; k < i + 3; ++k)
        boxes.push_back(upper ? std::max(mesh.v[0][k], mesh.v[1][k]) : std::min(mesh.v[0][k], mesh.v[1][k]));
      boxes.push_back(0);
    }
  ElementTree<double> tree;
  tree.start(elements.of(Element::edge), 16, active_kernel_set());
  tree.refresh(boxes.data(), 2);
  const WideArrays<double> nodes = tree.leaves().tree;
  std::vector<WidePair> stack(1 << 16);
  std::vector<LeafSlot> found(1 << 12);
  const auto traverse = [&](WideOverlapKernels<double>::Traverse kernel) {
    WideTraversal state{stack.data(),     1, stack.size(),     found.data(), 0,
                        found.size() / 2, 0, ~std::uint64_t(0)};
    stack[0] = {0, 0};
    std::size_t leaf_pairs = 0;
    for (; state.depth > 0; state.found = 0) {
      kernel(nodes, nodes, state);
      leaf_pairs += state.found;
    }
    return leaf_pairs;
  };
  const auto& kernels = wide_overlap_kernels<double>(active_kernel_set());
  table.compare("Pairs of leaves of edges whose boxes overlap",
                {{"each two subtrees once", [&] { return traverse(kernels.self(8)); }},
                 {"in both orders", [&] { return traverse(kernels.traverse(8)); }}},
                repetitions);
}

int run(int argc, char** argv) {
  const std::filesystem::path folder =
      argc > 1 ? std::filesystem::path(argv[1]) : data_folder() / "ccd" / "frames" / "cloth-ball";
  const int repetitions = argc > 2 ? std::max(1, std::atoi(argv[2])) : 5;
  std::printf("kernels: %s\n", name(active_kernel_set()));
  Table table;
  std::string scene = "none";
  if (is_frame_pair(folder)) {
    const FramePair frames = read_frame_pair(folder);
    scene = frames.name;
    std::printf("%s: %zu vertices, %zu edges, %zu faces\n", frames.name.c_str(),
                frames.positions[0].size() / 3, frames.edges.size(), frames.faces.size());
    swept(frames, repetitions, table);
    swept_by_trees(frames, repetitions, table);
    iterates(frames, repetitions, table);
    between_parts(frames, repetitions, table);
    both_orders(frames, repetitions, table);
  } else {
    std::printf("no pair of frames in %s\n", folder.c_str());
  }
  moved(538, 3 * repetitions, table);
  moved_in_a_scene(538, 3 * repetitions, table);
  compare_self_intersections(repetitions, table);

  const std::string scratch = "kbvh::broad_phase, double, new object and buffers";
  const std::string known = "kbvh::broad_phase, double, known tree";
  table.target("swept candidates from scratch, over sort and sweep", scratch,
               "sort and sweep (SIMD), from scratch", 3, 10);
  table.target("swept candidates from scratch, over a refit of a scene of features", scratch,
               "bottom_up on a scene of features, from scratch", 1.5, 3);
  table.target("swept candidates with a known tree, over sort and sweep with a known order", known,
               "sort and sweep (SIMD), known order", 0, 0);
  table.target("iterates of a solver, over detection at each", "valid_for(a tenth of an edge)",
               "detection at each", 4, 10);
  table.target("candidates between groups, over a list of all that is sifted", "groups",
               "a list of all candidates, sifted", 0, 0);
  table.target("update(V, moved) of 1 %, one patch, over a whole refit", "update(V, moved), one patch",
               "update(V), whole refit", 10, 40);
  table.target("update(V, moved) of 1 %, scattered, over a whole refit", "update(V, moved), scattered",
               "update(V), whole refit", 0, 0);
  table.target("swept candidates with a known tree, over a scene of features with a known tree", known,
               "bottom_up on a scene of features, known tree", 1.3, 2);
  // CGAL keeps nothing but memory from frame to frame.
  table.target("swept candidates with a known tree, over boxes of CGAL", known, "CGAL's box_intersection_d",
               4, 15);
  table.target("swept candidates with new trees in kept memory, over boxes of CGAL",
               "kbvh::broad_phase, double, new trees in kept memory", "CGAL's box_intersection_d", 0, 0);
  const std::string tree = ", vertex-face in float, known tree";
  table.target("swept vertex-face candidates with a known tree, over Bullet's dynamic tree",
               "kbvh::broad_phase" + tree, "Bullet's dynamic tree" + tree, 4, 15);
  table.target("swept vertex-face candidates with a known tree, over Embree", "kbvh::broad_phase" + tree,
               "Embree" + tree, 4, 15);
  table.target("dirty_refit of 1 %, one patch, over bottom_up", "dirty_refit, one patch",
               "bottom_up, whole refit", 10, 40);
  table.target("dirty_refit of 1 %, scattered, over bottom_up", "dirty_refit, scattered",
               "bottom_up, whole refit", 0, 0);
  table.target("a tree with itself, each two subtrees once, over both orders", "each two subtrees once",
               "in both orders", 0, 0);
  table.print_targets();
  if (argc > 3) table.write(argv[3], scene, repetitions);
  return 0;
}

}  // namespace
}  // namespace kbvh::experiments::micro

int main(int argc, char** argv) {
  try {
    return kbvh::experiments::micro::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kbvh_broad_phase_bench: %s\n", error.what());
    return 1;
  }
}
