#include "core/families/build/curve_order.hpp"

#include <algorithm>
#include <cmath>

namespace kbvh {

namespace {
/// Below this number, comparing keys costs less than counting digits.
constexpr std::uint32_t few = 256;
/// Up to this number of primitives, 22 bits of a code distinguish them well enough.
constexpr std::uint32_t coarse_count = 1U << 16;
/// Fewer primitives are sorted on one thread.
constexpr std::uint32_t least_shared = 1U << 12;
}  // namespace

PrimitiveList::PrimitiveList(const Primitives& primitives) : count(primitives.live_count()), corners_each(0) {
  if (primitives.removed_count != 0)
    for (std::uint32_t p = 0; p < primitives.count(); ++p)
      if (primitives.alive(p)) living.push_back(p);
  if (primitives.count() == 0) return;
  corners_each = primitives.offsets[1];
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    if (primitives.offsets[p + 1] - primitives.offsets[p] != corners_each) corners_each = 0;
}

template <class S>
void CurveOrder<S>::take(const Primitives& primitives, const PrimitiveList& list, const S* positions,
                         KernelSet kernels) {
  const Room to = room(primitives.count(), list.count, kernels);
  if (count_ == 0) return;
  build_kernels<S>(kernels).primitive_boxes({primitives.offsets.data(), primitives.vertices.data(),
                                             list.corners_each, list.ids(), count_, positions, to.boxes,
                                             to.centres, to.stride, to.extent});
}

template <class S>
void CurveOrder<S>::take(Workers& workers, const Primitives& primitives, const PrimitiveList& list,
                         const S* positions, KernelSet kernels) {
  if (!workers.several()) return take(primitives, list, positions, kernels);
  const Room to = room(primitives.count(), list.count, kernels);
  if (count_ == 0) return;
  const Parts cut = parts();
  if (part_extents_.size() < cut.parts()) part_extents_.resize(cut.parts());
  workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    const std::size_t first = cut.begin(part);
    PrimitiveBoxesJob<S> job{primitives.offsets.data(),
                             primitives.vertices.data(),
                             list.corners_each,
                             list.ids(),
                             std::uint32_t(cut.end(part) - first),
                             positions,
                             to.boxes,
                             to.centres + first,
                             to.stride,
                             part_extents_[part].of};
    if (job.living != nullptr) {
      job.living += first;
    } else {
      // Without a list, the kernel numbers primitives from 0.
      job.offsets += first;
      job.vertices += first * list.corners_each;
      job.boxes += 8 * first;
    }
    build_kernels<S>(kernels).primitive_boxes(job);
  });
  std::copy_n(part_extents_[0].of, 8, extent_);
  for (std::size_t part = 1; part < cut.parts(); ++part)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      extent_[axis] = std::min(extent_[axis], part_extents_[part].of[axis]);
      extent_[axis + 4] = std::max(extent_[axis + 4], part_extents_[part].of[axis + 4]);
    }
}

template <class S>
typename CurveOrder<S>::Room CurveOrder<S>::room(std::uint32_t primitives, std::uint32_t living,
                                                 KernelSet kernels) {
  kernels_ = kernels;
  count_ = living;
  const std::size_t size = std::size_t(8) * primitives + 8;
  if (boxes_.size() < size) boxes_.resize(size);
  stride_ = (std::size_t(count_) + 15) / 16 * 16;
  if (centres_.size() < 3 * stride_) centres_.resize(3 * stride_);
  return {boxes_.data(), centres_.data(), stride_, extent_};
}

template <class S>
CurveKeysJob<S> CurveOrder<S>::keys_job(const S* extent) {
  CurveKeysJob<S> job{};
  job.curve = curve_;
  for (int axis = 0; axis < 3; ++axis) {
    job.lower[axis] = extent[axis];
    const S scale = S(1U << curve_bits) / (extent[axis + 4] - extent[axis]);
    job.scale[axis] = std::isfinite(scale) ? scale : S(0);
  }
  return job;
}

template <class S>
CurveKeysJob<S> CurveOrder<S>::keys_job(const PrimitiveList& list) {
  CurveKeysJob<S> job = keys_job(extent_);
  job.centres = centres_.data();
  job.stride = stride_;
  job.living = list.ids();
  job.count = count_;
  job.keys = keys_.data();
  // Cells need not be much smaller than leaves, so one pass can be skipped.
  job.dropped_bits = count_ <= coarse_count ? 8 : 0;
  return job;
}

template <class S>
void CurveOrder<S>::sort(Workers& workers, const PrimitiveList& list, Curve curve) {
  if (!workers.several() || count_ < least_shared) return sort(list, curve);
  curve_ = curve;
  if (keys_.size() < count_) keys_.resize(count_);
  const Parts cut = parts();
  const CurveKeysJob<S> all = keys_job(list);
  workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    const std::size_t first = cut.begin(part);
    CurveKeysJob<S> job = all;
    job.centres += first;
    job.count = std::uint32_t(cut.end(part) - first);
    job.keys += first;
    if (job.living != nullptr) job.living += first;
    build_kernels<S>(kernels_).curve_keys(job);
    if (job.living != nullptr) return;
    for (std::uint32_t k = 0; k < job.count; ++k) job.keys[k] += first;  // numbered from 0, as above
  });
  radix_.sort(workers, {keys_.data(), count_});
}

template <class S>
void CurveOrder<S>::sort(const PrimitiveList& list, Curve curve) {
  curve_ = curve;
  if (keys_.size() < count_) keys_.resize(count_);
  if (count_ == 0) return;
  CurveKeysJob<S> job = keys_job(list);
  job.histogram = count_ <= few ? nullptr : radix_.counts();
  build_kernels<S>(kernels_).curve_keys(job);
  if (count_ <= few)
    std::sort(keys_.begin(), keys_.begin() + count_);
  else
    radix_.sort({keys_.data(), count_});
}

template <class S>
bool CurveOrder<S>::refine(std::uint32_t begin, std::uint32_t end) {
  const std::uint32_t count = end - begin;
  const std::size_t stride = (std::size_t(count) + 15) / 16 * 16;
  ids_.resize(std::max<std::size_t>(ids_.size(), count));
  few_centres_.resize(std::max(few_centres_.size(), 3 * stride));
  S extent[8] = {};
  for (std::uint32_t k = 0; k < count; ++k) {
    ids_[k] = primitive(keys_[begin + k]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const S* const box = boxes_.data() + std::size_t(8) * ids_[k];
      const S centre = box[axis] + box[axis + 4];
      few_centres_[axis * stride + k] = centre;
      extent[axis] = k == 0 ? centre : std::min(extent[axis], centre);
      extent[axis + 4] = k == 0 ? centre : std::max(extent[axis + 4], centre);
    }
  }
  CurveKeysJob<S> job = keys_job(extent);
  if (job.scale[0] == 0 && job.scale[1] == 0 && job.scale[2] == 0) return false;
  job.centres = few_centres_.data();
  job.stride = stride;
  job.living = ids_.data();
  job.count = count;
  job.keys = keys_.data() + begin;
  build_kernels<S>(kernels_).curve_keys(job);
  std::sort(keys_.begin() + begin, keys_.begin() + end);
  return true;
}

template <class S>
void CurveOrder<S>::refine_runs(std::uint32_t most) {
  runs_.clear();
  runs_.push_back({0, count_});
  while (!runs_.empty()) {
    const auto [begin, end] = runs_.back();
    runs_.pop_back();
    for (std::uint32_t i = begin, next; i < end; i = next) {
      for (next = i + 1; next < end && code(keys_[next]) == code(keys_[i]); ++next) {
      }
      if (next - i > most && refine(i, next)) runs_.push_back({i, next});
    }
  }
}

template <class S>
void CurveOrder<S>::refine_runs(Workers& workers, std::uint32_t most) {
  if (workers.several() && count_ > most) {
    // Hardly any frame has such a run, which has two keys of one code, `most` places apart.
    const Parts cut{count_ - most, 8192};
    if (part_runs_.size() < cut.parts()) part_runs_.resize(cut.parts());
    workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
      std::uint64_t runs = 0;
      for (std::size_t i = cut.begin(part); i < cut.end(part); ++i)
        runs += code(keys_[i]) == code(keys_[i + most]) ? 1U : 0U;
      part_runs_[part].value = runs;
    });
    bool any = false;
    for (std::size_t part = 0; part < cut.parts(); ++part) any = any || part_runs_[part].value != 0;
    if (!any) return;
  }
  refine_runs(most);
}

template <class S>
std::size_t CurveOrder<S>::bytes() const {
  return (boxes_.capacity() + centres_.capacity() + few_centres_.capacity()) * sizeof(S) +
         keys_.capacity() * sizeof(std::uint64_t) + radix_.bytes() + ids_.capacity() * sizeof(std::uint32_t) +
         runs_.capacity() * sizeof(runs_[0]) + part_extents_.capacity() * sizeof(PartExtent) +
         part_runs_.capacity() * sizeof(OwnCount);
}

template class CurveOrder<float>;
template class CurveOrder<double>;

}  // namespace kbvh
