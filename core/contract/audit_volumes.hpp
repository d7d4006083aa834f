#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace kbvh {

/// The bounding volumes of one body's nodes, for audits, where they are not axis-aligned boxes. A box around
/// a volume proves nothing about the volume, so audits ask the volume itself.
class AuditVolumes {
 public:
  AuditVolumes() = default;
  virtual ~AuditVolumes() = default;
  AuditVolumes(const AuditVolumes&) = delete;
  AuditVolumes& operator=(const AuditVolumes&) = delete;

  /// How many nodes have a volume; an audit compares this number with the size of the topology.
  virtual std::size_t size() const = 0;
  /// How far a point (3 numbers) lies outside a node's volume; 0 if and only if the point lies inside,
  /// decided exactly.
  virtual double protrusion(std::uint32_t node, const double* point) const = 0;
  /// Surface area of a node's volume.
  virtual double surface(std::uint32_t node) const = 0;
  /// Surface area of a volume of the same kind that is fitted to these points at once: [point][3], exact in
  /// the strategy's scalar.
  virtual double tight_surface(std::span<const double> points) const = 0;
};

}  // namespace kbvh
