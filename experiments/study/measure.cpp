#include "experiments/study/measure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

#include "core/judge/sort_pairs.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// The number of frames at which the quality of a contestant's boxes is recorded.
constexpr std::uint64_t quality_samples = 16;

/// Returns the first pair of `from` that `without` lacks, both sorted; null if there is none.
const PrimitivePair* lacking(const PairBuffer& from, const PairBuffer& without) {
  auto other = without.begin();
  for (const PrimitivePair& pair : from) {
    while (other != without.end() && *other < pair) ++other;
    if (other == without.end() || !(*other == pair)) return &pair;
  }
  return nullptr;
}

/// Compares an answer of the replay with the truth, both sorted; returns the first difference, or "".
std::string compared(const PairBuffer& found, const PairBuffer& truth, bool all_found_are_true) {
  if (const PrimitivePair* missed = lacking(truth, found)) return "pair " + text(*missed) + " is missed";
  if (!all_found_are_true) return {};
  if (const PrimitivePair* extra = lacking(found, truth))
    return "pair " + text(*extra) + " is reported but does not intersect";
  return found.size() == truth.size() ? "" : "a pair was reported more than once";
}

/// Returns the number of changes of geometry before the frame at t.
template <class S>
std::uint32_t geometry_changes_before(const PlanScript<S>* script, double t) {
  std::uint32_t changes = 0;
  if (script != nullptr)
    for (const auto& step : script->steps) changes += step.time < t && !step.geometry.empty() ? 1 : 0;
  return changes;
}

}  // namespace

std::string answers_differ(std::span<const std::uint64_t> timed, std::span<const std::uint64_t> replayed) {
  for (std::size_t f = 0; f < timed.size(); ++f)
    if (timed[f] != replayed[f])
      return "frame " + std::to_string(f) + " has " + std::to_string(timed[f]) +
             " answers while it is timed, and " + std::to_string(replayed[f]) +
             " in the replay of the same calls";
  return {};
}

void refuse(Measured& measured, const std::exception& thrown) {
  measured.repetitions.clear();
  measured.choice.clear();
  if (dynamic_cast<const std::bad_alloc*>(&thrown) != nullptr) {
    measured.unfinished = true;
    measured.refused = "out of memory";
    measured.verification = {};
    measured.counters = {};
    return;
  }
  const bool promised = dynamic_cast<const BrokenPromise*>(&thrown) != nullptr;
  measured.refused = promised ? thrown.what() : std::string("it threw: ") + thrown.what();
  measured.verification.first_violation = measured.refused;
}

template <class S>
std::optional<std::size_t> steady_frame(const Scene<S>& scene, std::span<const double> frames,
                                        bool plans_change) {
  const std::vector<double> knots = overlaid_keyframes(scene);
  if (plans_change || knots.size() < 3) return {};
  const auto first = std::lower_bound(frames.begin(), frames.end(), knots[1]);
  if (first == frames.end()) return {};
  return std::size_t(first - frames.begin());
}
template std::optional<std::size_t> steady_frame(const Scene<float>&, std::span<const double>, bool);
template std::optional<std::size_t> steady_frame(const Scene<double>&, std::span<const double>, bool);

template <class S>
void Measurement<S>::add(const ContestantSpec& spec, std::uint64_t oracle_every) {
  this->admit(*scene_, spec, oracle_every, steady_from_, [&](Entrant<S>& entrant) {
    Measured& measured = entrant.measured;
    {
      Session<S> session(*scene_, spec.contestant());
      measured.verification = verify<S>(session, frames_, *oracle_, script_, {oracle_every, quality_samples});
    }
    if (query_.changes && measured.verification.holds()) {
      Session<S> session(*scene_, spec.contestant());
      measured.changes = verify_changes<S>(session, frames_, *oracle_, script_,
                                           {oracle_every, VerifyChangesOptions::Calls::every_frame});
      measured.verification.first_violation = measured.changes.first_violation;
    }
    if (measured.verification.holds()) replay(measured);
  });
}

template <class S>
void Measurement<S>::replay(Measured& measured) {
  Session<S> session(*scene_, measured.spec->contestant());
  const bool promises = session.info().guarantee != Guarantee::approximate;
  const bool exact = !query_.changes || *query_.changes == Answer::pairs;
  ChangeReplay added;
  const auto ask = [&](PhaseTimes& times, std::size_t f) {
    const std::uint64_t size = query_.ask(session, times);
    const auto broken = [&](const std::string& what) {
      throw BrokenPromise("t = " + std::to_string(frames_[f]) + ": in the replay of the timed calls, " +
                          what);
    };
    if (query_.changes)
      if (const std::string fault = added.add(query_.pairs, query_.ended); !fault.empty()) broken(fault);
    const bool sampled = f % measured.sampled_every == 0 || f + 1 == frames_.size();
    if (!promises || !sampled) return size;
    const PairBuffer* truth = oracle_->known(frames_[f], geometry_changes_before(script_, frames_[f]));
    if (truth == nullptr) throw std::logic_error("the truth of a frame that was verified is not known");
    PairBuffer found = query_.changes ? added.pairs() : query_.pairs;
    if (!query_.changes) sort_pairs(found);
    if (const std::string what = compared(found, *truth, exact); !what.empty()) broken(what);
    return size;
  };
  measured.answers = play_frames<S>(session, frames_, script_, ask).answers;
  measured.counters = session.strategy().counters();
}

template <class S>
void Measurement<S>::play(std::size_t i) {
  this->play_warm(i, [&](Session<S>& session, const WarmUp* warm_up) {
    const auto ask = [&](PhaseTimes& times, std::size_t) { return query_.ask(session, times); };
    return play_frames<S>(session, frames_, script_, ask, warm_up);
  });
}

template <class S>
json Measurement<S>::extras(std::size_t i) const {
  if (!query_.changes) return json::object();
  const ChangesVerification& changes = this->entrants_[i].measured.changes;
  return {{"changes", {{"begun", changes.begun}, {"ended", changes.ended}}}};
}

template class Measurement<float>;
template class Measurement<double>;

namespace {
/// JSON has no infinity: an empty box counts as the largest protrusion.
double finite(double value) {
  return std::isfinite(value) ? value : std::numeric_limits<double>::max();
}
}  // namespace

json verified_record(const Measured& measured) {
  const Verification& v = measured.verification;
  json over_time = json::array();
  for (const Quality& q : v.over_time)
    over_time.push_back({{"t", q.t},
                         {"looseness", finite(q.looseness)},
                         {"sah", finite(q.sah)},
                         {"sah_rebuilt", finite(q.sah_rebuilt)}});
  return {{"holds", v.holds()},
          {"first_violation", v.first_violation},
          {"frames", v.frames},
          {"pairs", v.pairs},
          {"candidates", v.candidates},
          {"missed_candidates", v.missed_candidates},
          {"missed", v.missed},
          {"extra", v.extra},
          {"wrong_frames", v.wrong_frames},
          {"first_missed", v.first_missed ? json(*v.first_missed) : json()},
          {"missed_depth", v.missed_deepest.depth},
          {"missed_depth_mean", v.missed > 0 ? v.missed_depth_sum / double(v.missed) : 0},
          {"missed_depth_in_edges", v.missed_deepest.in_edges},
          {"repeated", v.repeated},
          {"malformed", v.malformed},
          {"audited", v.audited},
          {"protrusion", finite(v.audit.protrusion)},
          {"looseness", finite(v.audit.looseness())},
          {"invalid", v.audit.invalid},
          {"not_tight", v.audit.not_tight},
          {"sampled_every", measured.sampled_every},
          {"over_time", over_time}};
}

json counters_record(const Counters& counters) {
  json record = json::object();
  for (std::size_t c = 0; c < std::size_t(Counter::count); ++c)
    record[name(Counter(c))] = counters[Counter(c)];
  for (const Counters::Named& counter : counters.named) record[std::string(counter.name)] = counter.value;
  return record;
}

json depths_record(const Counters& counters) {
  const auto& events = counters.events_at_depth;
  std::size_t used = events.size();
  while (used > 0 && events[used - 1] == 0) --used;
  return json(std::vector<std::uint64_t>(events.begin(), events.begin() + std::ptrdiff_t(used)));
}

}  // namespace kbvh::experiments
