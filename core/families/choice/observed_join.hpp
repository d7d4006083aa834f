#pragma once
#include <algorithm>
#include <cmath>

#include "core/base/cost_constants.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// What a choice knows of an interval join by the work that it does, where bodies meet. Its cost is predicted
/// from the plans and the work of a refit. How wrong this is, is known when a segment was joined after a
/// refit had answered. Before that the prediction is taken as if it might be too high by `hope`, so that a
/// join is tried where it may pay. When its work has doubled or halved since, or after a number of frames
/// that doubles each time, a refit must answer a frame to be compared with. What was learned is slowly
/// forgotten while other strategies answer.
class ObservedJoin {
 public:
  void start_over(Observed& seen) {
    *this = {};
    seen.join_factor = costs::Work::hope;
    seen.apart_factor = 1;
  }
  /// Registers that a strategy that refits has answered the frame before `frame`; its work is in `seen`.
  void refitted(int frame, Observed& seen) {
    frame_ = frame;
    bodies_were_near_at_refit_ = seen.near;
    if (outdated_) compare(seen);
    if (late_) patience_ *= 2;
    outdated_ = late_ = false;
    compared_ = 0;
  }
  /// Registers the work of the join in a mean frame over whole segments before `frame`, in nanoseconds by its
  /// counts, and the candidates of the last one. Where bodies are apart it is the work that was not foreseen.
  void joined(double work, double candidates, int frame, Observed& seen) {
    if (!seen.near) {
      // No refit need answer: what one costs where nothing meets is known without.
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
      compare(seen);  // the same contacts, for which a refit would take as long as then
    else
      outdated_ = work > 2 * compared_ || 2 * work < compared_;
    // A frame of a refit costs as many frames of the join as the join is faster.
    late_ = frame - frame_ > patience_ * std::max(1.0, refit_cost(seen) / join_cost(seen));
    outdated_ = outdated_ || late_;
  }
  /// Registers that a join was given up before it was whole: it took as many times a refit's work of the same
  /// frames as a trial may.
  void given_up(Observed& seen) {
    double& factor = seen.near ? seen.join_factor : seen.apart_factor;
    factor = 1;
    const double predicted = join_cost(seen);
    factor = std::max(most, predicted > 0 ? dearer * refit_cost(seen) / predicted : most);
    kept_ = std::sqrt(kept_);
    known_ = known_ || seen.near;
    outdated_ = late_ = false;
    compared_ = 0;
  }
  /// Prepares a choice while another strategy answers.
  void forget(Observed& seen) const {
    if (known_) seen.join_factor = std::pow(seen.join_factor, kept_);
    seen.apart_factor = std::pow(seen.apart_factor, kept_);
  }
  /// Whether a join was compared with a refit.
  bool known() const { return known_; }
  /// Whether it was since another strategy has answered.
  bool judged() const { return compared_ > 0; }
  /// Whether a refit must answer next.
  bool outdated() const { return outdated_; }

 private:
  /// One segment that took long does not tell that all will. But it is left where it took longer than a
  /// refit.
  static constexpr double most = 4, dearer = 2;

  /// Returns the work over the prediction.
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
  double work_ = 0;  // of the join in a frame, at last
  double candidates_ = 0, compared_candidates_ = 0;
  double compared_ = 0;   // when it was compared; 0: a refit has answered since
  int frame_ = 0;         // the last one that a refit has answered
  double patience_ = 32;  // frames until a refit must answer again, as long as the join is as slow
  bool bodies_were_near_at_refit_ = false;  // bodies did when a refit answered
  bool known_ = false, outdated_ = false;
  bool late_ = false;  // outdated by the number of frames
};

}  // namespace kbvh
