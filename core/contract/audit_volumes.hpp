#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace kbvh {

/// The bounding volumes of one body's nodes, for audits of volumes other than axis-aligned boxes. A box
/// around a volume proves nothing about the volume, so audits query the volume itself.
class AuditVolumes {
 public:
  AuditVolumes() = default;
  virtual ~AuditVolumes() = default;
  AuditVolumes(const AuditVolumes&) = delete;
  AuditVolumes& operator=(const AuditVolumes&) = delete;

  /// Returns the number of nodes with a volume; an audit compares it with the size of the topology.
  virtual std::size_t size() const = 0;
  /// Returns the distance by which a point (3 numbers) lies outside a node's volume; 0 if and only if the
  /// point lies inside, decided exactly.
  virtual double protrusion(std::uint32_t node, const double* point) const = 0;
  /// Returns the surface area of a node's volume.
  virtual double surface(std::uint32_t node) const = 0;
  /// Returns whether a node's volume equals a volume of the same kind that is fitted directly to these
  /// points: [point][3], exact in the strategy's scalar.
  virtual bool tight(std::uint32_t node, std::span<const double> points) const = 0;
  /// Returns the surface area of the volume that is fitted directly.
  virtual double tight_surface(std::span<const double> points) const = 0;
};

}  // namespace kbvh
