#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace kbvh {

/// What is known about a candidate before a frame. Work is in nanoseconds computed from counts.
struct Offer {
  double expected = 0;  ///< predicted work per frame, where no count is known
  double hoped = 0;     ///< the same at best; at most `expected`
  double fixed = 0;     ///< part of the work per frame that contacts do not change
  double change = 0;    ///< what a change to it costs; 0 if it goes on from where it was
  int frames = 1;       ///< frames that a unit would answer from this frame on; 0: it cannot begin now
  int whole = 1;        ///< frames of a whole unit
  bool follows_prediction = false;  ///< its estimate falls with `expected` while the refit answers
};

/// The state of a choice.
enum class ChoiceState : std::uint8_t {
  stays,    ///< the incumbent answers
  tries,    ///< a challenger answers one unit, whose counted work decides whether it becomes the incumbent
  stopped,  ///< the active candidate reached its limit; another one answers the rest of the frame
};

/// Chooses among candidates whose costs drift, from counts only. Candidate 0 is the refit: it can always
/// answer, and the first frame has to be its own. Each candidate answers whole units, a frame or a segment of
/// the flight plans. The incumbent is the candidate of the least estimate; all others are challengers.
///
/// Estimates age. Work is counted in the units that a candidate answers: its usual frame, and what the first
/// frame of a unit took beyond that, which the frames of a later unit share. While others answer, the part
/// that depends on contacts follows their number, and the estimate becomes uncertain with the frames that
/// pass and with every change of what is observed; half as fast after each trial in a row that the candidate
/// lost. Once contacts or other observations have changed fourfold, a prediction replaces it, times what the
/// last count was over its prediction. What a join lists depends on its whole segment, of which the refit's
/// counts tell more than contacts do: while the refit answers, its estimate falls with its prediction. A
/// challenger is tried when the work that it may have saved since its last trial, and may save in the frames
/// that a choice usually lasts, equals what the trial and the change are expected to cost (ski rental), if
/// the budget allows it.
///
/// The budget. Let W be all work counted since `start_over`. The charge of a trial is its work so far, minus
/// `stay_estimate` for each frame that it has answered, but at least 0. Each candidate has one allowance for
/// a trial that costs something: the refit's estimate times the frames of the unit. At all times
///   sum of all charges <= budget * W + sum of the allowances used.
/// Proof. A charge beyond its allowance is paid from the budget. A trial begins with a limit on its charge of
/// its allowance, if that is not used yet, plus budget * W minus all that was paid before. Work that would
/// raise the charge beyond the limit is not done, and W never decreases; so what has been paid never exceeds
/// budget * W, and the sum follows. A candidate that cannot stop within a frame exceeds its limit, and with
/// it the bound, by no more than the rest of that frame. Like the counters of a strategy, W and the charges
/// contain no changes of the choice: these delay trials, as `Offer::change`. A trial also ends when its work
/// exceeds the refit's estimate for its unit and one frame more.
///
/// Return to a refit. At the end of a unit the incumbent's own count replaces its estimate; if that exceeds
/// the refit's, the refit becomes the incumbent, whatever the budget is. Within a unit of several frames the
/// incumbent stops when it has taken the refit's estimate for all of them, which rises with contacts.
class ChoicePolicy {
 public:
  struct Settings {
    double gain = 1.1;     ///< estimated speed-up from which on another candidate is worth a change
    double budget = 0.05;  ///< charges of trials, as a share of all work
  };
  static constexpr std::size_t refit = 0;

  ChoicePolicy(std::size_t candidates, const Settings& settings)
      : settings_(settings), candidates_(candidates), offers_(candidates) {}
  /// Forgets everything; the refit answers the current frame.
  void start_over();

  /// Chooses the candidate that answers the next frame; `offers` has an entry for each.
  std::size_t next(std::span<const Offer> offers);
  /// Whether the unit of the active candidate has ended. If not, and if the candidate can still answer,
  /// `go_on` lets it answer the next frame, too, without offers.
  bool due() const { return left_ <= 0; }
  std::size_t go_on() {
    --left_;
    return active_;
  }
  /// Registers the work of the active candidate in the current frame, and the number of contacts found.
  void worked(double work, double contacts);
  /// Registers that the active candidate reached its limit in the current frame after `work`. Returns the
  /// candidate that answers this frame instead, without a limit; `worked` then follows.
  std::size_t stopped(double work);
  /// Registers a change of what is observed, relative to its former amount: 1 if it has doubled.
  void changed(double share) {
    changes_ += share;
    observed_ += share;
  }

  std::size_t active() const { return active_; }
  std::size_t incumbent() const { return incumbent_; }
  ChoiceState state() const { return state_; }
  /// Whether the active candidate began a unit in this frame.
  bool begins() const { return answered_ == 0; }
  /// Returns the work that the active candidate may do in this frame.
  double limit() const { return most_work() - unit_work_; }
  /// Returns the estimated work of a frame of the incumbent, at the beginning of the last trial.
  double stay_estimate() const { return stay_; }
  /// Returns the estimated work of a frame of a candidate; infinite before its first unit.
  double estimate(std::size_t candidate) const;

  /// Returns the number of contacts, relative to the first frame's.
  double contacts() const { return contacts_; }
  double all_work() const { return all_work_; }
  /// Returns the charges of all trials, and the allowances that they used.
  double charges() const { return charged_ + charge(); }
  double allowances() const { return allowances_ + (charge() > 0 ? allowance_ : 0); }

 private:
  struct Candidate {
    double frame = 0;      ///< work of a usual frame of its last unit
    double search = 0;     ///< what the unit's first frame took beyond that
    double contacts = 1;   ///< `contacts_` at that time
    double changes = 0;    ///< `changes_` at that time
    double observed = 0;   ///< `observed_` at that time
    double predicted = 0;  ///< what was expected of it then, without the fixed part
    double surplus = 1;    ///< the unit's work over its prediction, if it was more
    double regret = 0;     ///< work that it may have saved since its last trial
    int lost = 0;          ///< trials in a row that it lost
    bool known = false;    ///< has answered a unit
    bool allowance_is_free = true;
  };
  enum class Event : std::uint8_t { unit_due, unit_done, limit_reached };

  void transition(Event event);
  void begin(std::size_t candidate, ChoiceState state);
  void learn(double frame, double search);
  void settle();
  std::size_t best_known() const;
  std::size_t challenger();
  double allowance(std::size_t candidate) const;
  double charge() const;
  /// Returns the work that the unit may have done; in a trial, each frame answered adds what staying costs.
  double most_work() const { return std::min(most_work_, most_charge_ + stay_ * answered_); }
  double change_of_contacts(const Candidate& candidate) const;
  /// Returns the frames whose work a refit would have to do again after a trial that is stopped.
  int more_frames() const { return state_ == ChoiceState::tries ? 1 : 0; }

  Settings settings_;
  std::vector<Candidate> candidates_;
  std::vector<Offer> offers_;
  ChoiceState state_ = ChoiceState::stays;
  std::size_t active_ = refit, incumbent_ = refit, last_ = refit;
  int left_ = 0, answered_ = 0;  ///< frames of the unit
  double unit_work_ = 0, first_work_ = 0, most_work_ = 0, most_charge_ = 0;
  double refit_work_ = 0;            ///< what a refit would have taken for the frames that are answered
  double stay_ = 0, allowance_ = 0;  ///< of the last trial
  double all_work_ = 0, charged_ = 0, allowances_ = 0, paid_ = 0;
  double found_ = -1;                   ///< contacts of the last frame
  double contacts_ = 1, observed_ = 0;  ///< relative number of contacts; other changes
  double changes_ = 0;                  ///< other changes, and frames
};

}  // namespace kbvh
