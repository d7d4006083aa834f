#include "core/judge/verify_changes.hpp"

#include <algorithm>
#include <iterator>

#include "core/judge/sort_pairs.hpp"
#include "core/judge/verify.hpp"

namespace kbvh {

namespace {

/// Returns the first pair of `a` that `b` has (`had`) or lacks (not `had`); null if there is none. Both lists
/// are sorted.
const PrimitivePair* first_of(const PairBuffer& a, bool had, const PairBuffer& b) {
  auto from = b.begin();
  for (const PrimitivePair& pair : a) {
    while (from != b.end() && *from < pair) ++from;
    if ((from != b.end() && *from == pair) == had) return &pair;
  }
  return nullptr;
}
const PrimitivePair* lacking(const PairBuffer& a, const PairBuffer& b) {
  return first_of(a, false, b);
}

const char* name(Answer answer) {
  return answer == Answer::candidates ? "candidates" : "pairs";
}

/// Plays one clip.
template <class S>
class ChangesChecker {
 public:
  ChangesChecker(Session<S>& session, Oracle<S>& oracle, bool known_truth, ChangesVerification& result)
      : session_(session), oracle_(oracle), known_truth_(known_truth), result_(result) {}

  void ask(Answer answer) {
    const std::size_t kind = std::size_t(answer);
    session_.changes(answer, begun_, ended_, ignored_);
    if (const std::string fault = replays_[kind].add(begun_, ended_); !fault.empty())
      violate(std::string("changes of ") + name(answer) + ": " + fault);
    if (asked_[kind] && answer == Answer::pairs) {
      result_.begun += begun_.size();
      result_.ended += ended_.size();
    }
    asked_[kind] = true;
  }
  /// Fills `full_` with both full answers.
  void ask_in_full() {
    PairBuffer& candidates = full_[std::size_t(Answer::candidates)];
    candidates.clear();
    session_.strategy().candidates_at(time(), candidates, Budget{});
    full_[std::size_t(Answer::pairs)] = candidates;
    session_.strategy().confirm(time(), full_[std::size_t(Answer::pairs)]);
    for (PairBuffer& pairs : full_) sort_pairs(pairs);
  }
  void compare_with_full(Answer answer) {
    const PairBuffer &added = replays_[std::size_t(answer)].pairs(), &full = full_[std::size_t(answer)];
    if (added == full) return;
    const PrimitivePair* lost = lacking(full, added);
    const PrimitivePair* extra = lacking(added, full);
    violate("added changes of " + std::string(name(answer)) + ": " +
            (lost != nullptr    ? "pair " + text(*lost) + " has not begun"
             : extra != nullptr ? "pair " + text(*extra) + " has not ended"
                                : "the full answer repeats a pair"));
  }
  void compare_with_truth(bool pairs, bool candidates) {
    if (session_.info().guarantee == Guarantee::approximate) return;
    session_.playback().evaluate_all();
    const PairBuffer& truth = known_truth_
                                  ? oracle_.pairs(session_.playback(), session_.scene(), geometry_changes_)
                                  : (found_ = sweep_pairs(session_.scene(), session_.playback()), found_);
    if (candidates)
      if (const PrimitivePair* lost = lacking(truth, replays_[0].pairs()))
        violate("added changes of candidates: the true pair " + text(*lost) + " has not begun");
    if (!pairs) return;
    if (const PrimitivePair* lost = lacking(truth, replays_[1].pairs()))
      violate("added changes of pairs: the true pair " + text(*lost) + " has not begun");
    if (const PrimitivePair* extra = lacking(replays_[1].pairs(), truth))
      violate("added changes of pairs: pair " + text(*extra) + " does not intersect, and has not ended");
  }

  void geometry_changed() { ++geometry_changes_; }

 private:
  double time() { return session_.playback().time(); }
  void violate(const std::string& what) {
    if (result_.first_violation.empty()) result_.first_violation = "t = " + number_text(time()) + ": " + what;
  }
  Session<S>& session_;
  Oracle<S>& oracle_;
  bool known_truth_;
  std::uint32_t geometry_changes_ = 0;
  ChangesVerification& result_;
  ChangeReplay replays_[2];  ///< [Answer]
  bool asked_[2] = {false, false};
  PairBuffer full_[2], begun_, ended_, found_;
  PhaseTimes ignored_;
};

}  // namespace

std::string ChangeReplay::add(PairBuffer begun, PairBuffer ended) {
  for (PairBuffer* pairs : {&begun, &ended}) {
    sort_pairs(*pairs);
    if (const auto twice = std::adjacent_find(pairs->begin(), pairs->end()); twice != pairs->end())
      return "pair " + text(*twice) + (pairs == &begun ? " begins twice" : " ends twice");
  }
  if (const PrimitivePair* known = first_of(begun, true, pairs_))
    return "pair " + text(*known) + " begins while it lasts";
  if (const PrimitivePair* unknown = lacking(ended, pairs_))
    return "pair " + text(*unknown) + " ends without a begin";
  kept_.clear();
  std::set_difference(pairs_.begin(), pairs_.end(), ended.begin(), ended.end(), std::back_inserter(kept_));
  pairs_.clear();
  std::merge(kept_.begin(), kept_.end(), begun.begin(), begun.end(), std::back_inserter(pairs_));
  return {};
}

template <class S>
ChangesVerification verify_changes(Session<S>& session, std::span<const double> frames, Oracle<S>& oracle,
                                   const PlanScript<S>* script, const VerifyChangesOptions& options) {
  ChangesVerification result;
  const bool known_truth = oracle.script() == (script ? hash(*script) : 0);
  ChangesChecker<S> checker(session, oracle, known_truth, result);
  ScriptCursor<S> cursor(script);
  PhaseTimes ignored;
  std::size_t calls = 0;
  const auto query = [&](bool compared, bool last) {
    const bool mixed = options.calls == VerifyChangesOptions::Calls::mixed;
    const std::size_t call = calls++;
    const bool candidates = !mixed || last || call % 3 != 1, pairs = !mixed || last || call % 4 != 2;
    const bool before = mixed && call % 5 == 0, after = compared && (!mixed || last || call % 2 == 0);
    if (before) checker.ask_in_full();
    // The order of the two kinds must not matter.
    const bool pairs_first = call % 2 == 1;
    if (pairs && pairs_first) checker.ask(Answer::pairs);
    if (candidates) checker.ask(Answer::candidates);
    if (pairs && !pairs_first) checker.ask(Answer::pairs);
    if (after) checker.ask_in_full();
    if ((before || after) && candidates) checker.compare_with_full(Answer::candidates);
    if ((before || after) && pairs) checker.compare_with_full(Answer::pairs);
    if (compared) checker.compare_with_truth(pairs, candidates);
  };
  for (std::size_t f = 0; f < frames.size() && result.first_violation.empty(); ++f) {
    f == 0 ? session.reset(frames[0]) : session.advance(frames[f], ignored);
    const bool last = f + 1 == frames.size();
    query(f % options.every_nth_frame == 0 || last, last);
    const auto* step = cursor.at(frames[f]);
    if (step == nullptr) continue;
    if (!step->changes.empty()) session.change_plans(step->changes, ignored);
    if (step->geometry.empty()) continue;
    session.change_geometry(step->geometry, ignored);
    checker.geometry_changed();
    query(f % options.every_nth_frame == 0 || last, last);
  }
  return result;
}

template ChangesVerification verify_changes(Session<float>&, std::span<const double>, Oracle<float>&,
                                            const PlanScript<float>*, const VerifyChangesOptions&);
template ChangesVerification verify_changes(Session<double>&, std::span<const double>, Oracle<double>&,
                                            const PlanScript<double>*, const VerifyChangesOptions&);

}  // namespace kbvh
