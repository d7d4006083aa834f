#pragma once
#include <chrono>
#include <span>
#include <string>
#include <vector>

#include "core/judge/follow_script.hpp"
#include "experiments/common/effort.hpp"
#include "experiments/common/stopwatch.hpp"

namespace kbvh::experiments {

/// One clip played once by one contestant. It begins when the session has restored scene and instance: the
/// positions that the strategy needs, its `reset`, its answer and its response to changes are frame 0. In
/// queries of intervals, the first interval is frame 0.
struct ClipTimes {
  PhaseTimes start;                    ///< positions and `reset`, which are also part of the first frame
  std::vector<PhaseTimes> frames;      ///< seconds
  std::vector<std::uint64_t> answers;  ///< size of each frame's answer
  Effort effort;
  std::uint32_t round = 0, place = 0;  ///< when it was played: in which round, as which contestant

  /// Returns the sum over frames from `begin` on.
  PhaseTimes sum(std::size_t begin = 0) const {
    PhaseTimes sum;
    for (std::size_t f = begin; f < frames.size(); ++f) sum += frames[f];
    return sum;
  }
  double total() const { return sum().total(); }
};

/// Ends a warm-up, in which a contestant's buffers grow: 0.05 s suffice, or one clip.
class WarmUp {
 public:
  bool is_over() const { return seconds_since(begin_) > 0.05; }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// Plays frames: exactly the calls that are timed. `ask(times, f)` makes the query of frame f and returns the
/// size of its answer. With `warm_up`, ends after the frame in which the warm-up is over.
template <class S, class Ask>
ClipTimes play_frames(Session<S>& session, std::span<const double> frames, const PlanScript<S>* script,
                      const Ask& ask, const WarmUp* warm_up = nullptr) {
  ScriptCursor<S> cursor(script);
  ClipTimes clip;
  clip.frames.resize(frames.size());
  clip.answers.resize(frames.size());
  session.restore(frames[0]);
  const EffortClock effort;
  for (std::size_t f = 0; f < frames.size() && (warm_up == nullptr || !warm_up->is_over()); ++f) {
    PhaseTimes& frame = clip.frames[f];
    if (f > 0) {
      session.advance(frames[f], frame);
    } else {
      session.start(frame);
      clip.start = frame;
    }
    clip.answers[f] = ask(frame, f);
    follow(session, cursor.at(frames[f]), frame);
  }
  clip.effort = effort.elapsed();
  return clip;
}

/// Does the same for the intervals between `knots`: ask(times, k) answers for the interval from knots[k] to
/// knots[k + 1], and plans change at its start.
template <class S, class Ask>
ClipTimes play_intervals(Session<S>& session, std::span<const double> knots, const PlanScript<S>* script,
                         const Ask& ask, const WarmUp* warm_up = nullptr) {
  ScriptCursor<S> cursor(script);
  ClipTimes clip;
  clip.frames.resize(knots.size() - 1);
  clip.answers.resize(knots.size() - 1);
  session.restore(knots[0]);
  const EffortClock effort;
  for (std::size_t k = 0; k + 1 < knots.size() && (warm_up == nullptr || !warm_up->is_over()); ++k) {
    PhaseTimes& interval = clip.frames[k];
    if (k == 0) {
      session.start(interval);
      clip.start = interval;
    }
    follow(session, cursor.at(knots[k]), interval);
    clip.answers[k] = ask(interval, k);
  }
  clip.effort = effort.elapsed();
  return clip;
}

/// Returns in words the first frame of a timed clip whose answer differs from the replay's; "" if none does.
std::string answers_differ(std::span<const std::uint64_t> timed, std::span<const std::uint64_t> replayed);

}  // namespace kbvh::experiments
