#include "core/topology/subtree_swap.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/base/assert.hpp"

namespace kbvh {

namespace {
/// Returns the first id of the sibling pair of a node; the root has none.
std::uint32_t pair_of(const Topology& topology, std::uint32_t node) {
  return topology.nodes[topology.parents[node]].first();
}

bool is_above(const Topology& topology, std::uint32_t upper, std::uint32_t node) {
  while (node != upper && node != 0) node = topology.parents[node];
  return node == upper;
}

std::invalid_argument refusal(std::uint32_t first, std::uint32_t second, const std::string& why) {
  return std::invalid_argument("cannot exchange nodes " + std::to_string(first) + " and " +
                               std::to_string(second) + ": " + why);
}
void check_places(const Topology& topology, std::uint32_t first, std::uint32_t second) {
  for (const std::uint32_t node : {first, second})
    if (node >= topology.size() || topology.parents[node] >= topology.size())
      throw refusal(first, second,
                    "node " + std::to_string(node) + " is none of " + std::to_string(topology.size()));
  if (is_above(topology, first, second) || is_above(topology, second, first))
    throw refusal(first, second, "one is the other or above it");
}
}  // namespace

void SubtreeSwap::rotate(Topology& topology, std::uint32_t child, std::uint32_t grandchild,
                         TopologyEdit& edit) {
  if (child >= topology.size() || grandchild >= topology.size() || child == 0 || grandchild == 0)
    throw refusal(child, grandchild, "both have to be nodes below the root");
  const std::uint32_t sibling = topology.parents[grandchild];
  if (sibling == 0 || sibling == child || topology.parents[sibling] != topology.parents[child])
    throw refusal(child, grandchild, "the second is not a child of the first's sibling");
  swap(topology, child, grandchild, edit);
}

void SubtreeSwap::swap(Topology& topology, std::uint32_t first, std::uint32_t second, TopologyEdit& edit) {
  if (topology.width != 2)
    throw refusal(first, second, "the topology is " + std::to_string(topology.width) + "-wide");
  check_places(topology, first, second);
  if (first > second) std::swap(first, second);
  edit.clear();
  moves_.clear();
  exchange_contents(topology, first, second);
  // The former subtree of the second place has larger ids than that place; at the first place the ids are
  // larger still.
  const TopologyNode lower = topology.nodes[second];
  if (!lower.is_leaf() && lower.first() < second) order(topology, second);

  const auto before = [&](std::uint32_t id) { return id == first ? second : id == second ? first : id; };
  for (const Move& move : moves_)
    for (std::uint32_t k = 0; k < 2; ++k)
      if (before(move.from + k) != move.to + k) edit.moved.push_back({before(move.from + k), move.to + k});
  for (const std::uint32_t place : {first, second})
    if (move_of(place) == nullptr) edit.moved.push_back({before(place), place});
  const std::uint32_t parents[2] = {topology.parents[moved_to(first)], topology.parents[moved_to(second)]};
  edit.changed.push_back(parents[0]);
  if (parents[1] != parents[0]) edit.changed.push_back(parents[1]);
}

void SubtreeSwap::exchange(Topology& topology, std::uint32_t first, std::uint32_t second,
                           TopologyEdit& edit) {
  check_places(topology, first, second);
  edit.clear();
  exchange_contents(topology, first, second);
  edit.moved.push_back({first, second});
  edit.moved.push_back({second, first});
  edit.changed.push_back(topology.parents[first]);
  if (topology.parents[second] != topology.parents[first]) edit.changed.push_back(topology.parents[second]);
}

void SubtreeSwap::exchange_contents(Topology& topology, std::uint32_t first, std::uint32_t second) {
  topology.perfect = false;
  std::swap(topology.nodes[first], topology.nodes[second]);
  for (const std::uint32_t node : {first, second}) {
    const TopologyNode content = topology.nodes[node];
    if (content.is_leaf()) continue;
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      topology.parents[c] = node;
  }
  if (topology.depths[first] == topology.depths[second]) return;
  set_depths_below(topology, first, open_);
  set_depths_below(topology, second, open_);
}

const SubtreeSwap::Move* SubtreeSwap::move_of(std::uint32_t node) const {
  // The pair that begins at the node or at the id before it.
  const auto next = std::upper_bound(moves_.begin(), moves_.end(), node,
                                     [](std::uint32_t id, const Move& move) { return id < move.from; });
  if (next == moves_.begin()) return nullptr;
  const Move& move = *(next - 1);
  return node - move.from < 2 ? &move : nullptr;
}

std::uint32_t SubtreeSwap::moved_to(std::uint32_t node) const {
  const Move* const move = move_of(node);
  return move == nullptr ? node : move->to + (node - move->from);
}

/// Gives a node a smaller id than its children; all other parents precede theirs. Sibling pairs above the
/// node and pairs below it that lie in the wrong order redistribute their ids: first the pairs above, then
/// the pairs below, each in their previous order.
void SubtreeSwap::order(Topology& topology, std::uint32_t parent) {
  const std::uint32_t upper = pair_of(topology, parent), lower = topology.nodes[parent].first();
  KBVH_ASSERT(lower < upper);
  for (std::uint32_t node = parent; node != 0 && pair_of(topology, node) > lower;
       node = topology.parents[node])
    moves_.push_back({pair_of(topology, node), 0, topology.parents[node], 0, {}});
  std::sort(moves_.begin(), moves_.end(), [](const Move& a, const Move& b) { return a.from < b.from; });
  below_.clear();
  open_.assign(1, lower);
  while (!open_.empty()) {
    const std::uint32_t pair = open_.back();
    open_.pop_back();
    below_.push_back(pair);
    for (std::uint32_t node = pair; node < pair + 2; ++node) {
      const TopologyNode content = topology.nodes[node];
      if (!content.is_leaf() && content.first() < upper) open_.push_back(content.first());
    }
  }
  std::sort(below_.begin(), below_.end());
  for (const std::uint32_t pair : below_) moves_.push_back({pair, 0, topology.parents[pair], 0, {}});

  // Assigns ids in ascending order, to the pairs above first.
  open_.clear();
  for (const Move& move : moves_) open_.push_back(move.from);
  std::sort(open_.begin(), open_.end());
  for (std::size_t i = 0; i < moves_.size(); ++i) {
    Move& move = moves_[i];
    move.to = open_[i];
    move.depth = topology.depths[move.from];
    for (std::uint32_t k = 0; k < 2; ++k) move.nodes[k] = topology.nodes[move.from + k];
  }
  std::sort(moves_.begin(), moves_.end(), [](const Move& a, const Move& b) { return a.from < b.from; });

  for (const Move& move : moves_)
    for (std::uint32_t k = 0; k < 2; ++k) {
      topology.nodes[move.to + k] = move.nodes[k];
      topology.parents[move.to + k] = moved_to(move.parent);
      topology.depths[move.to + k] = move.depth;
    }
  // Updates the parents' ids in children that stay, and the children's ids in parents.
  for (const Move& move : moves_)
    for (std::uint32_t k = 0; k < 2; ++k) {
      const TopologyNode content = move.nodes[k];
      if (content.is_leaf() || moved_to(content.first()) != content.first()) continue;
      topology.parents[content.first()] = topology.parents[content.first() + 1] = move.to + k;
    }
  for (const Move& move : moves_) topology.nodes[moved_to(move.parent)] = TopologyNode::inner(move.to, 2);
}

}  // namespace kbvh
