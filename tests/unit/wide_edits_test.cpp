// The layout of a wide hierarchy whose topology is edited equals a new layout: by boxes, pairs, box tests,
// vertices of leaves, and its topology by the validator.

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "core/families/wide/height_order.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/subtree_swap.hpp"
#include "tests/support/polygon_soups.hpp"

namespace kbvh::test::wide_edits_test {
namespace {

/// A hierarchy of the first body, edited, and one of the second body.
template <class S>
class Edited {
 public:
  Edited(std::uint32_t primitives, const BuilderConfig& config, std::uint64_t seed)
      : random_(seed), scene_(polygon_soups<S>(primitives, random_)) {
    for (std::uint32_t body = 0; body < 2; ++body) {
      const FlightPlans<S>& plans = scene_.bodies[body].plans;
      positions_[body].assign(plans.keyframe(0), plans.keyframe(0) + std::size_t(3) * plans.vertex_count());
      positions_[body].push_back(0);
      hierarchies_[body].assign(build_topology(primitives_of(body), positions_[body].data(), config),
                                primitives_of(body), active_kernel_set());
      hierarchies_[body].refit(positions_[body].data());
    }
    editor_.emplace(topology(), primitives);
  }

  WideHierarchy<S>& hierarchy() { return hierarchies_[0]; }
  const Topology& topology() const { return hierarchies_[0].topology(); }
  const Primitives& primitives_of(std::uint32_t body) const { return scene_.bodies[body].primitives; }
  const S* positions() const { return positions_[0].data(); }
  Random& random() { return random_; }

  std::uint32_t any_node() {
    for (;;) {
      const std::uint32_t node = random_.below(topology().size());
      if (topology().parents[node] < topology().size()) return node;
    }
  }
  bool is_above(std::uint32_t upper, std::uint32_t node) const {
    while (node != upper && node != 0) node = topology().parents[node];
    return node == upper;
  }
  std::size_t leaves_below(std::uint32_t node) const {
    const TopologyNode content = topology().nodes[node];
    if (content.is_leaf()) return 1;
    std::size_t leaves = 0;
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      leaves += leaves_below(c);
    return leaves;
  }

  enum class Op : std::uint8_t { exchange, regrow };
  /// Edits at random nodes; returns false if the edit is not possible there.
  bool edit(Op op) {
    const std::uint32_t a = any_node(), b = any_node();
    if (op == Op::regrow) {
      if (topology().nodes[a].is_leaf() || leaves_below(a) > 60) return false;
      hierarchy().edit([&](Topology& topology, TopologyEdit& edit) {
        editor_->rebalance(topology, a, edit, [&](std::uint32_t n) { return to_double(hierarchy().box(n)); });
      });
      return true;
    }
    if (is_above(a, b) || is_above(b, a)) return false;
    hierarchy().edit([&](Topology& topology, TopologyEdit& edit) { swap_.exchange(topology, a, b, edit); });
    for (const std::uint32_t node : {a, b})
      if (topology().nodes[node].is_leaf()) editor_->placed(topology(), node);
    return true;
  }
  void refit_edited() { hierarchy().refit_edited(positions()); }
  void move_vertices() {
    for (S& x : positions_[0]) x += S(random_.unit() / 16);
    hierarchy().positions_changed();
    hierarchy().refit(positions());
  }

  /// Returns the first difference from a new layout, or nothing.
  std::string fault() {
    std::vector<std::uint32_t> nodes;
    const Topology topology = hierarchy().built_topology(nodes);
    if (const std::string broken = check_topology(topology, primitives_of(0)); !broken.empty()) return broken;
    WideHierarchy<S> fresh;
    fresh.assign(topology, primitives_of(0), active_kernel_set());
    fresh.refit(positions());
    for (std::uint32_t i = topology.size(); i-- > 0;) {
      const std::string where = "node " + std::to_string(nodes[i]) + ": ";
      if (!(hierarchy().box(nodes[i]) == fresh.box(i))) return where + "another box";
      const auto ours = hierarchy().leaf_vertices(nodes[i]), theirs = fresh.leaf_vertices(i);
      if (!std::equal(ours.begin(), ours.end(), theirs.begin(), theirs.end()))
        return where + "other vertices";
      const std::uint32_t wide = hierarchy().wide_node(nodes[i]), fresh_wide = fresh.wide_node(i);
      if ((wide == hierarchy().no_node) != (fresh_wide == fresh.no_node)) return where + "another kind";
      if (wide != hierarchy().no_node &&
          hierarchy().leaf_vertices_of(wide) != fresh.leaf_vertices_of(fresh_wide))
        return where + "another number of vertices";
      if (wide != hierarchy().no_node && hierarchy().arrays().nodes[wide].leaf_count != 0 &&
          hierarchy().arrays().nodes[wide].length != fresh.arrays().nodes[fresh_wide].length)
        return where + "lists of another length";
    }
    if (pairs(hierarchy(), 1) != pairs(fresh, 1)) return "other pairs";
    if (pairs(hierarchy(), 0) != pairs(fresh, 0)) return "other pairs within the body";
    std::vector<S> rows(hierarchy().node_count() * lane_scalars(topology.width));
    std::vector<S> bounds(std::size_t(8) * hierarchy().node_count());
    hierarchy().refit_into(rows.data(), bounds.data(), positions());
    for (std::uint32_t i = 0; i < topology.size(); ++i)
      if (!(hierarchy().box_in(rows.data(), bounds.data(), nodes[i]) == fresh.box(i)))
        return "node " + std::to_string(nodes[i]) + ": another box by refit_into";
    return {};
  }

 private:
  /// Returns the pairs of a hierarchy of the first body with a body; for two bodies, the number of box tests
  /// last.
  PairBuffer pairs(WideHierarchy<S>& hierarchy, std::uint32_t other) {
    PairBuffer found;
    std::uint64_t tests = 0;
    query_.run({&hierarchy, 0, positions()},
               {other == 0 ? &hierarchy : &hierarchies_[1], other, positions_[other].data()}, found, tests);
    for (PrimitivePair& pair : found)
      if (other == 0 && pair.primitive_b < pair.primitive_a) std::swap(pair.primitive_a, pair.primitive_b);
    std::sort(found.begin(), found.end());
    if (other != 0) found.push_back({std::uint32_t(tests), 0, 0, 0});
    return found;
  }

  Random random_;
  Scene<S> scene_;
  WideHierarchy<S> hierarchies_[2];
  std::vector<S> positions_[2];
  std::optional<TopologyEditor> editor_;
  SubtreeSwap swap_;
  WideQuery<S> query_;
};

template <class S>
void edit_at_random(const BuilderConfig& config, const std::vector<typename Edited<S>::Op>& ops) {
  Edited<S> edited(250, config, config.width + 31 * config.leaf_size);
  std::size_t made = 0;
  for (int i = 0; i < 4000 && made < 600; ++i) {
    if (!edited.edit(ops[edited.random().below(std::uint32_t(ops.size()))])) continue;
    ++made;
    if (made % 7 == 0)
      edited.move_vertices();
    else
      edited.refit_edited();
    if (made % 12 == 0 || made < 12) {
      ASSERT_EQ(edited.fault(), "") << name(config.method) << ", width " << config.width << ", leaf "
                                    << config.leaf_size << ", edit " << made;
    }
  }
  EXPECT_GT(made, 300u);
  // At most, the arrays have as many unused places as there are different numbers of children.
  EXPECT_LT(edited.hierarchy().node_count(), 250u * 4);
  edited.hierarchy().undo_edits(edited.primitives_of(0));
  edited.hierarchy().refit(edited.positions());
  EXPECT_FALSE(edited.hierarchy().edited());
  EXPECT_EQ(check_topology(edited.topology(), 250u), "");
  EXPECT_EQ(edited.fault(), "");
}

class WideEdits : public testing::TestWithParam<std::tuple<BuildMethod, std::uint32_t, std::uint32_t>> {
 protected:
  BuilderConfig config() const {
    return {.method = std::get<0>(GetParam()),
            .width = std::get<1>(GetParam()),
            .leaf_size = std::get<2>(GetParam())};
  }
};

TEST_P(WideEdits, EqualARemadeLayoutInFloat) {
  using Op = Edited<float>::Op;
  edit_at_random<float>(config(), {Op::exchange});
  edit_at_random<float>(config(), {Op::exchange, Op::regrow});
}
TEST_P(WideEdits, EqualARemadeLayoutInDouble) {
  using Op = Edited<double>::Op;
  edit_at_random<double>(config(), {Op::exchange});
  edit_at_random<double>(config(), {Op::regrow});
}

INSTANTIATE_TEST_SUITE_P(Shapes, WideEdits,
                         testing::Combine(testing::Values(BuildMethod::median, BuildMethod::sah),
                                          testing::Values(2u, 4u, 8u), testing::Values(1u, 4u)),
                         [](const auto& test) {
                           return std::string(name(std::get<0>(test.param))) + "_width" +
                                  std::to_string(std::get<1>(test.param)) + "_leaf" +
                                  std::to_string(std::get<2>(test.param));
                         });

// Every kind of fault is detected: an edit that does not list its changes, boxes that are not recomputed.
TEST(WideEditsOnce, FaultsAreSeen) {
  const BuilderConfig config{.method = BuildMethod::sah, .width = 8, .leaf_size = 4};
  std::size_t unlisted = 0, unfitted = 0, tries = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Edited<float> edited(250, config, seed);
    ASSERT_EQ(edited.fault(), "");
    while (!edited.edit(Edited<float>::Op::exchange)) {
    }
    unfitted += edited.fault().empty() ? 0 : 1;
    edited.refit_edited();
    ASSERT_EQ(edited.fault(), "");
    std::uint32_t a = 0, b = 0;
    while (edited.is_above(a, b) || edited.is_above(b, a) ||
           edited.topology().parents[a] == edited.topology().parents[b]) {
      a = edited.any_node();
      b = edited.any_node();
    }
    SubtreeSwap swap;
    edited.hierarchy().edit([&](Topology& topology, TopologyEdit& edit) {
      swap.exchange(topology, a, b, edit);
      edit.clear();
    });
    edited.hierarchy().refit(edited.positions());
    unlisted += edited.fault().empty() ? 0 : 1;
    ++tries;
  }
  EXPECT_EQ(unlisted, tries);
  EXPECT_GT(unfitted, tries / 2);
}

// Where numbers of children recur, the arrays stop growing.
TEST(WideEditsOnce, PlacesAreTakenAgain) {
  using Op = Edited<float>::Op;
  Edited<float> edited(250, {.method = BuildMethod::sah, .width = 8, .leaf_size = 1}, 5);
  std::size_t half = 0;
  for (int i = 0; i < 40'000; ++i) {
    edited.edit(Op::exchange);
    if (i == 20'000) half = edited.hierarchy().bytes();
  }
  edited.hierarchy().refit(edited.positions());
  EXPECT_EQ(edited.fault(), "");
  EXPECT_LE(edited.hierarchy().bytes(), half + half / 10);
}

TEST(HeightOrder, ListsChildrenBeforeParents) {
  Random random(3);
  HeightOrder order;
  const std::vector<WideNode> none;
  order.assign(none);
  order.resize(100);
  std::vector<std::uint32_t> present;
  for (int i = 0; i < 5000; ++i) {
    const std::uint32_t node = random.below(100);
    const auto at = std::find(present.begin(), present.end(), node);
    if (at == present.end()) {
      order.insert(node);
      present.push_back(node);
    } else if (random.below(4) == 0) {
      order.remove(node);
      present.erase(at);
    } else {
      order.set_height(node, random.below(12));
    }
    ASSERT_EQ(order.nodes().size(), present.size());
    for (std::size_t k = 0; k < order.nodes().size(); ++k) {
      ASSERT_EQ(order.rank(order.nodes()[k]), k);
      ASSERT_TRUE(k == 0 || order.height(order.nodes()[k - 1]) <= order.height(order.nodes()[k]));
    }
  }
}

}  // namespace
}  // namespace kbvh::test::wide_edits_test
