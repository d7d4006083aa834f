#include "experiments/study/measure.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <new>
#include <numeric>

#include "core/judge/follow_script.hpp"
#include "experiments/common/stopwatch.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// The warm-up time, in which a contestant's buffers grow; this long, or one clip, suffices.
constexpr double warm_up_seconds = 0.05;

/// The number of frames at which the quality of a contestant's boxes is recorded.
constexpr std::uint64_t quality_samples = 16;

/// The number of equal parts of a clip whose times are recorded.
constexpr std::size_t time_parts = 16;

template <class S>
ClipTimes play_clip(Session<S>& session, std::span<const double> frames, const PlanScript<S>* script,
                    FrameQuery& query) {
  ScriptCursor<S> cursor(script);
  ClipTimes times;
  times.frames.reserve(frames.size());
  const auto begin = std::chrono::steady_clock::now();
  session.reset(frames[0]);
  times.reset_seconds = seconds_since(begin);
  if (frames.size() > 1) {
    // The first frame belongs to the reset, which has no update to compare; its query runs anyway, because
    // lazy strategies work there.
    PhaseTimes ignored;
    query.ask(session, ignored);
    follow(session, cursor.at(frames[0]), ignored);
  }
  for (std::size_t f = frames.size() > 1 ? 1 : 0; f < frames.size(); ++f) {
    PhaseTimes frame;
    session.advance(frames[f], frame);
    query.ask(session, frame);
    follow(session, cursor.at(frames[f]), frame);
    times.frames.push_back(frame);
  }
  return times;
}

template <class S>
void warm_up(Session<S>& session, std::span<const double> frames, const PlanScript<S>* script,
             FrameQuery& query) {
  ScriptCursor<S> cursor(script);
  const auto begin = std::chrono::steady_clock::now();
  PhaseTimes ignored;
  session.reset(frames[0]);
  for (std::size_t f = 0; f < frames.size() && (f == 0 || seconds_since(begin) < warm_up_seconds); ++f) {
    if (f > 0) session.advance(frames[f], ignored);
    query.ask(session, ignored);
    follow(session, cursor.at(frames[f]), ignored);
  }
}

/// Counts over every frame: the verifying instance confirms only the frames that it compares.
template <class S>
Counters count_clip(const Scene<S>& scene, const Contestant& contestant, std::span<const double> frames,
                    const PlanScript<S>* script, FrameQuery& query) {
  Session<S> session(scene, contestant, CountingPolicy::counting);
  play_clip(session, frames, script, query);
  return session.strategy().counters();
}

}  // namespace

PhaseTimes ClipTimes::mean() const {
  PhaseTimes sum;
  for (const PhaseTimes& frame : frames) {
    sum.motion += frame.motion;
    sum.update += frame.update;
    sum.traversal += frame.traversal;
    sum.triangle_tests += frame.triangle_tests;
    sum.plan_changes += frame.plan_changes;
    sum.geometry_changes += frame.geometry_changes;
  }
  const double n = frames.empty() ? 1 : double(frames.size());
  return {sum.motion / n,         sum.update / n,       sum.traversal / n,
          sum.triangle_tests / n, sum.plan_changes / n, sum.geometry_changes / n};
}

double ClipTimes::total() const {
  double sum = 0;
  for (const PhaseTimes& frame : frames) sum += frame.total();
  return sum;
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
  measured.refused = std::string("it threw: ") + thrown.what();
  measured.verification.first_violation = measured.refused;
}

template <class S>
void Measurement<S>::add(const ContestantSpec& spec, std::uint64_t oracle_every) {
  Entrant<S> entrant;
  Measured& measured = entrant.measured;
  measured.spec = &spec;
  measured.sampled_every = oracle_every;
  entrant.attempt([&] {
    {
      Session<S> session(*scene_, spec.contestant(), CountingPolicy::counting);
      measured.verification = verify<S>(session, frames_, *oracle_, script_, {oracle_every, quality_samples});
      measured.counters = session.strategy().counters();
    }
    if (query_.changes && measured.verification.holds()) {
      Session<S> session(*scene_, spec.contestant(), CountingPolicy::counting);
      measured.changes = verify_changes<S>(session, frames_, *oracle_, script_,
                                           {oracle_every, VerifyChangesOptions::Calls::every_frame});
      measured.verification.first_violation = measured.changes.first_violation;
    }
    if (!measured.verification.holds()) {
      measured.refused = measured.verification.first_violation;
    } else {
      if (oracle_every > 1 || query_.changes)
        measured.counters = count_clip<S>(*scene_, spec.contestant(), frames_, script_, query_);
      const auto begin = std::chrono::steady_clock::now();
      entrant.session = std::make_unique<Session<S>>(*scene_, spec.contestant(), CountingPolicy::silent);
      measured.build_seconds = seconds_since(begin);
      warm_up<S>(*entrant.session, frames_, script_, query_);
    }
  });
  this->entrants_.push_back(std::move(entrant));
}

template <class S>
const ClipTimes* Measurement<S>::play(std::size_t i) {
  Entrant<S>& entrant = this->entrants_[i];
  const bool played = entrant.attempt([&] {
    entrant.measured.repetitions.push_back(play_clip<S>(*entrant.session, frames_, script_, query_));
    entrant.measured.choice = entrant.session->strategy().choice();
  });
  return played ? &entrant.measured.repetitions.back() : nullptr;
}

template <class S>
json Measurement<S>::extras(std::size_t i) const {
  if (!query_.changes) return json::object();
  const ChangesVerification& changes = this->entrants_[i].measured.changes;
  return {{"changes", {{"begun", changes.begun}, {"ended", changes.ended}}}};
}

template class Measurement<float>;
template class Measurement<double>;

json times_record(const Measured& measured) {
  constexpr double ms = 1e3;
  json repetitions = json::array();
  for (const ClipTimes& clip : measured.repetitions) {
    const PhaseTimes mean = clip.mean();
    repetitions.push_back({{"motion", ms * mean.motion},
                           {"update", ms * mean.update},
                           {"traversal", ms * mean.traversal},
                           {"triangle_tests", ms * mean.triangle_tests},
                           {"plan_changes", ms * mean.plan_changes},
                           {"geometry_changes", ms * mean.geometry_changes},
                           {"reset", ms * clip.reset_seconds}});
  }
  std::vector<std::size_t> order(measured.repetitions.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return measured.repetitions[a].total() < measured.repetitions[b].total();
  });
  const ClipTimes& median = measured.repetitions[order[(order.size() - 1) / 2]];
  std::vector<double> totals;
  for (const PhaseTimes& frame : median.frames) totals.push_back(ms * frame.total());
  std::sort(totals.begin(), totals.end());
  // The smallest value that at least this share of the frames does not exceed.
  const auto quantile = [&](double share) {
    const auto rank = std::size_t(std::ceil(share * double(totals.size())));
    return totals[std::max<std::size_t>(rank, 1) - 1];
  };
  // The clip in equal parts, so that a structure that ages shows.
  const std::size_t parts = std::min<std::size_t>(time_parts, totals.size());
  json over_time = json::array();
  for (std::size_t part = 0; part < parts; ++part) {
    const std::size_t begin = part * totals.size() / parts, end = (part + 1) * totals.size() / parts;
    double update = 0, query = 0;
    for (std::size_t f = begin; f < end; ++f) {
      update += median.frames[f].update;
      query += median.frames[f].traversal + median.frames[f].triangle_tests;
    }
    const double frames = double(end - begin);
    over_time.push_back({{"begin", double(begin) / double(totals.size())},
                         {"update", ms * update / frames},
                         {"query", ms * query / frames}});
  }
  return {{"unit", "ms"},
          {"frames", totals.size()},
          {"repetitions", repetitions},
          {"total_p50", quantile(0.5)},
          {"total_p99", quantile(0.99)},
          {"total_worst", totals.back()},
          {"build_ms", ms * measured.build_seconds},
          {"over_time", over_time}};
}

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
