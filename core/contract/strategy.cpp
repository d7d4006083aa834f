#include "core/contract/strategy.hpp"

namespace kbvh {

template <class S>
Strategy<S>::~Strategy() = default;

template class Strategy<float>;
template class Strategy<double>;
template class CountedStrategy<float>;
template class CountedStrategy<double>;

}  // namespace kbvh
