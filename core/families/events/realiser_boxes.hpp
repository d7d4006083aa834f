#pragma once
#include <cstdint>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// The box whose sides are realised by six vertices: [lower x, upper x, lower y, ...]. Fetches their
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

/// Boxes made on demand, each at most once per frame.
template <class S>
class BoxCache {
 public:
  explicit BoxCache(std::uint32_t nodes) : boxes_(nodes), stamps_(nodes, 0) {}
  void new_frame() {
    if (++frame_ == 0) {
      std::fill(stamps_.begin(), stamps_.end(), 0);
      frame_ = 1;
    }
  }
  bool current(std::uint32_t node) const { return stamps_[node] == frame_; }
  const Box<S>& box(std::uint32_t node) const { return boxes_[node]; }
  void store(std::uint32_t node, const Box<S>& box) {
    boxes_[node] = box;
    stamps_[node] = frame_;
  }
  /// For a hierarchy that has more nodes now; boxes made before stay.
  void resize(std::uint32_t nodes) {
    boxes_.resize(nodes);
    stamps_.resize(nodes, 0);
  }
  std::size_t bytes() const { return boxes_.size() * (sizeof(Box<S>) + sizeof(std::uint32_t)); }

 private:
  std::vector<Box<S>> boxes_;
  std::vector<std::uint32_t> stamps_;
  std::uint32_t frame_ = 1;
};

/// A bounds view (traversal.hpp) of implicit boxes: read from the realising vertices when the query asks.
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
  const Box<S>& operator()(std::uint32_t node) const { return cache_->box(node); }

 private:
  const std::uint32_t* realisers_;
  const SampledMotion<S>* motion_;
  std::uint32_t body_;
  BoxCache<S>* cache_;
};

}  // namespace kbvh
