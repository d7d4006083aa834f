#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/contract/audit_volumes.hpp"
#include "core/geometry/volumes/bounding_volume.hpp"

namespace kbvh {

namespace detail {
/// Calls the function of the concept from a class with a member of the same name.
template <BoundingVolume V>
double protrusion_of(const V& volume, const double* point) {
  return protrusion(volume, point);
}
}  // namespace detail

/// The volumes of a hierarchy in the form that audits query.
template <BoundingVolume V>
class AuditedVolumes final : public AuditVolumes {
 public:
  explicit AuditedVolumes(std::vector<V> volumes) : volumes_(std::move(volumes)) {}
  std::size_t size() const override { return volumes_.size(); }
  double protrusion(std::uint32_t node, const double* point) const override {
    return detail::protrusion_of(volumes_[node], point);
  }
  double surface(std::uint32_t node) const override { return surface_area(volumes_[node]); }
  bool tight(std::uint32_t node, std::span<const double> points) const override {
    return volumes_[node] == fitted(points);
  }
  double tight_surface(std::span<const double> points) const override { return surface_area(fitted(points)); }

 private:
  static V fitted(std::span<const double> points) {
    std::vector<VolumeScalar<V>> rounded(points.size());
    for (std::size_t i = 0; i < rounded.size(); ++i) rounded[i] = VolumeScalar<V>(points[i]);
    V volume;
    fit(volume, PointSet<VolumeScalar<V>>(rounded.data(), rounded.size() / 3));
    return volume;
  }

  std::vector<V> volumes_;
};

}  // namespace kbvh
