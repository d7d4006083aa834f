#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/broad_phase/broad_phase.hpp"
#include "experiments/loop/closest_points.hpp"
#include "experiments/loop/contact_mesh.hpp"
#include "experiments/loop/strategy_contacts.hpp"

namespace kbvh::experiments::loop {

/// The ways to find pairs at iterate after iterate.
enum class Detection : std::uint8_t {
  rebuild,  ///< new trees and a search at each
  refit,    ///< trees are refitted, then searched
  kept,     ///< candidates are kept until a vertex has moved by a bound
};
/// Returns the way in words: rebuild, refit, kept.
const char* name(Detection detection);
/// Finds a way by its name. Throws std::invalid_argument that lists the known names.
Detection detection(const std::string& name);

/// What finds the pairs of one simulation or of one replay: a broad phase, used in one of the ways, or a
/// strategy.
class IterateDetector {
 public:
  struct Settings {
    Detection detection = Detection::refit;
    double keep = 0;               ///< m: the bound of `kept`, positive there
    double radius = 0;             ///< m
    std::uint32_t lose_every = 0;  ///< a fault for tests: loses one pair of so many, by its ids; 0: none
    ContactStrategy strategy{};  ///< if named, finds the pairs; `detection` is then `refit`, without a bound
  };
  /// Keeps a reference to the mesh. Throws std::invalid_argument for a bound that does not fit the way, and
  /// for another way with a strategy; ConfigError as check_contact_strategy.
  IterateDetector(const ContactMesh& mesh, const Settings& settings);

  /// Takes positions; rows are vertices.
  void update(const Positions& x);
  /// Takes a motion.
  void update(const Positions& x, const Positions& end);
  /// Returns the candidates of the last positions or motion; valid until the next update.
  std::span<const Candidate> candidates(CandidateKind kind) {
    return by_strategy_ ? by_strategy_->candidates(kind) : broad_.candidates(kind);
  }
  /// Returns the earliest impact of the last motion (BroadPhase::earliest_impact).
  EarliestImpact earliest_impact(double separation) {
    return by_strategy_ ? by_strategy_->earliest_impact(separation) : broad_.earliest_impact(separation);
  }
  /// Returns the number of searches, of one kind of pairs each.
  std::uint64_t searches() const { return by_strategy_ ? by_strategy_->searches() : broad_.detections(); }
  std::size_t bytes() const { return by_strategy_ ? by_strategy_->bytes() : broad_.bytes(); }
  /// Returns the broad phase, for questions that strategies do not answer; unused if a strategy is named.
  BroadPhase<double>& broad() { return broad_; }
  const Settings& settings() const { return settings_; }

 private:
  void build(const Positions& x);

  const ContactMesh& mesh_;
  Settings settings_;
  BroadPhase<double> broad_;
  std::unique_ptr<StrategyContacts> by_strategy_;  // null: none is named
};

/// Takes what a simulator asks at each iterate.
class IterateSink {
 public:
  virtual ~IterateSink() = default;
  /// A motion from x to end that was asked about, in the given iterate of the current step.
  virtual void take(std::uint32_t iterate, const Positions& x, const Positions& end) = 0;
};

/// The cost of finding pairs, summed up.
struct DetectionWork {
  double detect_seconds = 0;     ///< updates and candidates
  double impact_seconds = 0;     ///< exact tests of candidates for the earliest impact
  std::uint64_t questions = 0;   ///< positions and motions that were asked about
  std::uint64_t searches = 0;    ///< those of the broad phase, of one kind of pairs each
  std::uint64_t candidates = 0;  ///< of both kinds, summed over questions
};

/// Pairs for one simulation: candidates of vertices and faces, and of edges, and impacts of motions.
class ContactFinder {
 public:
  /// A pair that may touch, with the vertices in the order of FourPoints.
  struct Pair {
    ContactKind kind;
    std::uint32_t first, second;  ///< ids of the elements
    std::uint32_t vertices[4];
  };
  /// `sink`, if given, must outlive this object.
  ContactFinder(const ContactMesh& mesh, const IterateDetector::Settings& settings,
                IterateSink* sink = nullptr);

  /// Makes the candidates those of positions: all pairs within the radius, and others.
  void look_at(const Positions& x);
  /// Makes the candidates those of a motion: all pairs that come within the radius, and others. Returns how
  /// much of the motion, at most 1, is free: no pair comes within the separation until its end. Returns 0 if
  /// that would be less than 10^-12.
  double look_along(std::uint32_t iterate, const Positions& x, const Positions& end, double separation);

  /// Calls take(pair) for each candidate, in an order that depends on the trees.
  template <class Take>
  void for_each(const Take& take) {
    for (const Candidate& candidate : detector_.candidates(CandidateKind::face_vertex))
      take(pair_of(ContactKind::face_vertex, candidate));
    for (const Candidate& candidate : detector_.candidates(CandidateKind::edge_edge))
      take(pair_of(ContactKind::edge_edge, candidate));
  }

  const DetectionWork& work() const { return work_; }
  std::size_t bytes() const { return detector_.bytes() + sizeof(double) * std::size_t(part_.size()); }

 private:
  Pair pair_of(ContactKind kind, const Candidate& candidate) const;
  void search();

  const ContactMesh& mesh_;
  IterateDetector detector_;
  IterateSink* sink_;
  DetectionWork work_;
  Positions part_;  // the end of a part of a motion
};

}  // namespace kbvh::experiments::loop
