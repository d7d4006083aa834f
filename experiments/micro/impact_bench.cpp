// Impacts per second: in batches, one by one, and by the continuous tests of peers, in one run and by turns,
// on pairs between two real frames: those with known verdicts, and all candidates of kbvh::broad_phase.
// Prints medians of processor time as queries per second and ratios, and compares them with targets; FILE
// receives all times, ratios and targets. Exit code 1: batches and single tests differ.
//   kbvh_impact_bench [FRAMES] [REPETITIONS] [FILE]
// FRAMES is a folder with a pair of frames, or one of such folders (default: ccd/frames of the data folder).
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/broad_phase/broad_phase.hpp"
#include "core/continuous/impact_batch.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/study/impact_queries.hpp"
#include "frame_mesh.hpp"
#include "turns_table.hpp"

namespace kbvh::experiments {
namespace {

namespace fs = std::filesystem;

/// Pairs of ids of one kind, as they come from a broad phase: a vertex and a face, or two edges.
struct Pairs {
  std::string name;
  Contact::Kind kind;
  std::vector<std::array<std::uint32_t, 2>> ids;
};

/// Calls take(points) for each pair.
template <class Take>
void for_each(const FramePair& frames, const Pairs& pairs, const Take& take) {
  for (const auto& [first, second] : pairs.ids) {
    const std::array<std::uint32_t, 4> corners = frames.corners(pairs.kind, first, second);
    MovingPoints points;
    for (std::size_t i = 0; i < 4; ++i) {
      points.begin[i] = frames.positions[0].data() + std::size_t(3) * corners[i];
      points.end[i] = frames.positions[1].data() + std::size_t(3) * corners[i];
    }
    take(points);
  }
}

/// What a test found in all pairs: a number that depends on every verdict and, for exact tests, every time.
struct Found {
  std::uint64_t touching = 0;
  double times = 0;
  void add(const Impact& impact) {
    touching += impact.touches ? 1 : 0;
    times += impact.begin + 2 * impact.end;
  }
};

Found in_batches(const FramePair& frames, const Pairs& pairs, ImpactStats* stats) {
  Found found;
  ImpactBatch batch(pairs.kind);
  const auto decide = [&] {
    batch.decide(stats);
    for (std::size_t i = 0; i < batch.size(); ++i) found.add(batch.impact(i));
    batch.clear();
  };
  for_each(frames, pairs, [&](const MovingPoints& points) {
    batch.add(points);
    if (batch.full()) decide();
  });
  decide();
  return found;
}
Found one_by_one(const FramePair& frames, const Pairs& pairs, ImpactStats* stats) {
  Found found;
  for_each(frames, pairs,
           [&](const MovingPoints& points) { found.add(find_impact(pairs.kind, points, stats)); });
  return found;
}

struct Contestant {
  std::string name;
  std::function<Found()> work;
  Found found{};
  std::vector<double> times{};  ///< seconds
  double per_second = 0;
};

class Bench {
 public:
  explicit Bench(int repetitions) : repetitions_(repetitions) {}

  void compare(const FramePair& frames, const Pairs& pairs) {
    if (pairs.ids.empty()) return;
    ImpactStats stats, single_stats;
    std::vector<Contestant> contestants{
        {"in batches", [&] { return in_batches(frames, pairs, &stats); }},
        {"one by one", [&] { return one_by_one(frames, pairs, &single_stats); }}};
    for (const auto& peer : peers_)
      contestants.push_back({peer.id, [&] {
                               Found found;
                               for_each(frames, pairs, [&](const MovingPoints& points) {
                                 found.touching += peer.touches(pairs.kind, points) ? 1 : 0;
                               });
                               return found;
                             }});
    for (int r = -1; r < repetitions_; ++r)
      for (Contestant& contestant : contestants) {
        const double begin = micro::milliseconds();
        contestant.found = contestant.work();
        if (r >= 0) contestant.times.push_back(1e-3 * (micro::milliseconds() - begin));
      }
    const Found &ours = contestants[0].found, &single = contestants[1].found;
    if (ours.touching != single.touching || ours.times != single.times) differs_ = true;
    const double exact = double(stats.exact) / double(stats.tests);
    std::printf("%s: %zu queries, %llu touch, %.3f %% by integers (%.3f %% one by one)%s\n",
                pairs.name.c_str(), pairs.ids.size(), (unsigned long long)ours.touching, 100 * exact,
                100 * double(single_stats.exact) / double(single_stats.tests),
                differs_ ? ", BATCHES DIFFER" : "");
    nlohmann::json rows = nlohmann::json::array();
    for (Contestant& contestant : contestants) {
      const double median = median_of_times(contestant.times);
      contestant.per_second = median > 0 ? double(pairs.ids.size()) / median : 0;
      std::printf("  %-20s %12.4g per second  %8.2f ns each  %8llu touch\n", contestant.name.c_str(),
                  contestant.per_second, 1e9 * median / double(pairs.ids.size()),
                  (unsigned long long)contestant.found.touching);
      rows.push_back({{"name", contestant.name},
                      {"seconds", contestant.times},
                      {"queries_per_second", contestant.per_second},
                      {"touching", contestant.found.touching}});
    }
    comparisons_.push_back(
        {{"pairs", pairs.name}, {"queries", pairs.ids.size()}, {"exact", exact}, {"contestants", rows}});
    for (std::size_t i = 1; i < contestants.size(); ++i)
      targets_.add(pairs.name + ": batches over " + contestants[i].name,
                   contestants[0].per_second / contestants[i].per_second, i == 1 ? 0 : 0.5, i == 1 ? 0 : 1.5);
  }

  void print_targets() const {
    targets_.print();
    if (peers_.empty()) std::printf("  no peer with a continuous test of its own is built in\n");
  }
  void write(const fs::path& file) const {
    targets_.write(file, "kbvh_impact_bench", repetitions_, comparisons_);
  }
  bool differs() const { return differs_; }

 private:
  int repetitions_;
  std::vector<ImpactPeer> peers_ = impact_peers();
  bool differs_ = false;
  nlohmann::json comparisons_ = nlohmann::json::array();
  micro::RatioTargets targets_;
};

void compare_frames(const FramePair& frames, Bench& bench) {
  const micro::Mesh<double> mesh(frames);
  BroadPhase<double> broad;
  broad.build(mesh.view(0), mesh.view(1), mesh.e, mesh.f);
  for (const Contact::Kind kind : {Contact::Kind::vertex_face, Contact::Kind::edge_edge}) {
    const bool faces = kind == Contact::Kind::vertex_face;
    const std::string name = frames.name + (faces ? ", vertex-face" : ", edge-edge");
    Pairs pairs{name + ", with known verdicts", kind, {}};
    for (const FramePair::Listed& listed : frames.listed)
      if (listed.kind == kind) pairs.ids.push_back({listed.first, listed.second});
    bench.compare(frames, pairs);
    CandidateBuffer candidates;
    if (faces)
      broad.detect_face_vertex_candidates(candidates);
    else
      broad.detect_edge_edge_candidates(candidates);
    pairs = {name + ", all candidates", kind, {}};
    for (const Candidate& pair : candidates) {
      if (faces)
        pairs.ids.push_back({pair.second, pair.first});
      else
        pairs.ids.push_back({pair.first, pair.second});
    }
    bench.compare(frames, pairs);
  }
}

int run(int argc, char** argv) {
  const fs::path path = argc > 1 ? fs::path(argv[1]) : data_folder() / "ccd" / "frames";
  Bench bench(argc > 2 ? std::max(1, std::atoi(argv[2])) : 5);
  std::printf("kernels: %s\n", name(active_kernel_set()));
  std::vector<fs::path> folders;
  if (is_frame_pair(path)) {
    folders.push_back(path);
  } else if (fs::is_directory(path)) {
    for (const auto& entry : fs::directory_iterator(path))
      if (is_frame_pair(entry.path())) folders.push_back(entry.path());
  }
  if (folders.empty()) throw std::runtime_error("no pair of frames in " + path.string());
  std::sort(folders.begin(), folders.end());
  for (const fs::path& folder : folders) compare_frames(read_frame_pair(folder), bench);
  bench.print_targets();
  if (argc > 3) bench.write(argv[3]);
  return bench.differs() ? 1 : 0;
}

}  // namespace
}  // namespace kbvh::experiments

int main(int argc, char** argv) {
  try {
    return kbvh::experiments::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "kbvh_impact_bench: %s\n", error.what());
    return 2;
  }
}
