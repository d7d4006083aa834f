// Binned SAH: the surface-area heuristic from the top down, which gives the best trees of this family. It
// makes at most as many box tests as `ploc`, and takes somewhat longer to build: for frames that ask many
// queries of one tree. `rebuild` with method=sah builds such trees, too, and takes longer.
#include "core/contract/registry.hpp"
#include "core/families/build/built_strategy.hpp"
#include "core/families/build/cluster_builders.hpp"

namespace kbvh {
namespace {

template <class S>
struct BinnedSahBuilder : BinnedBuilder<S> {
  explicit BinnedSahBuilder(const Params& params) : BinnedBuilder<S>(std::uint32_t(params.number("grain"))) {}
};
template <class S>
using BinnedSah = BuiltStrategy<S, BinnedSahBuilder<S>>;

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(binned_sah) {
  using namespace kbvh;
  return {make_entry<BinnedSah>({
      .id = "binned_sah",
      .title = "binned SAH",
      .family = "rebuild",
      .citation = "Wald 2007",
      .declares = {.restructures = true, .time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::sah, .width = 8, .leaf_size = 16}},
      .parameters = {{"grain",
                      "1",
                      {"1", "16"},
                      "primitives that stay together, neighbours on a Hilbert curve; 16: full leaves"},
                     threads_parameter("positions, builds, queries, rays and triangle tests")},
  })};
}
