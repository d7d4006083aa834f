#pragma once
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "experiments/loop/barrier.hpp"
#include "experiments/loop/contact_finder.hpp"
#include "experiments/loop/friction.hpp"
#include "experiments/loop/newton_system.hpp"
#include "experiments/loop/script.hpp"
#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// The state of a simulation between two steps.
struct State {
  std::uint64_t step = 0;
  Positions positions, velocities;
};

/// Returns the state in which a scene starts.
State first_state(const SimulatedMesh& mesh);

/// Reports a state in which a pair of surfaces is nearer than their thickness: the finder lost this pair in
/// an earlier step.
struct TooNear : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// How a step ended.
enum class Ending : std::uint8_t {
  converged,   ///< no coordinate changed by more than the tolerance in the last iterate
  iterations,  ///< after the largest number of iterates
  stalled,     ///< no part of a direction makes the energy smaller
};
/// Returns the ending in words.
const char* name(Ending ending);

/// What a step did, and the state at its end.
struct StepReport {
  Ending ending = Ending::iterations;
  std::uint32_t iterates = 0;     ///< of Newton's method
  std::uint32_t evaluations = 0;  ///< of the energy, in line searches
  std::uint64_t contacts = 0;     ///< pairs that repel each other
  double smallest_gap =
      0;  ///< m: the smallest distance of a pair, without the thickness; the reach if no pair repels
  double kinetic = 0, gravitational = 0, elastic = 0, barrier = 0;  ///< J
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();               ///< kg m/s
  double lag = 0;            ///< m: the largest distance of a driven vertex to its place in the script
  std::uint32_t orders = 0;  ///< computed orders of elimination
};

/// Steps of implicit Euler in their variational form: the end of a step minimises
///   sum of mass / 2 |x - x_free|^2 + time_step^2 (elastic energy + energies of barriers and friction),
/// where x_free is where vertices would fly under gravity alone. Newton's method with Hessians whose
/// negative eigenvalues are set to zero pair by pair, spring by spring; a line search that never leaves the
/// part of a direction that is free of impacts (Li et al. 2020, "Incremental Potential Contact"). All pairs
/// come from the finder: a pair that it loses is not kept apart. For driven vertices, x_free is where the
/// script wants them: contact holds them back by its force times time_step^2 over their mass.
///
/// Equal states and scenes give equal bits in one build, in whatever order the finder lists pairs.
class ImplicitStep {
 public:
  /// Keeps references to the scene and the finder, whose radius must be that of the scene's physics.
  ImplicitStep(const Simulated& scene, ContactFinder& finder);

  /// Replaces the state by that one time step later. Throws TooNear, and leaves the state, if a pair of the
  /// state is nearer than the thickness, and std::runtime_error if a direction cannot be computed.
  StepReport advance(State& state);

  const Barrier& barrier() const { return barrier_; }
  /// Returns the energy of all pairs of the finder's candidates at x, in J; infinite if one is too near.
  double barrier_energy(const Positions& x);
  std::size_t bytes() const;

 private:
  struct Active {
    ContactFinder::Pair pair;
    double squared_distance, energy;
  };
  /// Lists the pairs that repel each other, in an order of their ids. Returns the sum of their energies.
  double collect(const Positions& x, std::vector<Active>& found);
  double energy(const Positions& x, std::vector<Active>& found);
  double energy_of_friction(const Positions& x) const;
  void assemble(const Positions& x);
  void add_pair(const std::uint32_t (&vertices)[4], const PairForce& force);
  void find_friction();
  Fading fading_of(const ContactFinder::Pair& pair) const;
  StepReport report(const State& state) const;

  const Simulated& scene_;
  ContactFinder& finder_;
  Barrier barrier_{};
  NewtonSystem system_;
  ScriptPlayer script_;
  Positions begin_, free_, x_, end_, trial_, direction_;
  std::vector<Active> active_, trial_active_;
  struct Rubbing {
    std::uint32_t vertices[4];
    PairFriction friction;
  };
  std::vector<Rubbing> rubbing_;      // pairs that repel each other at the start of the step
  std::vector<double> edge_lengths_;  // [edge] at rest
};

}  // namespace kbvh::experiments::loop
