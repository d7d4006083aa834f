#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/broad_phase/earliest_impact.hpp"
#include "core/contract/strategy.hpp"
#include "core/facade/strategy_broad_phase.hpp"
#include "experiments/loop/contact_mesh.hpp"

namespace kbvh::experiments::loop {

/// The strategy of the registry that finds the pairs of a simulation.
struct ContactStrategy {
  std::string id;                               ///< empty: none, kbvh::broad_phase finds them
  std::map<std::string, std::string> params{};  ///< its parameters, as text
};

/// Returns the registry's description of a strategy. Throws ConfigError for an unknown id.
const Info& info_of(const std::string& id);

/// Checks that a strategy can find the pairs of a simulation of this mesh. Throws ConfigError, in one
/// sentence with the reason, for an unknown id or parameter, and for a strategy that has to know the motion
/// in advance, does not answer pairs within a body, does not take the boxes of moving elements, has no double
/// version, or is not offered so many pairs.
void check_contact_strategy(const ContactStrategy& strategy, const ContactMesh& mesh);

/// The pairs of a mesh that may touch, found by a strategy: the same set as those of BroadPhase, if the
/// strategy is exact. Pairs of obstacles, and inner vertices, are found and then left out by filters.
class StrategyContacts {
 public:
  /// Throws as check_contact_strategy. `lose_every`: see IterateDetector::Settings.
  StrategyContacts(const ContactMesh& mesh, const ContactStrategy& strategy, double radius,
                   std::uint32_t lose_every);
  StrategyContacts(const StrategyContacts&) = delete;
  StrategyContacts& operator=(const StrategyContacts&) = delete;

  /// Takes positions; rows are vertices. The first call builds.
  void update(const Positions& x);
  /// Takes a motion.
  void update(const Positions& x, const Positions& end);
  /// Returns the candidates of the last positions or motion: of vertices and faces, or of edges. Valid until
  /// the next update, whose first question of each kind searches.
  std::span<const Candidate> candidates(CandidateKind kind);
  /// Returns the earliest impact of the last motion, as BroadPhase does. Throws std::logic_error if
  /// positions were taken last.
  EarliestImpact earliest_impact(double separation);

  /// Returns the number of searches, of one kind of pairs each.
  std::uint64_t searches() const { return searches_; }
  std::size_t bytes() const;

 private:
  void start(const Positions& x);
  /// Moves the pairs that may touch, and that the fault of tests leaves, to the front; returns their number.
  std::size_t keep(CandidateKind kind, std::span<Candidate> pairs) const;
  void forget_found() { found_valid_.fill(false); }

  const ContactMesh& mesh_;
  double radius_;
  std::uint32_t lose_every_;
  Elements elements_;
  std::vector<std::uint8_t> is_inner_;  // [vertex]
  StrategyBroadPhase<double> broad_;
  bool built_ = false, moves_ = false;
  std::vector<double> begin_, end_;  // [vertex][4], of the last motion
  std::array<CandidateBuffer, candidate_kinds.size()> found_;
  std::array<bool, candidate_kinds.size()> found_valid_{};
  std::uint64_t searches_ = 0;
};

}  // namespace kbvh::experiments::loop
