#include "experiments/cli/loop_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstddef>
#include <optional>

#include "experiments/cli/program.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/steps_left.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/table.hpp"
#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// The word for the finder that is no strategy.
constexpr const char* own_finder = "broad_phase";

/// Returns the largest memory in the first tenth of the steps and in the last one, in MB: what a run needs at
/// first, and whether it needs more and more.
std::string memory_text(const std::vector<double>& megabytes) {
  if (megabytes.empty()) return "-";
  const auto tenth = std::ptrdiff_t((megabytes.size() + 9) / 10);
  return fmt::format("{:.1f}, {:.1f}", *std::max_element(megabytes.begin(), megabytes.begin() + tenth),
                     *std::max_element(megabytes.end() - tenth, megabytes.end()));
}

std::string mean_text(double sum, std::uint64_t steps) {
  return steps == 0 ? "-" : fmt::format("{:.4g}", sum / double(steps));
}

/// Returns the first step that both made and after which their states differ.
std::optional<std::uint64_t> first_difference(const StepSums& a, const StepSums& b) {
  for (const auto& [step, state] : a.states) {
    const auto other = b.states.find(step);
    if (other != b.states.end() && other->second != state) return step;
  }
  return {};
}

LiveRun simulate_with(loop::SimulationOptions options, const LiveFinder& finder) {
  options.strategy = finder.strategy;
  LiveRun made{finder, {}, {}};
  Progress progress;
  StepsLeft left;
  std::uint64_t penetrations = 0;
  const auto begin = std::chrono::steady_clock::now();
  made.result = loop::simulate(options, [&](const json& record) {
    made.sums.add(record);
    penetrations += record["penetrations"].get<std::uint64_t>();
    const auto step = record["step"].get<std::uint64_t>();
    left.made(options.steps - step, seconds_since(begin));
    progress.show(fmt::format("{}{}, {}: step {} of {}, {} contacts, {} iterates, {:.1f} ms, {} penetrations",
                              time_left_in_words(left.seconds()), options.scene, finder.label, step,
                              options.steps, record["contacts"].get<std::uint64_t>(),
                              record["iterates"].get<std::uint64_t>(),
                              record["detect_ms"].get<double>() + record["impact_ms"].get<double>() +
                                  record["rest_ms"].get<double>(),
                              penetrations));
  });
  progress.clear();
  if (made.result.first_step > 0)
    say(finder.label + ": continued after step " + std::to_string(made.result.first_step));
  return made;
}

void print_one(const LiveStudy& study, const LiveRun& one) {
  const StepSums& sums = one.sums;
  const std::uint64_t n = sums.steps;
  std::string found_by = one.finder.label;
  if (one.finder.strategy.id.empty()) found_by += std::string(", ") + loop::name(study.simulation.detection);
  print(columns({{"of " + study.title, ""},
                 {"pairs found by", found_by},
                 {"steps", std::to_string(one.result.state.step)},
                 {"penetrations", std::to_string(one.result.penetrations)},
                 {"stalled steps", std::to_string(one.result.stalled)},
                 {"unconverged steps", std::to_string(one.result.unconverged)},
                 {"most contacts", std::to_string(sums.most_contacts)},
                 {"smallest gap, mm", fmt::format("{:.3g}", 1e3 * sums.smallest_gap)},
                 {"largest lag, mm", fmt::format("{:.3g}", 1e3 * sums.largest_lag)},
                 {"iterates", mean_text(double(sums.iterates), n)},
                 {"orders", mean_text(double(sums.orders), n)},
                 {"searches", mean_text(double(sums.searches), n)},
                 {"candidates", mean_text(double(sums.candidates), n)},
                 {"detection, ms", mean_text(sums.detect_ms, n)},
                 {"impacts, ms", mean_text(sums.impact_ms, n)},
                 {"rest, ms", mean_text(sums.rest_ms, n)},
                 {"worst step, ms", fmt::format("{:.4g}", sums.worst_ms)},
                 {"memory, MB", memory_text(sums.resident_mb)}}));
  print("From iterates on, numbers are means over the " + counted(n, "step") +
        " made now, but for the worst step and the largest\nmemory, in the first and in the last tenth of "
        "these steps.\n");
}

/// Returns the run with which the others are compared: the first exact one, else the first.
const LiveRun& reference_of(const std::vector<LiveRun>& runs) {
  for (const LiveRun& one : runs)
    if (one.finder.exact) return one;
  return runs.front();
}

/// Returns the shortest mean detection of a baseline in ms; 0 if there is none.
double best_refit_ms(const std::vector<LiveRun>& runs) {
  double best = 0;
  for (const LiveRun& one : runs) {
    if (!one.finder.baseline || one.sums.steps == 0) continue;
    const double mean = one.sums.detect_ms / double(one.sums.steps);
    if (best == 0 || mean < best) best = mean;
  }
  return best;
}

void print_several(const LiveStudy& study, const std::vector<LiveRun>& runs) {
  const double best = best_refit_ms(runs);
  const LiveRun& reference = reference_of(runs);
  std::vector<std::vector<std::string>> table{{"of " + study.title, "detection, ms", "over refit",
                                               "impacts, ms", "rest, ms", "worst, ms", "penetrations",
                                               "states"}};
  for (const LiveRun& one : runs) {
    const StepSums& sums = one.sums;
    const std::uint64_t n = sums.steps;
    const std::optional<std::uint64_t> differs = first_difference(reference.sums, sums);
    table.push_back(
        {one.finder.label, mean_text(sums.detect_ms, n),
         best > 0 && sums.detect_ms > 0 ? fmt::format("{:.2f}", best * double(n) / sums.detect_ms) : "-",
         mean_text(sums.impact_ms, n), mean_text(sums.rest_ms, n), fmt::format("{:.4g}", sums.worst_ms),
         std::to_string(one.result.penetrations),
         &one == &reference ? "-"
         : differs          ? "differ at " + std::to_string(*differs)
                            : "equal"});
  }
  print(columns(table, longest_line));
  print(
      "Times are means over the steps made now, but for the worst step. Over refit: detection of the "
      "table's\n"
      "fastest refit over that of the line. States: those after every step, compared with those of\n" +
      reference.finder.label + ".\n");
}

/// Says what is wrong with runs, and returns the exit code.
int judge(const std::vector<LiveRun>& runs) {
  int code = success;
  const LiveRun& reference = reference_of(runs);
  for (const LiveRun& one : runs) {
    const std::string whose = runs.size() > 1 ? one.finder.label + ": " : "";
    if (one.result.penetrations > 0) {
      say(whose + counted(one.result.penetrations, "pair") + " of triangles penetrated, first after step " +
          std::to_string(one.result.first_penetration));
      code = guarantee_broken;
    }
    if (one.result.too_near) {
      say(whose + "ended after step " + std::to_string(one.result.state.step) +
          ", which left two surfaces nearer than their thickness: a pair had been lost");
      code = guarantee_broken;
    }
    const std::optional<std::uint64_t> differs = first_difference(reference.sums, one.sums);
    if (differs && one.finder.exact && reference.finder.exact) {
      say(whose + "another trajectory than " + reference.finder.label + ", from step " +
          std::to_string(*differs) + " on");
      code = guarantee_broken;
    }
  }
  return code;
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

}  // namespace

void StepSums::add(const json& record) {
  const double detect = record["detect_ms"], impact = record["impact_ms"], rest = record["rest_ms"],
               gap = record["smallest_gap_m"];
  smallest_gap = steps == 0 ? gap : std::min(smallest_gap, gap);
  ++steps;
  iterates += record["iterates"].get<std::uint64_t>();
  orders += record["orders"].get<std::uint64_t>();
  largest_lag = std::max(largest_lag, record["lag_m"].get<double>());
  resident_mb.push_back(record["resident_bytes"].get<double>() / 1e6);
  states[record["step"].get<std::uint64_t>()] = record["state"].get<std::string>();
  questions += record["questions"].get<std::uint64_t>();
  searches += record["searches"].get<std::uint64_t>();
  candidates += record["candidates"].get<std::uint64_t>();
  most_contacts = std::max(most_contacts, record["contacts"].get<std::uint64_t>());
  detect_ms += detect;
  impact_ms += impact;
  rest_ms += rest;
  worst_ms = std::max(worst_ms, detect + impact + rest);
}

std::vector<LiveFinder> live_finders(const std::vector<StrategyRequest>& requests, const Sweep& params,
                                     const loop::SimulationOptions& simulation) {
  std::vector<LiveFinder> finders;
  std::vector<StrategyRequest> strategies;
  for (const StrategyRequest& request : requests) {
    if (request.id != own_finder)
      strategies.push_back(request);
    else if (finders.empty())
      finders.emplace_back();
  }
  if (strategies.empty() && params.empty()) return finders;
  std::vector<std::string> notes;
  const std::vector<ContestantSpec> chosen = expand(strategies, params, {}, notes);
  const loop::ContactMesh mesh(
      loop::make_scene(simulation.scene, simulation.triangles, simulation.seed).mesh);
  for (const ContestantSpec& spec : chosen) {
    const Info& info = spec.entry->info;
    LiveFinder finder{
        spec.label, {info.id, spec.given}, info.guarantee != Guarantee::approximate, info.baseline};
    try {
      loop::check_contact_strategy(finder.strategy, mesh);
    } catch (const ConfigError& problem) {
      const bool by_id = std::any_of(strategies.begin(), strategies.end(),
                                     [&](const StrategyRequest& request) { return request.id == info.id; });
      if (by_id) throw;
      notes.push_back(std::string(problem.what()) + ": left out");
      continue;
    }
    finders.push_back(std::move(finder));
  }
  for (const std::string& note : notes) say(note);
  if (finders.empty()) throw ConfigError("none of these strategies can find the pairs of a simulation");
  return finders;
}

std::vector<LiveStudy> load_live_studies(const std::filesystem::path& plan,
                                         const std::filesystem::path& out) {
  const std::string place = plan.string();
  const json said = parse_json(io::read_file(plan), place);
  if (!said.is_object() || !said.contains("live"))
    throw io::InputError(place + ": has no simulations, a list \"live\"");
  std::vector<LiveStudy> studies;
  JsonReader whole(said, place);
  for (const json& one : whole.list("live")) {
    JsonReader keys(one, place + ": live[" + std::to_string(studies.size()) + "]");
    LiveStudy study;
    loop::SimulationOptions& options = study.simulation;
    options.scene = keys.word("scene").value_or(options.scene);
    const std::vector<std::string>& known = loop::scene_names();
    if (std::find(known.begin(), known.end(), options.scene) == known.end())
      keys.fail("scene", no_such("scene", options.scene, known));
    study.title = keys.word("name").value_or(options.scene);
    const std::string folder = folder_name(study.title);
    for (const LiveStudy& other : studies)
      if (folder_name(other.title) == folder)
        keys.fail("name", "two simulations are called " + io::printable(folder));
    if (!out.empty()) options.folder = out / folder;
    options.triangles = keys.whole("triangles", live_triangles).value_or(options.triangles);
    options.seed = keys.whole("seed", ranges::any).value_or(options.seed);
    options.steps = keys.whole("steps", live_steps).value_or(options.steps);
    std::vector<StrategyRequest> requests;
    for (const std::string& word : keys.words("strategies")) requests.push_back({word, {}, {}});
    Sweep params;
    if (const json* given = keys.find("params")) params = read_params(*given, keys.place() + ": params");
    keys.finish();
    try {
      study.finders = live_finders(requests, params, options);
    } catch (const ConfigError& problem) {
      throw io::InputError(keys.place() + ": " + problem.what());
    }
    if (study.finders.empty()) study.finders.emplace_back();
    studies.push_back(std::move(study));
  }
  return studies;
}

int run_live(const LiveStudy& study) {
  std::vector<LiveRun> runs;
  for (const LiveFinder& finder : study.finders) {
    loop::SimulationOptions options = study.simulation;
    if (study.finders.size() > 1 && !options.folder.empty()) options.folder /= folder_name(finder.label);
    runs.push_back(simulate_with(options, finder));
  }
  if (runs.size() == 1)
    print_one(study, runs.front());
  else
    print_several(study, runs);
  return judge(runs);
}

}  // namespace kbvh::experiments
