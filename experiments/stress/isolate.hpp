#pragma once
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace kbvh::experiments::stress {

/// How a job in a child process ended.
struct JobOutcome {
  enum class End : unsigned char {
    finished,  ///< `said` is what it returned
    crashed,   ///< the process ended without an answer; `said` tells how
    hung,      ///< it was still at work when its time was up, and was ended
  };
  End end = End::finished;
  std::string said;
};

/// Runs jobs 0, 1, ... in child processes, so that none of them can take this process along: work(i) is
/// called in a copy of this process and its text comes back. One child does as many jobs as it lives to do;
/// after a crash or a hang the next child goes on behind. A job may take `seconds` of processor time, and
/// many times that of any other. What it prints on standard error is dropped if it is `silent`. For processes
/// of one thread. Throws std::runtime_error if no child can be made.
enum class Stderr : unsigned char { shown, silent };
std::vector<JobOutcome> run_in_children(std::size_t jobs, double seconds,
                                        const std::function<std::string(std::size_t)>& work,
                                        Stderr standard_error = Stderr::shown);

}  // namespace kbvh::experiments::stress
