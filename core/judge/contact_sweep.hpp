#pragma once
#include <cstdint>
#include <vector>

#include "core/continuous/contacts.hpp"
#include "core/contract/strategy.hpp"
#include "core/judge/phase_times.hpp"

namespace kbvh {

/// Finds the contacts between two times: the strategy's swept pairs are the broad phase, followed by the
/// exact narrow phase.
template <class S>
class ContactSweep {
 public:
  /// Throws std::invalid_argument unless all bodies in pairs consist of triangles.
  explicit ContactSweep(const Scene<S>& scene) : finder_(scene) {}

  /// Moves the playback to t by `seek` and appends the contacts on the way. Returns the number of pairs of
  /// primitives that reached the narrow phase.
  template <class Seek>
  std::size_t find(Strategy<S>& strategy, Playback<S>& playback, double t, const Seek& seek,
                   ContactBuffer& out, PhaseTimes& times) {
    timed(times.motion, [&] { playback.evaluate_all(); });  // already current, except in the first interval
    finder_.start(playback);
    const double from = playback.time();
    timed(times.update, [&] { strategy.start_sweep(from); });
    seek(t);
    timed(times.motion, [&] { playback.evaluate_all(); });
    before_.clear();
    for (std::uint32_t body = 0; body < playback.body_count(); ++body)
      before_.push_back(finder_.before(body));
    pairs_.clear();
    timed(times.traversal, [&] { strategy.swept_pairs(from, t, before_, pairs_); });
    timed(times.triangle_tests, [&] { finder_.find(playback, pairs_, out); });
    return pairs_.size();
  }

  /// Returns how contacts were decided since construction.
  ImpactStats stats() const { return finder_.stats(); }
  /// Returns the swept pairs of the last call of `find`.
  const PairBuffer& pairs() const { return pairs_; }

 private:
  ContactFinder<S> finder_;
  std::vector<const S*> before_;  ///< positions at the start, by body
  PairBuffer pairs_;
};

}  // namespace kbvh
