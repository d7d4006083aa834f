#pragma once
#include <boost/align/aligned_allocator.hpp>
#include <boost/core/noinit_adaptor.hpp>
#include <vector>

namespace kbvh {

/// An array of values that starts on a cache line, and whose `resize` leaves new elements unset. A large one
/// has no pages until they are written; each page then lies in the memory of the thread that wrote it first.
template <class T>
using UnfilledArray = std::vector<T, boost::noinit_adaptor<boost::alignment::aligned_allocator<T, 64>>>;

}  // namespace kbvh
