#pragma once
#include <functional>
#include <string>
#include <vector>

#include "experiments/study/plan.hpp"

namespace kbvh::experiments {

/// A step is a timed clip. To verify and replay a contestant takes as long as several.
constexpr std::size_t verification_steps = 3;

/// Estimates how long a plan still takes, from the time that its work so far has taken. The work of a table
/// is taken to grow with triangles, frames, contestants and clips; what a scene loads from files is not known
/// before.
class TimeLeft {
 public:
  /// `contestants` are those of each study; `now` returns seconds.
  TimeLeft(const Plan& plan, const std::vector<std::size_t>& contestants, std::function<double()> now);

  /// The next scene of the plan begins, however many tables of the last one were played.
  void begin_scene();
  /// The next table begins, with so many steps; none of them is made if all is known from earlier runs.
  void begin_table(std::size_t steps);
  /// Steps of the table were made; more than it has do not count.
  void made(std::size_t steps);

  /// Returns the estimated seconds, or a negative number while too little is known.
  double seconds() const;
  /// Returns it as time_left_in_words does.
  std::string said() const;

 private:
  void end_table();
  double part_done() const;

  std::function<double()> now_;
  std::vector<std::vector<double>> scenes_;   // work of each table
  std::size_t scene_ = 0, table_ = 0;         // counted from 1; 0: before the first
  std::size_t steps_ = 0, made_ = 0;          // of the table
  double ahead_ = 0;                          // work of all tables that have not ended
  double worked_ = 0, took_ = 0, began_ = 0;  // measured work and its seconds; when the table began
};

}  // namespace kbvh::experiments
