#include "core/families/choice/choice_policy.hpp"

#include <algorithm>
#include <cmath>

namespace kbvh {

namespace {
constexpr double unlimited = std::numeric_limits<double>::infinity();
constexpr double frame_ages = 1.0 / 256;  ///< change of what is observed that a frame counts as
constexpr double recent = 0.25;           ///< age up to which an estimate needs no trial
constexpr double forgets = 4;             ///< change beyond which a prediction knows more
constexpr double few_contacts = 16;       ///< below this many, changes of contacts count less
constexpr int lasts = 32;                 ///< frames that a choice usually lasts, at least
}  // namespace

void ChoicePolicy::start_over() {
  std::fill(candidates_.begin(), candidates_.end(), Candidate{});
  std::fill(offers_.begin(), offers_.end(), Offer{});
  active_ = incumbent_ = last_ = refit;
  all_work_ = charged_ = allowances_ = paid_ = changes_ = observed_ = 0;
  contacts_ = 1;
  found_ = -1;
  begin(refit, ChoiceState::stays);
  left_ = 0;  // the frame has begun
}

double ChoicePolicy::estimate(std::size_t candidate) const {
  const Candidate& one = candidates_[candidate];
  if (!one.known) return unlimited;
  const Offer& offer = offers_[candidate];
  const double work = one.frame + one.search / std::max(1, offer.whole), fixed = std::min(offer.fixed, work),
               ratio = contacts_ / one.contacts;
  // With fewer contacts, the search becomes less of a work, but does not vanish.
  double rest = std::max(ratio, (1 + ratio) / 2);
  if (offer.follows_prediction && last_ == refit && one.predicted > 0)
    rest = std::min(rest, std::max(0.0, offer.expected - offer.fixed) / one.predicted);
  return fixed + (work - fixed) * rest;
}

/// Returns by what factor the number of contacts has changed since a candidate's work was counted, up or
/// down.
double ChoicePolicy::change_of_contacts(const Candidate& candidate) const {
  return std::max(contacts_ / candidate.contacts, candidate.contacts / contacts_);
}

double ChoicePolicy::charge() const {
  return state_ == ChoiceState::tries ? std::max(0.0, unit_work_ - stay_ * answered_) : 0;
}

std::size_t ChoicePolicy::next(std::span<const Offer> offers) {
  std::copy(offers.begin(), offers.end(), offers_.begin());
  if (left_ <= 0 || offers_[active_].frames == 0) transition(Event::unit_due);
  --left_;
  return active_;
}

void ChoicePolicy::worked(double work, double contacts) {
  all_work_ += work;
  unit_work_ += work;
  if (++answered_ == 1) first_work_ = unit_work_;
  changes_ += frame_ages;
  // Candidates differ in the contacts that they report, so frames of different ones are not compared.
  if (found_ >= 0 && last_ == active_)
    contacts_ = std::clamp(contacts_ * (contacts + few_contacts) / (found_ + few_contacts), 1e-9, 1e9);
  found_ = contacts;
  last_ = active_;
  refit_work_ += estimate(refit);
  if (most_work_ < unlimited)
    most_work_ = std::max(most_work_, refit_work_ + (left_ + more_frames()) * estimate(refit));
  if (state_ == ChoiceState::stopped) state_ = ChoiceState::stays;
  if (left_ <= 0)
    transition(Event::unit_done);
  else if (unit_work_ > most_work())
    transition(Event::limit_reached);
}

std::size_t ChoicePolicy::stopped(double work) {
  all_work_ += work;
  unit_work_ += work;
  transition(Event::limit_reached);
  // In the middle of a unit of several frames, its search would not pay.
  const bool can = incumbent_ != active_ && offers_[incumbent_].frames == 1 && offers_[incumbent_].whole == 1;
  begin(can ? incumbent_ : refit, ChoiceState::stopped);
  --left_;
  return active_;
}

/// All changes of state but for `stopped`, which lasts for the rest of a frame.
void ChoicePolicy::transition(Event event) {
  Candidate& active = candidates_[active_];
  switch (event) {
    case Event::unit_due: {
      settle();  // of a unit that cannot be finished
      incumbent_ = best_known();
      const std::size_t next = challenger();
      begin(next, next == incumbent_ ? ChoiceState::stays : ChoiceState::tries);
      return;
    }
    case Event::unit_done: {
      const double later = answered_ > 1 ? (unit_work_ - first_work_) / (answered_ - 1) : unit_work_,
                   frame = std::min(later, unit_work_ / answered_);
      learn(frame, unit_work_ - answered_ * frame);
      if (state_ != ChoiceState::tries) break;
      // The change is made already, so it need not be worth another one.
      if (estimate(active_) < stay_) {
        incumbent_ = active_;
        active.lost = 0;
      } else {
        ++active.lost;
      }
      break;
    }
    case Event::limit_reached:
      // Half done at the limit, so it would take at least as much again.
      learn(2 * std::max(unit_work_ / std::max(offers_[active_].whole, 1), estimate(refit)), 0);
      if (state_ == ChoiceState::tries)
        ++active.lost;
      else
        incumbent_ = refit;
      break;
  }
  settle();
  left_ = 0;
}

void ChoicePolicy::begin(std::size_t candidate, ChoiceState state) {
  state_ = state;
  active_ = candidate;
  left_ = std::max(1, offers_[candidate].frames);
  answered_ = 0;
  unit_work_ = refit_work_ = 0;
  most_work_ = most_charge_ = unlimited;
  if (state == ChoiceState::tries) {
    allowance_ = allowance(candidate);
    most_charge_ = settings_.budget * all_work_ - paid_ + allowance_;
    stay_ = estimate(incumbent_);
    candidates_[candidate].regret = 0;
  }
  if (candidate != refit && (state == ChoiceState::tries || left_ > 1))
    most_work_ = (left_ + more_frames()) * estimate(refit);
}

/// Takes what was counted as the active candidate's estimate.
void ChoicePolicy::learn(double frame, double search) {
  Candidate& one = candidates_[active_];
  one.frame = frame;
  one.search = search;
  one.contacts = contacts_;
  one.changes = changes_;
  one.observed = observed_;
  one.predicted = offers_[active_].expected - offers_[active_].fixed;
  one.known = true;
  one.surplus = std::max(1.0, estimate(active_) / std::max(1e-9, offers_[active_].expected));
}

/// Books the charge of a trial that ends.
void ChoicePolicy::settle() {
  const double cost = charge();
  if (cost > 0) {
    charged_ += cost;
    allowances_ += allowance_;
    paid_ += std::max(0.0, cost - allowance_);
    candidates_[active_].allowance_is_free = false;
  }
  state_ = ChoiceState::stays;
}

/// Returns the candidate of the least estimate among those that need no trial.
std::size_t ChoicePolicy::best_known() const {
  std::size_t best = incumbent_;
  if (offers_[best].frames == 0 || estimate(best) > estimate(refit)) best = refit;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const Candidate& one = candidates_[i];
    const double age = changes_ - one.changes + change_of_contacts(one) - 1;
    if (offers_[i].frames > 0 && one.known && age <= recent && estimate(i) * settings_.gain < estimate(best))
      best = i;
  }
  return best;
}

/// Returns the allowance of a trial of a candidate, if it is not used yet; else 0.
double ChoicePolicy::allowance(std::size_t candidate) const {
  return candidates_[candidate].allowance_is_free ? offers_[candidate].frames * estimate(refit) : 0;
}

/// Returns the candidate to try, or the incumbent.
std::size_t ChoicePolicy::challenger() {
  std::size_t best = incumbent_;
  const double stay = estimate(incumbent_);
  if (stay == unlimited) return best;
  double least = stay / settings_.gain;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    Candidate& one = candidates_[i];
    const Offer& offer = offers_[i];
    if (i == incumbent_ || offer.frames == 0) continue;
    const bool counts =
        one.known && change_of_contacts(one) <= forgets && observed_ - one.observed <= forgets;
    // What was counted, and how it differed from its prediction, says less with time and other contacts.
    const double doubt = 1 + std::ldexp(changes_ - one.changes, -one.lost),
                 mistrust = 1 + (one.surplus - 1) / doubt * forgets / change_of_contacts(one),
                 expected = counts ? estimate(i) : mistrust * offer.expected,
                 hoped = counts ? expected / doubt : mistrust * offer.hoped;
    if (!(hoped < stay / settings_.gain)) continue;
    one.regret += (stay - hoped) * answered_;
    const double cost = offer.change + offers_[incumbent_].change + (expected - stay) * offer.frames;
    if (one.regret + (stay - hoped) * std::max(offer.frames, lasts) < cost) continue;
    if (hoped < least && hoped * offer.frames <= settings_.budget * all_work_ - paid_ + allowance(i)) {
      least = hoped;
      best = i;
    }
  }
  return best;
}

}  // namespace kbvh
