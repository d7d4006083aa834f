#include "experiments/run/rounds.hpp"

#include <algorithm>
#include <numeric>

#include "experiments/study/chance.hpp"

namespace kbvh::experiments {

std::vector<std::size_t> shuffled(std::size_t count, std::uint64_t seed, std::uint32_t round) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t(0));
  Chance chance(seed + 0x2545f4914f6cdd1du * (round + 1));
  for (std::size_t left = count; left > 1; --left) std::swap(order[left - 1], order[chance.below(left)]);
  return order;
}

bool narrow_enough(std::span<const RawTimes> contestants, std::span<const std::uint8_t> baselines,
                   double width) {
  const RawTimes* refit = nullptr;
  for (std::size_t i = 0; i < contestants.size(); ++i)
    if (baselines[i] != 0 && (refit == nullptr || time_of(contestants[i], "total_with_motion") <
                                                      time_of(*refit, "total_with_motion")))
      refit = &contestants[i];
  const auto is_narrow = [&](const std::vector<double>& above, const std::vector<double>& below,
                             Rounds rounds, double middle) {
    const auto [low, high] = middle_of_quotients(above, below, rounds);
    return high - low < width * middle;
  };
  std::vector<double> of_refit[2];  // by frames and by clips, where asked for
  for (const RawTimes& one : contestants) {
    if (one.repetitions() < fewest_of_an_interval) return false;
    if (&one == refit && contestants.size() > 1) continue;
    const By by =
        one.by == By::clips || (refit != nullptr && refit->by == By::clips) ? By::clips : By::frames;
    const double own = time_of(one, "total", Part::clip, by, every_repetition(one.repetitions()));
    if (!(own > 0)) continue;
    const std::vector<double> below = replicates(one, "total", Part::clip, by);
    if (refit == nullptr || &one == refit) {
      // Nothing to compare with: its time over itself, as if of other rounds.
      if (!is_narrow(below, below, Rounds::others, 1)) return false;
      continue;
    }
    std::vector<double>& above = of_refit[by == By::clips ? 1 : 0];
    if (above.empty()) above = replicates(*refit, "total", Part::clip, by);
    const double middle =
        time_of(*refit, "total", Part::clip, by, every_repetition(refit->repetitions())) / own;
    if (!is_narrow(above, below, Rounds::same, middle)) return false;
  }
  return true;
}

}  // namespace kbvh::experiments
