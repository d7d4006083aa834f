#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {

template class FixedPlansHierarchyStrategy<float, Counting>;
template class FixedPlansHierarchyStrategy<double, Counting>;
template class StoredHierarchyStrategy<float, Counting>;
template class StoredHierarchyStrategy<double, Counting>;
#ifndef KBVH_COUNTING_ONLY
template class FixedPlansHierarchyStrategy<float, Silent>;
template class FixedPlansHierarchyStrategy<double, Silent>;
template class StoredHierarchyStrategy<float, Silent>;
template class StoredHierarchyStrategy<double, Silent>;
#endif

}  // namespace kbvh
