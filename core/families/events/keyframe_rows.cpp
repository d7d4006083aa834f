#include "core/families/events/keyframe_rows.hpp"

#include <algorithm>

#include "core/families/events/projected_plan.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(RowScanKernels, row_scan_kernels, row_scan)

template <class S>
KeyframeRows<S>::KeyframeRows(const FlightPlans<S>& plans, std::span<const SlabDirection> directions)
    : plans_(&plans),
      directions_(directions),
      times_(plans.keyframe_times()),
      vertices_(plans.keyframed_count()),
      kernels_(&row_scan_kernels<S>(active_kernel_set())) {
  if (times_.size() > 1) per_second_ = double(times_.size() - 1) / (times_.back() - times_.front());
}

template <class S>
void KeyframeRows<S>::copy() {
  const std::size_t keyframes = times_.size();
  if (keyframes < 2 || vertices_ == 0 || plans_->curved()) return;
  values_.resize(directions_.size() * vertices_ * keyframes + row_padding, S(0));
  // Copies in blocks that fit into the cache on both sides.
  constexpr std::size_t block = 64;
  for (std::size_t first = 0; first < vertices_; first += block)
    for (std::size_t begin = 0; begin < keyframes; begin += block) {
      const std::size_t end = std::min(begin + block, keyframes);
      for (std::size_t v = first; v < std::min(first + block, vertices_); ++v)
        for (std::size_t direction = 0; direction < directions_.size(); ++direction) {
          S* const to = values_.data() + (direction * vertices_ + v) * keyframes;
          for (std::size_t k = begin; k < end; ++k) {
            const S* const position = plans_->keyframe(k) + 3 * v;
            to[k] = direction < 3 ? position[direction] : projected(directions_[direction], position);
          }
        }
    }
}

template <class S>
std::size_t KeyframeRows<S>::segment_at(double t) const {
  const double guess = (t - times_.front()) * per_second_;
  const std::size_t last = times_.size() - 1;
  if (guess >= 0 && guess <= double(last)) {
    std::size_t k = std::size_t(guess);
    // For evenly spaced keyframes, rounding is off by one at most.
    if (t < times_[k] && k > 0) --k;
    if (k < last && t >= times_[k + 1]) ++k;
    if (t >= times_[k] && (k == last || t < times_[k + 1])) return k;
  }
  const auto above = std::upper_bound(times_.begin(), times_.end(), t);
  return above == times_.begin() ? 0 : std::size_t(above - times_.begin()) - 1;
}

template class KeyframeRows<float>;
template class KeyframeRows<double>;

}  // namespace kbvh
