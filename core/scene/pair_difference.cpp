#include "core/scene/pair_difference.hpp"

#include <algorithm>
#include <bit>

namespace kbvh {

namespace {

/// The farthest that the walk looks ahead for a partner.
constexpr std::size_t reach = 16;
/// The number of pairs after which the walk is reviewed. If half of them had no partner, the answers have no
/// common order, and the rest is looked up.
constexpr std::size_t window = 1024;

constexpr PrimitivePair free_slot{~0u, ~0u, ~0u, ~0u};

/// Returns a number of slots of a table that is at most half full.
std::size_t slots_for(std::size_t pairs) {
  return std::bit_ceil(2 * pairs + 16);
}

/// Mixes the four words of a pair.
std::uint64_t hash_of(const PrimitivePair& pair) {
  const std::uint64_t bodies = (std::uint64_t(pair.body_a) << 40) + (std::uint64_t(pair.body_b) << 8);
  std::uint64_t word = ((std::uint64_t(pair.primitive_a) << 32) | pair.primitive_b) ^ bodies;
  word *= 0x9e3779b97f4a7c15u;
  word = (word ^ (word >> 32)) * 0xd6e8feb86659fd93u;
  return word ^ (word >> 32);
}

}  // namespace

void PairDifference::find(std::span<const PrimitivePair> before, std::span<const PrimitivePair> after,
                          PairBuffer& begun, PairBuffer& ended) {
  left_before_.clear();
  left_after_.clear();
  walk(before, after);
  if (left_before_.empty() || left_after_.empty()) {
    begun.insert(begun.end(), left_after_.begin(), left_after_.end());
    ended.insert(ended.end(), left_before_.begin(), left_before_.end());
    return;
  }
  look_up(begun, ended);
}

/// Drops pairs that both answers have at corresponding places; keeps all others in `left_before_` and
/// `left_after_`.
void PairDifference::walk(std::span<const PrimitivePair> before, std::span<const PrimitivePair> after) {
  const PrimitivePair* a = before.data();
  const PrimitivePair* b = after.data();
  const PrimitivePair *const a_end = a + before.size(), *const b_end = b + after.size();
  const auto keep = [](PairBuffer& to, const PrimitivePair* from, const PrimitivePair* end) {
    to.insert(to.end(), from, end);
  };
  while (a != a_end && b != b_end) {
    const PrimitivePair *const a_window = a, *const a_stop = a + std::min<std::size_t>(window, a_end - a);
    const std::size_t left = left_before_.size() + left_after_.size();
    while (a != a_stop && b != b_end) {
      if (*a == *b) {
        ++a;
        ++b;
        continue;
      }
      // The nearest partner of either pair decides which one is passed over.
      const auto ahead = std::min<std::size_t>({reach, std::size_t(a_end - a), std::size_t(b_end - b)});
      std::size_t k = 1;
      while (k < ahead && !(a[k] == *b) && !(*a == b[k])) ++k;
      if (k < ahead && a[k] == *b) {
        keep(left_before_, a, a + k);
        a += k;
      } else if (k < ahead) {
        keep(left_after_, b, b + k);
        b += k;
      } else {
        left_before_.push_back(*a++);
        left_after_.push_back(*b++);
      }
      if (a > a_stop) break;
    }
    const std::size_t differing = left_before_.size() + left_after_.size() - left;
    if (2 * differing > std::size_t(a - a_window)) break;  // no common order
  }
  keep(left_before_, a, a_end);
  keep(left_after_, b, b_end);
}

void PairDifference::look_up(PairBuffer& begun, PairBuffer& ended) {
  const std::size_t slots = slots_for(left_before_.size());
  if (slots > table_.size()) {
    table_.assign(slots, 0);
    stamp_ = 0;
  }
  if (++stamp_ == 0) {
    std::fill(table_.begin(), table_.end(), 0);
    stamp_ = 1;
  }
  // Only as much of the table as needed: the rest stays out of the cache.
  const std::size_t mask = slots - 1;
  const std::uint64_t stamp = std::uint64_t(stamp_) << 32;
  for (std::size_t i = 0; i < left_before_.size(); ++i) {
    std::size_t slot = hash_of(left_before_[i]) & mask;
    while ((table_[slot] >> 32) == stamp_) slot = (slot + 1) & mask;
    table_[slot] = stamp | i;
  }
  met_.assign(left_before_.size(), 0);
  for (const PrimitivePair& pair : left_after_) {
    std::size_t slot = hash_of(pair) & mask;
    bool known = false;
    for (; !known && (table_[slot] >> 32) == stamp_; slot = (slot + 1) & mask) {
      const auto i = std::uint32_t(table_[slot]);
      known = left_before_[i] == pair;
      if (known) met_[i] = 1;
    }
    if (!known) begun.push_back(pair);
  }
  for (std::size_t i = 0; i < left_before_.size(); ++i)
    if (met_[i] == 0) ended.push_back(left_before_[i]);
}

std::size_t PairDifference::bytes() const {
  return (left_before_.capacity() + left_after_.capacity()) * sizeof(PrimitivePair) +
         table_.capacity() * sizeof(table_[0]) + met_.capacity();
}

void PairSet::clear() {
  std::fill(slots_.begin(), slots_.end(), free_slot);
  size_ = 0;
}

/// Returns the slot of the pair, or the free slot where it belongs.
std::size_t PairSet::find(const PrimitivePair& pair) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t slot = hash_of(pair) & mask;
  while (!(slots_[slot] == pair) && !(slots_[slot] == free_slot)) slot = (slot + 1) & mask;
  return slot;
}

bool PairSet::insert(const PrimitivePair& pair) {
  if (2 * (size_ + 1) > slots_.size()) grow();
  PrimitivePair& slot = slots_[find(pair)];
  if (slot == pair) return false;
  slot = pair;
  ++size_;
  return true;
}

bool PairSet::erase(const PrimitivePair& pair) {
  if (size_ == 0) return false;
  std::size_t hole = find(pair);
  if (slots_[hole] == free_slot) return false;
  --size_;
  // Moves back every pair that the free slot would cut off from its place.
  const std::size_t mask = slots_.size() - 1;
  for (std::size_t slot = (hole + 1) & mask; !(slots_[slot] == free_slot); slot = (slot + 1) & mask) {
    const std::size_t home = hash_of(slots_[slot]) & mask;
    if (((slot - home) & mask) < ((slot - hole) & mask)) continue;
    slots_[hole] = slots_[slot];
    hole = slot;
  }
  slots_[hole] = free_slot;
  return true;
}

void PairSet::grow() {
  PairBuffer old(std::max<std::size_t>(32, 2 * slots_.size()), free_slot);
  old.swap(slots_);
  for (const PrimitivePair& pair : old)
    if (!(pair == free_slot)) slots_[find(pair)] = pair;
}

void PairSet::sample(std::size_t most, PairBuffer& out) const {
  const std::size_t stride = std::max<std::size_t>(1, slots_.size() / (4 * most)), end = out.size() + most;
  for (std::size_t slot = 0; slot < slots_.size() && out.size() < end; slot += stride)
    if (!(slots_[slot] == free_slot)) out.push_back(slots_[slot]);
}

void PairSet::append_to(PairBuffer& out) const {
  for (const PrimitivePair& pair : slots_)
    if (!(pair == free_slot)) out.push_back(pair);
}

}  // namespace kbvh
