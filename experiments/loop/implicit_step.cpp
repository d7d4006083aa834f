#include "experiments/loop/implicit_step.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "experiments/loop/elasticity.hpp"

namespace kbvh::experiments::loop {
namespace {

FourPoints points_of(const std::uint32_t (&vertices)[4], const Positions& x) {
  FourPoints points;
  for (int i = 0; i < 4; ++i) points.col(i) = x.row(vertices[i]).transpose();
  return points;
}

/// Returns the mean mass of a free vertex.
double mean_mass(const SimulatedMesh& mesh) {
  double sum = 0;
  std::size_t count = 0;
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.is_free(v)) {
      sum += mesh.mass[v];
      ++count;
    }
  return count == 0 ? 1 : sum / double(count);
}

/// A line search accepts a step that gives at least this share of the decrease that the slope promises.
constexpr double sufficient_decrease = 1e-4;
/// Differences of energies below this share of the energy count as rounding errors.
constexpr double energy_rounding = 1e-12;
/// A line search gives up at this part of a direction.
constexpr double least_part = 1e-10;

}  // namespace

const char* name(Ending ending) {
  switch (ending) {
    case Ending::converged:
      return "converged";
    case Ending::iterations:
      return "iterations";
    case Ending::stalled:
      break;
  }
  return "stalled";
}

State first_state(const SimulatedMesh& mesh) {
  return {0, mesh.positions, mesh.velocities};
}

ImplicitStep::ImplicitStep(const Simulated& scene, ContactFinder& finder)
    : scene_(scene), finder_(finder), system_(scene.mesh), script_(scene.mesh) {
  const Physics& physics = scene.physics;
  barrier_ = {physics.thickness, physics.reach, physics.repulsion * physics.reach * mean_mass(scene.mesh)};
  for (Eigen::Index e = 0; e < scene.mesh.edges.rows(); ++e)
    edge_lengths_.push_back(
        (scene.mesh.positions.row(scene.mesh.edges(e, 0)) - scene.mesh.positions.row(scene.mesh.edges(e, 1)))
            .norm());
}

Fading ImplicitStep::fading_of(const ContactFinder::Pair& pair) const {
  if (pair.kind != ContactKind::edge_edge) return {};
  return fading_of_edges(edge_lengths_[pair.first], edge_lengths_[pair.second]);
}

double ImplicitStep::collect(const Positions& x, std::vector<Active>& found) {
  found.clear();
  bool too_near = false;
  const double most = barrier_.radius() * barrier_.radius();
  finder_.for_each([&](const ContactFinder::Pair& pair) {
    const FourPoints points = points_of(pair.vertices, x);
    const double squared = closest_points(pair.kind, points).squared_distance;
    if (squared >= most) return;
    const double energy = pair_energy(barrier_, pair.kind, points, fading_of(pair));
    too_near = too_near || !std::isfinite(energy);
    found.push_back({pair, squared, energy});
  });
  if (too_near) return std::numeric_limits<double>::infinity();
  std::sort(found.begin(), found.end(), [](const Active& a, const Active& b) {
    return std::tuple(a.pair.kind, a.pair.first, a.pair.second) <
           std::tuple(b.pair.kind, b.pair.first, b.pair.second);
  });
  double sum = 0;
  for (const Active& active : found) sum += active.energy;
  return sum;
}

double ImplicitStep::barrier_energy(const Positions& x) {
  return collect(x, trial_active_);
}

double ImplicitStep::energy(const Positions& x, std::vector<Active>& found) {
  const SimulatedMesh& mesh = scene_.mesh;
  double inertia = 0;
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    inertia += 0.5 * mesh.mass[std::size_t(v)] * (x.row(v) - free_.row(v)).squaredNorm();
  const double h = scene_.physics.time_step;
  return inertia +
         h * h * (spring_energy(mesh, x) + hinge_energy(mesh, x) + energy_of_friction(x) + collect(x, found));
}

void ImplicitStep::assemble(const Positions& x) {
  const SimulatedMesh& mesh = scene_.mesh;
  const double h = scene_.physics.time_step;
  system_.clear();
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    system_.add_gradient(v, mesh.mass[v] * (x.row(v) - free_.row(v)).transpose());
    system_.add_block(v, mesh.mass[v] * Eigen::Matrix3d::Identity());
  }
  add_springs(mesh, x, h * h, system_);
  add_hinges(mesh, x, h * h, system_);
  PairForce force;
  for (const Active& active : active_) {
    pair_force(barrier_, active.pair.kind, points_of(active.pair.vertices, x), fading_of(active.pair),
               Curvature::positive, force);
    add_pair(active.pair.vertices, force);
  }
  for (const Rubbing& pair : rubbing_) {
    friction_force(pair.friction, points_of(pair.vertices, x) - points_of(pair.vertices, begin_), force);
    add_pair(pair.vertices, force);
  }
}

void ImplicitStep::add_pair(const std::uint32_t (&vertices)[4], const PairForce& force) {
  const double h = scene_.physics.time_step;
  for (int i = 0; i < 4; ++i) {
    system_.add_gradient(vertices[i], h * h * force.gradient.segment<3>(3 * i));
    system_.add_block(vertices[i], h * h * force.hessian.block<3, 3>(3 * i, 3 * i));
    for (int j = 0; j < i; ++j)
      system_.add_block(vertices[i], vertices[j], h * h * force.hessian.block<3, 3>(3 * i, 3 * j));
  }
}

void ImplicitStep::find_friction() {
  rubbing_.clear();
  const Physics& physics = scene_.physics;
  if (physics.friction == 0) return;
  for (const Active& active : active_) {
    if (active.energy == 0) continue;
    Rubbing pair;
    std::copy(std::begin(active.pair.vertices), std::end(active.pair.vertices), pair.vertices);
    pair.friction =
        pair_friction(barrier_, active.pair.kind, points_of(pair.vertices, begin_), fading_of(active.pair),
                      physics.friction, physics.slip_speed * physics.time_step);
    rubbing_.push_back(pair);
  }
}

double ImplicitStep::energy_of_friction(const Positions& x) const {
  double sum = 0;
  for (const Rubbing& pair : rubbing_)
    sum += friction_energy(pair.friction, points_of(pair.vertices, x) - points_of(pair.vertices, begin_));
  return sum;
}

StepReport ImplicitStep::advance(State& state) {
  const SimulatedMesh& mesh = scene_.mesh;
  const Physics& physics = scene_.physics;
  const double h = physics.time_step;
  free_ = state.positions;
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.is_free(v)) free_.row(v) += h * state.velocities.row(v) + h * h * physics.gravity.transpose();
  script_.place(double(state.step + 1) * h, free_);
  // A step depends on the state at its start alone, so a continued run has the bits of an uninterrupted one.
  system_.forget_entries();
  const std::uint64_t orders_before = system_.orders();
  x_ = begin_ = state.positions;
  finder_.look_at(x_);
  collect(x_, active_);
  find_friction();
  double present = energy(x_, active_);
  if (!std::isfinite(present)) throw TooNear("two surfaces are nearer than their thickness");
  StepReport result;
  std::uint32_t evaluations = 0;
  while (result.iterates < physics.most_iterations) {
    ++result.iterates;
    assemble(x_);
    system_.solve(direction_);
    const double size = direction_.cwiseAbs().maxCoeff();
    const double slope = system_.slope(direction_);
    end_ = x_ + direction_;
    double part = finder_.look_along(result.iterates - 1, x_, end_, physics.thickness);
    bool accepted = false;
    while (!accepted && part > least_part) {
      trial_ = x_ + part * direction_;
      ++evaluations;
      const double there = energy(trial_, trial_active_);
      accepted = there <= present + sufficient_decrease * part * slope + energy_rounding * std::fabs(present);
      if (accepted)
        present = there;
      else
        part /= 2;
    }
    if (!accepted) {
      // When no sensible direction is left, rounding decides whether the energy decreases.
      result.ending = size <= physics.tolerance ? Ending::converged : Ending::stalled;
      break;
    }
    x_.swap(trial_);
    active_.swap(trial_active_);
    if (size <= physics.tolerance) {
      result.ending = Ending::converged;
      break;
    }
  }
  state.velocities = (x_ - state.positions) / h;
  state.positions = x_;
  ++state.step;
  StepReport at_end = report(state);
  at_end.ending = result.ending;
  at_end.iterates = result.iterates;
  at_end.evaluations = evaluations;
  at_end.lag = script_.largest_distance(x_, free_);
  at_end.orders = std::uint32_t(system_.orders() - orders_before);
  return at_end;
}

StepReport ImplicitStep::report(const State& state) const {
  const SimulatedMesh& mesh = scene_.mesh;
  StepReport result;
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    if (!mesh.is_free(v)) continue;
    const Eigen::Vector3d velocity = state.velocities.row(v).transpose();
    result.kinetic += 0.5 * mesh.mass[v] * velocity.squaredNorm();
    result.gravitational -= mesh.mass[v] * scene_.physics.gravity.dot(state.positions.row(v).transpose());
    result.momentum += mesh.mass[v] * velocity;
  }
  result.elastic = spring_energy(mesh, state.positions) + hinge_energy(mesh, state.positions);
  result.contacts = active_.size();
  double nearest = barrier_.radius() * barrier_.radius();
  for (const Active& active : active_) {
    result.barrier += active.energy;
    nearest = std::min(nearest, active.squared_distance);
  }
  result.smallest_gap = std::sqrt(nearest) - barrier_.thickness;
  return result;
}

std::size_t ImplicitStep::bytes() const {
  return system_.bytes() + sizeof(double) * std::size_t(6 * x_.size()) +
         (active_.capacity() + trial_active_.capacity()) * sizeof(Active) +
         rubbing_.capacity() * sizeof(Rubbing) + edge_lengths_.capacity() * sizeof(double);
}

}  // namespace kbvh::experiments::loop
