// The dynamic tree: after any insertions and removals every box is the union of its children's, and every
// search finds the same pairs as a comparison of all boxes. Also: the suite can fail for a strategy that uses
// the tree wrongly.

#include "core/families/restructure/dynamic_tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/families/build/built_each_frame.hpp"
#include "core/geometry/lane_box.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::dynamic_tree_test {
namespace {

Box<float> random_box(Random& random) {
  Box<float> box;
  for (int axis = 0; axis < 3; ++axis) {
    // A coarse grid: some boxes touch, some are equal or flat.
    const float low = float(random.below(32)), size = float(random.below(4));
    box.lower[axis] = low;
    box.upper[axis] = low + size;
  }
  return box;
}

/// Requires a sound topology over exactly these primitives, in which every box is the union of its
/// children's.
void expect_sound(const DynamicTree<float>& tree, const std::vector<Box<float>>& boxes,
                  const std::set<std::uint32_t>& inside) {
  std::vector<Box<double>> found;
  const Topology topology = tree.topology(found);
  Primitives primitives;
  for (std::uint32_t p = 0; p < boxes.size(); ++p) primitives.add(std::vector<std::uint32_t>{0});
  for (std::uint32_t p = 0; p < boxes.size(); ++p)
    if (!inside.contains(p)) primitives.remove(p);
  ASSERT_EQ(check_topology(topology, primitives), "");
  for (std::uint32_t node = 0; node < topology.size(); ++node) {
    const TopologyNode content = topology.nodes[node];
    Box<double> expected;
    for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
      expected.extend(content.is_leaf() ? to_double(boxes[topology.primitives[k]]) : found[k]);
    ASSERT_EQ(found[node], expected) << "node " << node;
  }
}

TEST(DynamicTree, StaysSoundUnderInsertionsAndRemovals) {
  constexpr std::uint32_t most = 60;
  Random random(3);
  DynamicTree<float> trees[2];
  std::vector<Box<float>> boxes[2];
  std::set<std::uint32_t> inside[2];
  for (int t = 0; t < 2; ++t) {
    trees[t].clear(most);
    boxes[t].resize(most);
  }
  std::vector<NodePair> stack;
  std::size_t met = 0;
  for (int step = 0; step < 3000; ++step) {
    const int t = int(random.below(2));
    const std::uint32_t p = random.below(most);
    ASSERT_EQ(trees[t].contains(p), inside[t].contains(p));
    if (inside[t].contains(p)) {
      trees[t].remove(p);
      inside[t].erase(p);
    } else {
      boxes[t][p] = random_box(random);
      trees[t].insert(p, boxes[t][p]);
      inside[t].insert(p);
      ASSERT_EQ(trees[t].leaf_box(p), boxes[t][p]);
    }
    if (step % 10 != 0) continue;
    expect_sound(trees[t], boxes[t], inside[t]);
    for (const bool within : {false, true}) {
      const int u = within ? 0 : 1;
      std::vector<std::pair<std::uint32_t, std::uint32_t>> expected, found;
      for (const std::uint32_t a : inside[0])
        for (const std::uint32_t b : inside[u])
          if ((!within || a < b) && overlap(boxes[0][a], boxes[u][b])) expected.push_back({a, b});
      std::uint64_t tests = 0;
      DynamicTree<float>::search(trees[0], trees[u], stack, tests, [&](std::uint32_t a, std::uint32_t b) {
        found.push_back(within ? std::pair(std::min(a, b), std::max(a, b)) : std::pair(a, b));
      });
      std::sort(found.begin(), found.end());
      ASSERT_EQ(found, expected) << "step " << step;
      met += found.size();
    }
  }
  EXPECT_GT(met, 500U);
  for (int t = 0; t < 2; ++t) {
    while (!inside[t].empty()) {
      trees[t].remove(*inside[t].begin());
      inside[t].erase(inside[t].begin());
    }
    EXPECT_TRUE(trees[t].empty());
  }
}

enum class Fault : std::uint8_t {
  none,
  stays_in_old_box,  // every fourth primitive that leaves its box keeps it
  lost,              // every eighth removal is not followed by an insertion
  wrong_place,       // a primitive is inserted with its predecessor's box
};

template <class S>
struct Body {
  DynamicTree<S> tree;
  std::size_t bytes() const { return tree.bytes(); }
};

template <class S, Fault fault>
class Simple : public BuiltEachFrame<S, Body<S>> {
  using Base = BuiltEachFrame<S, Body<S>>;

 public:
  Simple(const SceneView<S>& scene, const SampledMotion<S>& motion, const Topologies&, const Params&)
      : Base(scene, motion) {}
  QueryStatus find_candidates(double, PairBuffer& out, const Budget&) override {
    std::uint64_t tests = 0;
    for (const BodyPair& pair : this->scene_.pairs())
      DynamicTree<S>::search(this->bodies_[pair.first].tree, this->bodies_[pair.second].tree, stack_, tests,
                             [&](std::uint32_t a, std::uint32_t b) {
                               out.push_back({pair.first, a, pair.second, b});
                             });
    return {};
  }
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    AuditView view;
    view.topology = this->bodies_[body].tree.topology(view.boxes);
    return view;
  }

 private:
  void start() override {
    for (std::uint32_t body = 0; body < this->bodies_.size(); ++body)
      this->bodies_[body].tree.clear(this->scene_.primitives(body).count());
  }
  void build(std::uint32_t index) override {
    DynamicTree<S>& tree = this->bodies_[index].tree;
    const Primitives& primitives = this->scene_.primitives(index);
    Box<S> before;
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      const Box<S> box = primitive_box(primitives[p], this->sampled_.positions(index));
      if (tree.contains(p)) {
        if (tree.leaf_box(p).contains(box)) continue;
        if (fault == Fault::stays_in_old_box && ++events_ % 4 == 0) continue;
        tree.remove(p);
        if (fault == Fault::lost && ++events_ % 8 == 0) continue;
      }
      tree.insert(p, fault == Fault::wrong_place && p % 16 == 1 ? before : box);
      before = box;
    }
  }
  std::vector<NodePair> stack_;
  std::uint64_t events_ = 0;
};

template <Fault fault>
struct With {
  template <class S>
  using Strategy = Simple<S, fault>;
};

template <Fault fault>
std::string first_violation() {
  Info info;
  info.id = "simple";
  info.tightness = Tightness::conservative;
  info.topology.own = true;
  const StrategyEntry entry = make_entry<With<fault>::template Strategy>(info);
  for (const char* name : {"soups", "sheets"})
    if (std::string found = check(entry, synthetic_scene<float>(name, 7), 7, {}, {}); !found.empty())
      return found;
  return {};
}

TEST(DynamicTreeFaults, AreCaught) {
  EXPECT_EQ(first_violation<Fault::none>(), "");
  EXPECT_NE(first_violation<Fault::stays_in_old_box>(), "");
  EXPECT_NE(first_violation<Fault::lost>(), "");
  EXPECT_NE(first_violation<Fault::wrong_place>(), "");
}

}  // namespace
}  // namespace kbvh::test::dynamic_tree_test
