#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// Returns the box whose sides are realised by six vertices: [lower x, upper x, lower y, ...]. Fetches their
/// positions.
template <class S>
Box<S> box_of_realisers(const std::uint32_t* realisers, const SampledMotion<S>& motion, std::uint32_t body) {
  motion.fetch(body, {realisers, 6});
  const S* positions = motion.positions(body);
  Box<S> box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = positions[std::size_t(3) * realisers[2 * axis] + axis];
    box.upper[axis] = positions[std::size_t(3) * realisers[2 * axis + 1] + axis];
  }
  return box;
}

/// The volumes of one body's nodes, computed on demand, each at most once per frame.
template <class Volume>
class VolumeCache {
 public:
  explicit VolumeCache(std::uint32_t nodes) : volumes_(nodes), stamps_(nodes, 0) {}
  void new_frame() {
    if (++frame_ == 0) {
      std::fill(stamps_.begin(), stamps_.end(), 0);
      frame_ = 1;
    }
  }
  bool current(std::uint32_t node) const { return stamps_[node] == frame_; }
  const Volume& volume(std::uint32_t node) const { return volumes_[node]; }
  void store(std::uint32_t node, const Volume& volume) {
    volumes_[node] = volume;
    stamps_[node] = frame_;
  }
  /// Makes room for more nodes; volumes computed before stay.
  void resize(std::uint32_t nodes) {
    volumes_.resize(nodes);
    stamps_.resize(nodes, 0);
  }
  std::size_t bytes() const {
    return volumes_.capacity() * sizeof(Volume) + stamps_.capacity() * sizeof(std::uint32_t);
  }

 private:
  std::vector<Volume> volumes_;
  std::vector<std::uint32_t> stamps_;
  std::uint32_t frame_ = 1;
};
template <class S>
using BoxCache = VolumeCache<Box<S>>;

/// A bounds view (traversal.hpp) of boxes that are computed from their realisers when a query reads them.
template <class S>
class RealiserBoxes {
 public:
  /// `realisers` is [node][6].
  RealiserBoxes(const std::uint32_t* realisers, const SampledMotion<S>& motion, std::uint32_t body,
                BoxCache<S>& cache)
      : realisers_(realisers), motion_(&motion), body_(body), cache_(&cache) {}
  void ensure(std::uint32_t node) {
    if (!cache_->current(node))
      cache_->store(node, box_of_realisers(realisers_ + std::size_t(6) * node, *motion_, body_));
  }
  const Box<S>& operator()(std::uint32_t node) const { return cache_->volume(node); }

 private:
  const std::uint32_t* realisers_;
  const SampledMotion<S>* motion_;
  std::uint32_t body_;
  BoxCache<S>* cache_;
};

}  // namespace kbvh
