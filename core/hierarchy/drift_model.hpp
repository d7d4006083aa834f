#pragma once
#include <algorithm>

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

  /// Frames for the next search; 0 if it is better to refit and to query at every frame, for `rest` frames.
  /// `step` is the mean way that a side closes in one frame, against the sides of two leaves.
  int period(double step) {
    if (!known_) return step > longest_step ? 0 : int(std::clamp(first_reach / step, 2.0, 8.0));
    double least = 0.97 * plain_cost();
    int best = 0;
    for (const int frames : {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64}) {
      if (frames > 4 * period_) break;  // no further than can be told from what was seen
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
  static constexpr double longest_step = 0.12, first_reach = 0.15;
  static constexpr int shortest_rest = 16;
  // In box tests: reading a vertex in a refit, or in the order of memory, twice; listing a pair; and looking
  // whether a listed pair meets now.
  static constexpr double refitting = 0.2, observing = 0.15, listing = 3, checking = 3;

  double tests(double frames) const {
    const double grown = 1 + frames / period_ * counts_.reach, was = 1 + counts_.reach;
    return counts_.tests * (grown * grown) / (was * was);
  }
  double listed_cost(double frames) const {
    const double per_frame = (counts_.listed - counts_.overlapping) / period_;
    const double search = refitting * counts_.reads + observing * counts_.vertices + tests(frames) +
                          listing * (counts_.overlapping + frames * per_frame);
    const double each = (watching_ == Watching::reads ? observing * counts_.vertices : 0) +
                        checking * (counts_.overlapping + per_frame * (frames - 1) / 2);
    return search / frames + each;
  }
  double plain_cost() const { return refitting * counts_.reads + tests(0); }

  DriftCounts counts_;
  int period_ = 1, rest_ = shortest_rest;
  Watching watching_ = Watching::reads;
  bool known_ = false;
};

}  // namespace kbvh
