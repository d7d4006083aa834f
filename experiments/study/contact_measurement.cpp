#include "experiments/study/contact_measurement.hpp"

#include <algorithm>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

namespace {

std::string text(const Contact& contact) {
  return std::string(contact.kind == Contact::Kind::vertex_face ? "vertex-face" : "edge-edge") + " (" +
         std::to_string(contact.body_a) + ":" + std::to_string(contact.feature_a) + ", " +
         std::to_string(contact.body_b) + ":" + std::to_string(contact.feature_b) + ")";
}

/// Compares sorted contacts with the truth.
void compare(const ContactBuffer& found, const ContactBuffer& truth, std::size_t interval,
             Verification& result) {
  ContactBuffer missed, extra;
  std::set_difference(truth.begin(), truth.end(), found.begin(), found.end(), std::back_inserter(missed));
  std::set_difference(found.begin(), found.end(), truth.begin(), truth.end(), std::back_inserter(extra));
  ++result.frames;
  result.pairs += truth.size();
  result.missed += missed.size();
  result.extra += extra.size();
  for (std::size_t i = 1; i < found.size(); ++i) result.repeated += found[i] == found[i - 1] ? 1 : 0;
  if (!result.first_violation.empty()) return;
  const std::string place = "interval " + std::to_string(interval) + ": ";
  if (!missed.empty())
    result.first_violation = place + "contact " + text(missed[0]) + " is missed";
  else if (!extra.empty())
    result.first_violation = place + "contact " + text(extra[0]) + " is reported too often, or is none";
}

}  // namespace

template <class S>
std::vector<double> contact_times(const Scene<S>& scene, std::vector<double> frames,
                                  const PlanScript<S>& script) {
  const double first = frames.front(), last = frames.back();
  const auto add = [&](double t) {
    if (t > first && t < last) frames.push_back(t);
  };
  for (const double t : overlaid_keyframes(scene)) add(t);
  for (const auto& step : script.steps)
    for (const PlanChange<S>& change : step.changes)
      for (const double t : change.times) add(t);
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  return frames;
}
template std::vector<double> contact_times(const Scene<float>&, std::vector<double>,
                                           const PlanScript<float>&);
template std::vector<double> contact_times(const Scene<double>&, std::vector<double>,
                                           const PlanScript<double>&);

template <class S>
ContactMeasurement<S>::ContactMeasurement(const Scene<S>& scene, std::vector<double> knots,
                                          const PlanScript<S>* script)
    : scene_(&scene), knots_(std::move(knots)), script_(script) {
  const std::span<const double> begins(knots_.data(), knots_.empty() ? 0 : knots_.size() - 1);
  steady_from_ = steady_frame(scene, begins, script != nullptr);
  try {
    ScriptCursor<S> cursor(script_);
    ContactFinder<S> finder(scene);
    Playback<S> playback(scene);
    for (std::size_t k = 0; k + 1 < knots_.size(); ++k) {
      playback.seek(knots_[k]);
      playback.evaluate_all();
      if (const auto* step = cursor.at(knots_[k])) playback.change_plans(knots_[k], step->changes);
      finder.start(playback);
      playback.seek(knots_[k + 1]);
      playback.evaluate_all();
      truth_.emplace_back();
      finder.find_by_sweep(playback, truth_.back());
      std::sort(truth_.back().begin(), truth_.back().end());
    }
  } catch (const std::invalid_argument& problem) {
    throw io::InputError(scene.name + ": " + problem.what());
  }
}

template <class S>
void ContactMeasurement<S>::add(const ContestantSpec& spec, std::uint64_t oracle_every) {
  this->admit(*scene_, spec, oracle_every, steady_from_, [&](ContactEntrant<S>& entrant) {
    Measured& measured = entrant.measured;
    Session<S> session(*scene_, spec.contestant());
    const auto ask = [&](PhaseTimes& times, std::size_t k) {
      contacts_.clear();
      measured.verification.candidates += session.contacts(knots_[k + 1], contacts_, times);
      if (k % oracle_every == 0 || k + 1 == truth_.size()) {
        std::sort(contacts_.begin(), contacts_.end());
        compare(contacts_, truth_[k], k, measured.verification);
      }
      return std::uint64_t(contacts_.size());
    };
    measured.answers = play_intervals<S>(session, knots_, script_, ask).answers;
    measured.counters = session.strategy().counters();
    entrant.impacts = session.impact_stats();
  });
}

template <class S>
void ContactMeasurement<S>::play(std::size_t i) {
  this->play_warm(i, [&](Session<S>& session, const WarmUp* warm_up) {
    const auto ask = [&](PhaseTimes& times, std::size_t k) {
      contacts_.clear();
      session.contacts(knots_[k + 1], contacts_, times);
      return std::uint64_t(contacts_.size());
    };
    return play_intervals<S>(session, knots_, script_, ask, warm_up);
  });
}

template <class S>
nlohmann::json ContactMeasurement<S>::extras(std::size_t i) const {
  const ImpactStats& impacts = this->entrants_[i].impacts;
  return {{"impacts", {{"tests", impacts.tests}, {"filtered", impacts.filtered}, {"exact", impacts.exact}}}};
}

template class ContactMeasurement<float>;
template class ContactMeasurement<double>;

}  // namespace kbvh::experiments
