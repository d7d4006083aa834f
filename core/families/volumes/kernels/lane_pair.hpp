#pragma once
#include "core/families/wide/kernels/wide_overlap.hpp"

namespace kbvh {

/// Two trees' volumes in rows of eight lanes, for a traversal.
template <class S>
struct LanePair {
  const WideNode *nodes_a, *nodes_b;
  const S *rows_a, *rows_b, *own_b;
};

}  // namespace kbvh
