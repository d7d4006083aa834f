#include "core/families/sweep/sorted_boxes.hpp"

#include <algorithm>
#include <cmath>
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
  sorted_.resize(primitives_.size());
  codes_.resize(primitives_.size());
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
bool SortedBoxes<S>::insertion_sort(std::size_t most_steps) {
  for (std::size_t i = 1; i < keys_.size(); ++i) {
    const Key key = keys_[i];
    std::size_t place = i;
    for (; place > 0 && key.lower < keys_[place - 1].lower; --place) keys_[place] = keys_[place - 1];
    keys_[place] = key;
    if (i - place > most_steps) return false;
    most_steps -= i - place;
  }
  return true;
}

template <class S>
void SortedBoxes<S>::radix_sort() {
  S least = keys_[0].lower, most = least;
  for (const Key& key : keys_) {
    least = std::min(least, key.lower);
    most = std::max(most, key.lower);
  }
  const double scale = double((1U << 30) - 1) / (double(most) - double(least));
  if (!std::isfinite(scale)) return;
  std::uint32_t* const counts = radix_.counts();
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    const auto code = std::uint32_t((double(keys_[k].lower) - double(least)) * scale);
    codes_[k] = std::uint64_t(code) << 32 | k;
    for (std::uint32_t digit = 0; digit < RadixSort::digits; ++digit)
      ++counts[digit * RadixSort::bins + (code >> (digit * RadixSort::digit_bits) & (RadixSort::bins - 1))];
  }
  radix_.sort(codes_);
  for (std::size_t k = 0; k < keys_.size(); ++k) sorted_[k] = keys_[std::uint32_t(codes_[k])];
  keys_.swap(sorted_);
}

template <class S>
void SortedBoxes<S>::sort() {
  if (keys_.empty() || insertion_sort(4 * keys_.size())) return;
  radix_sort();
  // Sorts what the codes cannot distinguish.
  if (insertion_sort(16 * keys_.size())) return;
  std::sort(keys_.begin(), keys_.end(), [](const Key& a, const Key& b) {
    return a.lower != b.lower ? a.lower < b.lower : a.primitive < b.primitive;
  });
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
         (keys_.capacity() + sorted_.capacity()) * sizeof(Key) + codes_.capacity() * sizeof(std::uint64_t) +
         radix_.bytes() + (rows_.capacity() + block_boxes_.capacity() + reach_.capacity()) * sizeof(S);
}

template class SortedBoxes<float>;
template class SortedBoxes<double>;

}  // namespace kbvh
