#include "core/broad_phase/pair_filter.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace kbvh {
namespace {

const char* plural(Element element) {
  return element == Element::vertex ? "vertices" : element == Element::edge ? "edges" : "faces";
}

void check_count(const Elements& elements, Element element, std::size_t groups) {
  if (groups != elements.count(element))
    throw std::invalid_argument("there are groups of " + std::to_string(groups) + " " + plural(element) +
                                " for " + std::to_string(elements.count(element)));
}

}  // namespace

void PairFilter::clear() {
  for (auto& groups : groups_) groups.clear();
  from_vertices_.fill(false);
  for (Excluded& excluded : excluded_) excluded.pairs.clear();
  exclude_rings(0);
  function_ = nullptr;
}

void PairFilter::set_groups(const Elements& elements, Element element, std::span<const GroupMask> groups) {
  if (!groups.empty()) check_count(elements, element, groups.size());
  groups_[std::size_t(element)].assign(groups.begin(), groups.end());
  from_vertices_[std::size_t(element)] = false;
}

void PairFilter::set_vertex_groups(const Elements& elements, std::span<const GroupMask> groups) {
  set_groups(elements, Element::vertex, groups);
  for (const Element element : {Element::edge, Element::face}) {
    groups_[std::size_t(element)].clear();
    from_vertices_[std::size_t(element)] = !groups.empty();
  }
  elements_inserted(elements);
}

void PairFilter::elements_inserted(const Elements& elements) {
  std::vector<GroupMask>& of_vertices = groups_[std::size_t(Element::vertex)];
  if (!of_vertices.empty()) of_vertices.resize(elements.vertex_count());
  for (const Element element : {Element::edge, Element::face}) {
    std::vector<GroupMask>& list = groups_[std::size_t(element)];
    const std::uint32_t count = elements.count(element);
    if (!from_vertices_[std::size_t(element)]) {
      if (!list.empty()) list.resize(count);
      continue;
    }
    while (list.size() < count) {
      GroupMask all{0, 0};
      for (const std::uint32_t v : elements.vertices(element, std::uint32_t(list.size())))
        all |= of_vertices.empty() ? GroupMask{} : of_vertices[v];
      list.push_back(all);
    }
  }
  for (const CandidateKind kind : candidate_kinds) {
    Excluded& excluded = excluded_[std::size_t(kind)];
    if (!excluded.pairs.empty())
      excluded.first_pair.resize(std::size_t(elements.count(first_element(kind))) + 1,
                                 std::uint32_t(excluded.pairs.size()));
  }
}

void PairFilter::prepare(const Elements& elements) {
  if (rings_ == 0 || rings_listed_) return;
  connected_.build(elements, rings_);
  rings_listed_ = true;
}

void PairFilter::exclude(const Elements& elements, CandidateKind kind, std::span<const Candidate> pairs) {
  const Element first = first_element(kind), second = second_element(kind);
  for (const Candidate& pair : pairs)
    if (pair.first >= elements.count(first) || pair.second >= elements.count(second))
      throw std::invalid_argument(
          std::string("the excluded ") + name(kind) + " pair (" + std::to_string(pair.first) + ", " +
          std::to_string(pair.second) + ") is not one of " + std::to_string(elements.count(first)) + " " +
          plural(first) + " and " + std::to_string(elements.count(second)) + " " + plural(second));
  Excluded& excluded = excluded_[std::size_t(kind)];
  excluded.pairs.assign(pairs.begin(), pairs.end());
  if (first == second)
    for (Candidate& pair : excluded.pairs)
      if (pair.first > pair.second) std::swap(pair.first, pair.second);
  std::sort(excluded.pairs.begin(), excluded.pairs.end());
  excluded.first_pair.assign(std::size_t(elements.count(first)) + 1, 0);
  for (const Candidate& pair : excluded.pairs) ++excluded.first_pair[pair.first + 1];
  for (std::size_t i = 1; i < excluded.first_pair.size(); ++i)
    excluded.first_pair[i] += excluded.first_pair[i - 1];
}

std::size_t PairFilter::keep(const Elements& elements, CandidateKind kind, std::span<Candidate> pairs) const {
  std::size_t count = pairs.size();
  const auto keep_if = [&](const auto& admitted) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      pairs[kept] = pairs[i];
      kept += admitted(pairs[i]) ? 1 : 0;
    }
    count = kept;
  };
  const std::span<const GroupMask> first = groups(first_element(kind)), second = groups(second_element(kind));
  if (!first.empty() && !second.empty())
    keep_if([&](const Candidate& pair) { return first[pair.first].admits(second[pair.second]); });
  else if (!first.empty())
    keep_if([&](const Candidate& pair) { return first[pair.first].admits({}); });
  else if (!second.empty())
    keep_if([&](const Candidate& pair) { return second[pair.second].admits({}); });
  if (rings_ > 0)
    keep_if([&](const Candidate& pair) {
      return !connected_.connect(elements.vertices(first_element(kind), pair.first),
                                 elements.vertices(second_element(kind), pair.second));
    });
  const Excluded& excluded = excluded_[std::size_t(kind)];
  if (!excluded.pairs.empty())
    keep_if([&](const Candidate& pair) {
      const auto begin = excluded.pairs.begin();
      return !std::binary_search(begin + excluded.first_pair[pair.first],
                                 begin + excluded.first_pair[pair.first + 1], pair);
    });
  if (!function_ || count == 0) return count;
  const std::size_t kept = function_(kind, pairs.first(count));
  if (kept > count)
    throw std::out_of_range("a filter of pairs kept " + std::to_string(kept) + " of " +
                            std::to_string(count));
  return kept;
}

std::size_t PairFilter::bytes() const {
  std::size_t total = connected_.bytes();
  for (const auto& groups : groups_) total += groups.capacity() * sizeof(GroupMask);
  for (const Excluded& excluded : excluded_)
    total += excluded.first_pair.capacity() * sizeof(std::uint32_t) +
             excluded.pairs.capacity() * sizeof(Candidate);
  return total;
}

}  // namespace kbvh
