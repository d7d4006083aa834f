#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {

template class FixedPlansHierarchyStrategy<float>;
template class FixedPlansHierarchyStrategy<double>;
template class StoredHierarchyStrategy<float>;
template class StoredHierarchyStrategy<double>;

}  // namespace kbvh
