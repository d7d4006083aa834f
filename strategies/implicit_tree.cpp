// Implicit tree: primitives in the order of a space-filling curve are cut into full leaves and full nodes, so
// that the shape of the tree is known before the frame. The Hilbert curve partly makes up for cuts that
// ignore the gaps between bodies. Somewhat slower than `lbvh`, with less memory: for scenes where memory
// counts, or where the number of leaves must not change.
#include "core/contract/registry.hpp"
#include "core/families/build/built_strategy.hpp"
#include "core/families/build/curve_builders.hpp"

namespace kbvh {
namespace {

template <class S>
struct ImplicitTreeBuilder : ImplicitBuilder<S> {
  explicit ImplicitTreeBuilder(const Params& params)
      : ImplicitBuilder<S>(params.word("curve") == "morton" ? Curve::morton : Curve::hilbert) {}
};
template <class S>
using ImplicitTree = BuiltStrategy<S, ImplicitTreeBuilder<S>>;

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(implicit_tree) {
  using namespace kbvh;
  return {make_entry<ImplicitTree>({
      .id = "implicit_tree",
      .title = "implicit tree",
      .family = "rebuild",
      .citation = "Chitalu et al. 2020; Kamel & Faloutsos 1993 (Hilbert order)",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::morton, .width = 8, .leaf_size = 16}},
      .parameters = {{"curve", "hilbert", {"hilbert", "morton"}, "the order in which leaves are filled"},
                     threads_parameter("positions, builds, queries, rays and triangle tests")},
  })};
}
