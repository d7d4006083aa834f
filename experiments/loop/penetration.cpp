#include "experiments/loop/penetration.hpp"

#include <algorithm>

#include "core/geometry/triangle_triangle.hpp"

namespace kbvh::experiments::loop {

PenetrationCheck::PenetrationCheck(const SimulatedMesh& mesh) : mesh_(mesh) {
  const Eigen::Index faces = mesh.faces.rows();
  bounds_.resize(std::size_t(faces));
  for (Eigen::Index f = 0; f < faces; ++f) {
    bool obstacle = true;
    for (int k = 0; k < 3; ++k) obstacle = obstacle && mesh.obstacle[mesh.faces(f, k)] != 0;
    obstacle_.push_back(obstacle ? 1 : 0);
    bounds_[std::size_t(f)].face = std::uint32_t(f);
  }
}

std::uint64_t PenetrationCheck::intersecting_pairs(const Positions& x) {
  for (Bounds& box : bounds_)
    for (int axis = 0; axis < 3; ++axis) {
      const auto corner = [&](int k) { return x(mesh_.faces(box.face, k), axis); };
      box.low[axis] = std::min({corner(0), corner(1), corner(2)});
      box.high[axis] = std::max({corner(0), corner(1), corner(2)});
    }
  std::sort(bounds_.begin(), bounds_.end(),
            [](const Bounds& a, const Bounds& b) { return a.low[0] < b.low[0]; });
  std::uint64_t found = 0;
  for (std::size_t i = 0; i < bounds_.size(); ++i) {
    const Bounds& a = bounds_[i];
    const auto v = mesh_.faces.row(a.face);
    for (std::size_t j = i + 1; j < bounds_.size() && bounds_[j].low[0] <= a.high[0]; ++j) {
      const Bounds& b = bounds_[j];
      if (a.low[1] > b.high[1] || b.low[1] > a.high[1] || a.low[2] > b.high[2] || b.low[2] > a.high[2])
        continue;
      if (obstacle_[a.face] != 0 && obstacle_[b.face] != 0) continue;
      const auto w = mesh_.faces.row(b.face);
      bool incident = false;
      for (int k = 0; k < 3; ++k) incident = incident || (v.array() == w(k)).any();
      if (incident) continue;
      const auto at = [&](std::uint32_t vertex) { return x.data() + std::size_t(3) * vertex; };
      found += triangles_intersect(at(v(0)), at(v(1)), at(v(2)), at(w(0)), at(w(1)), at(w(2))) ? 1 : 0;
    }
  }
  return found;
}

}  // namespace kbvh::experiments::loop
