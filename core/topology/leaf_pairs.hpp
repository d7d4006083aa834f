#pragma once
#include "core/base/counters.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// Turns overlapping leaves into candidate pairs: appends the primitive pairs of two leaves whose own boxes
/// overlap. One object serves one pair of bodies, fetches the positions that it reads, and adds its box tests
/// to `tests`. Within one body, the caller passes each two leaves once, and also each leaf of several
/// primitives with itself.
template <class S>
class LeafPairs {
 public:
  LeafPairs(const SceneView<S>& scene, const SampledMotion<S>& motion, std::uint32_t body_a,
            const Topology& a, std::uint32_t body_b, const Topology& b, std::uint64_t& tests, PairBuffer& out)
      : motion_(&motion),
        primitives_a_(&scene.primitives(body_a)),
        primitives_b_(&scene.primitives(body_b)),
        body_a_(body_a),
        body_b_(body_b),
        a_(&a),
        b_(&b),
        tests_(&tests),
        out_(&out) {}

  void operator()(std::uint32_t leaf_a, std::uint32_t leaf_b) {
    const std::size_t before = out_->size();
    append(leaf_a, leaf_b);
    if (body_a_ != body_b_) return;
    const LeavesOf leaves = leaf_a == leaf_b ? LeavesOf::one : LeavesOf::two;
    out_->resize(before +
                 keep_self_pairs(primitives_a_, leaves, out_->data() + before, out_->size() - before));
  }

 private:
  void append(std::uint32_t leaf_a, std::uint32_t leaf_b) {
    const TopologyNode na = a_->nodes[leaf_a], nb = b_->nodes[leaf_b];
    if (na.count() == 1 && nb.count() == 1) {
      out_->push_back({body_a_, a_->primitives[na.first()], body_b_, b_->primitives[nb.first()]});
      return;
    }
    LaneBox<S> boxes_b[16];
    LaneBox<S> whole_b = boxes_b[0] = box(body_b_, *primitives_b_, b_->primitives[nb.first()]);
    for (std::uint32_t j = 1; j < nb.count(); ++j) {
      boxes_b[j] = box(body_b_, *primitives_b_, b_->primitives[nb.first() + j]);
      whole_b.extend(boxes_b[j]);
    }
    std::uint64_t tests = na.count();
    for (std::uint32_t i = 0; i < na.count(); ++i) {
      const std::uint32_t primitive = a_->primitives[na.first() + i];
      const LaneBox<S> box_a = box(body_a_, *primitives_a_, primitive);
      if (!box_a.overlaps(whole_b)) continue;
      tests += nb.count();
      for (std::uint32_t j = 0; j < nb.count(); ++j)
        if (box_a.overlaps(boxes_b[j]))
          out_->push_back({body_a_, primitive, body_b_, b_->primitives[nb.first() + j]});
    }
    *tests_ += tests;
  }
  [[gnu::always_inline]] LaneBox<S> box(std::uint32_t body, const Primitives& primitives,
                                        std::uint32_t primitive) const {
    const auto vertices = primitives[primitive];
    motion_->fetch(body, vertices);
    return LaneBox<S>::of(vertices, motion_->positions(body));
  }
  const SampledMotion<S>* motion_;
  const Primitives* primitives_a_;
  const Primitives* primitives_b_;
  std::uint32_t body_a_, body_b_;
  const Topology* a_;
  const Topology* b_;
  std::uint64_t* tests_;
  PairBuffer* out_;
};

}  // namespace kbvh
