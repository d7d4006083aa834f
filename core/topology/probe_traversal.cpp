#include "core/topology/probe_traversal.hpp"

namespace kbvh {

void BodyOrder::count(RayBodies* bodies) const {
  if (bodies == nullptr) return;
  for (const Body& body : bodies_)
    ++(body.seen == Seen::entered  ? bodies->entered
       : body.seen == Seen::hidden ? bodies->hidden
                                   : bodies->unmet);
}

}  // namespace kbvh
