#include "core/families/build/built_strategy.hpp"

namespace kbvh {

template class BuiltEachFrame<float, Counting, BuiltTree<float>>;
template class BuiltEachFrame<double, Counting, BuiltTree<double>>;
#ifndef KBVH_COUNTING_ONLY
template class BuiltEachFrame<float, Silent, BuiltTree<float>>;
template class BuiltEachFrame<double, Silent, BuiltTree<double>>;
#endif

}  // namespace kbvh
