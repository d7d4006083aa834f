#include "core/families/choice/choice_policy.hpp"

#include <algorithm>

namespace kbvh {

namespace {
constexpr double unlimited = std::numeric_limits<double>::infinity();
constexpr double frame_ages = 1.0 / 64;  ///< change of what is observed that a frame counts as
constexpr double recent = 0.25;          ///< age up to which an estimate needs no trial
constexpr double few_contacts = 16;      ///< below this many, changes of contacts count less
constexpr int horizon = 8;               ///< frames for which a challenger is expected to stay at least
}  // namespace

void ChoicePolicy::start_over() {
  *this = ChoicePolicy(candidates_.size(), settings_);
  offers_.assign(candidates_.size(), Offer{});
  begin(refit, ChoiceState::stays);
  left_ = 0;  // the frame has begun
}

double ChoicePolicy::estimate(std::size_t candidate) const {
  const Candidate& one = candidates_[candidate];
  const double ratio = contacts_ / one.contacts;
  // With fewer contacts, the search becomes less of a work, but does not vanish.
  return one.known ? one.fixed + one.varying * std::max(ratio, (1 + ratio) / 2) : unlimited;
}

/// Returns how much of what was observed has changed since a candidate's work was counted.
double ChoicePolicy::age(const Candidate& candidate) const {
  const double ratio = contacts_ / candidate.contacts;
  return changes_ - candidate.changes + std::max(ratio, 1 / ratio) - 1;
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
  ++answered_;
  changes_ += frame_ages;
  // Candidates differ in the contacts that they report, so frames of different ones are not compared.
  if (found_ >= 0 && last_ == active_)
    contacts_ = std::clamp(contacts_ * (contacts + few_contacts) / (found_ + few_contacts), 1e-9, 1e9);
  found_ = contacts;
  last_ = active_;
  if (state_ == ChoiceState::stopped) state_ = ChoiceState::stays;
  if (left_ <= 0)
    transition(Event::unit_done);
  else if (unit_work_ > limit_)
    transition(Event::limit_reached);
}

std::size_t ChoicePolicy::stopped(double work) {
  all_work_ += work;
  unit_work_ += work;
  transition(Event::limit_reached);
  const bool can = incumbent_ != active_ && offers_[incumbent_].frames > 0;
  begin(can ? incumbent_ : refit, ChoiceState::stopped);
  --left_;
  return active_;
}

/// All changes of state but for `stopped`, which lasts for the rest of a frame.
void ChoicePolicy::transition(Event event) {
  switch (event) {
    case Event::unit_due: {
      settle();  // of a unit that cannot be finished
      incumbent_ = best_known();
      const std::size_t next = challenger();
      begin(next, next == incumbent_ ? ChoiceState::stays : ChoiceState::tries);
      return;
    }
    case Event::unit_done:
      learn(true);
      if (state_ == ChoiceState::tries && estimate(active_) * settings_.gain < stay_) incumbent_ = active_;
      break;
    case Event::limit_reached:
      learn(false);
      if (state_ != ChoiceState::tries) incumbent_ = refit;
      break;
  }
  settle();
  left_ = 0;
}

void ChoicePolicy::begin(std::size_t candidate, ChoiceState state) {
  const Offer& offer = offers_[candidate];
  const bool restarts = candidate != active_;
  limit_ = unlimited;
  if (state == ChoiceState::tries) {
    limit_ = trial_limit(candidate);
    stay_ = estimate(incumbent_);
    allowance_ = candidates_[candidate].allowance_is_free ? offer.frames * estimate(refit) : 0;
    candidates_[candidate].regret = 0;
  } else if (candidate != refit && offer.frames > 1) {
    limit_ = offer.frames * estimate(refit);
  }
  state_ = state;
  active_ = candidate;
  left_ = std::max(1, offer.frames);
  answered_ = 0;
  unit_work_ = start_ = restarts ? offer.start : 0;
  all_work_ += unit_work_;
}

/// Takes the work of the unit as the active candidate's estimate. A unit that was stopped is assumed to have
/// been half done.
void ChoicePolicy::learn(bool complete) {
  Candidate& one = candidates_[active_];
  const Offer& offer = offers_[active_];
  // The search of a segment serves all its frames, also those before the candidate began.
  const double frames = complete ? std::max(offer.whole, answered_) : 0.5 * std::max(offer.whole, 1);
  const double work = (unit_work_ - start_) / frames;
  one.fixed = complete ? std::min(offer.fixed, work) : 0;
  one.varying = work - one.fixed;
  one.contacts = contacts_;
  one.changes = changes_;
  one.known = true;
  one.complete = complete;
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
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    if (offers_[i].frames > 0 && candidates_[i].complete && age(candidates_[i]) <= recent &&
        estimate(i) * settings_.gain < estimate(best))
      best = i;
  return best;
}

/// Returns the most work of a trial.
double ChoicePolicy::trial_limit(std::size_t candidate) const {
  const double allowance = offers_[candidate].frames * estimate(refit);
  const double affordable =
      settings_.budget * all_work_ - paid_ + (candidates_[candidate].allowance_is_free ? allowance : 0);
  // More than a refit would take is not worth its work, except for the start.
  return candidate == refit ? affordable : std::min(affordable, allowance + offers_[candidate].start);
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
    const double expected = one.known ? estimate(i) : offer.expected;
    const double hoped = one.known ? expected / (1 + age(one)) : offer.hoped;
    if (!(hoped < stay / settings_.gain)) continue;
    one.regret += (stay - hoped) * answered_;
    const double cost =
        offer.cold + offer.start + offers_[incumbent_].start + (expected - stay) * offer.frames;
    if (one.regret + (stay - hoped) * std::max(offer.frames, horizon) < cost) continue;
    if (hoped < least && offer.start + hoped * offer.frames <= trial_limit(i)) {
      least = hoped;
      best = i;
    }
  }
  return best;
}

}  // namespace kbvh
