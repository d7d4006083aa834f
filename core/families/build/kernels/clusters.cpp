#include "core/families/build/kernels/clusters.hpp"

#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

constexpr std::size_t lanes = native_lanes<float> < 8 ? native_lanes<float> : 8;
using Values = Vector<float, lanes>;
using Words = Vector<std::int32_t, lanes>;

template <std::uint32_t radius>
void nearest(const NearestJob& shared) {
  const NearestJob job = shared;
  constexpr std::int32_t places = 2 * radius;  // a power of two
  std::int32_t numbers[lanes];
  for (std::size_t k = 0; k < lanes; ++k) numbers[k] = std::int32_t(k);
  const Words lane_numbers = load_lanes<Words>(numbers);
  for (std::uint32_t i = 0; i < job.count; ++i) {
    const float* const own = job.rows + i;
    float sides[6];
    for (std::size_t row = 0; row < 6; ++row) sides[row] = own[row * job.stride];
    // Ranks the places: the other one of clusters 2k and 2k + 1 comes first, then its side before the other
    // side.
    const std::int32_t first_place = std::int32_t(radius) - std::int32_t(i & 1U);
    Words best{};
    for (std::int32_t place = 0; place < places; place += std::int32_t(lanes)) {
      const float* const other = own + (place < std::int32_t(radius) ? place - std::int32_t(radius)
                                                                     : place - std::int32_t(radius) + 1);
      Values common[6];
      for (std::size_t row = 0; row < 6; ++row)
        common[row] = smaller(load_lanes<Values>(other + row * job.stride), Values{} + sides[row]);
      const Values x = common[0] + common[3], y = common[1] + common[4], z = common[2] + common[5];
      const Values area = x * y + y * z + z * x;  // of negative lengths
      // The surface with the rank of the place in its lowest bits; the sign of a zero is dropped.
      const Words word = (__builtin_bit_cast(Words, area) & std::int32_t(0x7fffffff & ~(places - 1))) |
                         ((lane_numbers + place) ^ first_place);
      best = place == 0 ? word : smaller(best, word);
    }
    std::int32_t each[lanes];
    __builtin_memcpy(each, &best, sizeof each);
    std::int32_t least = each[0];
    for (std::size_t k = 1; k < lanes; ++k) least = smaller(least, each[k]);
    const std::uint32_t place = std::uint32_t((least & (places - 1)) ^ first_place);
    job.nearest[i] = place < radius ? i + place - radius : i + place - radius + 1;
  }
}

using P = Points<float, 1>;
using Pack = P::Pack;

/// The bins of a box on the three axes.
#if defined(KBVH_KERNELS_portable)
[[gnu::always_inline]] inline void bins_of(PlainPoint<float> lower, PlainPoint<float> upper,
                                           const BinsJob& job, std::int32_t (&bin)[4]) {
  constexpr float last = float(sah_bins - 1);
  for (int axis = 0; axis < 3; ++axis) {
    const float place = (lower.v[axis] + upper.v[axis] - job.lower[axis]) * job.scale[axis];
    bin[axis] = std::int32_t(smaller(larger(place, 0.0F), last));
  }
}
#else
[[gnu::always_inline]] inline void bins_of(Vector<float, 4> lower, Vector<float, 4> upper, const BinsJob& job,
                                           std::int32_t (&bin)[4]) {
  using V = Vector<float, 4>;
  const V place = (lower + upper - load_lanes<V>(job.lower)) * load_lanes<V>(job.scale);
  const V clamped = smaller(larger(place, V{}), V{} + float(sah_bins - 1));
  const auto whole = __builtin_convertvector(clamped, Vector<std::int32_t, 4>);
  __builtin_memcpy(bin, &whole, sizeof bin);
}
#endif

void bins(const BinsJob& shared) {
  const BinsJob job = shared;
  constexpr float infinity = __builtin_inff();
  for (std::uint32_t b = 0; b < 3 * sah_bins; ++b) {
    job.bin_counts[b] = 0;
    for (std::uint32_t i = 0; i < 8; ++i) job.bin_boxes[8 * b + i] = i < 4 ? infinity : -infinity;
  }
  for (std::uint32_t k = 0; k < job.count; ++k) {
    const float* const box = job.boxes + std::size_t(8) * job.items[k];
    const Pack lower = P::load(box, box), upper = P::load(box + 4, box + 4);
    std::int32_t bin[4];
    bins_of(lower, upper, job, bin);
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t b = axis * sah_bins + std::uint32_t(bin[axis]);
      float* const target = job.bin_boxes + std::size_t(8) * b;
      P::store_smallest(target, smaller(P::load(target, target), lower));
      P::store_largest(target + 4, larger(P::load(target + 4, target + 4), upper));
      ++job.bin_counts[b];
    }
  }
}

std::uint32_t partition(const BinsJob& shared, std::uint32_t* items, std::uint32_t axis,
                        std::uint32_t last_bin) {
  const BinsJob job = shared;
  std::uint32_t left = 0, right = job.count;
  while (left < right) {
    const std::uint32_t item = items[left];
    const float* const box = job.boxes + std::size_t(8) * item;
    constexpr float last = float(sah_bins - 1);
    const float place = (box[axis] + box[axis + 4] - job.lower[axis]) * job.scale[axis];
    const bool stays = std::uint32_t(std::int32_t(smaller(larger(place, 0.0F), last))) <= last_bin;
    // Branchless, because the branch would be unpredictable.
    const std::uint32_t other = items[right - 1];
    items[right - 1] = stays ? other : item;
    items[left] = stays ? item : other;
    left += stays ? 1 : 0;
    right -= stays ? 0 : 1;
  }
  return left;
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const ClusterKernels clusters{&nearest<8>, &nearest<16>, &bins, &partition};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
