#include "experiments/stress/isolate.hpp"

#include <fcntl.h>
#include <poll.h>
#if defined(__linux__)
#include <sys/prctl.h>
#endif
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <stdexcept>

#include "core/base/library_gaps.hpp"

namespace kbvh::experiments::stress {

namespace {

using Clock = std::chrono::steady_clock;

/// A process that waits instead of working may take this many times its processor time.
constexpr double patience = 30;

void write_all(int file, const void* data, std::size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::write(file, at, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) ::_exit(3);  // the parent has gone
    at += written;
    size -= std::size_t(written);
  }
}

[[noreturn]] void be_child([[maybe_unused]] pid_t parent, int file, std::size_t first, std::size_t jobs,
                           const std::function<std::string(std::size_t)>& work, Stderr standard_error) {
#if defined(__linux__)
  // No child outlives its parent, however the parent ends.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(5);
#endif
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  if (standard_error == Stderr::silent) {
    const int nowhere = ::open("/dev/null", O_WRONLY);
    if (nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
  }
  for (std::size_t i = first; i < jobs; ++i) {
    std::string said;
    try {
      said = work(i);
    } catch (...) {
      ::_exit(4);  // the job must report its own exceptions
    }
    const std::uint64_t size = said.size();
    write_all(file, &size, sizeof size);
    write_all(file, said.data(), said.size());
  }
  ::_exit(0);  // no destructors, and no buffers of the parent written twice
}

/// Returns the processor seconds of a process; 0 if unknown.
double processor_seconds(pid_t child) {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(child, &clock) != 0 || ::clock_gettime(clock, &time) != 0) return 0;
  return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

std::string ending(int status) {
  if (WIFSIGNALED(status)) return "ended by signal " + std::to_string(WTERMSIG(status));
  return "ended with code " + std::to_string(WIFEXITED(status) ? WEXITSTATUS(status) : status);
}

}  // namespace

std::vector<JobOutcome> run_in_children(std::size_t jobs, double seconds,
                                        const std::function<std::string(std::size_t)>& work,
                                        Stderr standard_error) {
  std::vector<JobOutcome> outcomes;
  while (outcomes.size() < jobs) {
    int ends[2];
    if (::pipe(ends) != 0) throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
    const pid_t parent = ::getpid();
    const pid_t child = ::fork();
    if (child < 0) {
      ::close(ends[0]);
      ::close(ends[1]);
      throw std::runtime_error(std::string("no child process: ") + std::strerror(errno));
    }
    if (child == 0) {
      ::close(ends[0]);
      be_child(parent, ends[1], outcomes.size(), jobs, work, standard_error);
    }
    ::close(ends[1]);
    std::string received;
    double used = 0;
    Clock::time_point since = Clock::now();
    bool hung = false;
    for (;;) {
      pollfd waiting{ends[0], POLLIN, 0};
      const int ready = ::poll(&waiting, 1, 100);
      if (ready > 0) {
        char buffer[1 << 16];
        const ssize_t got = ::read(ends[0], buffer, sizeof buffer);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        received.append(buffer, std::size_t(got));
        std::uint64_t size = 0;
        while (received.size() >= sizeof size &&
               (std::memcpy(&size, received.data(), sizeof size), received.size() - sizeof size >= size)) {
          outcomes.push_back({JobOutcome::End::finished, received.substr(sizeof size, size)});
          received.erase(0, sizeof size + size);
          used = processor_seconds(child);
          since = Clock::now();
        }
        continue;
      }
      const double waited = std::chrono::duration<double>(Clock::now() - since).count();
      if (processor_seconds(child) - used > seconds || waited > patience * seconds) {
        hung = true;
        ::kill(child, SIGKILL);
        break;
      }
    }
    ::close(ends[0]);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (outcomes.size() >= jobs) break;
    if (hung)
      outcomes.push_back({JobOutcome::End::hung,
                          "was still at work after " + shortest_text(seconds) + " s of processor time"});
    else
      outcomes.push_back({JobOutcome::End::crashed, ending(status)});
  }
  return outcomes;
}

}  // namespace kbvh::experiments::stress
