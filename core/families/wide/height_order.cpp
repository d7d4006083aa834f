#include "core/families/wide/height_order.hpp"

#include <algorithm>

namespace kbvh {

void HeightOrder::assign(std::span<const WideNode> nodes) {
  heights_.assign(nodes.size(), 0);
  ranks_.assign(nodes.size(), 0);
  nodes_.resize(nodes.size());
  begin_.assign(1, 0);
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const WideNode& node = nodes[n];
    for (std::uint32_t i = 0; i < std::uint32_t(node.count - node.leaf_count); ++i)
      heights_[n] = std::max(heights_[n], heights_[node.first_child + i] + 1);
    if (heights_[n] + 1 >= begin_.size()) begin_.resize(heights_[n] + 2, 0);
    ++begin_[heights_[n] + 1];
  }
  for (std::size_t h = 1; h < begin_.size(); ++h) begin_[h] += begin_[h - 1];
  for (std::uint32_t n = 0; n < nodes.size(); ++n) put(n, begin_[heights_[n]]++);
  // Each entry now holds the end of its height, which is the begin of the next.
  std::rotate(begin_.begin(), begin_.end() - 1, begin_.end());
  begin_[0] = 0;
}

void HeightOrder::put(std::uint32_t node, std::uint32_t rank) {
  nodes_[rank] = node;
  ranks_[node] = rank;
}

void HeightOrder::raise(std::uint32_t node) {
  const std::uint32_t next = ++heights_[node];
  if (next == begin_.size()) begin_.push_back(std::uint32_t(nodes_.size()));
  const std::uint32_t last = --begin_[next], rank = ranks_[node];
  put(nodes_[last], rank);
  put(node, last);
}

void HeightOrder::lower(std::uint32_t node) {
  const std::uint32_t first = begin_[heights_[node]--]++, rank = ranks_[node];
  put(nodes_[first], rank);
  put(node, first);
}

void HeightOrder::insert(std::uint32_t node) {
  ranks_[node] = std::uint32_t(nodes_.size());
  heights_[node] = std::uint32_t(begin_.size()) - 1;
  nodes_.push_back(node);
  set_height(node, 0);
}

void HeightOrder::remove(std::uint32_t node) {
  set_height(node, std::uint32_t(begin_.size()) - 1);
  put(nodes_.back(), ranks_[node]);
  nodes_.pop_back();
}

}  // namespace kbvh
