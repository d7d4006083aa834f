#pragma once
#include <cstddef>
#include <map>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Keeps the boxes of bodies at segment ends of a clip for later plays. Older entries stay: if memory is
/// short, a looping clip would otherwise evict each box before its reuse.
template <class S>
class BoundsCache {
 public:
  struct Boxes {
    UnfilledArray<S> child_bounds, node_bounds;  ///< as in WideArrays
    bool complete = false;                       ///< set by the caller after filling in the boxes
  };

  BoundsCache(std::size_t bodies, std::size_t most_bytes) : kept_(bodies), most_bytes_(most_bytes) {}
  bool is_used() const { return most_bytes_ > 0; }

  /// Returns the boxes of a body at t; null if there are none.
  const Boxes* find(std::size_t body, double t) const {
    const auto found = kept_[body].find(t);
    return found == kept_[body].end() || !found->second.complete ? nullptr : &found->second;
  }
  /// Reserves boxes of a body at t, unset or not yet complete; null if memory is short.
  Boxes* add(std::size_t body, double t, std::size_t child_bounds, std::size_t node_bounds) {
    if (const auto begun = kept_[body].find(t); begun != kept_[body].end()) return &begun->second;
    const std::size_t more = (child_bounds + node_bounds) * sizeof(S);
    if (bytes_ + more > most_bytes_) return nullptr;
    bytes_ += more;
    Boxes& boxes = kept_[body][t];
    boxes.child_bounds.resize(child_bounds);
    boxes.node_bounds.resize(node_bounds);
    return &boxes;
  }
  std::size_t bytes() const { return bytes_; }

 private:
  std::vector<std::map<double, Boxes>> kept_;
  std::size_t most_bytes_, bytes_ = 0;
};

}  // namespace kbvh
