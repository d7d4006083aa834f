#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/run/run_plan.hpp"

namespace kbvh::experiments {

/// One subcommand: declared to CLI11, and what it does once the command line is read (its exit code).
/// `action` is set by the subcommand that was called.
using Action = std::function<int()>;

void add_list(CLI::App& program, Action& action);
void add_run(CLI::App& program, Action& action);
void add_bench(CLI::App& program, Action& action);
void add_report(CLI::App& program, Action& action);
void add_scene(CLI::App& program, Action& action);
void add_theory(CLI::App& program, Action& action);
void add_stress(CLI::App& program, Action& action);
void add_ccd(CLI::App& program, Action& action);

/// Runs a program of PATH, prints what it prints, and waits for it; its exit code. Throws io::InputError if
/// it cannot be started.
int run_and_wait(std::vector<std::string> words);

/// `run` and `bench` as said on the command line. Strings are kept as given, until `plan_of` turns them into
/// the plan that a file would hold.
struct StudyOptions {
  std::string plan_file, out, scene, name, clip, script;
  std::vector<std::string> bodies, strategies, scalars, params, studies, orders, builders;
  std::vector<std::uint64_t> triangles, seeds, l, widths, leaf_sizes;
  std::uint64_t obstacle = 0, keyframes = 0, repetitions = 0, frames_limit = 0, oracle_every = 0;
  bool print_plan = false, self = false, continuous = false;
};

/// Leaves only the studies of a plan file whose name is among `names` (a study without a name has the
/// plan's), and takes its targets out, which are about all studies together. Throws io::InputError, beginning
/// with `place`, for a name that no study has.
void keep_studies(nlohmann::json& plan, const std::vector<std::string>& names, const std::string& place);

/// The plan that the options say, as a plan file would (without `plan_file`, which is read by itself).
/// Throws io::InputError.
nlohmann::json plan_of(const StudyOptions& options);

}  // namespace kbvh::experiments
