#pragma once
#include <algorithm>
#include <cstdint>
#include <span>

#include "core/families/wide/kernels/wide_realisers.hpp"
#include "core/families/wide/rows_on_demand.hpp"
#include "core/motion/round_positions.hpp"

namespace kbvh {

/// Boxes on demand that are given by the vertices that realise their sides: each side is one coordinate of
/// one vertex. The callable `places_of(node, room)` returns the realisers of a wide node's rows, [6][width],
/// each as 3 * vertex + axis, any valid place for empty lanes; it may use the lane_scalars(width) entries of
/// `room` for them.
template <class S>
class RealiserRows : public RowsOnDemand<S> {
 public:
  /// Computes the boxes of the root's children and of the nodes that recent queries visited. Returns the
  /// number of positions that were read without being fetched.
  template <class PlacesOf>
  std::uint64_t make_visited(const SampledMotion<S>& motion, std::uint32_t body, const PlacesOf& places_of) {
    return make(this->due(), motion, body, places_of);
  }
  /// Computes the boxes of a wide node's children, and records the visit. Returns the same.
  template <class PlacesOf>
  std::uint64_t make_wanted(std::uint32_t node, const SampledMotion<S>& motion, std::uint32_t body,
                            const PlacesOf& places_of) {
    return make(this->visit(node), motion, body, places_of);
  }

  std::size_t bytes() const { return this->bytes_on_demand(); }

 private:
  using RowsOnDemand<S>::made_together;

  template <class PlacesOf>
  std::uint64_t make(std::span<const std::uint32_t> nodes, const SampledMotion<S>& motion, std::uint32_t body,
                     const PlacesOf& places_of) {
    const std::uint32_t width = this->hierarchy().topology().width;
    const std::size_t scalars = lane_scalars(width);
    const auto& kernels = wide_realiser_kernels<S>(this->hierarchy().kernels());
    const auto place = kernels.place(width);
    const bool on_lines = this->on_lines() && !motion.all_current(body);
    std::uint64_t reads = 0;
    alignas(64) S values[made_together * lane_scalars(8)], ends[made_together * lane_scalars(8)];
    std::uint32_t room[lane_scalars(8)], vertices[lane_scalars(8)];
    while (!nodes.empty()) {
      const std::size_t many = std::min(nodes.size(), made_together);
      for (std::size_t i = 0; i < many; ++i) {
        const std::uint32_t* places = places_of(nodes[i], room);
        if (on_lines) {
          kernels.collect(places, this->line_end(0), scalars, values + i * scalars);
          kernels.collect(places, this->line_end(1), scalars, ends + i * scalars);
          continue;
        }
        if (!motion.all_current(body)) {
          for (std::size_t k = 0; k < scalars; ++k) vertices[k] = places[k] / 3;
          motion.fetch(body, {vertices, scalars});
        }
        kernels.collect(places, motion.positions(body), scalars, values + i * scalars);
      }
      if (on_lines) {
        reads += many * scalars / 3;
        round_chord(values, ends, many * scalars, this->line_time(0), this->line_time(1), motion.time(),
                    values);
      }
      for (std::size_t i = 0; i < many; ++i) {
        place(this->hierarchy().arrays(), values + i * scalars, nodes[i]);
        this->computed(nodes[i]);
      }
      nodes = nodes.subspan(many);
    }
    return reads;
  }
};

}  // namespace kbvh
