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
