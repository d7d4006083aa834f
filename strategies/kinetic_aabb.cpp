// The kinetic AABB tree (Z&W 2006, s.4), with the errata of the reproduction: tight at every time, updated at
// events only. Vertices may move on curves of degree 2 or 3: certificates then compare polynomials.

#include "core/contract/registry.hpp"
#include "core/families/events/algebraic_clock.hpp"
#include "core/families/events/any_queue.hpp"
#include "core/families/events/kinetic_tree_strategy.hpp"

namespace kbvh {
namespace {

/// In the order of the forests: lines alone, and curves.
template <class S>
using OnAnyQueue = ExactKineticAabbStrategy<S, AnyQueue<S>, AnyEventQueue<AlgebraicClock<S>>>;

template <class S>
class KineticAabb final : public OnAnyQueue<S> {
 public:
  KineticAabb(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
              const Params& params)
      : OnAnyQueue<S>(scene, motion, std::move(topologies), any_on_curves(scene, motion) ? 1 : 0,
                      params.word("query") == "rows" ? KineticQuery::wide_rows : KineticQuery::node_pairs) {
    this->on_forest([&](auto& forest) { forest.choose_queue(params.word("queue")); });
  }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_aabb) {
  using namespace kbvh;
  return {make_entry<KineticAabb>({
      .id = "kinetic_aabb",
      .title = "kinetic AABB tree",
      .family = "kinetic",
      .citation = "Zachmann & Weller 2006, s.4",
      .positions = PositionUse::fetched,
      .declares = {.continuous = true, .time_budget = true, .curves = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {queue_parameter(),
                     {"query",
                      "rows",
                      {"rows", "nodes"},
                      "traversal of a query: rows of eight boxes at a time, or pairs of nodes as in 2006"}},
  })};
}
