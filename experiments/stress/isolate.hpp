#pragma once
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace kbvh::experiments::stress {

/// The outcome of a job in a child process.
struct JobOutcome {
  enum class End : unsigned char {
    finished,  ///< `said` is the returned text
    crashed,   ///< the process ended without an answer; `said` gives the signal or status
    hung,      ///< the job exceeded its time and was stopped
  };
  End end = End::finished;
  std::string said;
};

/// Runs jobs 0, 1, ... in child processes, so that no job can end this process: work(i) is called in a copy
/// of this process, and its text is returned. One child runs jobs until it ends; after a crash or a hang the
/// next child continues with the following job. A job may take `seconds` of processor time, and many times
/// that of wall-clock time. Its output on standard error is dropped if `silent`. For processes with one
/// thread. Throws std::runtime_error if no child can be created.
enum class Stderr : unsigned char { shown, silent };
std::vector<JobOutcome> run_in_children(std::size_t jobs, double seconds,
                                        const std::function<std::string(std::size_t)>& work,
                                        Stderr standard_error = Stderr::shown);

}  // namespace kbvh::experiments::stress
