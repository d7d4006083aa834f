#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace kbvh {

/// Many short lists of numbers under the keys 0, 1, ... Unchanged lists are packed like CSR lists; a list
/// that grows moves to a place of its own. Reading costs the same as with CSR lists. Changing a list is O(its
/// length). Abandoned places are recycled.
class ListPool {
 public:
  /// Takes lists in CSR form: list k is values[offsets[k] .. offsets[k + 1]).
  ListPool(std::span<const std::uint32_t> offsets, std::vector<std::uint32_t> values)
      : values_(std::move(values)) {
    if (offsets.empty()) return;
    lists_.reserve(offsets.size() - 1);
    for (std::size_t k = 0; k + 1 < offsets.size(); ++k)
      lists_.push_back({offsets[k], offsets[k + 1] - offsets[k]});
  }
  ListPool() = default;

  std::span<const std::uint32_t> operator[](std::uint32_t key) const {
    const List list = lists_[key];
    return {values_.data() + list.begin, list.count};
  }
  std::uint32_t keys() const { return std::uint32_t(lists_.size()); }
  /// Prefetches the data that reading a list starts with.
  void prefetch(std::uint32_t key) const { __builtin_prefetch(&lists_[key]); }
  /// Appends empty lists, or drops the last lists.
  void resize(std::uint32_t keys) {
    for (std::uint32_t key = keys; key < lists_.size(); ++key) release(lists_[key]);
    lists_.resize(keys);
  }

  /// Replaces a list; `list` must not point into the pool.
  void assign(std::uint32_t key, std::span<const std::uint32_t> list) {
    if (list.size() > room(lists_[key])) {
      release(lists_[key]);
      lists_[key] = reserve(std::uint32_t(list.size()));
    }
    std::copy(list.begin(), list.end(), values_.begin() + lists_[key].begin);
    lists_[key].count = std::uint32_t(list.size());
  }
  /// Appends a value and returns its index in the list.
  std::uint32_t push(std::uint32_t key, std::uint32_t value) {
    List list = lists_[key];
    if (list.count == room(list)) {
      List larger = reserve(list.count + 1);
      std::copy_n(values_.begin() + list.begin, list.count, values_.begin() + larger.begin);
      larger.count = list.count;
      release(list);
      list = larger;
    }
    values_[list.begin + list.count] = value;
    lists_[key] = {list.begin, list.count + 1, list.room};
    return list.count;
  }
  /// Removes one occurrence of a value, if there is one; the order may change.
  void erase(std::uint32_t key, std::uint32_t value) {
    const std::span<const std::uint32_t> list = (*this)[key];
    const auto at = std::find(list.begin(), list.end(), value);
    if (at != list.end()) erase_at(key, std::uint32_t(at - list.begin()));
  }
  /// Removes the value at an index. The list's last value takes its place; returns that value.
  std::uint32_t erase_at(std::uint32_t key, std::uint32_t index) {
    List& list = lists_[key];
    const std::uint32_t last = values_[list.begin + --list.count];
    values_[list.begin + index] = last;
    return last;
  }
  /// Replaces one occurrence of `value` by `by`.
  void replace(std::uint32_t key, std::uint32_t value, std::uint32_t by) {
    const List list = lists_[key];
    const auto begin = values_.begin() + list.begin;
    std::replace(begin, begin + list.count, value, by);
  }
  void clear(std::uint32_t key) {
    release(lists_[key]);
    lists_[key] = {};
  }

  /// Empties all lists.
  void clear() {
    for (List& list : lists_) list = {};
    values_.clear();
    for (auto& begins : free_) begins.clear();
  }

  std::size_t bytes() const {
    std::size_t total = lists_.capacity() * sizeof(List) + values_.capacity() * sizeof(std::uint32_t) +
                        free_.capacity() * sizeof(std::vector<std::uint32_t>);
    for (const auto& list : free_) total += list.capacity() * sizeof(std::uint32_t);
    return total;
  }

 private:
  struct List {
    std::uint32_t begin = 0, count = 0;
    std::uint32_t room = 0;  ///< capacity of a moved list, a power of two; 0: as packed
  };
  static constexpr std::uint32_t smallest = 4;
  static std::uint32_t room(const List& list) { return list.room != 0 ? list.room : list.count; }
  List reserve(std::uint32_t count) {
    const std::uint32_t wanted = std::max(smallest, std::bit_ceil(count));
    const auto size_class = std::size_t(std::countr_zero(wanted));
    if (size_class < free_.size() && !free_[size_class].empty()) {
      const std::uint32_t begin = free_[size_class].back();
      free_[size_class].pop_back();
      return {begin, 0, wanted};
    }
    const auto begin = std::uint32_t(values_.size());
    values_.resize(values_.size() + wanted, 0);
    return {begin, 0, wanted};
  }
  void release(const List& list) {
    if (list.room == 0) return;
    const auto size_class = std::size_t(std::countr_zero(list.room));
    if (free_.size() <= size_class) free_.resize(size_class + 1);
    free_[size_class].push_back(list.begin);
  }

  std::vector<List> lists_;
  std::vector<std::uint32_t> values_;
  std::vector<std::vector<std::uint32_t>>
      free_;  ///< begins of abandoned places, by the exponent of their capacity
};

}  // namespace kbvh
