#include "core/judge/audit.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace kbvh {

namespace {
std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}
}  // namespace

void Audit::add(const Audit& other) {
  nodes += other.nodes;
  stale += other.stale;
  invalid += other.invalid;
  not_tight += other.not_tight;
  protrusion = std::max(protrusion, other.protrusion);
  area += other.area;
  tight_area += other.tight_area;
  if (topology_error.empty()) topology_error = other.topology_error;
  if (first_fault.empty()) first_fault = other.first_fault;
}

template <class S>
std::vector<Box<double>> tight_boxes(const Topology& topology, const Primitives& primitives,
                                     const S* positions) {
  std::vector<Box<double>> boxes(topology.size());
  for (std::uint32_t i = topology.size(); i-- > 0;) {
    const TopologyNode node = topology.nodes[i];
    for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k) {
      if (!node.is_leaf()) {
        boxes[i].extend(boxes[k]);
        continue;
      }
      for (std::uint32_t v : primitives[topology.primitives[k]]) {
        const S* p = positions + std::size_t(3) * v;
        const double point[3] = {double(p[0]), double(p[1]), double(p[2])};
        boxes[i].extend(point);
      }
    }
  }
  return boxes;
}

template <class S>
Audit audit(const AuditView& view, const Primitives& primitives, const S* positions, const Topology* sound) {
  Audit result;
  result.nodes = view.topology.size();
  if (sound == nullptr || !(view.topology == *sound))
    result.topology_error = check_topology(view.topology, primitives);
  if (!result.topology_error.empty()) return result;
  if (view.boxes.size() != view.topology.size()) {
    result.topology_error =
        std::to_string(view.boxes.size()) + " boxes for " + std::to_string(view.topology.size()) + " nodes";
    return result;
  }
  const auto tight = tight_boxes(view.topology, primitives, positions);
  for (std::uint32_t i = 0; i < view.topology.size(); ++i) {
    if (!view.stale.empty() && view.stale[i]) {
      ++result.stale;
      continue;
    }
    const Box<double>& box = view.boxes[i];
    result.area += surface_area(box);
    result.tight_area += surface_area(tight[i]);
    if (!(box == tight[i])) ++result.not_tight;
    if (box.contains(tight[i])) continue;
    ++result.invalid;
    for (int axis = 0; axis < 3; ++axis) {
      const double below = box.lower[axis] - tight[i].lower[axis],
                   above = tight[i].upper[axis] - box.upper[axis];
      double amount = std::max(below, above);
      if (std::isnan(amount)) amount = std::numeric_limits<double>::infinity();
      if (amount > 0 && result.first_fault.empty())
        result.first_fault = "node " + std::to_string(i) +
                             (view.topology.nodes[i].is_leaf() ? " (leaf)" : "") + ", axis " + "xyz"[axis] +
                             ": a vertex protrudes by " + short_number(amount);
      result.protrusion = std::max(result.protrusion, amount);
    }
  }
  return result;
}

double sah_cost(const Topology& topology, const std::vector<Box<double>>& boxes, double traversal_cost) {
  if (topology.empty()) return 0;
  double cost = 0;
  for (std::uint32_t i = 0; i < topology.size(); ++i) {
    const TopologyNode node = topology.nodes[i];
    cost += surface_area(boxes[i]) * (node.is_leaf() ? double(node.count()) : traversal_cost);
  }
  const double root = surface_area(boxes[0]);
  return root > 0 ? cost / root : 0;
}

template std::vector<Box<double>> tight_boxes(const Topology&, const Primitives&, const float*);
template std::vector<Box<double>> tight_boxes(const Topology&, const Primitives&, const double*);
template Audit audit(const AuditView&, const Primitives&, const float*, const Topology*);
template Audit audit(const AuditView&, const Primitives&, const double*, const Topology*);

}  // namespace kbvh
