#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/loop_runs.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/loop/frames.hpp"
#include "experiments/loop/player.hpp"
#include "experiments/results/table.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* loop_examples = R"(Examples:
  kbvh loop --scene sphere --triangles 2000 --steps 200 --out results/loop
  kbvh loop --scene stack --detect kept --keep 1 --steps 100
  kbvh loop --scene walker --steps 10000 --save-every 100 --out results/walker
  kbvh loop --scene sheets --triangles 4000 --record --out results/sheets
  kbvh loop --play results/sheets/loop.recording
  kbvh loop --play results/sheets/loop.recording --strategies bottom_up,leaf_slabs,lbvh
  kbvh loop --scene sphere --strategies broad_phase,bottom_up,leaf_slabs,lbvh --steps 100
  kbvh loop --plan experiments/plans/loop.json --study small --seconds 600 --out results/live
Simulates cloth or soft bodies whose contacts come from kbvh::broad_phase: implicit steps, a barrier that keeps surfaces
apart, no step beyond an impact. A pair that the broad phase loses is a penetration; after each step an exact check, which
does not use the broad phase, counts intersecting triangles. --strategies lets strategies find the pairs instead, each in a
simulation of its own: those that need no foresight, take control nets and answer pairs within a body (kbvh list). Exact
ones must give equal states after every step. Of several, each has the folder DIR/NAME. The scenes: sphere (a cloth falls onto a sphere), cloths (a
cloth onto a cloth held at its corners), sheets (six sheets onto a floor), stack (three soft boxes onto a floor), walker (a
figure that walks in three skirts), knot (a rope with a knot, pulled and let go).
DIR/loop.jsonl has a line for each step; the same command continues a run that was ended, by --seconds or otherwise.
--record writes the motions of all iterates, which --play asks again in several ways, by turns, and compares with each
other and with all pairs. With --strategies, these take part: they answer candidates and impacts, not exact distances.
Exit codes: 0 no penetration and equal answers, 1 a penetration or a difference, 2 wrong use, 3 other error.)";

struct LoopArguments {
  loop::SimulationOptions simulation;
  loop::PlaySettings playing;
  std::string detect = "refit", out, recording, clip, plan;
  std::vector<std::string> strategies, params, studies;
  double keep = 1, seconds = 0;
  bool has_steps = false;  // --steps was given
};

std::string share_text(double value, std::uint64_t steps) {
  return steps == 0 ? "-" : fmt::format("{:.4g}", value / double(steps));
}

/// Returns --param as a sweep.
Sweep sweep_of(const std::vector<std::string>& params) {
  Sweep sweep;
  for (const std::string& text : params) {
    const auto assignment = parse_assignment(text);
    if (!assignment)
      throw io::InputError("--param: expected key=value or strategy.key=value, got " + io::printable(text));
    sweep[assignment->first] = split(assignment->second, ',');
  }
  return sweep;
}

/// Returns the finders of --strategies and --param; none without both. A refusal ends with `otherwise`.
std::vector<LiveFinder> finders_of(const LoopArguments& arguments, const loop::ContactMesh& mesh,
                                   const std::string& otherwise = "") {
  const Sweep params = sweep_of(arguments.params);
  if (arguments.strategies.empty()) {
    if (!params.empty())
      throw io::InputError("--param: " + io::printable(params.begin()->first) + " goes with --strategies");
    return {};
  }
  std::vector<StrategyRequest> requests;
  for (const std::string& word : arguments.strategies) requests.push_back({word, {}, {}});
  std::vector<std::string> notes;
  try {
    const std::vector<LiveFinder> finders = live_finders(requests, params, mesh, notes);
    for (const std::string& note : notes) say(note);
    return finders;
  } catch (const ConfigError& problem) {
    throw io::InputError(std::string("--strategies: ") + problem.what() + otherwise);
  }
}

int run_simulation(const LoopArguments& arguments) {
  LiveStudy study;
  study.simulation = arguments.simulation;
  loop::SimulationOptions& options = study.simulation;
  const std::vector<std::string>& known = loop::scene_names();
  if (std::find(known.begin(), known.end(), options.scene) == known.end())
    throw io::InputError("--scene: " + no_such("scene", options.scene, known));
  study.title = options.scene;
  options.detection = loop::detection(arguments.detect);
  options.keep = options.detection == loop::Detection::kept ? arguments.keep : 0;
  options.folder = arguments.out;
  if (options.record && options.folder.empty())
    throw io::InputError("--record: needs --out, the folder of the recording");
  if (options.frames_every > 0 && options.folder.empty())
    throw io::InputError("--frames: needs --out, the folder of the frames");
  study.finders = finders_of(
      arguments, loop::ContactMesh(loop::make_scene(options.scene, options.triangles, options.seed).mesh));
  if (study.finders.empty()) study.finders.emplace_back();
  return run_live({study}, arguments.seconds);
}

int run_plan_file(const LoopArguments& arguments) {
  std::vector<LiveStudy> studies = load_live_studies(arguments.plan, arguments.out, arguments.studies);
  for (LiveStudy& study : studies) {
    study.simulation.save_every = arguments.simulation.save_every;
    study.simulation.lose_every = arguments.simulation.lose_every;
    if (arguments.has_steps) study.simulation.steps = arguments.simulation.steps;
  }
  return run_live(studies, arguments.seconds);
}

/// Returns what the table calls a way.
std::string way_text(const loop::PlayedWay& way) {
  if (!way.strategy.empty()) return way.strategy;
  return way.keep > 0 ? fmt::format("kept, {:g} radii", way.keep) : loop::name(way.detection);
}

/// Reads a recording; messages about it begin with the option.
template <class Read>
auto from_recording(const Read& read) {
  try {
    return read();
  } catch (const io::InputError& problem) {
    throw io::InputError(std::string("--play: ") + problem.what());
  }
}

int play_recording(const LoopArguments& arguments) {
  loop::PlaySettings settings = arguments.playing;
  settings.lose_every = arguments.simulation.lose_every;
  const loop::ContactMesh mesh =
      from_recording([&] { return loop::RecordingReader(arguments.recording).header().mesh; });
  const char* const otherwise =
      "; --clip writes the iterates for `kbvh run`, which knows their motion in advance";
  for (const LiveFinder& finder : finders_of(arguments, mesh, otherwise))
    if (!finder.strategy.id.empty())  // kbvh::broad_phase always takes part
      settings.strategies.push_back({finder.label, finder.strategy, finder.exact});
  Progress progress;
  const loop::PlayResult result = from_recording([&] {
    return loop::play(arguments.recording, settings, [&](std::uint64_t iterates) {
      progress.show("playing " + arguments.recording + ": iterate " + std::to_string(iterates));
    });
  });
  progress.clear();
  std::vector<std::vector<std::string>> table{{"question", "way", "ms an iterate", "over refit", "searches",
                                               "pairs an iterate", "differences", "lacking"}};
  for (const loop::PlayedWay& way : result.ways)
    table.push_back({loop::name(way.question), way_text(way), share_text(1e3 * way.seconds, result.iterates),
                     fmt::format("{:.2f}", way.over_refit), std::to_string(way.searches),
                     share_text(double(way.listed), result.iterates), std::to_string(way.differences),
                     std::to_string(way.lacking)});
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
    if (!arguments.plan.empty()) return run_plan_file(arguments);
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
  CLI::Option* detect = add_text(*command, "--detect", a->detect, "rebuild, refit or kept (refit)");
  CLI::Option* keep =
      add_number(*command, "--keep", a->keep, 1e-3, 1e3,
                 "with kept: how far vertices move until candidates are found again, in radii (1)");
  CLI::Option* strategies =
      add_words(*command, "--strategies", a->strategies,
                "find the pairs by strategies instead, one simulation each: ids, family:NAME, !x, and "
                "broad_phase to compare with");
  strategies->excludes(detect)->excludes(keep);
  CLI::Option* params =
      add_texts(*command, "--param", a->params,
                "key=value or strategy.key=value, of these strategies; a list of values sweeps");
  CLI::Option* steps =
      add_whole(*command, "--steps", options.steps, live_steps,
                "of 0.01 s, those of an earlier run included (200; with --plan those that it says)");
  CLI::Option* of_scene[] = {
      detect,
      keep,
      add_text(*command, "--scene", options.scene, "sphere, cloths, sheets, stack, walker or knot (sphere)"),
      add_whole(*command, "--triangles", options.triangles, live_triangles,
                "of the moving bodies, about (2000)"),
      add_whole(*command, "--seed", options.seed, ranges::any, "of the scene's random numbers (1)"),
      add_whole(*command, "--frames", options.frames_every, {1, 1000000},
                "steps between two frames in DIR/frames, as OBJ files (none)"),
      command->add_flag("--record", options.record, "also write DIR/loop.recording")};
  CLI::Option* of_simulations[] = {
      steps,
      add_number(*command, "--seconds", a->seconds, 1e-3, 1e9,
                 "of all simulations, which get equal parts; the same command goes on where they end (no "
                 "limit)"),
      add_whole(*command, "--save-every", options.save_every, {1, 1000000},
                "steps between two saved states (10)"),
      add_text(*command, "--out", a->out, "folder for results and for continuing (none: the table only)")};
  CLI::Option* plan = add_text(*command, "--plan", a->plan,
                               "run the simulations of this plan's list \"live\", see RESULTS.md");
  CLI::Option* play = add_text(*command, "--play", a->recording, "replay this recording");
  add_texts(*command, "--study", a->studies, "run only the simulations of this name; repeatable")
      ->needs(plan);
  plan->excludes(play)->excludes(strategies)->excludes(params);
  for (CLI::Option* option : of_scene) {
    plan->excludes(option);
    play->excludes(option);
  }
  for (CLI::Option* option : of_simulations) play->excludes(option);
  add_whole(*command, "--truth-every", a->playing.truth_every, {0, 1000000000},
            "with --play: compare one iterate of so many with all pairs; 0: none (100)")
      ->needs(play);
  add_whole(*command, "--iterates", a->playing.most_iterates, {1, 1000000000},
            "with --play: stop after so many")
      ->needs(play);
  add_text(*command, "--clip", a->clip,
           "with --play: instead write the iterates to this folder, as a clip for kbvh run")
      ->needs(play)
      ->excludes(strategies);
  add_whole(*command, "--lose", options.lose_every, {1, 1000000},
            "a fault, to see what it does: lose one pair of so many");
  command->callback([&action, a, steps] {
    a->has_steps = steps->count() > 0;
    action = [a] { return run_loop(*a); };
  });
}

}  // namespace kbvh::experiments
