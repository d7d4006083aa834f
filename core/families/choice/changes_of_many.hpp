#pragma once
#include <cstddef>

#include "core/contract/strategy.hpp"
#include "core/scene/pair_difference.hpp"

namespace kbvh {

/// Changes of the answers of several strategies, one of which answers at a time. A strategy that has become
/// active since the last answer begins all its pairs; these are compared with the pairs that its predecessor
/// reported.
template <class S>
class ChangesOfMany {
 public:
  /// Forgets all answers, as at a reset.
  void start_over() {
    for (Reported& one : reported_) {
      one.pairs.clear();
      one.current = false;
    }
  }
  /// Registers that another strategy answers from now on.
  void switched() {
    for (Reported& one : reported_) one.current = false;
  }
  /// Queries the active strategy at t.
  void find(Strategy<S>& strategy, double t, Answer answer, PairBuffer& begun, PairBuffer& ended) {
    Reported& reported = reported_[std::size_t(answer)];
    if (reported.current) {
      strategy.changes_at(t, answer, begun, ended);
    } else {
      reported.current = true;
      strategy.changes_at(t, answer, now_, none_);
      before_.clear();
      reported.pairs.append_to(before_);
      difference_.find(before_, now_, begun, ended);
    }
    for (const PrimitivePair& pair : ended) reported.pairs.erase(pair);
    for (const PrimitivePair& pair : begun) reported.pairs.insert(pair);
  }
  /// Returns the sum of all changes of an answer.
  const PairSet& pairs(Answer answer) const { return reported_[std::size_t(answer)].pairs; }

  std::size_t bytes() const {
    return (now_.capacity() + before_.capacity()) * sizeof(PrimitivePair) + difference_.bytes() +
           reported_[0].pairs.bytes() + reported_[1].pairs.bytes();
  }

 private:
  struct Reported {
    PairSet pairs;
    bool current = false;  ///< from the currently active strategy
  };
  Reported reported_[2];  // [Answer]
  PairBuffer now_, none_, before_;
  PairDifference difference_;
};

}  // namespace kbvh
