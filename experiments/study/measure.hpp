#pragma once
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/judge/verify.hpp"
#include "core/judge/verify_changes.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments {

/// The times of one clip played once by one contestant. Script changes after the first frame's query belong
/// to the first frame, and are not timed.
struct ClipTimes {
  double reset_seconds = 0;        ///< `reset` at the first frame: preparation before the motion
  std::vector<PhaseTimes> frames;  ///< every frame after the first; the only frame if there is just one
  PhaseTimes mean() const;
  double total() const;  ///< update and query, summed, in seconds
};

/// The results of one contestant on one scene: verified first, then timed.
struct Measured {
  const ContestantSpec* spec = nullptr;
  Verification verification;
  ChangesVerification changes;  ///< of answers as changes
  std::uint64_t sampled_every = 1;
  Counters counters;
  std::string refused;      ///< the reason for a missing time, or empty
  bool unfinished = false;  ///< inconclusive: memory ran out this time
  double build_seconds = 0;
  std::string choice;  ///< of a strategy that chooses, at the end of the clip
  std::vector<ClipTimes> repetitions;
};

/// Refuses a contestant its time because of an exception: a broken guarantee, or, if memory ran out, no
/// verdict; the next run measures it again.
void refuse(Measured& measured, const std::exception& thrown);

/// One contestant with its timed instance; without an instance once it is refused.
template <class S>
struct Entrant {
  Measured measured;
  std::unique_ptr<Session<S>> session;

  /// Runs `work`. Refuses the contestant if `work` throws, except for ConfigError, which is passed on.
  /// Returns whether it ran to its end.
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

/// The contestants of a measurement by their places, as run/ and results/ see them in every kind of
/// measurement. A kind adds `add` (verifies a contestant), `play` (plays the clip once) and `extras` (members
/// of its record).
template <class E>
class Entrants {
 public:
  std::size_t size() const { return entrants_.size(); }
  Measured& operator[](std::size_t i) { return entrants_[i].measured; }
  /// Adds a contestant that is refused its time without being played; the caller says why.
  Measured& add_refused(const ContestantSpec& spec) {
    Measured& measured = entrants_.emplace_back().measured;
    measured.spec = &spec;
    return measured;
  }
  /// Returns whether the contestant has an instance to be timed.
  bool timed(std::size_t i) const { return entrants_[i].session != nullptr; }

 protected:
  std::vector<E> entrants_;
};

/// Receives progress messages; may be empty.
using MeasureProgress = std::function<void(const std::string&)>;

/// The question of every frame, with room for its answer.
struct FrameQuery {
  std::optional<Answer> changes{};  ///< the changes of this answer; otherwise the pairs
  PairBuffer pairs{}, ended{};

  template <class S>
  void ask(Session<S>& session, PhaseTimes& times) {
    if (changes)
      session.changes(*changes, pairs, ended, times);
    else
      session.query(pairs, times);
  }
};

/// Measures contestants on one scene, in one scalar, at one l.
template <class S>
class Measurement : public Entrants<Entrant<S>> {
 public:
  /// The script, if given, is replayed to every contestant; its times must be frames, and the oracle must be
  /// made for it. With `changes`, frames ask for the changes of this answer instead of the pairs.
  Measurement(const Scene<S>& scene, std::vector<double> frames, Oracle<S>& oracle,
              const PlanScript<S>* script = nullptr, std::optional<Answer> changes = {})
      : scene_(&scene), frames_(std::move(frames)), oracle_(&oracle), script_(script), query_{changes} {}

  /// Verifies a contestant over all frames, comparing every n-th with the oracle, and counts its work; its
  /// changes, too, if these are asked. If its guarantee holds, creates the silent instance that will be
  /// timed. Exceptions of the strategy count as a broken guarantee; ConfigError is passed on.
  void add(const ContestantSpec& spec, std::uint64_t oracle_every);

  /// Plays the clip once, keeps its times and returns them. If the contestant throws, it is refused its
  /// times, is no longer `timed`, and nullptr is returned.
  const ClipTimes* play(std::size_t i);
  const std::vector<double>& frames() const { return frames_; }
  /// Returns additional members of a contestant's record.
  nlohmann::json extras(std::size_t i) const;

 private:
  const Scene<S>* scene_;
  std::vector<double> frames_;
  Oracle<S>* oracle_;
  const PlanScript<S>* script_;
  FrameQuery query_;
};

extern template class Measurement<float>;
extern template class Measurement<double>;

/// Makes the times of a result record: means per frame of every repetition, in milliseconds, and the spread
/// over the frames of the median repetition.
nlohmann::json times_record(const Measured& measured);
/// Makes the verification of a result record.
nlohmann::json verified_record(const Measured& measured);
nlohmann::json counters_record(const Counters& counters);
/// Makes the list of bound events by depth, from the root to the deepest level with events.
nlohmann::json depths_record(const Counters& counters);

}  // namespace kbvh::experiments
