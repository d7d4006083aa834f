#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace kbvh {

/// Rows of slots under the keys 0, 1, ..., each contiguous. Like ListPool, but all rows begin empty, and an
/// entry is removed by its index in O(1). A row that outgrows its room moves to a larger one; rooms are
/// powers of two and are recycled.
class PairRows {
 public:
  std::span<const std::uint32_t> operator[](std::uint32_t key) const {
    return {slots_.data() + rows_[key].begin, rows_[key].count};
  }
  std::uint32_t keys() const { return std::uint32_t(rows_.size()); }
  void prefetch(std::uint32_t key) const { __builtin_prefetch(&rows_[key]); }
  /// Makes room for more keys.
  void grow(std::size_t keys) { rows_.resize(keys); }
  /// Empties all rows.
  void clear() {
    for (Row& row : rows_) row = {};
    slots_.clear();
    for (auto& rooms : free_) rooms.clear();
  }

  /// Appends a slot and returns its index in the row.
  std::uint32_t push(std::uint32_t key, std::uint32_t slot) {
    Row& row = rows_[key];
    if (row.count == row.room) move(row);
    slots_[row.begin + row.count] = slot;
    return row.count++;
  }
  /// Removes the entry at an index. The last entry takes its place; returns that entry.
  std::uint32_t erase_at(std::uint32_t key, std::uint32_t index) {
    Row& row = rows_[key];
    const std::uint32_t last = slots_[row.begin + --row.count];
    slots_[row.begin + index] = last;
    return last;
  }

  std::size_t bytes() const {
    std::size_t total = rows_.capacity() * sizeof(Row) + slots_.capacity() * sizeof(std::uint32_t);
    for (const auto& rooms : free_) total += sizeof rooms + rooms.capacity() * sizeof(std::uint32_t);
    return total;
  }

 private:
  struct Row {
    std::uint32_t begin = 0, count = 0;
    std::uint32_t room = 0;  ///< 0 or a power of two
  };

  /// Moves a row to a room of twice its size.
  void move(Row& row) {
    const std::uint32_t room = std::max(4U, 2 * row.room);
    const auto size_class = std::size_t(std::countr_zero(room));
    if (size_class >= free_.size()) free_.resize(size_class + 1);
    auto begin = std::uint32_t(slots_.size());
    if (auto& rooms = free_[size_class]; !rooms.empty()) {
      begin = rooms.back();
      rooms.pop_back();
    } else {
      slots_.resize(slots_.size() + room);
    }
    std::copy_n(slots_.begin() + row.begin, row.count, slots_.begin() + begin);
    if (row.room != 0) free_[size_class - 1].push_back(row.begin);
    row = {begin, row.count, room};
  }

  std::vector<Row> rows_;
  std::vector<std::uint32_t> slots_;
  std::vector<std::vector<std::uint32_t>> free_;  ///< begins of free rooms, by the exponent of their size
};

}  // namespace kbvh
