#pragma once
#include <cstdint>

#include "core/base/counters.hpp"

namespace kbvh {

/// Counts an update that wrote the six sides of so many boxes, and read so many vertices for them.
inline void count_boxes(Counters& count, std::uint64_t boxes, std::uint64_t vertices) {
  count.add(Counter::nodes_visited, boxes);
  count.add(Counter::values_written, 6 * boxes);
  count.add(Counter::vertex_reads, vertices);
}

}  // namespace kbvh
