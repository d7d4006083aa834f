#include "experiments/loop/strategy_contacts.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/contract/registry.hpp"
#include "experiments/common/text.hpp"

namespace kbvh::experiments::loop {

const Info& info_of(const std::string& id) {
  std::vector<std::string> known;
  for (const StrategyEntry& entry : registry()) {
    if (entry.info.id == id) return entry.info;
    known.push_back(entry.info.id);
  }
  throw ConfigError(no_such("strategy", id, known, "`kbvh list` shows them"));
}

namespace {

/// Returns why a strategy cannot find the pairs of a mesh, as the end of a sentence that begins with its id;
/// empty if it can.
std::string why_unsuitable(const Info& info, const ContactMesh& mesh) {
  if (info.foresight != Foresight::none)
    return "needs to know the motion in advance, which a simulation decides step by step";
  if (!info.can.self_pairs) return "cannot answer pairs within one body, as those of a mesh's edges are";
  if (std::find(info.primitives.begin(), info.primitives.end(), PrimitiveKind::control_nets) ==
      info.primitives.end())
    return "does not take control nets, as the boxes of moving vertices, edges and faces are";
  if (!info.has_double) return "has no double version, and a simulation computes in double";
  const auto edges = std::uint64_t(mesh.edges.rows());
  const std::uint64_t pairs = std::max(edges * edges, std::uint64_t(mesh.faces.rows()) * mesh.vertices);
  if (info.max_primitive_pairs > 0 && pairs > info.max_primitive_pairs)
    return "is offered at most " + std::to_string(info.max_primitive_pairs) +
           " primitive pairs of two bodies, here are " + std::to_string(pairs);
  return {};
}

void copy_points(const Positions& x, std::vector<double>& points) {
  points.resize(4 * std::size_t(x.rows()));
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    double* const point = points.data() + 4 * v;
    for (int axis = 0; axis < 3; ++axis) point[axis] = x(v, axis);
    point[3] = 0;
  }
}

}  // namespace

void check_contact_strategy(const ContactStrategy& strategy, const ContactMesh& mesh) {
  const Info& info = info_of(strategy.id);
  if (const std::string why = why_unsuitable(info, mesh); !why.empty())
    throw ConfigError("'" + info.id + "' " + why);
  const Params checked(info.id, info.parameters, strategy.params);  // throws for an unknown one
}

namespace {

const std::string& checked_id(const ContactStrategy& strategy, const ContactMesh& mesh) {
  check_contact_strategy(strategy, mesh);
  return strategy.id;
}

}  // namespace

StrategyContacts::StrategyContacts(const ContactMesh& mesh, const ContactStrategy& strategy, double radius,
                                   std::uint32_t lose_every)
    : mesh_(mesh),
      radius_(radius),
      lose_every_(lose_every),
      elements_(make_elements(mesh.vertices, view_of(mesh.edges), view_of(mesh.faces))),
      is_inner_(mesh.vertices, 0),
      broad_(checked_id(strategy, mesh), strategy.params) {
  for (const std::uint32_t vertex : mesh.inner) is_inner_[vertex] = 1;
}

std::size_t StrategyContacts::keep(CandidateKind kind, std::span<Candidate> pairs) const {
  std::size_t kept = 0;
  for (const Candidate& pair : pairs) {
    const bool is_inner = kind == CandidateKind::face_vertex && is_inner_[pair.second] != 0;
    if (!is_inner && (lose_every_ == 0 || !is_lost(kind, pair, lose_every_))) pairs[kept++] = pair;
  }
  return kept;
}

void StrategyContacts::start(const Positions& x) {
  broad_.build(x, mesh_.edges, mesh_.faces, radius_);
  broad_.set_vertex_groups(mesh_.vertex_groups());
  if (lose_every_ > 0 || !mesh_.inner.empty())
    broad_.keep_only([this](CandidateKind kind, std::span<Candidate> pairs) { return keep(kind, pairs); });
  built_ = true;
  forget_found();
}

void StrategyContacts::update(const Positions& x) {
  moves_ = false;
  if (!built_) return start(x);
  broad_.update(x);
  forget_found();
}

void StrategyContacts::update(const Positions& x, const Positions& end) {
  if (!built_) start(x);
  broad_.update(x, end);
  copy_points(x, begin_);
  copy_points(end, end_);
  moves_ = true;
  forget_found();
}

std::span<const Candidate> StrategyContacts::candidates(CandidateKind kind) {
  CandidateBuffer& found = found_[std::size_t(kind)];
  if (!found_valid_[std::size_t(kind)]) {
    broad_.detect(kind, found);
    ++searches_;
    found_valid_[std::size_t(kind)] = true;
  }
  return span_of(found);
}

EarliestImpact StrategyContacts::earliest_impact(double separation) {
  if (!moves_) throw std::logic_error("an impact is asked for without a motion");
  EarliestImpact earliest;
  for (const CandidateKind kind : {CandidateKind::face_vertex, CandidateKind::edge_edge})
    take_earlier_impacts<double>(kind, elements_, begin_.data(), end_.data(), candidates(kind), separation,
                                 earliest);
  return earliest;
}

std::size_t StrategyContacts::bytes() const {
  std::size_t total = broad_.bytes() + (begin_.capacity() + end_.capacity()) * sizeof(double);
  for (const Primitives& list : elements_.lists)
    total += (list.offsets.capacity() + list.vertices.capacity()) * sizeof(std::uint32_t);
  for (const CandidateBuffer& found : found_) total += found.capacity() * sizeof(Candidate);
  return total + is_inner_.capacity();
}

}  // namespace kbvh::experiments::loop
