// Bottom-up refit over flat arrays: the standard way to keep a hierarchy valid (van den Bergen 1997).

#include "core/hierarchy/stored_hierarchy.hpp"
#include "core/registry.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class BottomUp final : public StoredHierarchyStrategy<S, Count> {
  using Base = StoredHierarchyStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;

 private:
  void update(std::uint32_t body) override {
    this->refit(body);
    const auto& hierarchy = this->hierarchies_[body];
    this->count_.add(Counter::nodes_visited, hierarchy.topology.size());
    this->count_.add(Counter::values_written, std::uint64_t(6) * hierarchy.topology.size());
    this->count_.add(Counter::vertex_reads, hierarchy.leaf_vertices.vertices.size());
  }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up) {
  using namespace kbvh;
  return {make_entry<BottomUp>({
      .id = "bottom_up",
      .title = "bottom-up refit",
      .family = "refit",
      .citation = "van den Bergen 1997; Z&W 2006, s.2",
      .can = {.plan_changes = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 4}},
  })};
}
