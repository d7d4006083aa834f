#pragma once
// Internal to the façade.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/contract/takes_moved_vertices.hpp"
#include "core/facade/conversions.hpp"
#include "core/motion/admissible.hpp"
#include "core/scene/cut_polygons.hpp"
#include "core/scene/with_radius.hpp"

namespace kbvh::facade {

/// Returns the strategy, its parameters and the trees that it is started with.
inline Contestant contestant_of(const std::string& strategy, const std::map<std::string, std::string>& params,
                                const std::map<std::string, std::string>& topology) {
  const StrategyEntry& entry = find_strategy(strategy);
  for (const auto& [key, value] : topology)
    if (key != "method" && key != "width" && key != "leaf_size")
      throw std::invalid_argument("a topology has the keys method, width and leaf_size, not '" + key + "'");
  const auto method = topology.find("method");
  return {
      &entry, params,
      suitable_builder(entry.info,
                       method == topology.end() ? std::nullopt : std::optional(build_method(method->second)),
                       number_of(topology, "width"), number_of(topology, "leaf_size"))};
}

/// What a world of one scalar holds: the added bodies, the scene as it is played, and its session.
template <class S>
struct TypedWorld {
  struct Copies {
    std::vector<S> array[2];     ///< [vertex][3] and one more, as the session reads them
    std::vector<S> vertices[2];  ///< with a radius, where `array` has corners: [vertex][3]
  };
  Scene<S> scene;
  std::optional<double> radius;      ///< of the scene that is played: its vertices are then corners
  std::unique_ptr<Scene<S>> played;  ///< the session refers to it
  std::unique_ptr<Session<S>> started;
  std::vector<Copies> given;                        ///< [body], of the first body over its vertices
  mutable std::uint64_t fetched_for_questions = 0;  ///< positions evaluated for questions only
  PhaseTimes ignored;
  PairBuffer pairs, ended;
  SpanBuffer spans;
  ContactBuffer contacts;
  std::vector<Ray<S>> rays;
  std::vector<RayHit> hits;
  std::vector<Ball<S>> balls;
  BallHits ball_hits;
  EventDescription<S> done;
  std::vector<S> evaluated;                  ///< of one body, with a radius: see `vertex_positions`
  std::vector<std::uint32_t> moved_corners;  ///< with a radius, of the vertices that moved

  void check_not_started() const {
    if (started) throw std::logic_error("the world has started, so its scene is fixed");
  }
  void check_body(std::uint32_t body) const {
    if (body >= scene.bodies.size())
      throw std::invalid_argument("there is no body " + std::to_string(body) + " among " +
                                  std::to_string(scene.bodies.size()));
  }
  Session<S>& session() const {
    if (!started) throw std::logic_error("the world has not started: call start first");
    return *started;
  }
  double time() const { return session().playback().time(); }
  /// Throws std::logic_error if the world has a radius; `lacks` is the end of its sentence, as in "finds no
  /// contacts".
  void check_no_radius(const char* lacks) const {
    if (radius) throw std::logic_error(std::string("a world with a radius consists of boxes and ") + lacks);
  }
  /// Throws ConfigError if the world has a radius and the strategy takes no boxes of corners.
  void check_takes_radius(const Info& info) const {
    const bool takes = std::find(info.primitives.begin(), info.primitives.end(),
                                 PrimitiveKind::control_nets) != info.primitives.end();
    if (radius && !takes)
      throw ConfigError("'" + info.id + "' takes no radius, because it takes no control nets");
  }
  EventSource<S>& events() const {
    EventSource<S>* const source = session().strategy().events();
    if (source == nullptr) throw std::logic_error("'" + session().info().id + "' does not declare events");
    return *source;
  }

  /// Copies the scene as it is played, with the radius: the added bodies stay if a strategy does not suit
  /// them.
  Scene<S> whole_scene() const {
    Scene<S> whole = scene;
    if (whole.pairs.empty()) whole.pairs = all_pairs(whole.bodies);
    validate(whole);
    return radius ? with_radius(whole, *radius) : whole;
  }

  /// Returns the positions of a body, evaluated for a question.
  const S* fetched(std::uint32_t body) {
    Playback<S>& playback = session().playback();
    const std::uint64_t before = playback.fetched();
    playback.fetch_all(body);
    fetched_for_questions += playback.fetched() - before;
    return playback.positions(body);
  }

  /// Returns the vertices of a new primitive of a body as the played scene numbers them: with a radius, both
  /// corners of each vertex's box. Throws std::invalid_argument.
  std::vector<std::uint32_t> as_played(std::uint32_t body, const std::vector<std::uint32_t>& vertices) const {
    if (!radius) return vertices;
    check_body(body);
    const std::uint32_t count = scene.bodies[body].plans.vertex_count();
    std::vector<std::uint32_t> corners;
    for (const std::uint32_t vertex : vertices) {
      if (vertex >= count)
        throw std::invalid_argument("geometry change: a new primitive of body " + std::to_string(body) +
                                    " refers to vertex " + std::to_string(vertex) + ", but there are " +
                                    std::to_string(count));
      corners.push_back(2 * vertex);
      corners.push_back(2 * vertex + 1);
    }
    return corners;
  }

  /// Returns the plans of a body's vertices, with changes.
  const FlightPlans<S>& vertex_plans(std::uint32_t body) const {
    const Playback<S>& playback = session().playback();
    return radius ? scene.bodies[body].plans : playback.plans(body);
  }
  /// Returns the positions of a body's vertices at the current time where the played scene has corners of
  /// boxes. Valid until the next call, and until positions are set.
  const S* vertex_positions(std::uint32_t body) {
    const Playback<S>& playback = session().playback();
    const FlightPlans<S>& plans = scene.bodies[body].plans;
    if (plans.is_handed_in()) {
      const Copies& copies = given[scene.first_of_set(body)];
      for (std::size_t i = 0; i < 2; ++i)
        if (!copies.array[i].empty() && playback.positions(body) == copies.array[i].data())
          return copies.vertices[i].data();
      return plans.keyframe(0);
    }
    evaluated.resize(std::size_t(3) * plans.vertex_count() + 1);
    plans.evaluate(playback.time(), evaluated.data());
    return evaluated.data();
  }

  template <class T>
  std::uint32_t add(const std::string& name, const Connectivity& connectivity, std::span<const double> times,
                    std::span<const T> positions, const WorldCurves& curves) {
    const std::size_t frames = times.size();
    if (frames == 0 || positions.size() % (3 * frames) != 0)
      throw std::invalid_argument("body '" + name + "': " + std::to_string(positions.size()) +
                                  " coordinates for " + std::to_string(frames) + " keyframes");
    const auto vertices = std::uint32_t(positions.size() / (3 * frames));
    return add(name, connectivity,
               FlightPlans<S>(vertices, {times.begin(), times.end()}, converted<S>(positions),
                              bends_of(name, frames - 1, vertices, curves)));
  }
  static std::vector<SegmentBends<S>> bends_of(const std::string& name, std::size_t segments,
                                               std::uint32_t vertices, const WorldCurves& curves) {
    std::vector<SegmentBends<S>> bends;
    if (curves.bends.empty() && curves.twists.empty()) return bends;
    const std::size_t scalars = std::size_t(3) * vertices;
    bends.resize(segments);
    const auto take = [&](std::span<const double> numbers, std::vector<S> SegmentBends<S>::*list) {
      if (numbers.empty()) return;
      if (numbers.size() != segments * scalars)
        throw std::invalid_argument("body '" + name + "': " + std::to_string(numbers.size()) +
                                    " numbers for the curves of " + std::to_string(vertices) +
                                    " vertices in " + std::to_string(segments) + " segments");
      for (std::size_t k = 0; k < segments; ++k)
        bends[k].*list = converted<S>(numbers.subspan(k * scalars, scalars));
    };
    take(curves.bends, &SegmentBends<S>::bend);
    take(curves.twists, &SegmentBends<S>::twist);
    return bends;
  }
  template <class T>
  std::uint32_t add(const std::string& name, const Connectivity& connectivity, std::span<const T> positions) {
    if (positions.size() % 3 != 0)
      throw std::invalid_argument("body '" + name + "': " + std::to_string(positions.size()) +
                                  " coordinates are no positions");
    const auto vertices = std::uint32_t(positions.size() / 3);
    return add(name, connectivity, FlightPlans<S>::handed_in(vertices, converted<S>(positions)));
  }
  std::uint32_t add(const std::string& name, const Connectivity& connectivity, FlightPlans<S> plans) {
    check_not_started();
    Scene<S> alone;
    alone.bodies.push_back({name, primitives_of(connectivity), std::move(plans)});
    validate(alone);
    cut_polygons(alone);
    scene.bodies.push_back(std::move(alone.bodies[0]));
    return std::uint32_t(scene.bodies.size() - 1);
  }

  std::uint32_t add_over(std::uint32_t body, const std::string& name, const Connectivity& connectivity) {
    check_not_started();
    check_body(body);
    Scene<S> alone;
    alone.bodies.push_back({name, primitives_of(connectivity), scene.bodies[body].plans});
    validate(alone);
    cut_polygons(alone);
    return add_body_over(scene, body, name, std::move(alone.bodies[0].primitives));
  }

  void set_radius(double value) {
    check_not_started();
    write_corners<S>(nullptr, 0, value, nullptr);  // throws for a radius that is none
    radius = value;
  }

  template <class T>
  void set(std::uint32_t body, std::span<const T> positions,
           std::optional<std::span<const std::uint32_t>> moved = {}) {
    check_body(body);
    session();
    const Body<S>& target = scene.bodies[body];
    if (!target.plans.is_handed_in())
      throw std::logic_error("the motion of body '" + target.name + "' is known; positions cannot be set");
    const std::size_t size = std::size_t(3) * target.plans.vertex_count();
    if (positions.size() != size && positions.size() != size + 1)
      throw std::invalid_argument("body '" + target.name + "' has " + std::to_string(size) +
                                  " coordinates, not " + std::to_string(positions.size()));
    for (std::size_t i = 0; i < size; ++i)
      if (!(std::abs(S(positions[i])) <= admissible_magnitude<S>))
        throw std::invalid_argument("body '" + target.name + "', vertex " + std::to_string(i / 3) +
                                    ": coordinate " + number_text(double(positions[i])) +
                                    " is not finite or not admissible");
    if (moved)
      for (const std::uint32_t vertex : *moved)
        if (vertex >= size / 3)
          throw std::invalid_argument("vertex " + std::to_string(vertex) + " moved, but body '" +
                                      target.name + "' has " + std::to_string(size / 3));
    give(body, positions, size);
    if (moved && radius) {
      moved_corners.clear();
      for (const std::uint32_t vertex : *moved) {
        moved_corners.push_back(2 * vertex);
        moved_corners.push_back(2 * vertex + 1);
      }
      moved = moved_corners;
    }
    for (std::uint32_t other = 0; other < played->bodies.size(); ++other)
      if (played->same_vertices(body, other)) tell_moved(session().strategy(), other, moved);
  }
  template <class T>
  void give(std::uint32_t body, std::span<const T> positions, std::size_t size) {
    if constexpr (std::is_same_v<S, T>)
      if (positions.size() == size + 1 && !radius) {
        session().hand_in(body, positions.data());
        return;
      }
    // Two alternating copies: a sweep begins at the positions that the motion view still shows.
    Copies& copies = given[scene.first_of_set(body)];
    const std::size_t unread = session().playback().positions(body) == copies.array[0].data() ? 1 : 0;
    std::vector<S>& copy = copies.array[unread];
    if (radius) {
      std::vector<S>& of_vertices = copies.vertices[unread];
      of_vertices.assign(positions.begin(), positions.begin() + std::ptrdiff_t(size));
      copy.resize(2 * size + 1);
      write_corners(of_vertices.data(), std::uint32_t(size / 3), *radius, copy.data());
    } else {
      copy.resize(size + 1);
      for (std::size_t i = 0; i < size; ++i) copy[i] = S(positions[i]);
    }
    session().hand_in(body, copy.data());
  }
};

}  // namespace kbvh::facade
