// The time of kbvh::broad_phase relative to other ways to the same pairs, in one run and by turns: swept
// vertex-face and edge-edge candidates between two frames from scratch and with a known tree, iterates within
// a bound, updates of few vertices, and candidates between groups. Prints medians of processor time in ms and
// ratios, and compares them with targets; FILE receives all times, ratios and targets.
//   kbvh_broad_phase_bench [FRAMES] [REPETITIONS] [FILE]
// FRAMES is a folder with a pair of frames (default: cloth-ball of the data folder).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"
#include "core/families/sweep/sorted_boxes.hpp"
#include "core/judge/session.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/study/box_candidates.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {
namespace {

/// The processor's time of this program, which has one thread: other programs disturb it least.
double milliseconds() {
  return 1e3 * double(std::clock()) / CLOCKS_PER_SEC;
}

/// Work that is timed by turns with its rivals.
struct Contestant {
  std::string name;
  std::function<std::size_t()> work;  ///< returns the number of pairs
  std::vector<double> ms{};
  std::size_t pairs = 0;
};

/// What was compared in this run, for the file and for targets.
class Table {
 public:
  /// Plays all contestants once without a clock, then by turns, and prints medians and how many times as long
  /// as the first each one takes.
  void compare(const std::string& title, std::vector<Contestant> contestants, int repetitions) {
    for (int r = -1; r < repetitions; ++r)
      for (Contestant& contestant : contestants) {
        const double begin = milliseconds();
        contestant.pairs = contestant.work();
        const double took = milliseconds() - begin;
        if (r >= 0) contestant.ms.push_back(took);
      }
    std::printf("%s\n", title.c_str());
    nlohmann::json rows = nlohmann::json::array();
    double first = 0;
    for (Contestant& contestant : contestants) {
      std::sort(contestant.ms.begin(), contestant.ms.end());
      const double median = contestant.ms[contestant.ms.size() / 2];
      if (first == 0) first = median;
      medians_[contestant.name] = median;
      std::printf("  %-56s %10.3f ms  %7.2f x  %zu pairs\n", contestant.name.c_str(), median, median / first,
                  contestant.pairs);
      rows.push_back({{"name", contestant.name},
                      {"median_ms", median},
                      {"ms", contestant.ms},
                      {"over_first", median / first},
                      {"pairs", contestant.pairs}});
    }
    comparisons_.push_back({{"title", title}, {"contestants", rows}});
  }

  /// Compares how many times as long as `ours` the rival takes with what is at least asked for, and with the
  /// aim; 0: none is. Does nothing if one of them was not measured.
  void target(const char* what, const std::string& ours, const std::string& rival, double at_least,
              double aim) {
    if (!medians_.contains(ours) || !medians_.contains(rival)) return;
    const double ratio = medians_.at(rival) / medians_.at(ours);
    const char* const verdict = at_least == 0      ? "reported"
                                : ratio < at_least ? "missed"
                                : ratio < aim      ? "met"
                                                   : "met, and the aim";
    targets_.push_back({{"what", what},
                        {"ours", ours},
                        {"rival", rival},
                        {"ratio", ratio},
                        {"at_least", at_least},
                        {"aim", aim},
                        {"verdict", verdict}});
  }
  void not_measured(const char* what, const char* why) {
    targets_.push_back({{"what", what}, {"ratio", nullptr}, {"verdict", "not measured"}, {"why", why}});
  }

  void print_targets() const {
    std::printf("Targets\n");
    for (const nlohmann::json& target : targets_) {
      const std::string what = target["what"], verdict = target["verdict"];
      if (target["ratio"].is_null())
        std::printf("  %-78s %s: %s\n", what.c_str(), verdict.c_str(),
                    target["why"].get<std::string>().c_str());
      else
        std::printf("  %-78s %7.2f x  (%g, aim %g): %s\n", what.c_str(), target["ratio"].get<double>(),
                    target["at_least"].get<double>(), target["aim"].get<double>(), verdict.c_str());
    }
  }
  void write(const std::filesystem::path& file, const std::string& frames, int repetitions) const {
    const nlohmann::json result{{"program", "kbvh_broad_phase_bench"},
                                {"time", now_utc()},
                                {"commit", commit()},
                                {"dirty", dirty()},
                                {"machine", machine()},
                                {"kernels", name(active_kernel_set())},
                                {"frames", frames},
                                {"repetitions", repetitions},
                                {"clock", "processor time, median of repetitions by turns, one thread"},
                                {"comparisons", comparisons_},
                                {"targets", targets_}};
    std::ofstream out(file);
    out << result.dump(2) << '\n';
    if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
  }

 private:
  std::map<std::string, double> medians_;
  nlohmann::json comparisons_ = nlohmann::json::array(), targets_ = nlohmann::json::array();
};

template <class S>
struct Mesh {
  std::vector<S> v[2];
  MatrixView<std::uint32_t> e, f;
  explicit Mesh(const FramePair& frames)
      : e(MatrixView<std::uint32_t>::by_rows(frames.edges[0].data(), frames.edges.size(), 2)),
        f(MatrixView<std::uint32_t>::by_rows(frames.faces[0].data(), frames.faces.size(), 3)) {
    for (int i = 0; i < 2; ++i) v[i].assign(frames.positions[i].begin(), frames.positions[i].end());
  }
  MatrixView<S> view(int frame) const {
    return MatrixView<S>::by_rows(v[frame].data(), v[frame].size() / 3, 3);
  }
};

template <class S>
std::size_t detect_both(BroadPhase<S>& broad, CandidateBuffer (&out)[2]) {
  broad.detect_face_vertex_candidates(out[0]);
  broad.detect_edge_edge_candidates(out[1]);
  return out[0].size() + out[1].size();
}

/// Sort and sweep on the axis of the largest extent, by the SIMD kernels of the family `sweep`.
class Sweep {
 public:
  explicit Sweep(const FramePair& frames)
      : elements_(make_elements(
            frames.positions[0].size() / 3,
            MatrixView<std::uint32_t>::by_rows(frames.edges[0].data(), frames.edges.size(), 2),
            MatrixView<std::uint32_t>::by_rows(frames.faces[0].data(), frames.faces.size(), 3))) {}

  std::size_t find(const Mesh<double>& mesh, CandidateBuffer (&out)[2]) {
    const std::size_t values = mesh.v[0].size();
    positions_.resize(2 * values + 1);
    std::copy_n(mesh.v[0].data(), values, positions_.data());
    std::copy_n(mesh.v[1].data(), values, positions_.data() + values);
    for (std::size_t kind = 0; kind < element_kinds; ++kind) sort(kind);
    run(2, 0, CandidateKind::face_vertex, out[0]);
    run(1, 1, CandidateKind::edge_edge, out[1]);
    return out[0].size() + out[1].size();
  }

 private:
  void sort(std::size_t kind) {
    const Primitives& list = elements_.lists[kind];
    if (twice_[kind].count() == 0) {
      for (std::uint32_t p = 0; p < list.count(); ++p) {
        std::vector<std::uint32_t> corners(list[p].begin(), list[p].end());
        for (const std::uint32_t v : list[p]) corners.push_back(v + elements_.vertex_count());
        twice_[kind].add(corners);
      }
      sorted_[kind].start(PrimitiveList(twice_[kind]), active_kernel_set());
    }
    const PrimitiveList all(twice_[kind]);
    order_.take(twice_[kind], all, positions_.data(), active_kernel_set());
    sorted_[kind].update(order_.boxes(), axis());
  }
  std::uint32_t axis() const {
    std::uint32_t widest = 0;
    double extent[3];
    for (std::size_t k = 0; k < 3; ++k) {
      double low = positions_[k], high = low;
      for (std::size_t i = k; i + 1 < positions_.size(); i += 3) {
        low = std::min(low, positions_[i]);
        high = std::max(high, positions_[i]);
      }
      extent[k] = high - low;
      if (extent[k] > extent[widest]) widest = std::uint32_t(k);
    }
    return widest;
  }
  void run(std::size_t a, std::size_t b, CandidateKind kind, CandidateBuffer& out) {
    out.clear();
    chunk_.resize(4096);
    SweepJob<double> job{};
    job.a = sorted_[a].side(0);
    job.b = sorted_[b].side(a == b ? 0 : 1);
    job.axis = axis();
    job.block = SweepJob<double>::no_block;
    job.out = chunk_.data();
    job.out_room = chunk_.size();
    const auto kernel = a == b ? sweep_kernels<double>(active_kernel_set()).one
                               : sweep_kernels<double>(active_kernel_set()).two;
    while (job.next < job.a.count) {
      kernel(job);
      for (std::size_t i = 0; i < job.found; ++i) {
        Candidate pair{chunk_[i].primitive_a, chunk_[i].primitive_b};
        if (a == b && pair.first > pair.second) std::swap(pair.first, pair.second);
        if (!elements_.incident(kind, pair)) out.push_back(pair);
      }
      job.found = 0;
    }
  }

  Elements elements_;
  Primitives twice_[element_kinds];
  SortedBoxes<double> sorted_[element_kinds];
  CurveOrder<double> order_;
  std::vector<double> positions_;
  std::vector<FoundPair> chunk_;
};

void swept(const FramePair& frames, int repetitions, Table& table) {
  const Mesh<double> mesh(frames);
  const Mesh<float> mesh_float(frames);
  BroadPhase<double> known;
  BroadPhase<float> known_float;
  known.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
  known_float.build(mesh_float.view(0), mesh_float.view(1), mesh_float.e, mesh_float.f);
  CandidateBuffer out[2];
  Sweep sweep(frames);
  std::vector<Contestant> contestants;
  contestants.push_back({"kbvh::broad_phase, double, new object and buffers", [&] {
                           BroadPhase<double> broad;
                           CandidateBuffer fresh[2];
                           broad.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
                           return detect_both(broad, fresh);
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
                           Sweep fresh_sweep(frames);
                           CandidateBuffer fresh[2];
                           return fresh_sweep.find(mesh, fresh);
                         }});
  contestants.push_back({"sort and sweep (SIMD), known order", [&] { return sweep.find(mesh, out); }});
  contestants.push_back({"bottom_up on a scene of features, from scratch", [&] {
                           const BoxCandidates found = box_candidates(frames, BoxMargin::none);
                           return std::size_t(found.vertex_face + found.edge_edge);
                         }});
  table.compare("Swept vertex-face and edge-edge candidates between two frames", std::move(contestants),
                repetitions);
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
  const auto view = [](const std::vector<double>& v) {
    return MatrixView<double>::by_rows(v.data(), v.size() / 3, 3);
  };
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
                      bounded.update(view(v));
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
                      each.update(view(v));
                      sum += detect_both(each, out);
                    }
                    return sum;
                  }}},
                repetitions);
  std::printf("  searches of the first: %llu of 40\n", (unsigned long long)detections);
}

/// A sheet of n x n vertices, of which some move.
void moved(std::uint32_t n, int repetitions, Table& table) {
  std::vector<float> v;
  std::vector<std::uint32_t> e, f;
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t i = y * n + x;
      v.insert(v.end(), {float(x), float(y), float(std::sin(0.05 * x) * std::cos(0.04 * y))});
      if (x + 1 < n) e.insert(e.end(), {i, i + 1});
      if (y + 1 < n) e.insert(e.end(), {i, i + n});
      if (x + 1 < n && y + 1 < n) {
        e.insert(e.end(), {i + 1, i + n});
        f.insert(f.end(), {i, i + 1, i + n, i + 1, i + n + 1, i + n});
      }
    }
  const auto view = [&] { return MatrixView<float>::by_rows(v.data(), v.size() / 3, 3); };
  const std::uint32_t count = n * n / 100, side = std::uint32_t(std::sqrt(double(count)));
  std::vector<std::uint32_t> patch, scattered;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) patch.push_back((n / 2 + y) * n + n / 3 + x);
  for (std::uint32_t i = 0; i < count; ++i)
    scattered.push_back(std::uint32_t((std::uint64_t(i) * 7919 * 100) % (n * n)));
  BroadPhase<float> broad[3];
  CandidateBuffer out;
  for (auto& one : broad) {
    one.build(view(), MatrixView<std::uint32_t>::by_rows(e.data(), e.size() / 2, 2),
              MatrixView<std::uint32_t>::by_rows(f.data(), f.size() / 3, 3), 0.1F);
    one.detect_face_vertex_candidates(out);
    one.detect_edge_edge_candidates(out);
  }
  int turn = 0;
  const auto shift = [&](const std::vector<std::uint32_t>& vertices) {
    for (const std::uint32_t i : vertices) v[3 * i + 2] += turn % 2 == 0 ? 0.01F : -0.01F;
    ++turn;
  };
  const std::string title =
      "1 % of " + std::to_string(n * n) + " vertices moved, all three trees made current";
  table.compare(title,
                {{"update(V), whole refit",
                  [&] {
                    shift(patch);
                    broad[0].update(view());
                    broad[0].refresh();
                    return std::size_t(0);
                  }},
                 {"update(V, moved), one patch",
                  [&] {
                    shift(patch);
                    broad[1].update(view(), patch);
                    broad[1].refresh();
                    return std::size_t(0);
                  }},
                 {"update(V, moved), scattered",
                  [&] {
                    shift(scattered);
                    broad[2].update(view(), scattered);
                    broad[2].refresh();
                    return std::size_t(0);
                  }}},
                10 * repetitions);
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
    iterates(frames, repetitions, table);
    between_parts(frames, repetitions, table);
  } else {
    std::printf("no pair of frames in %s\n", folder.c_str());
  }
  moved(538, repetitions, table);

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
  table.not_measured("swept candidates with a known tree, over a scene of features with a known tree",
                     "a session of a scene starts over to sweep again");
  table.not_measured("swept candidates, over boxes of CGAL and trees of Bullet and Embree",
                     "the adapters of peers have no swept pairs");
  table.not_measured("exact self pairs, normal cones over none", "there are no cones");
  table.print_targets();
  if (argc > 3) table.write(argv[3], scene, repetitions);
  return 0;
}

}  // namespace
}  // namespace kbvh::experiments

int main(int argc, char** argv) {
  try {
    return kbvh::experiments::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kbvh_broad_phase_bench: %s\n", error.what());
    return 1;
  }
}
