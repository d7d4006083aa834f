#include "experiments/study/probe_measurement.hpp"

namespace kbvh::experiments {

template <class S>
ProbeMeasurement<S>::ProbeMeasurement(const Scene<S>& scene, std::vector<double> frames,
                                      const ProbeStudy& study, const PlanScript<S>* script)
    : scene_(&scene),
      frames_(std::move(frames)),
      study_(study),
      script_(script),
      probes_(make_probes(study, scene, frames_)),
      steady_from_(steady_frame(scene, std::span<const double>(frames_), script != nullptr)) {}

template <class S>
bool ProbeMeasurement<S>::is_exact(const Info& contestant) const {
  return (study_.sought == ProbeStudy::Sought::within ? contestant.guarantee : contestant.rays_guarantee) ==
         Guarantee::exact;
}

template <class S>
void ProbeMeasurement<S>::verify(ProbeEntrant<S>& entrant, std::uint64_t oracle_every) {
  Measured& measured = entrant.measured;
  Session<S> session(*scene_, measured.spec->contestant());
  probes_->forget();
  play_frames<S>(session, frames_, script_, [&](PhaseTimes& times, std::size_t f) {
    const std::uint64_t found = probes_->ask(session, times);
    entrant.hits += found;
    std::vector<bool> seen(session.scene().bodies.size(), false);
    probes_->mark_bodies(seen);
    for (std::size_t body = 0; body < seen.size(); ++body)
      if (!seen[body] && session.scene().bodies[body].primitives.kind == PrimitiveKind::polygons)
        ++entrant.hidden_bodies;
    if (f % oracle_every != 0 && f + 1 != frames_.size()) return found;
    probes_->remember(f);
    entrant.check.add(probes_->check(session, f));
    ++measured.verification.frames;
    return found;
  });
  const ProbeCheck& check = entrant.check;
  measured.verification.pairs = check.hits;
  measured.verification.candidates = check.hits;
  measured.verification.missed = check.missed;
  measured.verification.extra = check.extra + check.misplaced;
  if (is_exact(session.info())) {
    measured.verification.extra += check.rounded;
    measured.verification.first_violation = check.first_violation;
  }
}

template <class S>
void ProbeMeasurement<S>::replay(Measured& measured) {
  Session<S> session(*scene_, measured.spec->contestant());
  const bool exact = is_exact(session.info());
  const auto asked = [&](PhaseTimes& times, std::size_t f) {
    const std::uint64_t found = probes_->ask(session, times);
    if (const std::string probe = exact ? probes_->differs(f) : ""; !probe.empty())
      throw BrokenPromise("t = " + std::to_string(frames_[f]) + ": in the replay of the timed calls, " +
                          probe + " has another answer than in the verification");
    return found;
  };
  measured.answers = play_frames<S>(session, frames_, script_, asked).answers;
  measured.counters = session.strategy().counters();
}

template <class S>
void ProbeMeasurement<S>::add(const ContestantSpec& spec, std::uint64_t oracle_every) {
  this->admit(*scene_, spec, oracle_every, steady_from_, [&](ProbeEntrant<S>& entrant) {
    verify(entrant, oracle_every);
    if (entrant.measured.verification.holds()) replay(entrant.measured);
  });
}

template <class S>
void ProbeMeasurement<S>::play(std::size_t i) {
  this->play_warm(i, [&](Session<S>& session, const WarmUp* warm_up) {
    const auto asked = [&](PhaseTimes& times, std::size_t) { return probes_->ask(session, times); };
    return play_frames<S>(session, frames_, script_, asked, warm_up);
  });
}

template <class S>
nlohmann::json ProbeMeasurement<S>::extras(std::size_t i) const {
  const ProbeEntrant<S>& entrant = this->entrants_[i];
  return {{key_of(study_),
           {{"per_frame", probes_->size()},
            {"hits", entrant.hits},
            {"compared", entrant.check.probes},
            {"missed", entrant.check.missed},
            {"extra", entrant.check.extra},
            {"misplaced", entrant.check.misplaced},
            {"rounded", entrant.check.rounded},
            {"parameter_error", entrant.check.parameter_error},
            {"hidden_bodies", entrant.hidden_bodies}}}};
}

template <class S>
std::string ProbeMeasurement<S>::beyond_range(const Info& contestant) const {
  return out_of_range<S>(contestant, probes_->probes());
}

template class ProbeMeasurement<float>;
template class ProbeMeasurement<double>;

}  // namespace kbvh::experiments
