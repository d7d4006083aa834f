#include "core/broad_phase/changes.hpp"

#include <algorithm>
#include <iterator>

#include "core/base/assert.hpp"

namespace kbvh {

CandidateChanges ChangeTracker::take(std::span<const Candidate> present, std::uint32_t first_ids) {
  present_.resize(present.size());
  // places_[i + 1] first counts the pairs of id i, then is the place of the next one, at last of their end.
  places_.assign(std::size_t(first_ids) + 2, 0);
  for (const Candidate& pair : present) {
    KBVH_ASSERT(pair.first < first_ids);
    ++places_[pair.first + 2];
  }
  for (std::size_t i = 2; i < places_.size(); ++i) places_[i] += places_[i - 1];
  for (const Candidate& pair : present) present_[places_[pair.first + 1]++] = pair;
  for (std::uint32_t i = 0; i < first_ids; ++i)
    std::sort(present_.begin() + places_[i], present_.begin() + places_[i + 1]);

  begun_.clear();
  ended_.clear();
  auto before = known_.begin();
  auto now = present_.begin();
  while (before != known_.end() && now != present_.end()) {
    if (*before == *now) {
      ++before;
      ++now;
    } else if (*before < *now) {
      ended_.push_back(*before++);
    } else {
      begun_.push_back(*now++);
    }
  }
  ended_.insert(ended_.end(), before, known_.end());
  begun_.insert(begun_.end(), now, present_.end());
  known_.swap(present_);
  return {span_of(begun_), span_of(ended_)};
}

std::size_t ChangeTracker::bytes() const {
  return (known_.capacity() + present_.capacity() + begun_.capacity() + ended_.capacity()) *
             sizeof(Candidate) +
         places_.capacity() * sizeof(std::uint32_t);
}

}  // namespace kbvh
