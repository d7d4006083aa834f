#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/stress/runner.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* stress_examples = R"(Examples:
  kbvh stress --scenes 1000 --out results/stress
  kbvh stress --families near_tangent,spikes --strategies kinetic_aabb,bottom_up --l 7
  kbvh stress --strategies family:approximate --out results/error
  kbvh stress --repro results/stress/repro-spikes-kinetic_aabb-float.json
Plays adversarial scenes, generated from seeds, to each contestant in a process of its own, and compares with the
oracle. DIR/stress.json has the table, DIR/repro-*.json the failures, shrunk as far as possible. If DIR is the folder of
a study, the study's report includes the table.
Exit codes: 0 no failure, 1 failure, 2 wrong use, 3 other error. Errors of approximate contestants are results.)";

struct StressArguments {
  std::string out, repro;
  std::vector<std::string> strategies{"default"}, families, scalars{"float", "double"}, params;
  std::vector<std::uint32_t> l{1, 7, 100};
  std::uint64_t scenes = 100, seed = 1;
  std::uint32_t many_keyframes = 100000;
  double seconds = 100;
  bool plain = false, no_shrink = false, list = false;
};

std::vector<ContestantSpec> contestants_of(const StressArguments& arguments) {
  std::vector<StrategyRequest> requests;
  for (const std::string& id : arguments.strategies) {
    StrategyRequest request;
    request.id = id;
    requests.push_back(std::move(request));
  }
  Sweep sweep;
  for (const std::string& text : arguments.params) {
    const auto assignment = parse_assignment(text);
    if (!assignment) throw io::InputError("--param: expected key=value, got '" + text + "'");
    sweep[assignment->first] = split(assignment->second, ',');
  }
  std::vector<std::string> notes;
  auto list = expand(requests, sweep, {}, notes);
  for (const std::string& note : notes) say(note);
  return list;
}

int run_repro(const StressArguments& arguments, bool others) {
  const stress::Repro repro = stress::repro_of(io::read_file(arguments.repro), arguments.repro);
  std::vector<ContestantSpec> specs;
  if (others) {
    specs = contestants_of(arguments);
  } else {
    ContestantSpec spec;
    spec.entry = &strategy_named(repro.strategy);
    const Info& info = spec.entry->info;
    spec.given = repro.params;
    spec.params = Params(info.id, info.parameters, repro.params).values();
    spec.builder = repro.builder.empty() ? info.topology.preferred : stress::builder_of(repro.builder);
    spec.label = repro.strategy;
    specs = {spec};
  }
  stress::RunLimits limits;
  limits.seconds = arguments.seconds;
  const auto results = stress::run_scene(repro.scene, repro.scalar, specs, limits);
  bool failed = false;
  for (std::size_t i = 0; i < specs.size(); ++i) {
    failed |= results[i].failed();
    print(specs[i].label + ", " + repro.scalar + ": " + name(results[i].outcome) +
          (results[i].what.empty() ? "" : ": " + results[i].what) + "\n");
  }
  return failed ? guarantee_broken : success;
}

/// The files of a run in its folder, written during the run, so that an interrupted run keeps its findings.
class StressFiles {
 public:
  /// Writes nothing without a folder. Throws io::InputError if the folder cannot be written.
  StressFiles(std::filesystem::path folder, const stress::StressOptions& options)
      : folder_(std::move(folder)), options_(options) {
    if (folder_.empty()) return;
    file_.emplace(folder_, "stress.json", options_record(options));
    if (file_->earlier().is_null()) write_table({});
  }

  /// Writes failures at once, the table every other second. Errors are kept for `finish`: the run continues.
  void keep(stress::StressReport& report) {
    if (folder_.empty()) return;
    try {
      bool found = false;
      for (std::size_t i = 0; i < report.failures.size(); ++i) found |= keep(report.failures[i], i);
      const auto now = std::chrono::steady_clock::now();
      if (!found && now - written_ < std::chrono::seconds(2)) return;
      write_table(report);
      written_ = now;
    } catch (const io::InputError& problem) {
      if (problem_.empty()) problem_ = problem.what();
    }
  }

  /// Throws io::InputError if any file could not be written.
  void finish(const stress::StressReport& report) {
    if (folder_.empty()) return;
    if (!problem_.empty()) throw io::InputError(problem_);
    write_table(report);
    say("all numbers are in " + file_->path().string());
  }

 private:
  /// Keeps the table of an earlier run with the same options until this run has progressed as far.
  void write_table(const stress::StressReport& report) {
    if (const nlohmann::json& earlier = file_->earlier();
        !earlier.is_null() && earlier.value("played", nlohmann::json(0)) > nlohmann::json(report.played))
      return;
    file_->write(to_json(report, options_));
  }

  /// Writes a failure that is new or was shrunk further; returns false if there was nothing to write.
  bool keep(stress::StressFailure& failure, std::size_t i) {
    std::string text = stress::to_text(failure.repro);
    if (i < texts_.size() && texts_[i] == text) return false;
    const std::string before = failure.file;
    failure.file = name_for(failure.repro, text, before);
    io::write_file_atomically(folder_ / failure.file, text);
    std::error_code error;
    if (!before.empty() && before != failure.file) std::filesystem::remove(folder_ / before, error);
    texts_.resize(std::max(texts_.size(), i + 1));
    texts_[i] = std::move(text);
    return true;
  }

  /// Returns an unused name: a failure of another run stays, and the same failure is not written twice.
  std::string name_for(const stress::Repro& repro, const std::string& text, const std::string& own) const {
    const std::string base = "repro-" + repro.scene.family + "-" + repro.strategy + "-" + repro.scalar;
    std::error_code error;
    for (int i = 1;; ++i) {
      const std::string name = base + (i == 1 ? "" : "-" + std::to_string(i)) + ".json";
      const std::filesystem::path file = folder_ / name;
      if (name == own || !std::filesystem::exists(file, error)) return name;
      const bool readable =
          std::filesystem::is_regular_file(file, error) && std::filesystem::file_size(file, error) > 0;
      if (readable && io::read_file(file) == text) return name;
    }
  }

  std::filesystem::path folder_;
  const stress::StressOptions& options_;
  std::optional<ResultFile> file_;
  std::vector<std::string> texts_;  ///< text of each failure as written
  std::chrono::steady_clock::time_point written_{};
  std::string problem_;
};

int run(const StressArguments& arguments, bool strategies_named) {
  if (arguments.list) {
    for (const stress::Family& family : stress::families())
      print(fmt::format("{:<22} {}\n", family.name, family.meaning));
    return success;
  }
  if (!arguments.repro.empty()) return run_repro(arguments, strategies_named);
  stress::StressOptions options;
  for (const std::string& name : arguments.families) options.families.push_back(&stress::find_family(name));
  if (options.families.empty())
    for (const stress::Family& family : stress::families()) options.families.push_back(&family);
  options.contestants = contestants_of(arguments);
  options.scenes = arguments.scenes;
  options.seed = arguments.seed;
  for (const std::string& scalar : arguments.scalars)
    if (scalar != "float" && scalar != "double")
      throw io::InputError("--scalars: expected float or double, got " + io::printable(scalar));
  options.scalars = arguments.scalars;
  options.l = arguments.l;
  options.many_keyframes = arguments.many_keyframes;
  options.limits.seconds = arguments.seconds;
  options.vary = !arguments.plain;
  options.shrink = !arguments.no_shrink;
  const std::filesystem::path folder = arguments.out;
  StressFiles files(folder, options);
  Progress progress;
  const stress::StressReport report = stress::run_stress(
      options, [&](const std::string& what) { progress.show(what); },
      [&](stress::StressReport& so_far) { files.keep(so_far); });
  progress.clear();
  print(stress_table(report));
  for (const stress::StressFailure& failure : report.failures) {
    const stress::Repro& repro = failure.repro;
    say(repro.strategy + " on " + repro.scene.family + ", " + repro.scalar +
        ", l = " + std::to_string(failure.l) + ": " + repro.failure + " (made smaller from " +
        counted(failure.triangles_before, "triangle") + " to " + std::to_string(repro.scene.triangles()) +
        ")");
    if (!failure.file.empty()) say("kbvh stress --repro " + (folder / failure.file).string() + " shows it");
  }
  files.finish(report);
  for (const stress::StressRow& row : report.rows)
    if (row.failures() > 0) return guarantee_broken;
  return success;
}

}  // namespace

void add_stress(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("stress", "play adversarial scenes");
  command->footer(stress_examples);
  auto a = std::make_shared<StressArguments>();
  CLI::Option* strategies =
      add_words(*command, "--strategies", a->strategies, "as for run: ids, family:NAME, default, all, !ID");
  add_words(*command, "--families", a->families, "families of scenes (all)");
  add_whole(*command, "--scenes", a->scenes, {1, 10000000},
            "number of scenes, cycling through the families (100)");
  add_whole(*command, "--seed", a->seed, ranges::any, "seed of the scenes (1)");
  add_words(*command, "--scalars", a->scalars, "float, double (both)");
  add_wholes(*command, "--l", a->l, {1, 100000}, "frames for each keyframe interval (1,7,100)");
  add_texts(*command, "--param", a->params, "key=value or strategy.key=value; a list of values sweeps");
  add_whole(*command, "--many-keyframes", a->many_keyframes, {100, 10000000},
            "keyframes of the longest scene (100000)");
  add_number(*command, "--seconds", a->seconds, 0.001, 1e6,
             "processor time of a strategy on a scene; more counts as a hang (100)");
  command->add_flag("--plain", a->plain, "play every strategy in its usual configuration only");
  command->add_flag("--no-shrink", a->no_shrink, "do not shrink failures");
  command->add_flag("--list", a->list, "show the families");
  add_text(*command, "--repro", a->repro,
           "play the scene of this file with the strategy that it names, or with --strategies");
  add_text(*command, "--out", a->out, "folder for stress.json and repro files (none: the table only)");
  command->callback([&action, a, strategies] {
    const bool named = strategies->count() > 0;
    action = [a, named] { return run(*a, named); };
  });
}

}  // namespace kbvh::experiments
