#include "core/contract/strategy.hpp"

namespace kbvh {

template <class S>
Strategy<S>::~Strategy() = default;

template class Strategy<float>;
template class Strategy<double>;
template class CountedStrategy<float, Counting>;
template class CountedStrategy<float, Silent>;
template class CountedStrategy<double, Counting>;
template class CountedStrategy<double, Silent>;

}  // namespace kbvh
