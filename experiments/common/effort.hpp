#pragma once
#include <cstdint>
#include <string>

namespace kbvh::experiments {

/// The activity of the machine while something was timed. Numbers that the system does not provide are 0.
struct Effort {
  double wall = 0;             ///< seconds
  double processor = 0;        ///< seconds that processors worked for this process, all its threads added up
  double thread = 0;           ///< the same for the timing thread alone
  std::uint64_t switches = 0;  ///< times that a thread of this process lost its processor to another process
  double steal = 0;            ///< seconds for which a hypervisor withheld processors; in steps of 10 ms
  double others = 0;  ///< seconds that processors worked for other processes; in steps of 10 ms, added up

  Effort& operator+=(const Effort& more);
  /// Returns whether several threads worked: more than a twentieth of the work was not the timing thread's.
  bool several_threads() const { return processor > 1.05 * thread + 1e-4; }
};

/// Measures the effort from its construction on. A reading takes about 50 us: not for single frames.
class EffortClock {
 public:
  EffortClock();
  Effort elapsed() const;

 private:
  Effort begin_;
};

/// Returns why times were disturbed, in words: waiting for a processor (more than 2 % of the time; not
/// judged where several threads worked), involuntary switches (more than 20 a second), steal (more than 1 %).
/// Returns "" for a quiet machine.
std::string disturbance(const Effort& effort);

}  // namespace kbvh::experiments
