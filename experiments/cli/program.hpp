#pragma once

/// The kbvh program: lists, runs, benchmarks and reports. It is a library: a project with strategies of its
/// own gets the whole program by linking it with its own manifest.
namespace kbvh::experiments {

/// The exit codes of the program.
enum ExitCode : int {
  success = 0,
  guarantee_broken = 1,  ///< everything ran, but a contestant violated its declared guarantee or tightness
  wrong_use = 2,         ///< wrong command line, plan, parameter or input file; one sentence on stderr
  internal_error = 3,    ///< anything else, for example standard output on a full disk
};

/// Runs the whole program; `argv` as given to main. Prints results on stdout and everything else on stderr.
int run_program(int argc, const char* const* argv);

}  // namespace kbvh::experiments
