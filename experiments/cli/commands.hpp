#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/run/run_plan.hpp"

namespace kbvh::experiments {

/// One subcommand: its declaration to CLI11, and its action once the command line is read (returns the exit
/// code). The called subcommand sets `action`.
using Action = std::function<int()>;

void add_list(CLI::App& program, Action& action);
void add_run(CLI::App& program, Action& action);
void add_bench(CLI::App& program, Action& action);
void add_report(CLI::App& program, Action& action);
void add_explore(CLI::App& program, Action& action);
void add_merge(CLI::App& program, Action& action);
void add_scene(CLI::App& program, Action& action);
void add_theory(CLI::App& program, Action& action);
void add_stress(CLI::App& program, Action& action);
void add_ccd(CLI::App& program, Action& action);
void add_loop(CLI::App& program, Action& action);
void add_lab(CLI::App& program, Action& action);
void add_data(CLI::App& program, Action& action);

/// Runs a program of PATH, passes on its output, waits for it and returns its exit code. Throws
/// io::InputError if it cannot be started.
int run_and_wait(std::vector<std::string> words);

/// The options of `run` and `bench` on the command line. Strings stay as given until `plan_of` turns them
/// into the equivalent plan.
struct StudyOptions {
  std::string plan_file, out, scene, name, clip, script, changes, rays, within, kernels, job, prepare;
  std::vector<std::string> bodies, pairs, strategies, scalars, params, studies, orders, builders;
  std::vector<std::uint64_t> triangles, seeds, l, widths, leaf_sizes;
  std::uint64_t obstacle = 0, keyframes = 0, repetitions = 0, frames_limit = 0, oracle_every = 0;
  double radius = -1, interval_width = -1, seconds = -1;  ///< negative: not given
  bool print_plan = false, list_jobs = false, self = false, continuous = false, names = false;
};

/// Keeps only the studies of a plan file whose name is among `names` (a study without a name has the plan's),
/// and removes its targets, which concern all studies together. Throws io::InputError, beginning with
/// `place`, for a name that no study has.
void keep_studies(nlohmann::json& plan, const std::vector<std::string>& names, const std::string& place);

/// Returns the plan that is equivalent to the options (without `plan_file`, which is read separately). Throws
/// io::InputError.
nlohmann::json plan_of(const StudyOptions& options);

}  // namespace kbvh::experiments
