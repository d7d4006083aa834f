#include "experiments/loop/contact_finder.hpp"

#include <chrono>
#include <stdexcept>
#include <vector>

#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"

namespace kbvh::experiments::loop {
namespace {}  // namespace

const char* name(Detection detection) {
  switch (detection) {
    case Detection::rebuild:
      return "rebuild";
    case Detection::refit:
      return "refit";
    case Detection::kept:
      break;
  }
  return "kept";
}

Detection detection(const std::string& word) {
  std::vector<std::string> known;
  for (const Detection one : {Detection::rebuild, Detection::refit, Detection::kept}) {
    if (word == name(one)) return one;
    known.emplace_back(name(one));
  }
  throw std::invalid_argument(no_such("way to detect", word, known));
}

IterateDetector::IterateDetector(const ContactMesh& mesh, const Settings& settings)
    : mesh_(mesh), settings_(settings) {
  if ((settings.detection == Detection::kept) != (settings.keep > 0))
    throw std::invalid_argument(
        "a bound on displacements belongs to the way 'kept', and must be positive there");
  if (settings.strategy.id.empty()) return;
  if (settings.detection != Detection::refit)
    throw std::invalid_argument(std::string("the way '") + name(settings.detection) +
                                "' belongs to kbvh::broad_phase; a strategy has its own");
  by_strategy_ =
      std::make_unique<StrategyContacts>(mesh, settings.strategy, settings.radius, settings.lose_every);
}

void IterateDetector::build(const Positions& x) {
  broad_.build(x, mesh_.edges, mesh_.faces, settings_.radius);
  broad_.remove(Element::vertex, mesh_.inner);
  broad_.set_vertex_groups(mesh_.vertex_groups());
  if (settings_.lose_every > 0)
    broad_.keep_if([every = settings_.lose_every](CandidateKind kind, const Candidate& pair) {
      return !is_lost(kind, pair, every);
    });
  if (settings_.detection == Detection::kept) broad_.valid_for(settings_.keep);
}

void IterateDetector::update(const Positions& x) {
  if (by_strategy_) return by_strategy_->update(x);
  if (!broad_.built()) return build(x);
  if (settings_.detection == Detection::rebuild) broad_.forget_trees();
  broad_.update(x);
}

void IterateDetector::update(const Positions& x, const Positions& end) {
  if (by_strategy_) return by_strategy_->update(x, end);
  if (!broad_.built()) build(x);
  if (settings_.detection == Detection::rebuild) broad_.forget_trees();
  broad_.update(x, end);
}

ContactFinder::ContactFinder(const ContactMesh& mesh, const IterateDetector::Settings& settings,
                             IterateSink* sink)
    : mesh_(mesh), detector_(mesh, settings), sink_(sink) {}

ContactFinder::Pair ContactFinder::pair_of(ContactKind kind, const Candidate& candidate) const {
  const auto a = Eigen::Index(candidate.first), b = Eigen::Index(candidate.second);
  if (kind == ContactKind::face_vertex)
    return {kind,
            candidate.first,
            candidate.second,
            {candidate.second, mesh_.faces(a, 0), mesh_.faces(a, 1), mesh_.faces(a, 2)}};
  return {kind,
          candidate.first,
          candidate.second,
          {mesh_.edges(a, 0), mesh_.edges(a, 1), mesh_.edges(b, 0), mesh_.edges(b, 1)}};
}

void ContactFinder::search() {
  work_.candidates += detector_.candidates(CandidateKind::face_vertex).size();
  work_.candidates += detector_.candidates(CandidateKind::edge_edge).size();
  ++work_.questions;
}

void ContactFinder::look_at(const Positions& x) {
  const auto begin = std::chrono::steady_clock::now();
  detector_.update(x);
  search();
  work_.searches = detector_.searches();
  work_.detect_seconds += seconds_since(begin);
}

double ContactFinder::look_along(std::uint32_t iterate, const Positions& x, const Positions& end,
                                 double separation) {
  if (sink_ != nullptr) sink_->take(iterate, x, end);
  const auto begin = std::chrono::steady_clock::now();
  detector_.update(x, end);
  search();
  work_.detect_seconds += seconds_since(begin);
  const auto searched = std::chrono::steady_clock::now();
  double part = 1;
  EarliestImpact impact = detector_.earliest_impact(separation);
  // A time of impact is enclosed to 2^-20 of the motion: if that is too coarse, ask about a shorter part.
  while (impact.touches && impact.begin < 0x1p-10 && part > 1e-12) {
    part *= 0x1p-9;
    part_ = x + part * (end - x);
    detector_.update(x, part_);
    impact = detector_.earliest_impact(separation);
  }
  work_.impact_seconds += seconds_since(searched);
  work_.searches = detector_.searches();
  if (part <= 1e-12) return 0;
  return impact.touches ? 0.9 * impact.begin * part : part;
}

}  // namespace kbvh::experiments::loop
