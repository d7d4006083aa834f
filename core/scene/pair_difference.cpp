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

/// The pairs of two answers that have no partner at their place.
struct PairDifference::Left {
  std::span<const PrimitivePair> before, after;
};

void PairDifference::find(std::span<const PrimitivePair> before, std::span<const PrimitivePair> after,
                          PairBuffer& begun, PairBuffer& ended) {
  if (room_before_.size() < before.size()) room_before_.resize(before.size());
  if (room_after_.size() < after.size()) room_after_.resize(after.size());
  const Left left = walk(before, after);
  if (!left.before.empty() && !left.after.empty()) return look_up(left, begun, ended);
  begun.insert(begun.end(), left.after.begin(), left.after.end());
  ended.insert(ended.end(), left.before.begin(), left.before.end());
}

/// Skips the pairs that both answers have at corresponding places, and returns all others.
PairDifference::Left PairDifference::walk(std::span<const PrimitivePair> before,
                                          std::span<const PrimitivePair> after) {
  const PrimitivePair* a = before.data();
  const PrimitivePair* b = after.data();
  const PrimitivePair *const a_end = a + before.size(), *const b_end = b + after.size();
  PrimitivePair *left_a = room_before_.data(), *left_b = room_after_.data();
  while (a != a_end && b != b_end) {
    const PrimitivePair *const begin = a, *const stop = a + std::min<std::size_t>(window, a_end - a);
    const std::size_t left = (left_a - room_before_.data()) + (left_b - room_after_.data());
    while (a < stop && b != b_end) {
      if (*a == *b) {
        ++a;
        ++b;
        continue;
      }
      // The nearest partner of either pair decides which one is skipped.
      const auto ahead = std::min<std::size_t>({reach, std::size_t(a_end - a), std::size_t(b_end - b)});
      std::size_t k = 1;
      while (k < ahead && !(a[k] == *b) && !(*a == b[k])) ++k;
      if (k < ahead && a[k] == *b) {
        left_a = std::copy_n(a, k, left_a);
        a += k;
      } else if (k < ahead) {
        left_b = std::copy_n(b, k, left_b);
        b += k;
      } else {
        *left_a++ = *a++;
        *left_b++ = *b++;
      }
    }
    const std::size_t differing = (left_a - room_before_.data()) + (left_b - room_after_.data()) - left;
    if (2 * differing > std::size_t(a - begin)) break;  // no common order
  }
  left_a = std::copy(a, a_end, left_a);
  left_b = std::copy(b, b_end, left_b);
  return {{room_before_.data(), left_a}, {room_after_.data(), left_b}};
}

/// Calls use(index, first slot) for all pairs; slots are fetched ahead, so that their cache misses overlap.
template <class Use>
void PairDifference::for_slots(std::span<const PrimitivePair> pairs, std::size_t mask, const Use& use) const {
  constexpr std::size_t ahead = 16;
  std::size_t slots[ahead];
  const auto fetch = [&](std::size_t i) {
    const std::size_t slot = hash_of(pairs[i]) & mask;
    __builtin_prefetch(&table_[slot]);
    slots[i % ahead] = slot;
  };
  for (std::size_t i = 0; i < std::min(ahead, pairs.size()); ++i) fetch(i);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::size_t slot = slots[i % ahead];
    if (i + ahead < pairs.size()) fetch(i + ahead);
    use(i, slot);
  }
}

void PairDifference::look_up(const Left& left, PairBuffer& begun, PairBuffer& ended) {
  const std::size_t slots = slots_for(left.before.size());
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
  for_slots(left.before, mask, [&](std::size_t i, std::size_t slot) {
    while ((table_[slot] >> 32) == stamp_) slot = (slot + 1) & mask;
    table_[slot] = stamp | i;
  });
  met_.assign(left.before.size(), 0);
  for_slots(left.after, mask, [&](std::size_t k, std::size_t slot) {
    const PrimitivePair& pair = left.after[k];
    bool known = false;
    for (; !known && (table_[slot] >> 32) == stamp_; slot = (slot + 1) & mask) {
      const auto i = std::uint32_t(table_[slot]);
      known = left.before[i] == pair;
      if (known) met_[i] = 1;
    }
    if (!known) begun.push_back(pair);
  });
  for (std::size_t i = 0; i < left.before.size(); ++i)
    if (met_[i] == 0) ended.push_back(left.before[i]);
}

std::size_t PairDifference::bytes() const {
  return (room_before_.capacity() + room_after_.capacity()) * sizeof(PrimitivePair) +
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
  // Moves back every pair that the free slot would separate from its place.
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
  // Takes those with the smallest hashes. About twice as many have one below the limit, and are sorted.
  const double share = 2 * double(most) / double(std::max<std::size_t>(1, size_));
  const std::uint64_t limit = share < 1 ? std::uint64_t(share * 0x1p64) : ~std::uint64_t(0);
  const auto begin = std::ptrdiff_t(out.size());
  for (const PrimitivePair& pair : slots_)
    if (!(pair == free_slot) && hash_of(pair) <= limit) out.push_back(pair);
  std::sort(out.begin() + begin, out.end(), [](const PrimitivePair& a, const PrimitivePair& b) {
    const std::uint64_t hash_a = hash_of(a), hash_b = hash_of(b);
    return hash_a != hash_b ? hash_a < hash_b : a < b;
  });
  out.resize(std::min(out.size(), std::size_t(begin) + most));
}

void PairSet::append_to(PairBuffer& out) const {
  for (const PrimitivePair& pair : slots_)
    if (!(pair == free_slot)) out.push_back(pair);
}

}  // namespace kbvh
