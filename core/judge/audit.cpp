#include "core/judge/audit.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace kbvh {

namespace {
std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

/// Records one invalid bound: its protrusion, and its place if it is the first.
void add_fault(Audit& result, const Topology& topology, std::uint32_t node, const std::string& where,
               double amount) {
  if (result.first_fault.empty())
    result.first_fault = "node " + std::to_string(node) + (topology.nodes[node].is_leaf() ? " (leaf)" : "") +
                         ", " + where + ": a vertex protrudes by " + short_number(amount);
  result.protrusion = std::max(result.protrusion, amount);
}

/// The vertices below every node of a topology in one list; those of one node are contiguous.
template <class S>
class PointsBelow {
 public:
  PointsBelow(const Topology& topology, const Primitives& primitives, const S* positions)
      : begin_(topology.size(), 0), count_(topology.size(), 0) {
    if (topology.empty()) return;
    const LeafVertices leaves = unique_leaf_vertices(topology, primitives);
    for (std::uint32_t node = topology.size(); node-- > 0;) {
      const TopologyNode content = topology.nodes[node];
      if (content.is_leaf()) count_[node] = std::uint32_t(leaves[node].size());
      for (std::uint32_t k = content.first(); !content.is_leaf() && k < content.first() + content.count();
           ++k)
        count_[node] += count_[k];
    }
    points_.resize(std::size_t(3) * count_[0]);
    vertices_.resize(count_[0]);
    for (std::uint32_t node = 0; node < topology.size(); ++node) {
      const TopologyNode content = topology.nodes[node];
      std::uint32_t at = begin_[node];
      if (!content.is_leaf()) {
        for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k) {
          begin_[k] = at;
          at += count_[k];
        }
        continue;
      }
      for (const std::uint32_t v : leaves[node]) {
        for (std::size_t d = 0; d < 3; ++d)
          points_[std::size_t(3) * at + d] = double(positions[std::size_t(3) * v + d]);
        vertices_[at++] = v;
      }
    }
  }
  /// Returns [point][3]; a vertex of several leaves occurs several times.
  std::span<const double> points(std::uint32_t node) const {
    return {points_.data() + std::size_t(3) * begin_[node], std::size_t(3) * count_[node]};
  }
  std::span<const std::uint32_t> vertices(std::uint32_t node) const {
    return {vertices_.data() + begin_[node], count_[node]};
  }

 private:
  std::vector<std::uint32_t> begin_, count_, vertices_;
  std::vector<double> points_;
};

/// Queries every volume that is not stale about all vertices below its node.
template <class S>
void audit_volumes(const AuditView& view, const Primitives& primitives, const S* positions, Areas areas,
                   Audit& result) {
  const PointsBelow<S> below(view.topology, primitives, positions);
  for (std::uint32_t node = 0; node < view.topology.size(); ++node) {
    if (!view.stale.empty() && view.stale[node]) {
      ++result.stale;
      continue;
    }
    const auto points = below.points(node);
    const bool tight = view.volumes->tight(node, points);
    if (!tight) ++result.not_tight;
    if (areas == Areas::summed) {
      const double surface = view.volumes->surface(node);
      result.area += surface;
      result.tight_area += tight ? surface : view.volumes->tight_surface(points);
    }
    double furthest = 0;
    std::uint32_t vertex = 0;
    for (std::size_t i = 0; i < points.size() / 3; ++i) {
      double amount = view.volumes->protrusion(node, points.data() + 3 * i);
      if (std::isnan(amount)) amount = std::numeric_limits<double>::infinity();
      if (!(amount > furthest)) continue;
      furthest = amount;
      vertex = below.vertices(node)[i];
    }
    if (furthest == 0) continue;
    ++result.invalid;
    add_fault(result, view.topology, node, "vertex " + std::to_string(vertex), furthest);
  }
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
Audit audit(const AuditView& view, const Primitives& primitives, const S* positions, const Topology* sound,
            Areas areas) {
  Audit result;
  result.nodes = view.topology.size();
  if (sound == nullptr || !(view.topology == *sound))
    result.topology_error = check_topology(view.topology, primitives);
  if (!result.topology_error.empty()) return result;
  const auto one_per_node = [&](std::size_t bounds, const char* kind) {
    if (bounds != view.topology.size())
      result.topology_error = std::to_string(bounds) + kind + std::to_string(view.topology.size()) + " nodes";
    return bounds == view.topology.size();
  };
  if (!one_per_node(view.boxes.size(), " boxes for ")) return result;
  if (view.volumes && !one_per_node(view.volumes->size(), " volumes for ")) return result;
  if (view.volumes) {
    audit_volumes(view, primitives, positions, areas, result);
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
      if (amount > 0) add_fault(result, view.topology, i, std::string("axis ") + "xyz"[axis], amount);
    }
  }
  return result;
}

double sah_cost(const Topology& topology, std::span<const double> areas, double traversal_cost) {
  if (topology.empty()) return 0;
  double cost = 0;
  for (std::uint32_t i = 0; i < topology.size(); ++i) {
    const TopologyNode node = topology.nodes[i];
    cost += areas[i] * (node.is_leaf() ? double(node.count()) : traversal_cost);
  }
  return areas[0] > 0 ? cost / areas[0] : 0;
}

double sah_cost(const Topology& topology, const std::vector<Box<double>>& boxes, double traversal_cost) {
  std::vector<double> areas(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) areas[i] = surface_area(boxes[i]);
  return sah_cost(topology, areas, traversal_cost);
}

template std::vector<Box<double>> tight_boxes(const Topology&, const Primitives&, const float*);
template std::vector<Box<double>> tight_boxes(const Topology&, const Primitives&, const double*);
template Audit audit(const AuditView&, const Primitives&, const float*, const Topology*, Areas);
template Audit audit(const AuditView&, const Primitives&, const double*, const Topology*, Areas);

}  // namespace kbvh
