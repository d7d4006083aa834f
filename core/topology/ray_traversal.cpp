#include "core/topology/ray_traversal.hpp"

#include <algorithm>

namespace kbvh {

void RayBodyOrder::find_met(const RayLine& line, double limit) {
  const RaySlabs slabs(line);
  met_.clear();
  for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
    double near = 0;
    if (slabs.meet(bodies_[i].box, limit, near)) met_.push_back({near, i});
  }
  std::sort(met_.begin(), met_.end(), [](const auto& a, const auto& b) {
    return a.near != b.near ? a.near < b.near : a.node < b.node;
  });
}

void RayBodyOrder::count(RayBodies* bodies) const {
  if (bodies == nullptr) return;
  for (const Body& body : bodies_)
    ++(body.seen == Seen::entered  ? bodies->entered
       : body.seen == Seen::hidden ? bodies->hidden
                                   : bodies->unmet);
}

}  // namespace kbvh
