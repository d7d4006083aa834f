#pragma once
#include <algorithm>
#include <cmath>

#include "core/base/cost_constants.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// A choice's knowledge about an interval join, from the work that it does where bodies meet. Its cost is
/// predicted from the plans and the work of a refit. The error of the prediction is known after a segment was
/// joined right after a refit had answered. Until then the prediction is assumed to be too high by `hope`, so
/// that a join is tried where it may pay. When the join's work has doubled or halved since the comparison, or
/// after a number of frames that doubles each time, a refit must answer a frame for a new comparison. The
/// result is slowly forgotten while other strategies answer.
class ObservedJoin {
 public:
  void start_over(Observed& seen) {
    *this = {};
    seen.join_factor = costs::Work::hope;
    seen.apart_factor = 1;
  }
  /// Registers that a refitting strategy has answered the frame before `frame`; its work is in `seen`.
  void refitted(int frame, Observed& seen) {
    frame_ = frame;
    bodies_were_near_at_refit_ = seen.near;
    if (outdated_) compare(seen);
    if (late_) patience_ *= 2;
    outdated_ = late_ = false;
    compared_ = 0;
  }
  /// Registers the work of the join in a mean frame over whole segments before `frame`, in nanoseconds
  /// computed from its counts, and the candidates of the last frame. Where bodies are apart, only unexpected
  /// work counts.
  void joined(double work, double candidates, int frame, Observed& seen) {
    if (!seen.near) {
      // No refit need answer: where nothing meets, its cost is known anyway.
      seen.apart_factor = 1;
      if (work > refit_cost(seen)) seen.apart_factor = std::max(1.0, factor(work, seen));
      return;
    }
    work_ = work;
    candidates_ = candidates;
    if (!bodies_were_near_at_refit_)
      outdated_ = true;
    else if (compared_ == 0)
      compare(seen);
    else if (std::abs(candidates - compared_candidates_) <= 0.2 * compared_candidates_)
      compare(seen);  // with the same contacts, a refit would take as long as before
    else
      outdated_ = work > 2 * compared_ || 2 * work < compared_;
    // A refitted frame costs as many frames of the join as the join is times faster.
    late_ = frame - frame_ > patience_ * std::max(1.0, refit_cost(seen) / join_cost(seen));
    outdated_ = outdated_ || late_;
  }
  /// Registers that a join was given up before it was whole, after so many times the work of a refit in the
  /// frames of the segment.
  void given_up(double times, Observed& seen) {
    double& factor = seen.near ? seen.join_factor : seen.apart_factor;
    factor = 1;
    const double predicted = join_cost(seen);
    factor = std::max(most, predicted > 0 ? times * refit_cost(seen) / predicted : most);
    kept_ = std::pow(kept_, 0.25);  // it costs more than a whole segment that lost
    known_ = known_ || seen.near;
    outdated_ = late_ = false;
    compared_ = 0;
  }
  /// Prepares a choice while another strategy answers.
  void forget(Observed& seen) const {
    if (known_) seen.join_factor = std::pow(seen.join_factor, kept_);
    seen.apart_factor = std::pow(seen.apart_factor, kept_);
  }
  /// Whether a join has ever been compared with a refit.
  bool known() const { return known_; }
  /// Whether it has been compared since another strategy answered.
  bool judged() const { return compared_ > 0; }
  /// Whether a refit must answer next.
  bool outdated() const { return outdated_; }

 private:
  /// Limits of the factor: one slow segment does not prove that all will be slow, but the join is left where
  /// it took longer than a refit.
  static constexpr double most = 4, dearer = 2;

  /// Returns the quotient of the work and the prediction.
  static double factor(double work, const Observed& seen) {
    const double predicted = join_cost(seen);
    if (!(work > 0 && predicted > 0 && std::isfinite(predicted))) return 1;
    return std::min(std::max(most, dearer * refit_cost(seen) / predicted), work / predicted);
  }
  void compare(Observed& seen) {
    seen.join_factor = 1;
    seen.join_factor = factor(work_, seen);
    if (!known_ || seen.join_factor > 1.1) kept_ = std::sqrt(kept_);
    compared_ = work_;
    compared_candidates_ = candidates_;
    known_ = true;
  }

  double kept_ =
      0.64;          // exponent of the factor at a further choice; closer to 1 with each trial that it lost
  double work_ = 0;  // of the join in a frame, as last measured
  double candidates_ = 0, compared_candidates_ = 0;
  double compared_ = 0;   // work at the comparison; 0: a refit has answered since
  int frame_ = 0;         // last frame that a refit answered
  double patience_ = 32;  // number of join frames, times its speed-up, before a refit must answer again
  bool bodies_were_near_at_refit_ = false;  // when a refit last answered
  bool known_ = false, outdated_ = false;
  bool late_ = false;  // outdated because of the number of frames
};

}  // namespace kbvh
