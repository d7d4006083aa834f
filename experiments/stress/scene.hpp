#pragma once
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/judge/plan_script.hpp"
#include "core/scene/scene.hpp"

namespace kbvh::experiments::stress {

/// One body of a stress scene, in double; a scene's scalar rounds every coordinate once. Anything may be in
/// it, also what the program refuses.
struct StressBody {
  std::uint32_t vertex_count = 0;
  std::vector<std::vector<std::uint32_t>> primitives;  ///< vertex ids of each
  std::vector<double> times{0.0};                      ///< seconds, of keyframes
  std::vector<double> positions;                       ///< [keyframe][vertex][3]

  double* position(std::size_t keyframe, std::size_t vertex) {
    return positions.data() + 3 * (keyframe * vertex_count + vertex);
  }
  const double* position(std::size_t keyframe, std::size_t vertex) const {
    return positions.data() + 3 * (keyframe * vertex_count + vertex);
  }
};

/// A scene with everything that decides what happens: its bodies, the frames at which it is looked at, and
/// the changes of plans in between. Small enough to be written out in full.
struct StressScene {
  std::string family;
  std::vector<StressBody> bodies;
  std::vector<double> frames;  ///< seconds, ascending, not empty; a time may come twice
  struct Step {
    double time;  ///< of a frame
    std::vector<PlanChange<double>> changes;
  };
  std::vector<Step> steps;          ///< ascending times
  std::uint64_t compare_every = 1;  ///< frames compared with the oracle and audited; the last always is

  std::size_t triangles() const;
  std::size_t vertices() const;
  /// The longest list of keyframes.
  std::size_t keyframes() const;
  /// Numbers that are neither 0 nor 1, and everything else that could be fewer: what shrinking makes smaller.
  std::size_t size() const;
};

/// The program does not take such a scene, by contract: a coordinate beyond the admissible range of the
/// scalar, or a change of plans that a vertex cannot take there.
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A stress scene in one scalar, ready to be played.
template <class S>
struct Playable {
  Scene<S> scene;
  PlanScript<S> script;
  std::vector<double> frames;
  std::uint64_t compare_every = 1;
};

/// Throws Refused.
template <class S>
Playable<S> playable(const StressScene& stress);

/// A scene, and who failed on it how: all that a repro file holds.
struct Repro {
  StressScene scene;
  std::string strategy, scalar;
  std::map<std::string, std::string> params;
  std::string builder;  ///< "method/width/leaf size", or empty: the strategy's own
  std::string failure;  ///< in words, as it was seen
};

/// Text of a repro file (RESULTS.md): every number reads back as the same double.
std::string to_text(const Repro& repro);

/// Reads a repro file's text. Throws io::InputError that begins with `name`.
Repro repro_of(const std::string& text, const std::string& name);

}  // namespace kbvh::experiments::stress
