#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "experiments/loop/implicit_step.hpp"
#include "experiments/loop/penetration.hpp"
#include "experiments/loop/simulation.hpp"

namespace kbvh::experiments::loop {

/// A simulation that is stepped by a test.
struct Simulator {
  explicit Simulator(Simulated simulated, Detection detection = Detection::refit, double keep = 0)
      : scene(std::move(simulated)),
        mesh(scene.mesh),
        finder(mesh, {detection, keep, scene.physics.radius(), 0}),
        step(scene, finder),
        state(first_state(scene.mesh)) {}
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;
  StepReport advance() { return step.advance(state); }
  std::uint64_t intersecting_pairs() const {
    return PenetrationCheck(scene.mesh).intersecting_pairs(state.positions);
  }

  Simulated scene;
  ContactMesh mesh;
  ContactFinder finder;
  ImplicitStep step;
  State state;
};

/// A scene in a size that takes a test some seconds.
inline SimulationOptions small(const std::string& scene, std::uint64_t steps) {
  SimulationOptions options;
  options.scene = scene;
  options.triangles = scene == "stack" ? 144 : 200;
  options.steps = steps;
  return options;
}

inline std::vector<nlohmann::json> lines_of(const std::filesystem::path& file) {
  std::vector<nlohmann::json> lines;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

}  // namespace kbvh::experiments::loop
