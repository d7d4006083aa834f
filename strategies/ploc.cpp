// PLOC: clusters along a curve merge with their best neighbour until one is left, which gives trees of nearly
// the quality of the surface-area heuristic. Queries make fewer box tests than with `lbvh`, but building
// takes many times as long: for frames that ask many queries of one tree. grain=16 clusters full leaves
// instead of primitives, which is cheap and no better than `lbvh`. Beyond the paper: among equal unions the
// clusters 2k and 2k + 1 choose each other, and a round in which few clusters choose each other also merges
// others.
#include "core/contract/registry.hpp"
#include "core/families/build/built_strategy.hpp"
#include "core/families/build/cluster_builders.hpp"

namespace kbvh {
namespace {

template <class S>
struct PlocBuilder : LocalClusterBuilder<S> {
  explicit PlocBuilder(const Params& params)
      : LocalClusterBuilder<S>(params.word("radius") == "8" ? 8 : 16, std::uint32_t(params.number("grain"))) {
  }
};
template <class S>
using Ploc = BuiltStrategy<S, PlocBuilder<S>>;

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(ploc) {
  using namespace kbvh;
  return {make_entry<Ploc>({
      .id = "ploc",
      .title = "PLOC",
      .family = "rebuild",
      .citation = "Meister & Bittner 2018",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::morton, .width = 8, .leaf_size = 16}},
      .parameters = {{"radius", "8", {"8", "16"}, "clusters searched on each side for the best partner"},
                     {"grain",
                      "1",
                      {"1", "16"},
                      "primitives in a cluster at the start, neighbours on a Hilbert curve; 16: full leaves"},
                     threads_parameter("positions, builds, queries, rays and triangle tests")},
  })};
}
