#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/steps_left.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/loop/frames.hpp"
#include "experiments/loop/player.hpp"
#include "experiments/loop/simulation.hpp"
#include "experiments/results/table.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

constexpr const char* loop_examples = R"(Examples:
  kbvh loop --scene sphere --triangles 2000 --steps 200 --out results/loop
  kbvh loop --scene stack --detect kept --keep 1 --steps 100
  kbvh loop --scene walker --steps 10000 --save-every 100 --out results/walker
  kbvh loop --scene sheets --triangles 4000 --record --out results/sheets
  kbvh loop --play results/sheets/loop.recording
Simulates cloth or soft bodies whose contacts come from kbvh::broad_phase: implicit steps, a barrier that keeps surfaces
apart, no step beyond an impact. A pair that the broad phase loses is a penetration; after each step an exact check, which
does not use the broad phase, counts intersecting triangles. The scenes: sphere (a cloth falls onto a sphere), cloths (a
cloth onto a cloth held at its corners), sheets (six sheets onto a floor), stack (three soft boxes onto a floor), walker (a
figure that walks in three skirts), knot (a rope with a knot, pulled and let go).
DIR/loop.jsonl has a line for each step; the same command continues a run that was ended. --record writes the motions of all
iterates, which --play asks again in several ways, by turns, and compares with each other and with all pairs.
Exit codes: 0 no penetration and equal answers, 1 a penetration or a difference, 2 wrong use, 3 other error.)";

struct LoopArguments {
  loop::SimulationOptions simulation;
  loop::PlaySettings playing;
  std::string detect = "refit", out, recording, clip;
  double keep = 1;
};

/// Sums of the lines of the steps that were made now.
struct StepSums {
  std::uint64_t steps = 0, iterates = 0, questions = 0, searches = 0, candidates = 0, most_contacts = 0;
  std::uint64_t orders = 0;
  double detect_ms = 0, impact_ms = 0, rest_ms = 0, worst_ms = 0, smallest_gap = 0, largest_lag = 0;
  std::vector<double> resident_mb{};  ///< after each step

  void add(const json& record) {
    const double detect = record["detect_ms"], impact = record["impact_ms"], rest = record["rest_ms"],
                 gap = record["smallest_gap_m"];
    smallest_gap = steps == 0 ? gap : std::min(smallest_gap, gap);
    ++steps;
    iterates += record["iterates"].get<std::uint64_t>();
    orders += record["orders"].get<std::uint64_t>();
    largest_lag = std::max(largest_lag, record["lag_m"].get<double>());
    resident_mb.push_back(record["resident_bytes"].get<double>() / 1e6);
    questions += record["questions"].get<std::uint64_t>();
    searches += record["searches"].get<std::uint64_t>();
    candidates += record["candidates"].get<std::uint64_t>();
    most_contacts = std::max(most_contacts, record["contacts"].get<std::uint64_t>());
    detect_ms += detect;
    impact_ms += impact;
    rest_ms += rest;
    worst_ms = std::max(worst_ms, detect + impact + rest);
  }
};

/// Returns the largest memory in the first tenth of the steps and in the last one, in MB: what a run needs at
/// first, and whether it needs more and more.
std::string memory_text(const std::vector<double>& megabytes) {
  if (megabytes.empty()) return "-";
  const auto tenth = std::ptrdiff_t((megabytes.size() + 9) / 10);
  return fmt::format("{:.1f}, {:.1f}", *std::max_element(megabytes.begin(), megabytes.begin() + tenth),
                     *std::max_element(megabytes.end() - tenth, megabytes.end()));
}

std::string share_text(double value, std::uint64_t steps) {
  return steps == 0 ? "-" : fmt::format("{:.4g}", value / double(steps));
}

int run_simulation(LoopArguments arguments) {
  loop::SimulationOptions& options = arguments.simulation;
  const std::vector<std::string>& known = loop::scene_names();
  if (std::find(known.begin(), known.end(), options.scene) == known.end())
    throw io::InputError("--scene: " + no_such("scene", options.scene, known));
  options.detection = loop::detection(arguments.detect);
  options.keep = options.detection == loop::Detection::kept ? arguments.keep : 0;
  options.folder = arguments.out;
  if (options.record && options.folder.empty())
    throw io::InputError("--record: needs --out, the folder of the recording");
  if (options.frames_every > 0 && options.folder.empty())
    throw io::InputError("--frames: needs --out, the folder of the frames");
  Progress progress;
  StepSums sums;
  StepsLeft left;
  std::uint64_t penetrations = 0;
  const auto begin = std::chrono::steady_clock::now();
  const loop::SimulationResult result = loop::simulate(options, [&](const json& record) {
    sums.add(record);
    penetrations += record["penetrations"].get<std::uint64_t>();
    const auto made = record["step"].get<std::uint64_t>();
    left.made(options.steps - made, seconds_since(begin));
    progress.show(fmt::format("{}{}: step {} of {}, {} contacts, {} iterates, {:.1f} ms, {} penetrations",
                              time_left_in_words(left.seconds()), options.scene, made, options.steps,
                              record["contacts"].get<std::uint64_t>(),
                              record["iterates"].get<std::uint64_t>(),
                              record["detect_ms"].get<double>() + record["impact_ms"].get<double>() +
                                  record["rest_ms"].get<double>(),
                              penetrations));
  });
  progress.clear();
  if (result.first_step > 0) say("continued after step " + std::to_string(result.first_step));
  const std::uint64_t n = sums.steps;
  print(columns({{"of " + options.scene, ""},
                 {"steps", std::to_string(result.state.step)},
                 {"penetrations", std::to_string(result.penetrations)},
                 {"stalled steps", std::to_string(result.stalled)},
                 {"unconverged steps", std::to_string(result.unconverged)},
                 {"most contacts", std::to_string(sums.most_contacts)},
                 {"smallest gap, mm", fmt::format("{:.3g}", 1e3 * sums.smallest_gap)},
                 {"largest lag, mm", fmt::format("{:.3g}", 1e3 * sums.largest_lag)},
                 {"iterates", share_text(double(sums.iterates), n)},
                 {"orders", share_text(double(sums.orders), n)},
                 {"searches", share_text(double(sums.searches), n)},
                 {"candidates", share_text(double(sums.candidates), n)},
                 {"detection, ms", share_text(sums.detect_ms, n)},
                 {"impacts, ms", share_text(sums.impact_ms, n)},
                 {"rest, ms", share_text(sums.rest_ms, n)},
                 {"worst step, ms", fmt::format("{:.4g}", sums.worst_ms)},
                 {"memory, MB", memory_text(sums.resident_mb)}}));
  print("From iterates on, numbers are means over the " + counted(n, "step") +
        " made now, but for the worst step and the largest\nmemory, in the first and in the last tenth of "
        "these steps.\n");
  if (result.penetrations == 0) return success;
  say(counted(result.penetrations, "pair") + " of triangles penetrated, first after step " +
      std::to_string(result.first_penetration));
  return guarantee_broken;
}

int play_recording(const LoopArguments& arguments) {
  Progress progress;
  loop::PlayResult result;
  try {
    result = loop::play(arguments.recording, arguments.playing, [&](std::uint64_t iterates) {
      progress.show("playing " + arguments.recording + ": iterate " + std::to_string(iterates));
    });
  } catch (const io::InputError& problem) {
    throw io::InputError(std::string("--play: ") + problem.what());
  }
  progress.clear();
  std::vector<std::vector<std::string>> table{{"question", "way", "ms an iterate", "over refit", "searches",
                                               "pairs an iterate", "differences", "lacking"}};
  for (const loop::PlayedWay& way : result.ways)
    table.push_back({loop::name(way.question),
                     way.keep > 0 ? fmt::format("kept, {:g} radii", way.keep) : loop::name(way.detection),
                     share_text(1e3 * way.seconds, result.iterates), fmt::format("{:.2f}", way.over_refit),
                     std::to_string(way.searches), share_text(double(way.listed), result.iterates),
                     std::to_string(way.differences), std::to_string(way.lacking)});
  print(columns(table));
  print(counted(result.iterates, "iterate") + " of " + counted(result.steps, "step") + "; " +
        counted(result.truths, "iterate") + " compared with all pairs, " +
        counted(result.true_pairs, "pair") + " within the radius.\n");
  if (result.agree()) return success;
  say("the ways differ, or lack pairs");
  return guarantee_broken;
}

int write_clip(const LoopArguments& arguments) {
  const std::uint64_t count =
      loop::save_iterates(arguments.recording, arguments.clip, arguments.playing.most_iterates);
  print(counted(count, "iterate") + " written. To play them with any strategy:\n  kbvh run --body " +
        arguments.clip + "/iterates.obj,motion=" + arguments.clip + "/iterates.pc2 --self --l 1\n");
  return success;
}

int run_loop(const LoopArguments& arguments) {
  try {
    if (!arguments.clip.empty()) return write_clip(arguments);
    return arguments.recording.empty() ? run_simulation(arguments) : play_recording(arguments);
  } catch (const std::invalid_argument& problem) {
    throw io::InputError(problem.what());
  }
}

}  // namespace

void add_loop(CLI::App& program, Action& action) {
  CLI::App* command =
      program.add_subcommand("loop", "simulate contacts that the broad phase finds, or replay them");
  command->footer(loop_examples);
  auto a = std::make_shared<LoopArguments>();
  loop::SimulationOptions& options = a->simulation;
  CLI::Option* of_simulations[] = {
      add_text(*command, "--scene", options.scene, "sphere, cloths, sheets, stack, walker or knot (sphere)"),
      add_whole(*command, "--triangles", options.triangles, {8, 1u << 24},
                "of the moving bodies, about (2000)"),
      add_whole(*command, "--seed", options.seed, ranges::any, "of the scene's random numbers (1)"),
      add_whole(*command, "--steps", options.steps, {1, 100000000},
                "of 0.01 s, those of an earlier run included (200)"),
      add_text(*command, "--detect", a->detect, "rebuild, refit or kept (refit)"),
      add_number(*command, "--keep", a->keep, 1e-3, 1e3,
                 "with kept: how far vertices move until candidates are found again, in radii (1)"),
      add_whole(*command, "--save-every", options.save_every, {1, 1000000},
                "steps between two saved states (10)"),
      add_text(*command, "--out", a->out, "folder for results and for continuing (none: the table only)"),
      add_whole(*command, "--frames", options.frames_every, {1, 1000000},
                "steps between two frames in DIR/frames, as OBJ files (none)"),
      command->add_flag("--record", options.record, "also write DIR/loop.recording")};
  CLI::Option* play = add_text(*command, "--play", a->recording, "replay this recording");
  for (CLI::Option* option : of_simulations) play->excludes(option);
  add_whole(*command, "--truth-every", a->playing.truth_every, {0, 1000000000},
            "with --play: compare one iterate of so many with all pairs; 0: none (100)")
      ->needs(play);
  add_whole(*command, "--iterates", a->playing.most_iterates, {1, 1000000000},
            "with --play: stop after so many")
      ->needs(play);
  add_text(*command, "--clip", a->clip,
           "with --play: instead write the iterates to this folder, as a clip for kbvh run")
      ->needs(play);
  add_whole(*command, "--lose", options.lose_every, {1, 1000000},
            "a fault, to see what it does: lose one pair of so many");
  command->callback([&action, a] { action = [a] { return run_loop(*a); }; });
}

}  // namespace kbvh::experiments
