#include "core/families/events/kinetic_rows.hpp"

#include "core/topology/collapse.hpp"

namespace kbvh {
namespace {

constexpr std::uint32_t none = ~std::uint32_t(0);

}  // namespace

template <class S>
void KineticRows<S>::lay_out(Topology topology, const std::vector<std::uint32_t>& order,
                             const Primitives& primitives) {
  std::vector<std::uint32_t> node_of = order;
  if (topology.width == 2) {
    topology = collapsed(topology, 8, leaves_below(topology), node_of);
    for (std::uint32_t& node : node_of) node = order[node];
  }
  wide_of_.clear();
  for (std::uint32_t i = 0; i < node_of.size(); ++i) {
    if (node_of[i] >= wide_of_.size()) wide_of_.resize(node_of[i] + 1, none);
    wide_of_[node_of[i]] = i;
  }
  rows_.assign(std::move(topology), primitives, active_kernel_set());
  const Topology& wide = hierarchy().topology();
  slots_.assign(wide_of_.size(), LeafSlot{0});
  lane_nodes_.assign(std::size_t(hierarchy().node_count()) * wide.width, 0);
  for (std::uint32_t i = 0; i < wide.size(); ++i) {
    if (hierarchy().wide_parent(i) == WideHierarchy<S>::no_node) continue;
    const std::size_t scalars = lane_scalars(wide.width), place = hierarchy().row_place(i, 0);
    lane_nodes_[place / scalars * wide.width + place % scalars] = node_of[i];
    slots_[node_of[i]] = {LeafSlot::of(std::uint32_t(place / scalars), std::uint32_t(place % scalars))};
  }
}

template <class S>
const Box<S>* KineticRows<S>::read_box(std::uint32_t node, Box<S>& room) const {
  if (node >= wide_of_.size() || wide_of_[node] == none || !rows_.current(wide_of_[node])) return nullptr;
  room = hierarchy().box(wide_of_[node]);
  return &room;
}

template class KineticRows<float>;
template class KineticRows<double>;

}  // namespace kbvh
