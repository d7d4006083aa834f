#include "core/families/build/built_strategy.hpp"

namespace kbvh {

template class BuiltEachFrame<float, BuiltTree<float>>;
template class BuiltEachFrame<double, BuiltTree<double>>;

}  // namespace kbvh
