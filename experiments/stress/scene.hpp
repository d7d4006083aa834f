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

/// One body of a stress scene, in double; a scene's scalar rounds every coordinate once. Its content is
/// unchecked and may be inadmissible.
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

/// A scene with everything that affects its result: its bodies, its frames, and the changes of plans in
/// between. Small enough to be written out in full.
struct StressScene {
  std::string family;
  std::vector<StressBody> bodies;
  std::vector<double> frames;  ///< seconds, ascending, not empty; a time may occur twice
  struct Step {
    double time;  ///< of a frame
    std::vector<PlanChange<double>> changes;
  };
  std::vector<Step> steps;  ///< ascending times
  std::uint64_t compare_every =
      1;  ///< distance of frames compared with the oracle and audited; the last always is

  std::size_t triangles() const;
  std::size_t vertices() const;
  /// Returns the length of the longest list of keyframes.
  std::size_t keyframes() const;
  /// Returns the size that shrinking reduces: numbers that are neither 0 nor 1, plus all removable items.
  std::size_t size() const;
};

/// The scene is inadmissible by contract: a coordinate beyond the admissible range of the scalar, or a change
/// of plans that a vertex cannot take at that time.
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

/// Converts a stress scene to one scalar. Throws Refused.
template <class S>
Playable<S> playable(const StressScene& stress);

/// The content of a repro file: a scene, the contestant that failed on it, and the failure.
struct Repro {
  StressScene scene;
  std::string strategy, scalar;
  std::map<std::string, std::string> params;
  std::string builder;  ///< "method/width/leaf size", or empty: the strategy's own
  std::string failure;  ///< in words, as observed
};

/// Writes the text of a repro file (RESULTS.md): every number reads back as the same double.
std::string to_text(const Repro& repro);

/// Reads a repro file's text. Throws io::InputError that begins with `name`.
Repro repro_of(const std::string& text, const std::string& name);

}  // namespace kbvh::experiments::stress
