#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>

#include "core/continuous/impact_batch.hpp"
#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/results/table.hpp"
#include "experiments/study/box_candidates.hpp"
#include "experiments/study/impact_queries.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

constexpr const char* ccd_examples = R"(Examples:
  kbvh ccd
  kbvh ccd queries/unit-tests frames/cloth-ball --out results/ccd
Decides queries of continuous collision detection (a vertex and a face, or two edges, in linear motion) exactly, and
compares with the given verdicts. Input: files with 8 rows per query in exact rationals, folders of such files, and
pairs of frames with lists of pairs, as in the NYU CCD benchmark (Wang et al. 2021). kbvh decides the queries of a file
in batches. The table also has the peers' own continuous tests of the same two features, in floating point, one query
at a time, if they are built in. DIR/ccd.json has the table; if DIR is the folder of a study, the study's report
includes it. With --candidates, counts the pairs of features whose swept
boxes meet between the two frames of each pair, next to published counts.
Exit codes: 0 all verdicts are right, 1 one is wrong, 2 wrong use or input, 3 other error.)";

/// The verdicts and the speed of one test on the queries of one file.
struct Row {
  std::uint64_t positives = 0, missed = 0, extra = 0, filtered = 0;
  double seconds = 0;
  std::uint64_t passes = 0;
  double per_second(std::size_t queries) const {
    return seconds > 0 ? double(queries) * double(passes) / seconds : 0;
  }
};

/// The exact test, on queries of one kind in batches.
class ExactTest {
 public:
  /// Calls take(query, touches) for all queries, in their order.
  template <class Take>
  void operator()(const ImpactQueries& queries, const Take& take) {
    std::size_t first = 0;
    const auto decide = [&](ImpactBatch& batch) {
      batch.decide(&stats_);
      for (std::size_t i = 0; i < batch.size(); ++i)
        take(queries.queries[first + i], batch.impact(i).touches);
      first += batch.size();
      batch.clear();
    };
    for (std::size_t i = 0; i < queries.queries.size(); ++i) {
      const ImpactQuery& query = queries.queries[i];
      ImpactBatch& batch = batches_[std::size_t(query.kind)];
      batch.add(query.moving());
      const bool last = i + 1 == queries.queries.size() || queries.queries[i + 1].kind != query.kind;
      if (batch.full() || last) decide(batch);
    }
  }
  const ImpactStats& stats() const { return stats_; }

 private:
  ImpactBatch batches_[2]{ImpactBatch(Contact::Kind::vertex_face), ImpactBatch(Contact::Kind::edge_edge)};
  ImpactStats stats_;
};

/// A peer's test, query by query.
struct PeerTest {
  bool (*touches)(Contact::Kind, const MovingPoints&);
  template <class Take>
  void operator()(const ImpactQueries& queries, const Take& take) const {
    for (const ImpactQuery& query : queries.queries) take(query, touches(query.kind, query.moving()));
  }
};

/// Decides all queries once and compares with the truth.
template <class Test>
void judge(const ImpactQueries& queries, Row& row, Test& test) {
  test(queries, [&](const ImpactQuery& query, bool touches) {
    row.positives += touches ? 1 : 0;
    if (!query.truth) return;
    if (*query.truth && !touches) ++row.missed;
    if (!*query.truth && touches) ++row.extra;
  });
}

/// Decides all queries repeatedly until that has taken `seconds`. Doubles the number of passes between two
/// reads of the clock, because a read costs more than a query.
template <class Test>
void time_passes(const ImpactQueries& queries, Row& row, double seconds, Test& test) {
  if (queries.queries.empty()) return;
  std::uint64_t touching = 0;
  double here = 0;
  for (std::uint64_t passes = 1; passes == 1 || here < seconds; passes *= 2) {
    const auto begin = std::chrono::steady_clock::now();
    for (std::uint64_t k = 0; k < passes; ++k)
      test(queries, [&](const ImpactQuery& /*query*/, bool touches) { touching += touches ? 1 : 0; });
    here += seconds_since(begin);
    row.passes += passes;
  }
  row.seconds += here;
  asm volatile("" : : "r"(touching));  // marks the verdicts as used for the optimiser
}

/// Times the exact test and the peers alternately, each for `seconds` in total.
std::vector<Row> measure(const ImpactQueries& queries, const std::vector<ImpactPeer>& others,
                         double seconds) {
  std::vector<Row> rows(1 + others.size());
  ExactTest exact;
  std::vector<PeerTest> tests;
  for (const ImpactPeer& other : others) tests.push_back({other.touches});
  judge(queries, rows[0], exact);
  rows[0].filtered = exact.stats().filtered;
  for (std::size_t i = 0; i < tests.size(); ++i) judge(queries, rows[1 + i], tests[i]);
  const int turns = seconds > 0 ? 4 : 1;
  for (int turn = 0; turn < turns; ++turn) {
    time_passes(queries, rows[0], seconds / turns, exact);
    for (std::size_t i = 0; i < tests.size(); ++i)
      time_passes(queries, rows[1 + i], seconds / turns, tests[i]);
  }
  return rows;
}

json record_of(const Row& row, std::size_t queries) {
  return {{"positives", row.positives},
          {"missed", row.missed},
          {"extra", row.extra},
          {"passes", row.passes},
          {"queries_per_second", row.per_second(queries)}};
}

struct Arguments {
  std::vector<std::string> paths;
  std::string out;
  double seconds = 0.05;
  bool candidates = false;
};

/// Returns the frame pairs among the paths, and in folders of such pairs.
std::vector<std::filesystem::path> frame_pairs(std::vector<std::string> paths) {
  if (paths.empty()) paths.push_back((data_folder() / "ccd" / "frames").string());
  std::vector<std::filesystem::path> found;
  for (const std::string& path : paths) {
    std::error_code error;
    if (is_frame_pair(path)) {
      found.emplace_back(std::filesystem::path(path).lexically_normal());
      continue;
    }
    const std::size_t before = found.size();
    for (const auto& entry : std::filesystem::directory_iterator(path, error))
      if (is_frame_pair(entry.path())) found.push_back(entry.path());
    if (found.size() == before)
      throw io::InputError(path + ": there is no frame pair (folders frames, boxes and mma_bool)");
  }
  std::sort(found.begin(), found.end());
  return found;
}

int count_candidates(const Arguments& arguments) {
  std::vector<std::vector<std::string>> table{{"frames", "boxes", "vertex-face", "published", "edge-edge",
                                               "published", "touch (listed)", "of these no candidate"}};
  std::uint64_t missed = 0;
  for (const std::filesystem::path& path : frame_pairs(arguments.paths)) {
    const FramePair frames = read_frame_pair(path);
    const PublishedCandidates published = published_candidates(frames.name);
    const auto known = [](std::uint64_t count) { return count == 0 ? "-" : std::to_string(count); };
    for (const BoxMargin margin : {BoxMargin::none, BoxMargin::one_ulp}) {
      const BoxCandidates found = box_candidates(frames, margin);
      table.push_back({frames.name, margin == BoxMargin::none ? "closed" : "one ulp wider",
                       std::to_string(found.vertex_face), known(published.vertex_face),
                       std::to_string(found.edge_edge), known(published.edge_edge),
                       std::to_string(found.touching), std::to_string(found.missed)});
      missed += found.missed;
    }
  }
  print(columns(table));
  return missed == 0 ? success : guarantee_broken;
}

int run(const Arguments& arguments) {
  std::vector<ImpactQueries> files;
  std::vector<std::string> paths = arguments.paths;
  if (paths.empty()) paths.push_back((data_folder() / "ccd").string());
  for (const std::string& path : paths)
    for (ImpactQueries& queries : find_impact_queries(path)) files.push_back(std::move(queries));
  if (files.empty()) throw io::InputError("no queries of continuous collision detection in " + joined(paths));
  const json options{{"paths", paths}, {"seconds", arguments.seconds}};
  std::optional<ResultFile> result;
  if (!arguments.out.empty()) result.emplace(arguments.out, "ccd.json", options);
  const std::vector<ImpactPeer> others = impact_peers();
  std::vector<std::vector<std::string>> table{
      {"queries of", "queries", "touch", "missed", "extra", "filtered", "per second"}};
  for (const ImpactPeer& peer : others)
    for (const char* column : {" missed", " extra", " per second"}) table[0].push_back(peer.id + column);
  json records = json::array();
  std::uint64_t queries = 0, wrong = 0, unknown = 0;
  Progress progress;
  std::vector<Row> totals(1 + others.size());
  const auto add_line = [&](const std::string& name, std::size_t count, const std::vector<Row>& rows) {
    std::vector<std::string> line{
        name,
        std::to_string(count),
        std::to_string(rows[0].positives),
        std::to_string(rows[0].missed),
        std::to_string(rows[0].extra),
        fmt::format("{:.1f} %", count == 0 ? 0 : 100.0 * double(rows[0].filtered) / double(count)),
        fmt::format("{:.3g}", rows[0].per_second(count))};
    for (std::size_t i = 1; i < rows.size(); ++i) {
      line.push_back(std::to_string(rows[i].missed));
      line.push_back(std::to_string(rows[i].extra));
      line.push_back(fmt::format("{:.3g}", rows[i].per_second(count)));
    }
    table.push_back(std::move(line));
  };
  for (const ImpactQueries& file : files) {
    progress.show(file.name);
    const std::vector<Row> rows = measure(file, others, arguments.seconds);
    add_line(file.name, file.queries.size(), rows);
    json record = record_of(rows[0], file.queries.size());
    record["name"] = file.name;
    record["queries"] = file.queries.size();
    record["filtered"] = rows[0].filtered;
    for (std::size_t i = 0; i < others.size(); ++i)
      record["peers"][others[i].id] = record_of(rows[1 + i], file.queries.size());
    records.push_back(std::move(record));
    queries += file.queries.size();
    wrong += rows[0].missed + rows[0].extra;
    for (const ImpactQuery& query : file.queries) unknown += query.truth ? 0 : 1;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      totals[i].positives += rows[i].positives;
      totals[i].missed += rows[i].missed;
      totals[i].extra += rows[i].extra;
      totals[i].filtered += rows[i].filtered;
      // Seconds for one pass over all files.
      if (rows[i].passes > 0) totals[i].seconds += rows[i].seconds / double(rows[i].passes);
      totals[i].passes = 1;
    }
  }
  progress.clear();
  add_line("all", queries, totals);
  print(columns(table));
  if (others.empty()) print("No peer with a continuous test of its own is built in (FCL 0.7 has one).\n");
  if (unknown > 0) print(counted(unknown, "query") + " without a given verdict.\n");
  if (result)
    result->write({{"commit", commit()},
                   {"dirty", dirty()},
                   {"machine", machine()},
                   {"options", options},
                   {"files", records}});
  if (wrong == 0) return success;
  say(counted(wrong, "verdict") + (wrong == 1 ? " is wrong" : " are wrong"));
  return guarantee_broken;
}

}  // namespace

void add_ccd(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("ccd", "decide queries of continuous collision detection");
  command->footer(ccd_examples);
  auto a = std::make_shared<Arguments>();
  add_texts(*command, "paths", a->paths, "files, folders, frame pairs (the data folder's ccd)");
  add_number(*command, "--seconds", a->seconds, 0, 3600, "minimum time of each test on each file (0.05)");
  CLI::Option* out = add_text(*command, "--out", a->out, "folder for ccd.json (none: the table only)");
  command
      ->add_flag("--candidates", a->candidates,
                 "count box candidates between frames instead (the data folder's ccd/frames)")
      ->excludes(out);
  command->callback(
      [&action, a] { action = [a] { return a->candidates ? count_candidates(*a) : run(*a); }; });
}

}  // namespace kbvh::experiments
