#include "experiments/program.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "core/base/params.hpp"
#include "experiments/cli.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/machine.hpp"
#include "experiments/progress.hpp"
#include "experiments/text.hpp"

namespace kbvh::experiments {

namespace {

/// CLI11's messages may have several lines; one sentence is wanted.
std::string one_line(std::string text) {
  for (char& c : text)
    if (c == '\n') c = ' ';
  text.erase(text.find_last_not_of(' ') + 1);
  return text;
}

std::string version() {
  return "kbvh, commit " + commit() + (dirty() ? " with changes" : "");
}

}  // namespace

int run_program(int argc, const char* const* argv) {
  Action action;
  CLI::App program("kbvh compares ways to keep bounding volume hierarchies valid while meshes deform.",
                   "kbvh");
  program.set_version_flag("--version", version());
  program.footer(
      "Example:\n  kbvh run --scene tablecloth --triangles 2000 --out results && kbvh report --out results\n"
      "Each command has its own --help.");
  program.require_subcommand(1);
  add_list(program, action);
  add_run(program, action);
  add_bench(program, action);
  add_report(program, action);
  add_scene(program, action);
  add_theory(program, action);
  add_stress(program, action);
  add_ccd(program, action);
  // CLI11 would only say that a command is missing.
  std::vector<std::string> commands;
  for (const CLI::App* command : program.get_subcommands({})) commands.push_back(command->get_name());
  if (argc > 1 && argv[1][0] != '-' &&
      std::find(commands.begin(), commands.end(), argv[1]) == commands.end()) {
    say("there is no command '" + std::string(argv[1]) + "'; known are " + joined(commands) +
        " (try --help)");
    return wrong_use;
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    // Help and version arrive here as well, with code 0, and print themselves.
    if (problem.get_exit_code() == 0) return program.exit(problem);
    say(one_line(problem.what()) + " (try --help)");
    return wrong_use;
  }
  try {
    return action();
  } catch (const io::InputError& problem) {
    say(one_line(problem.what()));
    return wrong_use;
  } catch (const ConfigError& problem) {
    say(one_line(problem.what()));
    return wrong_use;
  } catch (const std::exception& problem) {
    say(std::string("internal error: ") + one_line(problem.what()));
    return internal_error;
  }
}

}  // namespace kbvh::experiments
