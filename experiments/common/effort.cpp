#include "experiments/common/effort.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <cstdio>
#include <vector>

#include "experiments/common/text.hpp"

namespace kbvh::experiments {

namespace {

double seconds_of(clockid_t clock) {
  timespec now{};
  return ::clock_gettime(clock, &now) == 0 ? double(now.tv_sec) + 1e-9 * double(now.tv_nsec) : 0;
}

/// Reads the first line of /proc/stat: seconds of all processors since the start of the machine.
void read_processors(double& busy, double& steal) {
  busy = steal = 0;
  std::FILE* file = std::fopen("/proc/stat", "r");
  if (file == nullptr) return;
  unsigned long long user = 0, nice = 0, system = 0, idle = 0, waiting = 0, irq = 0, softirq = 0, stolen = 0;
  if (std::fscanf(file, "cpu %llu %llu %llu %llu %llu %llu %llu %llu", &user, &nice, &system, &idle, &waiting,
                  &irq, &softirq, &stolen) == 8) {
    const auto ticks = double(::sysconf(_SC_CLK_TCK));
    busy = double(user + nice + system + irq + softirq) / ticks;
    steal = double(stolen) / ticks;
  }
  std::fclose(file);
}

/// Returns the readings of all clocks; only their differences have a meaning.
Effort reading() {
  Effort now;
  double busy = 0;
  read_processors(busy, now.steal);
  rusage usage{};
  if (::getrusage(RUSAGE_SELF, &usage) == 0) now.switches = std::uint64_t(usage.ru_nivcsw);
  now.processor = seconds_of(CLOCK_PROCESS_CPUTIME_ID);
  now.thread = seconds_of(CLOCK_THREAD_CPUTIME_ID);
  now.wall = seconds_of(CLOCK_MONOTONIC);
  now.others = busy - now.processor;
  return now;
}

}  // namespace

Effort& Effort::operator+=(const Effort& more) {
  wall += more.wall;
  processor += more.processor;
  thread += more.thread;
  switches += more.switches;
  steal += more.steal;
  others += more.others;
  return *this;
}

EffortClock::EffortClock() : begin_(reading()) {}

Effort EffortClock::elapsed() const {
  const Effort now = reading();
  Effort past;
  past.wall = now.wall - begin_.wall;
  past.processor = now.processor - begin_.processor;
  past.thread = now.thread - begin_.thread;
  past.switches = now.switches - begin_.switches;
  past.steal = now.steal - begin_.steal;
  past.others = now.others > begin_.others ? now.others - begin_.others : 0;
  return past;
}

std::string disturbance(const Effort& effort) {
  constexpr double most_waiting = 0.02, most_switches = 20, most_steal = 0.01;  // of the time, per second
  std::vector<std::string> reasons;
  if (!(effort.wall > 0)) return {};
  const double waited = 1 - effort.thread / effort.wall;
  if (!effort.several_threads() && waited > most_waiting)
    reasons.push_back(fmt::format("it waited for a processor {:.0f} % of the time", 100 * waited));
  if (effort.switches >= 3 && double(effort.switches) > most_switches * effort.wall)
    reasons.push_back(fmt::format("{} involuntary switches, {:.0f} a second", effort.switches,
                                  double(effort.switches) / effort.wall));
  if (effort.steal > most_steal * effort.wall)
    reasons.push_back(fmt::format("a hypervisor withheld processors for {:.0f} ms", 1e3 * effort.steal));
  return joined(reasons);
}

}  // namespace kbvh::experiments
