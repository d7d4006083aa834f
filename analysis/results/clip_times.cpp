// The arithmetic of times for Python: raw_times.hpp and resamples.hpp behind functions that ctypes can call
// (clip_times.py). Tables are contiguous doubles, times in ms. Arguments are trusted: clip_times.py checks
// shapes, load.py values.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "experiments/study/best_refit.hpp"
#include "experiments/study/resamples.hpp"

namespace {

using namespace kbvh::experiments;

struct Times {
  RawTimes raw;
  Resamples resamples{raw};
};

std::vector<std::vector<double>> rows(const double* table, std::size_t repetitions, std::size_t frames) {
  std::vector<std::vector<double>> all;
  for (std::size_t r = 0; r < repetitions; ++r)
    all.emplace_back(table + r * frames, table + (r + 1) * frames);
  return all;
}

/// Reads sums over frames: update, traversal, triangle_tests, plan_changes, geometry_changes.
std::vector<kbvh::PhaseTimes> phases(const double* sums, std::size_t repetitions) {
  std::vector<kbvh::PhaseTimes> all;
  for (std::size_t r = 0; r < repetitions; ++r, sums += 5)
    all.push_back({0, sums[0], sums[1], sums[2], sums[3], sums[4]});
  return all;
}

std::vector<Draw> each_alone(const RawTimes& times) {
  std::vector<Draw> draws;
  for (const std::uint32_t r : every_repetition(times.repetitions())) draws.push_back({r});
  return draws;
}

}  // namespace

extern "C" {

Times* kbvh_times_new(std::size_t repetitions, std::size_t frames, const double* totals,
                      const double* motions, const double* sums, const double* steady_sums,
                      std::int64_t steady_from, int by_clips, const char* session) {
  RawTimes raw;
  raw.totals = rows(totals, repetitions, frames);
  raw.motions = rows(motions, repetitions, frames);
  raw.clip = phases(sums, repetitions);
  if (steady_from >= 0) {
    raw.steady = phases(steady_sums, repetitions);
    raw.steady_from = std::size_t(steady_from);
  }
  raw.by = by_clips != 0 ? By::clips : By::frames;
  raw.session = session;
  return new Times{std::move(raw)};
}

void kbvh_times_delete(Times* times) {
  delete times;
}

/// Returns the time of a phase over all repetitions; NaN for steady times where there are none.
double kbvh_times_of(const Times* times, const char* phase, int steady, int by_clips) {
  const Part part = steady != 0 ? Part::steady : Part::clip;
  if (!times->raw.has(part)) return NAN;
  return time_of(times->raw, phase, part, by_clips != 0 ? By::clips : By::frames,
                 every_repetition(times->raw.repetitions()));
}

/// Writes the time of a phase in each repetition alone.
void kbvh_times_single(const Times* times, const char* phase, double* out) {
  const std::vector<double> each =
      DrawnTimes(times->raw, Part::clip, times->raw.by, each_alone(times->raw)).of(phase);
  std::copy(each.begin(), each.end(), out);
}

/// Writes the time of a phase, by frames, over each of the 200 resamples.
void kbvh_times_replicates(Times* times, const char* phase, double* out) {
  const std::vector<double> all = times->resamples.replicates(phase, Part::clip, By::frames);
  std::copy(all.begin(), all.end(), out);
}

/// Writes the ratio and the ends of its interval or range (both the ratio itself for a single repetition).
/// Returns 0 if there is no ratio; else 1, plus 2 if repetitions are paired, plus 4 for an interval.
int kbvh_times_ratio(Times* numerator, Times* denominator, const char* phase, int steady, double* out) {
  const auto ratio =
      ratio_of(numerator->resamples, denominator->resamples, phase, steady != 0 ? Part::steady : Part::clip);
  if (!ratio) return 0;
  out[0] = ratio->middle;
  out[1] = ratio->within ? ratio->within->low : ratio->middle;
  out[2] = ratio->within ? ratio->within->high : ratio->middle;
  return 1 + (rounds_of(numerator->raw, denominator->raw) == Rounds::same ? 2 : 0) +
         (ratio->within && ratio->within->is_interval ? 4 : 0);
}

/// Returns the time by which contestants are ranked.
double kbvh_times_clip_total(const Times* times) {
  return clip_total(times->raw);
}

/// Returns why times are disturbed; the text lives until the next call of this thread.
const char* kbvh_times_doubts(const Times* times, const char* recorded) {
  static thread_local std::string text;
  text = doubts(times->raw, recorded);
  return text.c_str();
}

/// Returns the index of the best refit; -1 if there is none. A null pointer is a contestant without times.
std::int64_t kbvh_times_best_refit(std::size_t count, const Times* const* times,
                                   const unsigned char* baseline, const unsigned char* approximate) {
  std::vector<RefitCandidate> table;
  for (std::size_t i = 0; i < count; ++i)
    table.push_back({times[i] == nullptr ? nullptr : &times[i]->raw, baseline[i] != 0, approximate[i] != 0});
  const auto best = best_refit(table);
  return best ? std::int64_t(*best) : -1;
}

/// Returns the frame from which on preparation has paid; -1 if there is none.
std::int64_t kbvh_times_paid_from(const Times* own, double own_preparation, const Times* other,
                                  double other_preparation) {
  const auto frame = paid_from(own->raw, own_preparation, other->raw, other_preparation);
  return frame ? std::int64_t(*frame) : -1;
}

}  // extern "C"
