#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace kbvh {

/// A set of pairs of boxes, numbered from 0, in one array without gaps; a hash table finds a pair in it.
/// Insertion, removal and search are O(1) on average. Allocates when there are more pairs than ever before.
class BoxPairSet {
 public:
  struct Pair {
    std::uint32_t a, b;
    bool operator==(const Pair&) const = default;
  };

  std::span<const Pair> pairs() const { return pairs_; }
  void clear() {
    pairs_.clear();
    table_.assign(table_.size(), 0);
  }
  bool contains(Pair pair) const { return !pairs_.empty() && table_[place_of(pair)] != 0; }
  /// Returns false, and does nothing, if the pair is in the set already.
  bool insert(Pair pair) {
    if (2 * (pairs_.size() + 1) > table_.size()) grow();
    const std::size_t place = place_of(pair);
    if (table_[place] != 0) return false;
    pairs_.push_back(pair);
    table_[place] = std::uint32_t(pairs_.size());
    return true;
  }
  /// Returns false, and does nothing, if the pair is not in the set.
  bool erase(Pair pair) {
    if (pairs_.empty()) return false;
    const std::size_t place = place_of(pair);
    if (table_[place] == 0) return false;
    const std::uint32_t index = table_[place] - 1;
    close_gap(place);
    if (const Pair last = pairs_.back(); index + 1 != pairs_.size()) {
      table_[place_of(last)] = index + 1;
      pairs_[index] = last;
    }
    pairs_.pop_back();
    return true;
  }
  std::size_t bytes() const {
    return pairs_.capacity() * sizeof(Pair) + table_.capacity() * sizeof(std::uint32_t);
  }

 private:
  std::size_t home_of(Pair pair) const {
    const std::uint64_t key = (std::uint64_t(pair.a) << 32 | pair.b) * 0x9e3779b97f4a7c15U;
    return std::size_t(key >> 32) & (table_.size() - 1);
  }
  /// Returns the place of a pair, or the empty place at which it would be inserted.
  std::size_t place_of(Pair pair) const {
    std::size_t place = home_of(pair);
    while (table_[place] != 0 && !(pairs_[table_[place] - 1] == pair)) place = next(place);
    return place;
  }
  std::size_t next(std::size_t place) const { return (place + 1) & (table_.size() - 1); }
  /// Empties a place, and moves later pairs up that could otherwise not be found.
  void close_gap(std::size_t gap) {
    for (std::size_t place = next(gap); table_[place] != 0; place = next(place)) {
      const std::size_t home = home_of(pairs_[table_[place] - 1]);
      if (((place - home) & (table_.size() - 1)) < ((place - gap) & (table_.size() - 1))) continue;
      table_[gap] = table_[place];
      gap = place;
    }
    table_[gap] = 0;
  }
  void grow() {
    table_.assign(table_.empty() ? 64 : 2 * table_.size(), 0);
    for (std::size_t i = 0; i < pairs_.size(); ++i) table_[place_of(pairs_[i])] = std::uint32_t(i + 1);
  }

  std::vector<Pair> pairs_;
  std::vector<std::uint32_t>
      table_;  ///< index of a pair plus 1, or 0; a power of two, at least twice as long
};

}  // namespace kbvh
