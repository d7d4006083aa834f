#pragma once
#include <algorithm>
#include <cmath>

namespace kbvh {

/// What one search for near pairs showed, summed over the scene.
struct DriftCounts {
  double overlapping = 0;  ///< pairs whose boxes overlapped at the search
  double listed = 0;       ///< pairs within reach, these included
  double tests = 0;        ///< box tests
  double reach = 0;        ///< mean reach of a side, against the sides of two leaves
  double reads = 0;        ///< vertices that a refit reads
  double vertices = 0;     ///< vertices whose drift is read
};

/// For how many frames one search should last: a wider search costs more and lists more, but is needed more
/// seldom. It weighs counts, so that it does not depend on the machine or its load.
class DriftModel {
 public:
  /// Whether it costs anything to know how far vertices have moved.
  enum class Watching { reads, free };

  /// A search that was made to last for `period` frames.
  void searched(const DriftCounts& counts, int period, Watching watching) {
    counts_ = counts;
    period_ = period;
    watching_ = watching;
    known_ = true;
  }

  /// A query at one frame, without lists.
  void queried(double tests, double candidates) {
    plain_tests_ = tests;
    plain_candidates_ = candidates;
  }

  /// Frames for the next search; 0 if it is better to refit and to query at every frame, for `rest` frames.
  /// `step` is the mean way that a side closes in one frame, against the sides of two leaves.
  int period(double step) {
    // What a list would hold cannot be told from an empty one.
    if (!known_ || counts_.listed == 0)
      return step > longest_step ? 0 : int(std::clamp(first_reach / step, 2.0, 8.0));
    double least = clear_gain * plain_cost();
    int best = 0;
    for (const int frames : {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64}) {
      if (frames > 4 * period_ || frames * step > longest_reach)
        break;  // no further than can be told from what was seen
      const double cost = listed_cost(frames);
      if (!(cost < least)) continue;
      least = cost;
      best = frames;
    }
    if (best == 0) known_ = false;
    if (best != 0) rest_ = shortest_rest;
    return best;
  }
  /// So many frames until lists are tried again; twice as many each time that they were not worth it.
  int rest() {
    const int frames = rest_;
    rest_ = std::min(2 * rest_, 16 * shortest_rest);
    return frames;
  }

 private:
  /// Predictions are not so good that less would be worth a try.
  static constexpr double clear_gain = 0.9;
  static constexpr double longest_step = 0.12, first_reach = 0.15, longest_reach = 0.3;
  static constexpr int shortest_rest = 16;
  // In box tests of a query: reading a vertex in a refit, or in the order of memory, twice; a box test of a
  // search; listing a pair; and looking whether a listed pair meets now.
  static constexpr double refitting = 0.2, observing = 0.15, searching = 1.3, listing = 4, checking = 5;

  /// A count that is `none` with no reach and `some` with that of the last search, for one of `frames`.
  double grown(double none, double some, double frames) const {
    return none + std::max(0.0, some - none) * std::pow(frames / period_, 1.3);
  }
  /// Box tests of a query at one frame, as if there were no lists.
  double tests() const {
    if (plain_tests_ == 0) return counts_.tests / ((1 + counts_.reach) * (1 + counts_.reach));
    return plain_tests_ * std::clamp((counts_.overlapping + 1) / (plain_candidates_ + 1), 0.1, 10.0);
  }
  double listed_cost(double frames) const {
    const double listed = grown(counts_.overlapping, counts_.listed, frames);
    const double search = refitting * counts_.reads + observing * counts_.vertices +
                          searching * grown(tests(), counts_.tests, frames) + listing * listed;
    const double active = counts_.overlapping + (listed - counts_.overlapping) / 2.3;
    const double each = (watching_ == Watching::reads ? observing * counts_.vertices : 0) + checking * active;
    return search / frames + each * (frames - 1) / frames;
  }
  double plain_cost() const { return refitting * counts_.reads + tests(); }

  DriftCounts counts_;
  int period_ = 1, rest_ = shortest_rest;
  double plain_tests_ = 0, plain_candidates_ = 0;
  Watching watching_ = Watching::reads;
  bool known_ = false;
};

}  // namespace kbvh
