// The suite can fail for trees whose subtrees move: a refit with as many moves as pay, without a fault and
// with a seeded fault.

#include <gtest/gtest.h>

#include <array>

#include "core/families/restructure/moving_tree.hpp"
#include "core/families/wide/wide_query.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh {

/// Damages a tree.
struct MovingTreeFaults {
  template <class S>
  static std::array<S, 8> own_box(MovingTree<S>& tree, std::uint32_t node) {
    std::array<S, 8> box;
    std::copy_n(tree.own(node), 8, box.begin());
    return box;
  }
  template <class S>
  static void set_box(MovingTree<S>& tree, std::uint32_t node, const std::array<S, 8>& box) {
    if (node == 0 || tree.node(node).count == 0) return;
    std::copy_n(box.begin(), 8, tree.own(node));
    const S sides[6] = {box[0], box[1], box[2], -box[4], -box[5], -box[6]};
    tree.set_lane(tree.parent(node), tree.lane_in_parent(node), sides);
  }
  template <class S>
  static void lose_leaf(MovingTree<S>& tree, std::uint32_t node) {
    tree.remove_leaf(node, 0);
    tree.box_changed(node);
  }
  template <class S>
  static void double_leaf(MovingTree<S>& tree, std::uint32_t node) {
    S box[6];
    tree.read_lane(node, 0, box);
    tree.add_leaf(node, tree.leaf_at_[std::size_t(8) * node], box);
  }
};

namespace test::reinsertion_faults_test {
namespace {

enum class MoveFault : std::uint8_t {
  none,
  box_not_shrunk,      // a node that a child has left keeps its box
  box_not_grown,       // and so does the child's new parent
  lost_leaf,           // taken out, but not inserted
  leaf_at_two_places,  // inserted, but not taken out
};

template <MoveFault fault>
struct Moving {
  template <class S>
  class Strategy : public CountedStrategy<S>, public AnswersSelfPairs {
   public:
    static constexpr Foresight foresight = Foresight::none;
    Strategy(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
             const Params& /*params*/)
        : CountedStrategy<S>(scene, motion), start_(std::move(topologies)), trees_(scene.body_count()) {}
    void reset_to(double /*t*/) override {
      for (std::uint32_t body = 0; body < trees_.size(); ++body) {
        trees_[body].assign(start_[body], this->scene_.primitives(body), active_kernel_set());
        refit(body);
      }
    }
    void advance_to(double /*t*/) override {
      broken_ = false;
      for (std::uint32_t body = 0; body < trees_.size(); ++body) {
        refit(body);
        MovingTree<S>& tree = trees_[body];
        for (std::uint32_t node = 0; node < tree.numbers(); ++node)
          for (std::uint32_t lane = 0; lane < tree.node(node).count && tree.node(node).count > 1; ++lane)
            move(tree, node, lane);
      }
    }
    QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
      std::uint64_t tests = 0;
      for (const BodyPair& pair : this->scene_.pairs())
        query_.run({&trees_[pair.first], pair.first}, {&trees_[pair.second], pair.second}, out, tests);
      return {};
    }
    std::optional<AuditView> audit_view(std::uint32_t body) const override {
      AuditView view;
      view.topology = trees_[body].topology(view.boxes);
      return view;
    }
    std::size_t bytes() const override { return 1; }

   private:
    void refit(std::uint32_t body) {
      trees_[body].positions_changed();
      if (!trees_[body].empty()) trees_[body].refit(this->sampled_.positions(body));
    }
    void move(MovingTree<S>& tree, std::uint32_t node, std::uint32_t lane) {
      const auto found = tree.best_place(node, lane, S(0.06), S(0.01), 100);
      if (!(found.gain > 0) || broken_) return;
      const auto left = MovingTreeFaults::own_box(tree, node);
      const auto entered = MovingTreeFaults::own_box(tree, found.target);
      tree.move(found);
      const WideNode& now = tree.node(node);
      broken_ = fault != MoveFault::none;  // no other move hides it
      if (fault == MoveFault::box_not_shrunk) MovingTreeFaults::set_box(tree, node, left);
      if (fault == MoveFault::box_not_grown) MovingTreeFaults::set_box(tree, found.target, entered);
      if (fault == MoveFault::lost_leaf && now.leaf_count > 2) MovingTreeFaults::lose_leaf(tree, node);
      if (fault == MoveFault::leaf_at_two_places && now.leaf_count > 0 && now.count < 8)
        MovingTreeFaults::double_leaf(tree, node);
    }

    Topologies start_;
    std::vector<MovingTree<S>> trees_;
    WideQuery<S> query_{this->scene_, this->sampled_};
    bool broken_ = false;
  };
};

/// Returns the first violation.
template <class S, MoveFault fault>
std::string violation(const char* scene, std::uint32_t leaf_size) {
  Info info;
  info.id = "moving";
  info.declares = {.restructures = true};
  info.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = leaf_size};
  return check(make_entry<Moving<fault>::template Strategy>(info), synthetic_scene<S>(scene, 7), 7, {},
               info.topology.preferred);
}
template <MoveFault fault>
void expect_caught(const std::string& expected) {
  const std::string in_float = violation<float, fault>("soups", 1),
                    in_double = violation<double, fault>("soups", 1);
  EXPECT_NE(in_float.find(expected), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find(expected), std::string::npos) << "in double: " << in_double;
}

TEST(ReinsertionFaults, SoundMovesPass) {
  for (const char* const scene : {"soups", "sheets", "four_bodies_own_keyframes"})
    for (const std::uint32_t leaf : {1u, 4u}) {
      EXPECT_EQ((violation<float, MoveFault::none>(scene, leaf)), "") << scene;
      EXPECT_EQ((violation<double, MoveFault::none>(scene, leaf)), "") << scene;
    }
}
TEST(ReinsertionFaults, ABoxThatDoesNotShrink) {
  expect_caught<MoveFault::box_not_shrunk>("not tight");
}
TEST(ReinsertionFaults, ABoxThatDoesNotGrow) {
  expect_caught<MoveFault::box_not_grown>("protrudes");
}
TEST(ReinsertionFaults, ALostLeaf) {
  expect_caught<MoveFault::lost_leaf>("leaf");
}
TEST(ReinsertionFaults, ALeafAtTwoPlaces) {
  expect_caught<MoveFault::leaf_at_two_places>("more than once");
}

}  // namespace
}  // namespace test::reinsertion_faults_test
}  // namespace kbvh
