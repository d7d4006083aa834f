#include "core/families/average/kernels/meeting.hpp"

#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

template <class S, std::size_t width>
unsigned meeting(const S* rows, const S* box) {
  return overlapping<S, width>(rows, {{box[0], box[1], box[2]}, {box[3], box[4], box[5]}});
}

template <class S>
constexpr MeetingKernels<S> table{{&meeting<S, 2>, &meeting<S, 4>, &meeting<S, 8>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const MeetingKernels<float> meeting_float = table<float>;
const MeetingKernels<double> meeting_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
