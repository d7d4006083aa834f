// Linear BVH: a radix sort by Morton codes, and a tree read off the sorted codes. A new tree for every
// frame costs little more than the sort. Wins against a refit where bodies mix or fly apart, whatever the
// motion is (plan `ageing`). `ploc` and `binned_sah` build better trees, but one query per frame does not
// earn back the time. A refit wins where neighbours stay neighbours, as on cloth.
#include "core/contract/registry.hpp"
#include "core/families/build/built_strategy.hpp"
#include "core/families/build/curve_builders.hpp"

namespace kbvh {
namespace {

template <class S>
struct LbvhBuilder : LinearBuilder<S> {
  explicit LbvhBuilder(const Params& /*params*/) {}
};
template <class S>
using Lbvh = BuiltStrategy<S, LbvhBuilder<S>>;

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
      .parameters = {threads_parameter("positions, builds, queries, rays and triangle tests")},
  })};
}
