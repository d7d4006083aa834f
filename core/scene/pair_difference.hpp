#pragma once
#include <cstdint>
#include <vector>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// Finds the pairs that two answers do not share. Time is linear in the answers, in any order of pairs. If
/// both list most pairs in the same order, as consecutive answers of one structure do, they are walked side
/// by side, and only the pairs around a difference are looked up in a table. Allocates only if it needs a
/// larger table than ever before.
class PairDifference {
 public:
  /// Appends the pairs of `after` that `before` lacks to `begun`, and those of `before` that `after` lacks to
  /// `ended`. Each answer contains a pair at most once.
  void find(std::span<const PrimitivePair> before, std::span<const PrimitivePair> after, PairBuffer& begun,
            PairBuffer& ended);
  std::size_t bytes() const;

 private:
  struct Left;
  Left walk(std::span<const PrimitivePair> before, std::span<const PrimitivePair> after);
  template <class Use>
  void for_slots(std::span<const PrimitivePair> pairs, std::size_t mask, const Use& use) const;
  void look_up(const Left& left, PairBuffer& begun, PairBuffer& ended);

  PairBuffer room_before_, room_after_;  ///< for pairs without a partner
  std::vector<std::uint64_t> table_;     ///< stamp of the call, and index into room_before_
  std::vector<std::uint8_t> met_;        ///< [room_before_]
  std::uint32_t stamp_ = 0;
};

/// The last answer of one kind, for answers as changes.
class AnswerHistory {
 public:
  /// Forgets the last answer: in the next one all pairs begin.
  void clear() { last_.clear(); }
  /// Returns an empty buffer for the next answer.
  PairBuffer& next() {
    next_.clear();
    return next_;
  }
  /// Appends the difference from the last answer to the one in `next`, which becomes the last.
  void take_next(PairBuffer& begun, PairBuffer& ended) {
    difference_.find(last_, next_, begun, ended);
    last_.swap(next_);
  }
  std::size_t bytes() const {
    return (last_.capacity() + next_.capacity()) * sizeof(PrimitivePair) + difference_.bytes();
  }

 private:
  PairBuffer last_, next_;
  PairDifference difference_;
};

/// A set of pairs that follows changes, O(1) each (linear probing; Knuth, TAOCP 3, 6.4, Algorithms L and R).
/// Allocates only if there are more pairs than ever before.
class PairSet {
 public:
  void clear();
  /// Return false, and change nothing, if the pair is already in the set (insert) or not in it (erase).
  bool insert(const PrimitivePair& pair);
  bool erase(const PrimitivePair& pair);
  std::size_t size() const { return size_; }
  /// Appends all pairs, in no particular order. O(largest size so far).
  void append_to(PairBuffer& out) const;
  /// Appends some pairs, at most `most`, spread over the set; they depend only on the pairs of the set.
  /// O(largest size so far).
  void sample(std::size_t most, PairBuffer& out) const;
  std::size_t bytes() const { return slots_.capacity() * sizeof(PrimitivePair); }

 private:
  std::size_t find(const PrimitivePair& pair) const;
  void grow();

  PairBuffer slots_;  ///< a power of two; `free` in empty slots
  std::size_t size_ = 0;
};

}  // namespace kbvh
