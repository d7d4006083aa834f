#include "core/contract/registry.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/motion/admissible.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

std::vector<StrategyEntry> with_unique_ids(std::vector<StrategyEntry> entries) {
  for (std::size_t i = 0; i < entries.size(); ++i)
    for (std::size_t j = i + 1; j < entries.size(); ++j)
      if (entries[i].info.id == entries[j].info.id)
        throw std::logic_error("two strategies are registered as '" + entries[i].info.id + "'");
  return entries;
}

const StrategyEntry& find_strategy(const std::vector<StrategyEntry>& entries, std::string_view id) {
  std::string known;
  for (const StrategyEntry& entry : entries) {
    if (entry.info.id == id) return entry;
    known += (known.empty() ? "" : ", ") + entry.info.id;
  }
  throw ConfigError("there is no strategy '" + std::string(id) + "'; known are " + known);
}

BuilderConfig suitable_builder(const Info& info, std::optional<BuildMethod> method,
                               std::optional<std::uint32_t> width, std::optional<std::uint32_t> leaf_size) {
  BuilderConfig config = info.topology.preferred;
  if (method) config.method = *method;
  if (width) config.width = *width;
  if (leaf_size) config.leaf_size = *leaf_size;
  if (info.topology.own) return config;
  const auto& widths = info.topology.widths;
  if (std::find(widths.begin(), widths.end(), config.width) == widths.end())
    throw ConfigError("'" + info.id + "' does not take nodes of width " + std::to_string(config.width));
  if (config.leaf_size < info.topology.min_leaf_size || config.leaf_size > info.topology.max_leaf_size)
    throw ConfigError("'" + info.id + "' takes " + std::to_string(info.topology.min_leaf_size) + " to " +
                      std::to_string(info.topology.max_leaf_size) + " primitives per leaf, not " +
                      std::to_string(config.leaf_size));
  return config;
}

namespace {

/// Returns where a body exceeds the range of the contestant: at a keyframe, or on a curve between two, of
/// which `bulge` bounds the distance from the chord. Empty if it does not.
template <class S>
std::string beyond_range(const Info& info, const Body<S>& body) {
  const FlightPlans<S>& plans = body.plans;
  const auto refusal = [&](std::size_t i, const char* verb, double x, const std::string& when) {
    return "takes coordinates up to " + number_text(info.max_coordinate) + ", but vertex " +
           std::to_string(i / 3) + " of body '" + body.name + "' " + verb + " " + "xyz"[i % 3] + " = " +
           number_text(x) + when;
  };
  for (std::size_t k = 0; k < plans.keyframe_count(); ++k) {
    const S* const positions = plans.keyframe(k);
    for (std::size_t i = 0; i < std::size_t(3) * plans.keyframed_count(); ++i)
      if (std::abs(double(positions[i])) > info.max_coordinate)
        return refusal(i, "is at", double(positions[i]),
                       plans.keyframe_count() > 1 ? " at keyframe " + std::to_string(k) : "");
    if (!plans.curved_in(k)) continue;
    const S *const next = plans.keyframe(k + 1), *const bend = plans.bends(k), *const twist = plans.twists(k);
    for (std::size_t i = 0; i < std::size_t(3) * plans.keyframed_count(); ++i) {
      const Bulge<S> off = bulge(bend[i], twist == nullptr ? S(0) : twist[i]);
      const double lowest = std::min(double(positions[i]), double(next[i])) + off.lower,
                   highest = std::max(double(positions[i]), double(next[i])) + off.upper;
      if ((off.lower < 0 && lowest < -info.max_coordinate) ||
          (off.upper > 0 && highest > info.max_coordinate))
        return refusal(i, "may come to", highest > info.max_coordinate ? highest : lowest,
                       " after keyframe " + std::to_string(k));
    }
  }
  return {};
}

}  // namespace

template <class S>
std::string unsuitable_bodies(const Info& info, const Scene<S>& scene) {
  if (has_self_pairs(scene.pairs) && !info.can.self_pairs) return "cannot answer pairs within one body";
  for (const Body<S>& body : scene.bodies) {
    const auto& kinds = info.primitives;
    if (body.primitives.count() > 0 &&
        std::find(kinds.begin(), kinds.end(), body.primitives.kind) == kinds.end())
      return std::string("does not take ") + name(body.primitives.kind) + ", as in body '" + body.name + "'";
    if (body.plans.curved() && !info.can.curves)
      return "foresees linear motion only, but vertices of body '" + body.name + "' move on curves";
    if (body.plans.is_handed_in() && info.foresight != Foresight::none)
      return "needs to know the motion in advance, but the positions of body '" + body.name +
             "' are handed in frame by frame";
    if (info.max_coordinate < double(admissible_magnitude<S>))
      if (std::string where = beyond_range(info, body); !where.empty()) return where;
  }
  return {};
}

const char* name(Tightness tightness) {
  switch (tightness) {
    case Tightness::tight:
      return "tight";
    case Tightness::conservative:
      return "conservative";
    case Tightness::none:
      break;
  }
  return "none";
}

const char* name(Guarantee guarantee) {
  switch (guarantee) {
    case Guarantee::exact:
      return "exact";
    case Guarantee::candidate_superset:
      return "candidate_superset";
    case Guarantee::approximate:
      break;
  }
  return "approximate";
}

const char* name(Foresight foresight) {
  switch (foresight) {
    case Foresight::step_bound:
      return "step_bound";
    case Foresight::next_keyframe:
      return "next_keyframe";
    case Foresight::whole_clip:
      return "whole_clip";
    case Foresight::none:
      break;
  }
  return "none";
}

std::vector<std::string> names(const Capabilities& can) {
  const std::pair<bool, const char*> all[] = {{can.event_driven, "event_driven"},
                                              {can.events, "events"},
                                              {can.continuous, "continuous"},
                                              {can.restructures, "restructures"},
                                              {can.plan_changes, "plan_changes"},
                                              {can.geometry_changes, "geometry_changes"},
                                              {can.spans, "spans"},
                                              {can.self_pairs, "self_pairs"},
                                              {can.time_budget, "time_budget"},
                                              {can.contacts, "contacts"},
                                              {can.changes, "changes"},
                                              {can.rays, "rays"},
                                              {can.probes, "within"},
                                              {can.curves, "curves"}};
  std::vector<std::string> words;
  for (const auto& [has, word] : all)
    if (has) words.emplace_back(word);
  return words;
}

template <class S>
Topologies build_topologies(const SceneView<S>& scene, Playback<S>& playback, const BuilderConfig& config) {
  playback.evaluate_all();
  Topologies topologies;
  for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
    topologies.push_back(build_topology(scene.primitives(body), playback.positions(body), config));
  }
  return topologies;
}

template <class S>
std::unique_ptr<Strategy<S>> create(const StrategyEntry& entry, const SceneView<S>& scene,
                                    Playback<S>& playback, Topologies topologies, const Params& params) {
  const auto factory = entry.factory<S>();
  if (factory == nullptr)
    throw ConfigError("'" + entry.info.id + "' has no " + (sizeof(S) == 4 ? "float" : "double") + " version");
  // A strategy within another one uses the outer one's threads.
  if (const std::uint32_t threads = threads_of(params); threads > 1) playback.use_threads(threads);
  return factory(scene, playback, std::move(topologies), params);
}

#define KBVH_INSTANTIATE(S)                                                                             \
  template std::string unsuitable_bodies(const Info&, const Scene<S>&);                                 \
  template Topologies build_topologies(const SceneView<S>&, Playback<S>&, const BuilderConfig&);        \
  template std::unique_ptr<Strategy<S>> create(const StrategyEntry&, const SceneView<S>&, Playback<S>&, \
                                               Topologies, const Params&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
