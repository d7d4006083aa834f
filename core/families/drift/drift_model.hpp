#pragma once
#include <algorithm>
#include <cmath>

#include "core/base/cost_constants.hpp"

namespace kbvh {

/// The counts of one search for near pairs, summed over the scene.
struct DriftCounts {
  double overlapping = 0;  ///< pairs whose boxes overlapped at the search
  double listed = 0;       ///< pairs within reach, including the overlapping ones
  double tests = 0;        ///< box tests
  double reach = 0;        ///< mean reach of a side, relative to the sides of two leaves
  double reads = 0;        ///< vertices that a refit reads
  double vertices = 0;     ///< vertices whose drift is read
};

/// Chooses the number of frames that one search should last: a wider search costs more and lists more pairs,
/// but is needed less often. The choice rests on counts, so it does not depend on the machine or its load.
class DriftModel {
 public:
  /// Whether measuring the vertices' displacement costs reads or is free.
  enum class Watching { reads, free };

  /// Records a search that was made to last for `period` frames.
  void searched(const DriftCounts& counts, int period, Watching watching) {
    counts_ = counts;
    period_ = period;
    watching_ = watching;
    known_ = true;
  }

  /// Records a query at one frame, without lists.
  void queried(double tests, double candidates) {
    plain_tests_ = tests;
    plain_candidates_ = candidates;
  }

  /// Returns the number of frames for the next search; 0 if, for `rest` frames, it is better to refit and
  /// query at every frame. `step` is the mean closing of a side per frame, relative to the sides of two
  /// leaves.
  int period(double step) {
    // An empty list does not predict the size of later lists.
    if (!known_ || counts_.listed == 0)
      return step > Cost::longest_step ? 0 : int(std::clamp(Cost::first_reach / step, 2.0, 8.0));
    double least = Cost::clear_gain * plain_cost();
    int best = 0;
    for (const int frames : {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64}) {
      if (frames > 4 * period_ || frames * step > Cost::longest_reach)
        break;  // extrapolates no further than the observations allow
      const double cost = listed_cost(frames);
      if (!(cost < least)) continue;
      least = cost;
      best = frames;
    }
    if (best == 0) known_ = false;
    if (best != 0) rest_ = shortest_rest;
    return best;
  }
  /// Returns the number of frames until lists are tried again; it doubles each time that they did not pay.
  int rest() {
    const int frames = rest_;
    rest_ = std::min(2 * rest_, 16 * shortest_rest);
    return frames;
  }

 private:
  using Cost = costs::Drift;
  static constexpr int shortest_rest = 16;

  /// Interpolates a count for a reach of `frames` frames, from `none` at no reach and `some` at the reach of
  /// the last search.
  double grown(double none, double some, double frames) const {
    return none + std::max(0.0, some - none) * std::pow(frames / period_, Cost::growth);
  }
  /// Returns the box tests of a query at one frame without lists.
  double tests() const {
    if (plain_tests_ == 0) return counts_.tests / ((1 + counts_.reach) * (1 + counts_.reach));
    return plain_tests_ * std::clamp((counts_.overlapping + 1) / (plain_candidates_ + 1), 0.1, 10.0);
  }
  double listed_cost(double frames) const {
    const double listed = grown(counts_.overlapping, counts_.listed, frames);
    const double search = Cost::refitting * counts_.reads + Cost::observing * counts_.vertices +
                          Cost::searching * grown(tests(), counts_.tests, frames) + Cost::listing * listed;
    const double active = counts_.overlapping + (listed - counts_.overlapping) / Cost::kept_listed;
    const double each =
        (watching_ == Watching::reads ? Cost::observing * counts_.vertices : 0) + Cost::checking * active;
    return search / frames + each * (frames - 1) / frames;
  }
  double plain_cost() const { return Cost::refitting * counts_.reads + tests(); }

  DriftCounts counts_;
  int period_ = 1, rest_ = shortest_rest;
  double plain_tests_ = 0, plain_candidates_ = 0;
  Watching watching_ = Watching::reads;
  bool known_ = false;
};

}  // namespace kbvh
