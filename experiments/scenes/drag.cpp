#include "experiments/scenes/drag.hpp"

#include <cmath>
#include <stdexcept>

namespace kbvh::experiments {

std::vector<double> frames_of(const DragRule& rule) {
  std::vector<double> frames;
  for (std::uint32_t f = 0; f < rule.frames; ++f) frames.push_back(double(f) / rule.frames_per_second);
  return frames;
}

namespace {

struct Held {
  std::uint32_t vertex;
  double weight;
};

/// Returns the vertices within the hand's reach at the first keyframe; weights fall to 0 at its rim.
template <class S>
std::vector<Held> held_by(const FlightPlans<S>& plans, const DragRule& rule) {
  std::vector<Held> held;
  for (std::uint32_t v = 0; v < plans.vertex_count(); ++v) {
    double square = 0;
    for (std::size_t d = 0; d < 3; ++d) {
      const double gap = double(plans.keyframe(0)[std::size_t(3) * v + d]) - rule.grip[d];
      square += gap * gap;
    }
    const double rest = 1 - square / (rule.radius * rule.radius);
    if (rest > 0) held.push_back({v, rest * rest});
  }
  return held;
}

/// Returns the share of the hand's path at a frame: there and back with a smooth start and end. Polynomials
/// give the same bits on every machine.
double share_of_path(const DragRule& rule, std::uint32_t frame) {
  const double x = 2 * double(frame) / double(rule.frames - 1), s = x <= 1 ? x : 2 - x;
  return s * s * (3 - 2 * s);
}

}  // namespace

template <class S>
PlanScript<S> drag_script(const Scene<S>& scene, const DragRule& rule) {
  if (scene.bodies.empty()) throw std::invalid_argument("a scene without bodies has nothing to drag");
  const FlightPlans<S>& plans = scene.bodies[0].plans;
  const std::vector<Held> held = held_by(plans, rule);
  const std::vector<double> frames = frames_of(rule);
  const auto times = plans.keyframe_times();
  PlanScript<S> script;
  for (std::uint32_t f = 0; f + 1 < rule.frames && !held.empty(); ++f) {
    typename PlanScript<S>::Step step{frames[f], {}};
    const std::size_t k = plans.segment_at(frames[f]);
    const double hand = (share_of_path(rule, f + 1) - share_of_path(rule, f)) * rule.frames_per_second;
    for (const Held& one : held) {
      PlanChange<S> change;
      change.body = 0;
      change.vertex = one.vertex;
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t at = std::size_t(3) * one.vertex + d;
        const double own = k + 1 == times.size() || frames[f] < times[0]  // at rest
                               ? 0.0
                               : (double(plans.keyframe(k + 1)[at]) - double(plans.keyframe(k)[at])) /
                                     (times[k + 1] - times[k]);
        change.velocity[d] = S(own + one.weight * hand * rule.path[d]);
      }
      step.changes.push_back(std::move(change));
    }
    script.steps.push_back(std::move(step));
  }
  return script;
}

template PlanScript<float> drag_script(const Scene<float>&, const DragRule&);
template PlanScript<double> drag_script(const Scene<double>&, const DragRule&);

}  // namespace kbvh::experiments
