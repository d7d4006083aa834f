#pragma once
#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/judge/verify.hpp"
#include "core/judge/verify_changes.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/study/clip.hpp"
#include "experiments/study/contestants.hpp"
#include "experiments/study/raw_times.hpp"

namespace kbvh::experiments {

/// The results of one contestant on one scene: verified and replayed first, then timed.
struct Measured {
  const ContestantSpec* spec = nullptr;
  Verification verification;
  ChangesVerification changes;  ///< of answers as changes
  std::uint64_t sampled_every = 1;
  /// From the replay, which makes the timed calls and no others.
  Counters counters;
  std::vector<std::uint64_t> answers;  ///< of the replay: the size of each frame's answer
  std::string refused;                 ///< the reason for a missing time, or empty
  bool unfinished = false;             ///< inconclusive: memory ran out this time
  double build_seconds = 0;            ///< the preparation: topologies, and creating the instance
  std::string choice;                  ///< of a strategy that chooses, at the end of the clip
  std::vector<ClipTimes> repetitions;
  std::optional<std::size_t> steady_from;  ///< the first frame unaffected by the beginning
};

/// Refuses a contestant its time because of an exception. Records a broken guarantee or, if memory ran out,
/// no verdict; the next run then measures it again.
void refuse(Measured& measured, const std::exception& thrown);

/// The reasons to refuse a contestant its time, besides its own exceptions.
struct BrokenPromise : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One contestant with its timed instance; without an instance once it is refused.
template <class S>
struct Entrant {
  Measured measured;
  std::unique_ptr<Session<S>> session;

  /// Keeps the times of a clip if it answers like the replay; throws BrokenPromise otherwise.
  void keep(ClipTimes clip) {
    if (const std::string what = answers_differ(clip.answers, measured.answers); !what.empty())
      throw BrokenPromise(what);
    measured.choice = session->strategy().choice();
    measured.repetitions.push_back(std::move(clip));
  }

  /// Runs `work`. Refuses the contestant if `work` throws, except for ConfigError, which is passed on.
  /// Returns whether it ran to completion.
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

/// The contestants of a measurement by their places, in the form that run/ and results/ use for every kind of
/// measurement. A kind adds `add` (verifies and replays a contestant), `play` (warms it up, plays the clip
/// once, compares the sizes of its answers with the replay's, and keeps the times; a contestant that throws
/// or differs is refused its times and no longer `timed`) and `extras` (members of its record).
template <class E>
class Entrants {
 public:
  std::size_t size() const { return entrants_.size(); }
  Measured& operator[](std::size_t i) { return entrants_[i].measured; }
  /// Adds a contestant that is refused its time without being played; the caller adds the reason.
  Measured& add_refused(const ContestantSpec& spec) {
    Measured& measured = entrants_.emplace_back().measured;
    measured.spec = &spec;
    return measured;
  }
  /// Returns whether the contestant has an instance to be timed.
  bool timed(std::size_t i) const { return entrants_[i].session != nullptr; }

 protected:
  /// Adds a contestant. verify(entrant) verifies and replays it; if its guarantee holds afterwards, the
  /// instance is created that will be timed. Exceptions of the strategy count as a broken guarantee;
  /// ConfigError is passed on.
  template <class S, class Verify>
  void admit(const Scene<S>& scene, const ContestantSpec& spec, std::uint64_t oracle_every,
             std::optional<std::size_t> steady_from, const Verify& verify) {
    E entrant;
    Measured& measured = entrant.measured;
    measured.spec = &spec;
    measured.sampled_every = oracle_every;
    measured.steady_from = steady_from;
    entrant.attempt([&] {
      verify(entrant);
      if (!measured.verification.holds()) {
        measured.refused = measured.verification.first_violation;
        return;
      }
      const auto begin = std::chrono::steady_clock::now();
      entrant.session = std::make_unique<Session<S>>(scene, spec.contestant(), Use::timed);
      measured.build_seconds = seconds_since(begin);
    });
    entrants_.push_back(std::move(entrant));
  }
  /// Plays a clip, play(session, warm_up), until buffers have grown and hierarchies that are made at their
  /// first use exist, and once more, whose times are kept.
  template <class Play>
  void play_warm(std::size_t i, const Play& play) {
    E& entrant = entrants_[i];
    entrant.attempt([&] {
      const WarmUp warm_up;
      play(*entrant.session, &warm_up);
      entrant.keep(play(*entrant.session, nullptr));
    });
  }

  std::vector<E> entrants_;
};

/// The query of every frame, with space for its answer.
struct FrameQuery {
  std::optional<Answer> changes{};  ///< the changes of this answer; otherwise the pairs
  PairBuffer pairs{}, ended{};

  /// Returns the size of the answer.
  template <class S>
  std::uint64_t ask(Session<S>& session, PhaseTimes& times) {
    if (!changes) {
      session.query(pairs, times);
      return pairs.size();
    }
    session.changes(*changes, pairs, ended, times);
    return pairs.size() + ended.size();
  }
};

/// Returns the first frame (or interval, by its start) at or after the second knot of the overlaid plans;
/// nothing for clips of fewer than three knots, and where plans change at run time.
template <class S>
std::optional<std::size_t> steady_frame(const Scene<S>& scene, std::span<const double> frames,
                                        bool plans_change);

/// Measures contestants on one scene, in one scalar, at one l.
template <class S>
class Measurement : public Entrants<Entrant<S>> {
 public:
  /// The script, if given, is replayed to every contestant; its times must be frames, and the oracle must be
  /// made for it. With `changes`, frames request the changes of this answer instead of the pairs.
  Measurement(const Scene<S>& scene, std::vector<double> frames, Oracle<S>& oracle,
              const PlanScript<S>* script = nullptr, std::optional<Answer> changes = {})
      : scene_(&scene),
        frames_(std::move(frames)),
        oracle_(&oracle),
        script_(script),
        query_{changes},
        steady_from_(steady_frame(scene, std::span<const double>(frames_), script != nullptr)) {}

  /// Verifies a contestant over all frames, comparing every n-th with the oracle; also verifies its changes
  /// if these are requested. Then plays exactly the timed calls on a second instance, which counts; compares
  /// the answers of the same frames with the oracle, and keeps the sizes of all. If the guarantee holds,
  /// creates the instance that will be timed. Exceptions of the strategy count as a broken guarantee;
  /// ConfigError is passed on.
  void add(const ContestantSpec& spec, std::uint64_t oracle_every);

  void play(std::size_t i);
  const std::vector<double>& frames() const { return frames_; }
  /// Returns additional members of a contestant's record.
  nlohmann::json extras(std::size_t i) const;

 private:
  void replay(Measured& measured);

  const Scene<S>* scene_;
  std::vector<double> frames_;
  Oracle<S>* oracle_;
  const PlanScript<S>* script_;
  FrameQuery query_;
  std::optional<std::size_t> steady_from_;
};

extern template class Measurement<float>;
extern template class Measurement<double>;

/// Makes the verification of a result record.
nlohmann::json verified_record(const Measured& measured);
nlohmann::json counters_record(const Counters& counters);
/// Makes the list of bound events by depth, from the root to the deepest level with events.
nlohmann::json depths_record(const Counters& counters);

}  // namespace kbvh::experiments
