#pragma once
#include <string_view>
#include <type_traits>

#include "core/contract/strategy.hpp"

namespace kbvh {

/// A registered contestant: its description and its factory functions.
struct StrategyEntry {
  Info info;
  template <class S>
  using Factory = std::unique_ptr<Strategy<S>> (*)(const SceneView<S>&, Playback<S>&, Topologies,
                                                   const Params&);
  Factory<float> make_float = nullptr;
  Factory<double> make_double = nullptr;

  template <class S>
  Factory<S> factory() const {
    if constexpr (std::is_same_v<S, float>)
      return make_float;
    else
      return make_double;
  }
};

namespace detail {
/// Tests whether T derives from the interface in a way that `Strategy` can use.
template <class T, class Interface>
constexpr bool has() {
  static_assert(std::is_base_of_v<Interface, T> == std::is_convertible_v<T*, Interface*>,
                "derive from an interface of the contract publicly, and once");
  return std::is_base_of_v<Interface, T>;
}
template <class T, class S>
Capabilities capabilities(const Declared& declared) {
  constexpr bool events = has<T, EventSource<S>>();
  return {.event_driven = events || declared.event_driven,
          .continuous = declared.continuous,
          .restructures = declared.restructures,
          .time_budget = declared.time_budget,
          .events = events,
          .plan_changes = has<T, TakesPlanChanges<S>>(),
          .geometry_changes = has<T, TakesGeometryChanges<S>>(),
          .spans = has<T, AnswersSpans<S>>(),
          .self_pairs = has<T, AnswersSelfPairs>(),
          .contacts = has<T, AnswersSweeps<S>>(),
          .changes = has<T, AnswersChanges<S>>(),
          .rays = has<T, AnswersRays<S>>(),
          .probes = has<T, AnswersProbes<S>>(),
          .curves = declared.curves || T::foresight <= Foresight::step_bound};
}
template <template <class> class T, class S>
std::unique_ptr<Strategy<S>> make(const SceneView<S>& scene, Playback<S>& playback, Topologies topologies,
                                  const Params& params) {
  return std::make_unique<T<S>>(scene, MotionView<T<S>::foresight, S>(playback), std::move(topologies),
                                params);
}
}  // namespace detail

/// The scene scalars for which a strategy exists.
enum class Scalars : std::uint8_t { both, float_only, double_only };

/// Registers the class template T<Scalar>, which must
///   - derive from Strategy<Scalar>, and from the interfaces of its optional abilities,
///   - define `static constexpr Foresight foresight`,
///   - be constructible from (SceneView<S>, MotionView<foresight, S>, Topologies, const Params&).
/// The abilities are derived from the class: a given `Info::can` is overwritten.
template <template <class> class T, Scalars scalars = Scalars::both>
StrategyEntry make_entry(Info info) {
  using Any = std::conditional_t<scalars == Scalars::double_only, double, float>;
  StrategyEntry entry;
  info.foresight = T<Any>::foresight;
  info.can = detail::capabilities<T<Any>, Any>(info.declares);
  info.has_float = scalars != Scalars::double_only;
  info.has_double = scalars != Scalars::float_only;
  entry.info = std::move(info);
  if constexpr (scalars != Scalars::double_only) entry.make_float = &detail::make<T, float>;
  if constexpr (scalars != Scalars::float_only) entry.make_double = &detail::make<T, double>;
  return entry;
}

/// Defines the function through which the generated manifest finds a source file. In strategies/NAME.cpp:
///   KBVH_STRATEGY(NAME) { return {make_entry<MyStrategy>({.id = ...})}; }
#define KBVH_STRATEGY(name) std::vector<kbvh::StrategyEntry> kbvh_strategy_##name()

/// Returns all contestants linked into this program, in manifest order. Defined by the manifest, a source
/// that the build generates from the list of strategies: a program that links no manifest has no registry.
const std::vector<StrategyEntry>& registry();

/// Returns the entries; throws std::logic_error if two of them have one id. For manifests.
std::vector<StrategyEntry> with_unique_ids(std::vector<StrategyEntry> entries);

/// Finds a contestant. Throws ConfigError that lists the known ids.
const StrategyEntry& find_strategy(const std::vector<StrategyEntry>& entries, std::string_view id);
inline const StrategyEntry& find_strategy(std::string_view id) {
  return find_strategy(registry(), id);
}

/// Returns the strategy's preferred builder configuration with the given overrides. Throws ConfigError if the
/// strategy does not support them.
BuilderConfig suitable_builder(const Info& info, std::optional<BuildMethod> method,
                               std::optional<std::uint32_t> width, std::optional<std::uint32_t> leaf_size);

/// Returns the reason why the strategy cannot play a scene of these bodies, as the end of a sentence that
/// begins with its id; empty if it can. Checks pairs within a body, kinds of primitives, curves, positions
/// handed in frame by frame, and the range of keyframes and, by a bound, of the curves between them.
template <class S>
std::string unsuitable_bodies(const Info& info, const Scene<S>& scene);

/// Return the words of result files and of the facade.
const char* name(Tightness tightness);
const char* name(Guarantee guarantee);
const char* name(Foresight foresight);
/// Returns the names of the capabilities that are there.
std::vector<std::string> names(const Capabilities& can);

/// Builds the topologies of all bodies from the positions at the playback's current time.
template <class S>
Topologies build_topologies(const SceneView<S>& scene, Playback<S>& playback, const BuilderConfig& config);

/// Makes an instance, and gives the playback as many threads as the parameter `threads` asks for. Throws
/// ConfigError if the strategy does not exist in scalar S.
template <class S>
std::unique_ptr<Strategy<S>> create(const StrategyEntry& entry, const SceneView<S>& scene,
                                    Playback<S>& playback, Topologies topologies, const Params& params);

/// Makes instances for a strategy that consists of other strategies and forwards calls to them.
template <class S>
struct NestedStrategies {
  /// Like `create`. Also throws ConfigError if the instance needs more foresight than `motion` has.
  template <class Motion>
  static std::unique_ptr<Strategy<S>> create(const StrategyEntry& entry, const SceneView<S>& scene,
                                             const Motion& motion, Topologies topologies,
                                             const Params& params) {
    constexpr Foresight offered = std::is_base_of_v<ClipMotion<S>, Motion>      ? Foresight::whole_clip
                                  : std::is_base_of_v<SegmentMotion<S>, Motion> ? Foresight::next_keyframe
                                  : std::is_base_of_v<SteppedMotion<S>, Motion> ? Foresight::step_bound
                                                                                : Foresight::none;
    if (entry.info.foresight > offered)
      throw ConfigError("'" + entry.info.id + "' needs more foresight than the motion provides");
    return kbvh::create(entry, scene, *motion.playback_, std::move(topologies), params);
  }
};

}  // namespace kbvh
