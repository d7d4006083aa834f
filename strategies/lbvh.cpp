// Linear BVH. A radix sort by Morton codes, and a tree read off the sorted codes: a new topology for every
// frame at the price of a sort. What it is, when it wins: the best choice of this family where bodies mix or
// fly apart, because it adapts to any motion and costs about a tenth of `rebuild`; a query then takes longer
// than with `ploc` and `binned_sah`, but by less than these take longer to build. A refit wins wherever the
// motion leaves the neighbours of a surface neighbours (cloth: 4 times faster in total).
#include "core/contract/registry.hpp"
#include "core/families/build/built_strategy.hpp"
#include "core/families/build/curve_builders.hpp"

namespace kbvh {
namespace {

template <class S>
struct LbvhBuilder : LinearBuilder<S> {
  explicit LbvhBuilder(const Params& /*params*/) {}
};
template <class S, class Count>
using Lbvh = BuiltStrategy<S, Count, LbvhBuilder<S>>;

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(lbvh) {
  using namespace kbvh;
  return {make_entry<Lbvh>({
      .id = "lbvh",
      .title = "linear BVH",
      .family = "rebuild",
      .citation = "Lauterbach et al. 2009",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::morton, .width = 8, .leaf_size = 16}},
  })};
}
