#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/broad_phase/elements.hpp"

namespace kbvh {

/// What differs between two lists of candidates of one kind: the pairs that only the later one holds, and
/// those that only the earlier one holds, each ascending.
struct CandidateChanges {
  std::span<const Candidate> begun, ended;
};

/// Compares each list of candidates with the one before. Sorts by the first id in buckets, then each bucket:
/// O(elements + pairs log(pairs of one element)). Once warm, allocates only for longer lists.
class ChangeTracker {
 public:
  /// Forgets the list before: all pairs of the next one begin.
  void clear() { known_.clear(); }
  /// Compares with the list before, and keeps this one for the next call. All first ids are less than
  /// `first_ids`; pairs come in any order, each once. The result is valid until the next call.
  CandidateChanges take(std::span<const Candidate> present, std::uint32_t first_ids);
  std::size_t bytes() const;

 private:
  CandidateBuffer known_, present_, begun_, ended_;  // all ascending
  std::vector<std::uint32_t> places_;                // [first id + 1]
};

}  // namespace kbvh
