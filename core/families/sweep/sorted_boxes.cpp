#include "core/families/sweep/sorted_boxes.hpp"

#include <algorithm>
#include <numeric>

namespace kbvh {

template <class S>
void SortedBoxes<S>::start(const PrimitiveList& list, KernelSet kernels) {
  kernels_ = kernels;
  primitives_ = list.living;
  if (list.ids() == nullptr) {
    primitives_.resize(list.count);
    std::iota(primitives_.begin(), primitives_.end(), 0U);
  }
  const std::size_t blocks = (primitives_.size() + sweep_block - 1) / sweep_block;
  keys_.resize(primitives_.size());
  begins_.resize(blocks);
  ends_.resize(blocks);
  for (std::uint32_t block = 0; block < blocks; ++block) {
    begins_[block] = block * sweep_block;
    ends_[block] = std::min(begins_[block] + sweep_block, std::uint32_t(primitives_.size()));
  }
  rows_.resize(blocks * 6 * sweep_block);
  block_boxes_.resize(8 * blocks);
  reach_.resize(blocks);
}

template <class S>
void SortedBoxes<S>::sort() {
  // Insertion sort, until it takes more steps than sorting anew.
  std::size_t steps = 16 * keys_.size();
  for (std::size_t i = 1; i < keys_.size(); ++i) {
    const Key key = keys_[i];
    std::size_t place = i;
    for (; place > 0 && key.lower < keys_[place - 1].lower; --place) keys_[place] = keys_[place - 1];
    keys_[place] = key;
    if (i - place > steps) {
      std::sort(keys_.begin(), keys_.end(), [](const Key& a, const Key& b) {
        return a.lower != b.lower ? a.lower < b.lower : a.primitive < b.primitive;
      });
      return;
    }
    steps -= i - place;
  }
}

template <class S>
void SortedBoxes<S>::update(const S* boxes, std::uint32_t axis) {
  for (std::size_t k = 0; k < keys_.size(); ++k)
    keys_[k] = {boxes[std::size_t(8) * primitives_[k] + axis], primitives_[k]};
  sort();
  for (std::size_t k = 0; k < keys_.size(); ++k) primitives_[k] = keys_[k].primitive;
  build_kernels<S>(kernels_).leaf_rows[3]({boxes, primitives_.data(), begins_.data(), ends_.data(),
                                           std::uint32_t(begins_.size()), rows_.data(), block_boxes_.data()});
  for (std::size_t block = 0; block < begins_.size(); ++block) {
    const S* const own = block_boxes_.data() + 8 * block;
    for (std::size_t side = 0; side < 8; ++side) {
      if (side % 4 == 3) continue;
      S& bound = box_[side];
      bound = block == 0 ? own[side] : side < 4 ? std::min(bound, own[side]) : std::max(bound, own[side]);
    }
    reach_[block] = box_[axis + 4];
  }
}

template <class S>
SweepSide<S> SortedBoxes<S>::side(std::uint32_t body) const {
  SweepSide<S> side{
      rows_.data(), reach_.data(), primitives_.data(), std::uint32_t(primitives_.size()), body, {}};
  std::copy(box_.begin(), box_.end(), side.box);
  return side;
}

template <class S>
Box<double> SortedBoxes<S>::box() const {
  Box<double> box;
  if (empty()) return box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = box_[axis];
    box.upper[axis] = box_[axis + 4];
  }
  return box;
}

template <class S>
std::size_t SortedBoxes<S>::bytes() const {
  return (primitives_.capacity() + begins_.capacity() + ends_.capacity()) * sizeof(std::uint32_t) +
         keys_.capacity() * sizeof(Key) +
         (rows_.capacity() + block_boxes_.capacity() + reach_.capacity()) * sizeof(S);
}

template class SortedBoxes<float>;
template class SortedBoxes<double>;

}  // namespace kbvh
