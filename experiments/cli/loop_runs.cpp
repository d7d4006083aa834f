#include "experiments/cli/loop_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstddef>
#include <fstream>
#include <optional>

#include "experiments/cli/loop_tables.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/steps_left.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// The word for the finder that is no strategy.
constexpr const char* own_finder = "broad_phase";

void add_if_new(std::vector<std::string>& list, const std::string& value) {
  if (std::find(list.begin(), list.end(), value) == list.end()) list.push_back(value);
}

/// Shares a time among simulations: each next one gets an equal part of what is left.
class TimeShares {
 public:
  TimeShares(double seconds, std::size_t simulations) : seconds_(seconds), left_(simulations) {}
  /// Returns the seconds of the next simulation, positive; 0 if there is no limit.
  double next() {
    const double left = seconds_ - seconds_since(begin_), share = left / double(left_--);
    return seconds_ > 0 ? std::max(share, 1e-9) : 0;
  }

 private:
  double seconds_;
  std::size_t left_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// Reads all steps that a folder of a simulation has.
LiveSteps steps_in(const std::filesystem::path& folder) {
  LiveSteps steps;
  std::ifstream in(folder / "loop.jsonl");
  std::string line;
  std::getline(in, line);  // describes the simulation
  while (std::getline(in, line)) steps.add(json::parse(line));
  return steps;
}

LiveRun simulate_with(loop::SimulationOptions options, const LiveFinder& finder) {
  options.strategy = finder.strategy;
  LiveRun made{finder, {}, {}};
  Progress progress;
  StepsLeft left;
  std::uint64_t penetrations = 0;
  const auto begin = std::chrono::steady_clock::now();
  made.result = loop::simulate(options, [&](const json& record) {
    if (options.folder.empty()) made.steps.add(record);
    penetrations += record["penetrations"].get<std::uint64_t>();
    const auto step = record["step"].get<std::uint64_t>();
    const double seconds = seconds_since(begin);
    left.made(options.steps - step, seconds);
    const double limit = options.most_seconds > 0 ? options.most_seconds - seconds : left.seconds();
    progress.show(fmt::format("{}{}, {}: step {} of {}, {} contacts, {} iterates, {:.1f} ms, {} penetrations",
                              time_left_in_words(std::min(limit, left.seconds())), options.scene,
                              finder.label, step, options.steps, record["contacts"].get<std::uint64_t>(),
                              record["iterates"].get<std::uint64_t>(),
                              record["detect_ms"].get<double>() + record["impact_ms"].get<double>() +
                                  record["rest_ms"].get<double>(),
                              penetrations));
  });
  progress.clear();
  if (made.result.first_step > 0)
    say(finder.label + ": continued after step " + std::to_string(made.result.first_step));
  if (!options.folder.empty()) made.steps = steps_in(options.folder);
  return made;
}

/// Returns a label as the name of a folder.
std::string folder_name(const std::string& label) {
  std::string name;
  for (const char c : label) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
    if (plain || (!name.empty() && name.back() != '-')) name += plain ? c : '-';
  }
  while (!name.empty() && name.back() == '-') name.pop_back();
  return name;
}

/// An entry of the list "live": one scene or several, with the same finders.
struct LiveEntry {
  std::optional<std::string> name;
  std::vector<std::string> scenes;
  loop::SimulationOptions simulation;
  std::vector<StrategyRequest> requests;
  Sweep params;
  std::string place;  ///< in the plan

  const std::string& name_of(const std::string& scene) const { return name ? *name : scene; }
  bool has_folder_of_scenes() const { return name && scenes.size() > 1; }
  std::string title_of(const std::string& scene) const {
    return has_folder_of_scenes() ? *name + ", " + scene : name_of(scene);
  }
  std::filesystem::path folder_of(const std::string& scene) const {
    const std::filesystem::path folder = folder_name(name_of(scene));
    return has_folder_of_scenes() ? folder / scene : folder;
  }
};

LiveEntry read_entry(JsonReader& keys) {
  LiveEntry entry;
  entry.place = keys.place();
  loop::SimulationOptions& options = entry.simulation;
  const std::vector<std::string>& known = loop::scene_names();
  for (const std::string& scene : keys.words("scene")) {
    if (std::find(known.begin(), known.end(), scene) == known.end())
      keys.fail("scene", no_such("scene", scene, known));
    add_if_new(entry.scenes, scene);
  }
  if (entry.scenes.empty()) entry.scenes.push_back(options.scene);
  entry.name = keys.word("name");
  options.triangles = keys.whole("triangles", live_triangles).value_or(options.triangles);
  options.seed = keys.whole("seed", ranges::any).value_or(options.seed);
  options.steps = keys.whole("steps", live_steps).value_or(options.steps);
  for (const std::string& word : keys.words("strategies")) entry.requests.push_back({word, {}, {}});
  if (const json* given = keys.find("params")) entry.params = read_params(*given, keys.place() + ": params");
  keys.finish();
  return entry;
}

LiveStudy study_of(const LiveEntry& entry, const std::string& scene, const std::filesystem::path& out,
                   std::vector<std::string>& notes) {
  LiveStudy study{entry.title_of(scene), entry.simulation, {}};
  loop::SimulationOptions& options = study.simulation;
  options.scene = scene;
  if (!out.empty()) options.folder = out / entry.folder_of(scene);
  try {
    const loop::ContactMesh mesh(loop::make_scene(scene, options.triangles, options.seed).mesh);
    study.finders = live_finders(entry.requests, entry.params, mesh, notes);
  } catch (const ConfigError& problem) {
    throw io::InputError(entry.place + ": " + problem.what());
  }
  if (study.finders.empty()) study.finders.emplace_back();
  return study;
}

}  // namespace

std::vector<LiveFinder> live_finders(const std::vector<StrategyRequest>& requests, const Sweep& params,
                                     const loop::ContactMesh& mesh, std::vector<std::string>& notes) {
  std::vector<LiveFinder> finders;
  std::vector<StrategyRequest> strategies;
  for (const StrategyRequest& request : requests) {
    if (request.id != own_finder)
      strategies.push_back(request);
    else if (finders.empty())
      finders.emplace_back();
  }
  if (strategies.empty() && params.empty()) return finders;
  std::vector<std::string> left_out;
  for (const ContestantSpec& spec : expand(strategies, params, {}, left_out)) {
    const Info& info = spec.entry->info;
    LiveFinder finder{
        spec.label, {info.id, spec.given}, info.guarantee != Guarantee::approximate, info.baseline};
    try {
      loop::check_contact_strategy(finder.strategy, mesh);
    } catch (const ConfigError& problem) {
      const bool by_id = std::any_of(strategies.begin(), strategies.end(),
                                     [&](const StrategyRequest& request) { return request.id == info.id; });
      if (by_id) throw;
      left_out.push_back(std::string(problem.what()) + ": left out");
      continue;
    }
    finders.push_back(std::move(finder));
  }
  for (const std::string& note : left_out) add_if_new(notes, note);
  if (finders.empty()) throw ConfigError("none of these strategies can find the pairs of a simulation");
  return finders;
}

std::vector<LiveStudy> load_live_studies(const std::filesystem::path& plan, const std::filesystem::path& out,
                                         const std::vector<std::string>& only) {
  const std::string place = plan.string();
  const json said = parse_json(io::read_file(plan), place);
  if (!said.is_object() || !said.contains("live"))
    throw io::InputError(place + ": has no simulations, a list \"live\"");
  std::vector<LiveStudy> studies;
  std::vector<std::string> names, notes;
  std::vector<std::filesystem::path> folders;
  JsonReader whole(said, place);
  std::size_t count = 0;
  for (const json& one : whole.list("live")) {
    JsonReader keys(one, place + ": live[" + std::to_string(count++) + "]");
    const LiveEntry entry = read_entry(keys);
    for (const std::string& scene : entry.scenes) {
      const std::string& name = entry.name_of(scene);
      const std::filesystem::path folder = entry.folder_of(scene);
      if (std::find(folders.begin(), folders.end(), folder) != folders.end())
        keys.fail("name", "two simulations are called " + io::printable(folder.string()));
      folders.push_back(folder);
      add_if_new(names, name);
      if (only.empty() || std::find(only.begin(), only.end(), name) != only.end())
        studies.push_back(study_of(entry, scene, out, notes));
    }
  }
  for (const std::string& name : only)
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw io::InputError(place + ": live: " + no_such("study", name, names));
  for (const std::string& note : notes) say(note);
  return studies;
}

int run_live(const std::vector<LiveStudy>& studies, double seconds) {
  std::size_t simulations = 0;
  for (const LiveStudy& study : studies) simulations += study.finders.size();
  TimeShares shares(seconds, simulations);
  LiveTotals totals;
  int code = success;
  for (const LiveStudy& study : studies) {
    std::vector<LiveRun> runs;
    for (const LiveFinder& finder : study.finders) {
      loop::SimulationOptions options = study.simulation;
      options.most_seconds = shares.next();
      if (study.finders.size() > 1 && !options.folder.empty()) options.folder /= folder_name(finder.label);
      runs.push_back(simulate_with(options, finder));
    }
    if (&study != &studies.front()) print("\n");
    print_runs(study, runs);
    code = std::max(code, judge(studies.size() > 1 ? study.title : "", runs));
    totals.add(runs);
  }
  if (studies.size() > 1) {
    print("\n");
    totals.print_table();
  }
  return code;
}

}  // namespace kbvh::experiments
