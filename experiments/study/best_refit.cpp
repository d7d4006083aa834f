#include "experiments/study/best_refit.hpp"

#include <vector>

namespace kbvh::experiments {

double clip_total(const RawTimes& times) {
  return time_of(times, "total_with_motion");
}

std::optional<std::size_t> shortest_clip(std::span<const RawTimes* const> contestants) {
  std::optional<std::size_t> best;
  double shortest = 0;
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    if (contestants[i] == nullptr) continue;
    const double total = clip_total(*contestants[i]);
    if (best && total >= shortest) continue;
    best = i;
    shortest = total;
  }
  return best;
}

std::optional<std::size_t> best_refit(std::span<const RefitCandidate> table) {
  std::vector<const RawTimes*> baselines;
  for (const RefitCandidate& one : table)
    baselines.push_back(one.is_baseline && !one.is_approximate ? one.times : nullptr);
  return shortest_clip(baselines);
}

}  // namespace kbvh::experiments
