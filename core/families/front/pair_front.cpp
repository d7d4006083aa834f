#include "core/families/front/pair_front.hpp"

#include <algorithm>

#include "core/base/assert.hpp"
#include "core/families/wide/leaf_slots.hpp"

namespace kbvh {

template <class S>
void PairFront<S>::clear() {
  old_parts_.clear();
  kept_parts_.clear();
  kept_count_ = next_part_ = 0;
}

template <class S>
void PairFront<S>::start_frame() {
  for (; next_part_ < old_parts_.size(); ++next_part_) climbed_ += old_parts_[next_part_].entries();
  std::swap(old_, kept_);
  std::swap(old_parts_, kept_parts_);
  kept_parts_.clear();
  kept_count_ = next_part_ = 0;
  old_parts_.reserve(kept_parts_.capacity());
  kept_parts_.reserve(old_parts_.capacity());
}

template <class S>
typename PairFront<S>::Part PairFront<S>::old_part(std::uint32_t body_pair) {
  for (; next_part_ < old_parts_.size() && old_parts_[next_part_].body_pair <= body_pair; ++next_part_) {
    const Part& part = old_parts_[next_part_];
    if (part.body_pair == body_pair) {
      ++next_part_;
      return part;
    }
    climbed_ += part.entries();
  }
  return {body_pair, 0, 0};
}

template <class S>
FrontUpdate PairFront<S>::make_update(const Part& part, std::uint64_t test_limit) {
  leaf_pairs_.resize(2 * leaf_pair_room);
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  make_room(kept_count_ + part.entries() + 1);
  return {old_.data(),
          part.begin,
          part.end,
          stack_.data(),
          0,
          stack_.size(),
          kept_.data(),
          kept_count_,
          kept_.size(),
          leaf_pairs_.data(),
          0,
          leaf_pair_room,
          /*tests=*/1,
          test_limit,
          0,
          0};
}

template <class S>
void PairFront<S>::make_room(std::size_t entries) {
  if (entries <= kept_.size() && kept_.size() == old_.size()) return;
  const std::size_t room = std::max({2 * entries, kept_.size(), old_.size()});
  kept_.resize(room);
  old_.resize(room);
}

template <class S>
void PairFront<S>::grow(FrontUpdate& update) {
  if (update.depth + max_pairs_per_step >= update.stack_room) stack_.resize(2 * stack_.size());
  if (update.kept_count == update.kept_room) make_room(update.kept_room + 1);
  update.old = old_.data();
  update.stack = stack_.data();
  update.stack_room = stack_.size();
  update.kept = kept_.data();
  update.kept_room = kept_.size();
}

template <class S>
QueryStatus PairFront<S>::run(std::uint32_t body_pair, const Side& a, const Side& b, WideQuery<S>& query,
                              PairBuffer& out, std::uint64_t& tests, const Budget& budget) {
  KBVH_ASSERT(kept_parts_.empty() || kept_parts_.back().body_pair < body_pair);
  const Part part = old_part(body_pair);
  if (a.hierarchy->empty() || b.hierarchy->empty()) return {};
  if (!overlap(a.hierarchy->root_box(), b.hierarchy->root_box())) {
    ++tests;
    climbed_ += part.entries();
    return {};
  }
  FrontUpdate update = make_update(part, budget.box_tests);
  if (part.entries() == 0) {
    update.stack[update.depth++] = {0, 0, 0};
    ++update.descended;
  }
  const auto kernel = front_kernels<S>(a.hierarchy->kernels()).update(a.hierarchy->width(), a.body == b.body);
  while (!update.done() && update.tests < update.test_limit) {
    kernel(a.hierarchy->arrays(), b.hierarchy->arrays(), update);
    query.run_leaves(a, b, {update.out, 2 * update.found}, out, tests);
    update.found = 0;
    grow(update);
  }
  tests += update.tests;
  descended_ += update.descended;
  climbed_ += update.climbed;
  const std::size_t untested = update.depth + (update.end - update.next);
  // The boxes of an untested entry may be apart after its parent has recorded that; it would be made twice
  // later on.
  if (untested != 0) return {untested};
  kept_parts_.push_back({body_pair, kept_count_, update.kept_count});
  kept_count_ = update.kept_count;
  return {};
}

template <class S>
std::size_t PairFront<S>::bytes() const {
  return (old_.capacity() + kept_.capacity() + stack_.capacity()) * sizeof(FrontPair) +
         (old_parts_.capacity() + kept_parts_.capacity()) * sizeof(Part) +
         leaf_pairs_.capacity() * sizeof(LeafSlot);
}

template class PairFront<float>;
template class PairFront<double>;

}  // namespace kbvh
