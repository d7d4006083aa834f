#include "core/families/events/any_queue.hpp"

namespace kbvh {

Parameter queue_parameter() {
  const std::vector<std::string> names = AnyQueue<float>::names();
  return {"queue", names.front(), names,
          "event queue: lists by segment and a heap of what comes next, the paper's AVL tree, or an indexed "
          "binary heap"};
}

}  // namespace kbvh
