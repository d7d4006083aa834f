#pragma once
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/scene/pair_difference.hpp"

namespace kbvh {

/// A strategy that consists of several instances of others, one of which answers. A derived class decides
/// which one, in `advance_to` (`answer_by`), and passes its questions on to `active()`. All instances exist
/// from the start, so that a change of the active one allocates no more than a `reset` does; an instance
/// starts when it first answers.
///
/// The counters are those of the instances, so the class does not derive from CountedStrategy.
template <class S>
class OneOfMany : public Strategy<S>, public AnswersChanges<S>, public TakesPlanChanges<S> {
 public:
  using Strategy<S>::Strategy;

  bool wants_all_positions() const override { return active().info->positions == PositionUse::all; }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return active().strategy->audit_view(body);
  }
  void be_timed() override {
    for (Instance& one : instances_) one.strategy->be_timed();
  }
  std::size_t bytes() const override {
    std::size_t total = changed_.capacity() * sizeof(PlanChange<S>) + difference_.bytes() +
                        (now_.capacity() + before_.capacity()) * sizeof(PrimitivePair);
    for (const Reported& one : reported_) total += one.pairs.bytes();
    for (const Instance& one : instances_) total += one.strategy->bytes();
    return total;
  }
  /// Lists the instances that have answered, and their numbers of frames.
  std::string choice() const override {
    std::string text;
    for (const Instance& one : instances_)
      if (one.frames > 0)
        text += (text.empty() ? "" : ", ") + one.info->id + " for " + std::to_string(one.frames) +
                (one.frames == 1 ? " frame" : " frames");
    return text;
  }

 protected:
  struct Instance {
    const Info* info = nullptr;
    std::unique_ptr<Strategy<S>> strategy;
    bool started = false;      ///< since `reset`
    int frames = 0, last = 0;  ///< number of frames that it answered after the first one, and the last one
  };

  Instance& active() { return instances_[active_]; }
  const Instance& active() const { return instances_[active_]; }
  /// Forgets everything, and starts instance 0 at t.
  void start_over(double t) {
    for (Instance& one : instances_) {
      one.started = false;
      one.frames = one.last = 0;
    }
    retired_ = {};
    changed_.clear();
    body_changed_.assign(this->scene_.body_count(), 0);
    for (Reported& one : reported_) one.pairs.clear();
    frame_ = changed_at_ = 0;
    active_ = 0;
    start(t);
  }
  /// Makes an instance answer the next frame, at t.
  void answer_by(std::size_t instance, double t) {
    const bool advances = goes_on(instance);
    if (instance != active_) switched();
    active_ = instance;
    ++frame_;
    ++active().frames;
    active().last = frame_;
    if (!advances) return start(t);
    if (wants_all_positions()) fetch_all();
    active().strategy->advance(t);
  }
  /// Takes the current frame back from the active instance; another one has to answer it.
  void step_back() {
    --active().frames;
    active().last = --frame_;
  }
  /// Whether an instance that answers the next frame goes on from where it was: the active one, and another
  /// after few frames without changes of plans.
  bool goes_on(std::size_t instance) const {
    const Instance& one = instances_[instance];
    return instance == active_ || (one.started && frame_ - one.last < few_frames && changed_at_ <= one.last);
  }
  /// Returns the pairs of the last answer as changes.
  const PairSet& pairs_of_changes(Answer answer) const { return reported_[std::size_t(answer)].pairs; }
  int frame() const { return frame_; }

  void confirm_candidates(double t, PairBuffer& pairs) override { active().strategy->confirm(t, pairs); }
  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    Reported& reported = reported_[std::size_t(answer)];
    Strategy<S>& strategy = *active().strategy;
    strategy.changes_at(t, answer, begun, ended);
    if (!std::exchange(reported.current, true)) {
      // What the instance last answered itself may be old. Its changes brought it up to date; reported is
      // the difference from the pairs of its predecessor.
      begun.clear();
      ended.clear();
      now_.clear();
      if (answer == Answer::pairs)
        strategy.pairs_at(t, now_);
      else
        strategy.candidates_at(t, now_, {});
      before_.clear();
      reported.pairs.append_to(before_);
      difference_.find(before_, now_, begun, ended);
    }
    for (const PrimitivePair& pair : ended) reported.pairs.erase(pair);
    for (const PrimitivePair& pair : begun) reported.pairs.insert(pair);
  }
  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    for (const PlanChange<S>& change : changes)
      if (std::exchange(body_changed_[change.body], 1) == 0) changed_.push_back(change);
    active().strategy->flight_plans_changed(t, changes);
    changed_at_ = frame_;
  }

  void start_counting() override { first_fetch_ = this->sampled_.fetched(); }
  Counters counted() const override {
    Counters table = retired_;
    for (const Instance& one : instances_)
      if (one.started) add(table, one.strategy->counters());
    // All instances read the same positions, and each counts the fetches of all instances.
    table[Counter::positions_fetched] = this->sampled_.fetched() - first_fetch_;
    return table;
  }

  std::vector<Instance> instances_;

 private:
  static constexpr int few_frames = 128;

  static void add(Counters& sum, const Counters& other) {
    for (const Counter peak : {Counter::list_peak, Counter::queue_peak})
      sum[peak] = std::max(sum[peak], other[peak]) - other[peak];
    for (std::size_t c = 0; c < sum.values.size(); ++c) sum.values[c] += other.values[c];
    for (const Counters::Named& counter : other.named) sum.add(counter.name, counter.value);
  }
  void fetch_all() {
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) this->sampled_.fetch_all(body);
  }
  /// Starts the active instance. It sees the current plans, but does not know which bodies no longer rest.
  void start(double t) {
    Instance& one = active();
    if (one.started) add(retired_, one.strategy->counters());
    if (wants_all_positions()) fetch_all();
    one.strategy->reset(t);
    if (!changed_.empty()) one.strategy->flight_plans_changed(t, changed_);
    one.started = true;
    switched();
  }
  void switched() {
    for (Reported& one : reported_) one.current = false;
  }

  std::size_t active_ = 0;
  int frame_ = 0, changed_at_ = 0;  ///< frames since `reset`; the last one with changes of plans
  Counters retired_;                ///< counts of instances before their restart
  std::uint64_t first_fetch_ = 0;
  std::vector<PlanChange<S>> changed_;  ///< the first change of each body since `reset`
  std::vector<std::uint8_t> body_changed_;
  /// The sum of all changes of an answer.
  struct Reported {
    PairSet pairs;
    bool current = false;  ///< from the currently active instance
  };
  Reported reported_[2];  ///< [Answer]
  PairBuffer now_, before_;
  PairDifference difference_;
};

}  // namespace kbvh
