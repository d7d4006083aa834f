#include "core/families/average/probable_pairs.hpp"

#include <algorithm>
#include <bit>

#include "core/families/average/kernels/meeting.hpp"

namespace kbvh {
namespace {

/// A strict order of entries, so that equal probabilities do not depend on history.
template <class Entry>
bool less_probable(const Entry& x, const Entry& y) {
  if (x.probability != y.probability) return x.probability < y.probability;
  if (x.bodies != y.bodies) return x.bodies > y.bodies;
  return x.a != y.a ? x.a > y.a : x.b > y.b;
}

}  // namespace

template <class S>
auto ProbablePairs<S>::pop() -> Entry {
  std::pop_heap(heap_.begin(), heap_.end(), less_probable<Entry>);
  const Entry top = heap_.back();
  heap_.pop_back();
  return top;
}

template <class S>
auto ProbablePairs<S>::group_of(const Side& side, std::uint32_t slot) -> Group {
  if (is_leaf(side, slot)) return {slot, 1};
  const WideNode* const nodes = side.hierarchy->arrays().nodes;
  std::uint32_t wide = 0;
  if (slot != root) wide = nodes[slot / 8].first_child + slot % 8 - nodes[slot / 8].leaf_count;
  return {8 * wide, nodes[wide].count};
}

template <class S>
FilledBox ProbablePairs<S>::box_of(const Side& side, std::uint32_t slot) {
  const std::uint32_t width = side.hierarchy->topology().width;
  const S* const row = side.hierarchy->arrays().child_bounds + slot / 8 * lane_scalars(width) + slot % 8;
  FilledBox box;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = row[axis * width];
    box.upper[axis] = -row[(axis + 3) * width];
  }
  box.filled = side.grids->of(slot);
  box.amount = side.grids->amount(slot);
  return box;
}

template <class S>
std::uint64_t ProbablePairs<S>::expand(const Entry& entry, const Side& a, const Side& b,
                                       Distribution distribution) {
  const Group first = group_of(a, entry.a), second = group_of(b, entry.b);
  const std::uint32_t width = b.hierarchy->topology().width;
  const S* const rows = b.hierarchy->arrays().child_bounds + second.first / 8 * lane_scalars(width);
  const auto meeting = meeting_kernels<S>(b.hierarchy->kernels()).meeting(width);
  FilledBox others[8];
  for (std::uint32_t k = 0; k < second.count; ++k) others[k] = box_of(b, second.first + k);
  for (std::uint32_t i = first.first; i < first.first + first.count; ++i) {
    const FilledBox box = box_of(a, i);
    S sides[6];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sides[axis] = S(box.lower[axis]);
      sides[axis + 3] = S(box.upper[axis]);
    }
    unsigned hit = meeting(rows, sides) >> second.first % 8 & ((1U << second.count) - 1);
    for (; hit != 0; hit &= hit - 1) {
      const auto k = std::uint32_t(std::countr_zero(hit));
      heap_.push_back(
          {float(probability_of_meeting(box, others[k], distribution)), entry.bodies, i, second.first + k});
      std::push_heap(heap_.begin(), heap_.end(), less_probable<Entry>);
    }
  }
  return std::uint64_t(first.count) * second.count;
}

template class ProbablePairs<float>;
template class ProbablePairs<double>;

}  // namespace kbvh
