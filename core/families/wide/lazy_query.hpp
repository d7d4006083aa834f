#pragma once
#include <cstdint>

#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// Queries all pairs of bodies that are near each other, and computes boxes at their first use. side_of(body)
/// returns the WideSide<S> of a body, with its marks; the box of its root must be current. make(body, wide
/// node) computes the boxes of the node's children and clears the node's mark. Appends the candidates to
/// `out`. Counts body pairs beyond the budget as pending. Adds the number of box tests to `tests`.
template <class S, class SideOf, class Make>
QueryStatus query_lazily(WideQuery<S>& query, NearBodies& near_bodies, std::span<const BodyPair> pairs,
                         const Budget& budget, const SideOf& side_of, const Make& make, PairBuffer& out,
                         std::uint64_t& tests) {
  using Wanted = typename WideQuery<S>::Wanted;
  QueryStatus status;
  const auto box_of = [&](std::uint32_t body) {
    const WideTree<S>& hierarchy = *side_of(body).hierarchy;
    return hierarchy.empty() ? Box<double>{} : to_double(hierarchy.root_box());
  };
  for (const std::uint32_t i : near_bodies.find(box_of, tests)) {
    const BodyPair& pair = pairs[i];
    if (tests >= budget.box_tests) {
      ++status.pending;
      continue;
    }
    const auto first = side_of(pair.first), second = side_of(pair.second);
    query.start_lazy(first, second, rest_of(budget, tests));
    while (const Wanted wanted = query.step(first, second, out, tests)) {
      if (wanted.first != Wanted::none) make(pair.first, wanted.first);
      if (wanted.second != Wanted::none) make(pair.second, wanted.second);
    }
    status.pending += query.lazy_status().pending;
  }
  return status;
}

}  // namespace kbvh
