#pragma once
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/judge/verify.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

/// One clip played once by one contestant. What a script changes after the first frame's query belongs to the
/// first frame, and is not timed.
struct ClipTimes {
  double reset_seconds = 0;        ///< `reset` at the first frame: what is prepared before anything moves
  std::vector<PhaseTimes> frames;  ///< of every frame after the first; of the only one if there is just one
  PhaseTimes mean() const;
  double total() const;  ///< update and query, summed, in seconds
};

/// What is known of one contestant on one scene: verified first, then timed.
struct Measured {
  const ContestantSpec* spec = nullptr;
  Verification verification;
  std::uint64_t sampled_every = 1;
  Counters counters;
  std::string refused;      ///< why it gets no time, or empty
  bool unfinished = false;  ///< it says nothing of the contestant: there was no memory for it this time
  double build_seconds = 0;
  std::string choice;  ///< of a strategy that chooses, at the end of the clip
  std::vector<ClipTimes> repetitions;
};

/// Refuses a contestant its time for what it threw: a guarantee that is broken, but for want of memory, which
/// says nothing and is measured again by the next run.
void refuse(Measured& measured, const std::exception& thrown);

/// One contestant, and the instance of it that is timed; no instance once it is refused.
template <class S>
struct Entrant {
  Measured measured;
  std::unique_ptr<Session<S>> session;

  /// Runs `work`. Refuses the contestant for what it throws, but for ConfigError, which is passed on. Returns
  /// whether it ran to its end.
  template <class Work>
  bool attempt(const Work& work) {
    try {
      work();
      return true;
    } catch (const ConfigError&) {
      throw;
    } catch (const std::exception& problem) {
      session.reset();
      refuse(measured, problem);
      return false;
    }
  }
};

/// Told what is being done; may be empty.
using MeasureProgress = std::function<void(const std::string&)>;

/// Contestants on one scene, in one scalar, at one l.
template <class S>
class Measurement {
 public:
  /// The script, if there is one, is replayed to every contestant; its times are frames, and the oracle is
  /// made for it.
  Measurement(const Scene<S>& scene, std::vector<double> frames, Oracle<S>& oracle,
              const PlanScript<S>* script = nullptr)
      : scene_(&scene), frames_(std::move(frames)), oracle_(&oracle), script_(script) {}

  /// Verifies a contestant over all frames, comparing every n-th with the oracle, and counts what it does
  /// there; if its guarantee holds, makes the silent instance that will be timed. Exceptions of the strategy
  /// count as a broken guarantee; ConfigError is passed on.
  void add(const ContestantSpec& spec, std::uint64_t oracle_every);

  std::size_t size() const { return entrants_.size(); }
  Measured& operator[](std::size_t i) { return entrants_[i].measured; }
  /// True if the contestant has an instance to be timed.
  bool timed(std::size_t i) const { return entrants_[i].session != nullptr; }
  /// Plays the clip once and keeps its times; they are returned, too. If the contestant throws, it is refused
  /// its times, is not `timed` any more, and nullptr is returned.
  const ClipTimes* play(std::size_t i);
  const std::vector<double>& frames() const { return frames_; }
  /// What the record of a contestant has beside what all have.
  nlohmann::json extras(std::size_t /*i*/) const { return nlohmann::json::object(); }

 private:
  const Scene<S>* scene_;
  std::vector<double> frames_;
  Oracle<S>* oracle_;
  const PlanScript<S>* script_;
  std::vector<Entrant<S>> entrants_;
  PairBuffer pairs_;
};

extern template class Measurement<float>;
extern template class Measurement<double>;

/// Times as result records hold them: means per frame of every repetition, in milliseconds, and the spread
/// over the frames of the median repetition.
nlohmann::json times_record(const Measured& measured);
/// Verification as result records hold it.
nlohmann::json verified_record(const Measured& measured);
nlohmann::json counters_record(const Counters& counters);
/// Events of bounds by depth, from the root to the deepest that had any.
nlohmann::json depths_record(const Counters& counters);

}  // namespace kbvh::experiments
