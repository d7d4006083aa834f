#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "experiments/study/measure.hpp"
#include "experiments/study/plan.hpp"
#include "experiments/study/times_record.hpp"

namespace kbvh::experiments {

/// Returns 0 to count - 1 in an order that depends on the seed and the round only; the same on every machine.
std::vector<std::size_t> shuffled(std::size_t count, std::uint64_t seed, std::uint32_t round);

/// Returns whether the interval of each contestant's total relative to the best refit's (without a
/// baseline: of its own) is narrower than `width`, relative to it. False with fewer than five repetitions.
bool narrow_enough(std::span<const RawTimes> contestants, std::span<const std::uint8_t> baselines,
                   double width);

/// Plays rounds: in each, every timed contestant once, in an order of its own. Of the repetitions, the study
/// says the least number. Where that is five or more, goes on until all ratios are narrow enough, the study's
/// seconds are used up, or four times as many were played. `before` is called before each clip.
template <class M>
void play_rounds(M& measurement, const Study& study, std::uint64_t seed,
                 const std::function<void(std::size_t contestant, std::uint32_t round)>& before) {
  constexpr std::uint32_t most = 4;  // times the least number
  std::vector<std::size_t> timed;
  for (std::size_t i = 0; i < measurement.size(); ++i)
    if (measurement.timed(i)) timed.push_back(i);
  auto begin = std::chrono::steady_clock::now();
  for (std::uint32_t round = 0; round < most * study.repetitions; ++round) {
    if (round == study.repetitions) begin = std::chrono::steady_clock::now();
    if (round >= study.repetitions) {
      if (study.repetitions < fewest_of_an_interval || seconds_since(begin) >= study.seconds) return;
      std::vector<RawTimes> times;
      std::vector<std::uint8_t> baselines;
      for (const std::size_t i : timed) {
        if (!measurement.timed(i)) continue;
        times.push_back(raw_times(measurement[i], {}));
        const Info& info = measurement[i].spec->entry->info;
        baselines.push_back(info.baseline && info.guarantee != Guarantee::approximate ? 1 : 0);
      }
      if (narrow_enough(times, baselines, study.interval_width)) return;
    }
    const std::vector<std::size_t> order = shuffled(timed.size(), seed, round);
    for (std::size_t place = 0; place < order.size(); ++place) {
      const std::size_t i = timed[order[place]];
      if (!measurement.timed(i)) continue;  // it was refused its times meanwhile
      before(i, round);
      measurement.play(i);
      if (!measurement.timed(i)) continue;
      measurement[i].repetitions.back().round = round;
      measurement[i].repetitions.back().place = std::uint32_t(place);
    }
  }
}

}  // namespace kbvh::experiments
