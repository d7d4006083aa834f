#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/families/wide/kernels/wide_linear.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/wide_tree.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"
#include "core/topology/traversal.hpp"

namespace kbvh {

/// One of the two bodies of a query.
template <class S>
struct WideSide {
  WideTree<S>* hierarchy;
  std::uint32_t body;  ///< its id in the pairs found
  /// Positions [vertex][3] of the hierarchy's primitives, readable up to one scalar past the end. Null: those
  /// of the scene's body; the query fetches those that are not current.
  const S* positions = nullptr;
  /// One moment of a segment in which boxes are linear in time: the query computes the boxes that it reads
  /// into the hierarchy. The caller marks all nodes as stale first. Null: the stored boxes are current.
  const WideMoment<S>* moment = nullptr;
  /// For lazy queries: stale[wide node] is not 0 while the boxes of the node's children are not current. The
  /// box of the root must be current.
  const std::uint8_t* stale = nullptr;
};

/// Appends the pairs of primitives whose boxes overlap in the pairs of leaves [begin, end) of a list, in
/// which the leaves of side a are leaves[2 i]; adds the box tests made to `tests`. `positions_a` and
/// `positions_b` are those of the sides, or of the scene. `chunk` is memory that is kept from call to call.
template <class S>
void append_leaf_pairs(const WideSide<S>& a, const S* positions_a, const WideSide<S>& b, const S* positions_b,
                       const LeafSlot* leaves, std::size_t begin, std::size_t end,
                       std::vector<FoundPair>& chunk, PairBuffer& out, std::uint64_t& tests);

/// Queries two wide hierarchies; keeps its buffers from frame to frame.
template <class S>
class WideQuery {
 public:
  using Side = WideSide<S>;

  /// Creates a query of hierarchies over positions that each side provides.
  WideQuery() = default;
  /// Creates a query of the bodies of a scene, at the time of the motion.
  WideQuery(const SceneView<S>& scene, const SampledMotion<S>& motion) : scene_(scene), motion_(motion) {}

  /// Appends the pairs of primitives whose boxes, and those of all nodes above them, overlap. Both
  /// hierarchies need the same width and leaf size; throws std::invalid_argument if they differ. Either both
  /// sides have moments or none has. If both bodies are the same, the hierarchies must be the same, too; the
  /// result is then the pairs within the body, without those that share a vertex unless the sides provide
  /// their own positions. Returns the work that the budget left undone; adds the box tests made to `tests`.
  QueryStatus run(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests,
                  const Budget& budget = {});

  /// Appends the pairs of primitives whose boxes overlap in the given pairs of leaves, in which the leaves of
  /// side a are pairs[2 i]. The boxes of the leaves of side b must be current. Within one body, each two
  /// leaves are given once. Adds the box tests made to `tests`.
  void run_leaves(const Side& a, const Side& b, std::span<const LeafSlot> pairs, PairBuffer& out,
                  std::uint64_t& tests);

  /// Wide nodes whose boxes a lazy query waits for; `none`: it does not wait on that side.
  struct Wanted {
    static constexpr std::uint32_t none = ~std::uint32_t(0);
    std::uint32_t first = none, second = none;
    explicit operator bool() const { return first != none || second != none; }
  };
  /// Starts the same query for stored boxes that are computed at their first use:
  ///   query.start_lazy(a, b, budget);
  ///   while (const auto wanted = query.step(a, b, out, tests))
  ///     compute the boxes of their children, and clear the marks
  /// The query reads no marked box. It costs `run` nothing, because it uses a separate traversal.
  void start_lazy(const Side& a, const Side& b, const Budget& budget);
  Wanted step(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests);
  /// Returns the work that the budget left undone, once `step` waits for nothing.
  QueryStatus lazy_status() const { return {lazy_.depth}; }

  /// Returns the memory of the buffers in bytes.
  std::size_t bytes() const {
    return stack_.capacity() * sizeof(WidePair) +
           (leaf_pairs_.capacity() + own_leaves_.capacity()) * sizeof(LeafSlot) +
           chunk_.capacity() * sizeof(FoundPair) + to_fetch_.capacity() * sizeof(std::uint32_t);
  }

 private:
  /// Returns an empty traversal in this query's buffers.
  WideTraversal fresh_traversal(const Budget& budget);
  void push_roots(const Side& a, const Side& b, WideTraversal& state);
  void grow(WideTraversal& state);
  void traverse(const Side& a, const Side& b, WideTraversal& state) const;
  /// Turns the found pairs of leaves into pairs of primitives.
  void take_leaves(const Side& a, const Side& b, WideTraversal& state, PairBuffer& out, std::uint64_t& tests);
  void take_own_leaves(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests);
  void append_self_pairs(const Side& a, const Side& b, LeavesOf leaves, std::size_t count, PairBuffer& out,
                         std::uint64_t& tests);
  void fetch_leaves(const Side& side, std::size_t which, std::size_t count);
  const S* positions(const Side& side) const {
    return side.positions != nullptr || !motion_ ? side.positions : motion_->positions(side.body);
  }
  void append_pairs(const Side& a, const Side& b, std::size_t begin, std::size_t end, PairBuffer& out,
                    std::uint64_t& tests) {
    append_leaf_pairs(a, positions(a), b, positions(b), leaf_pairs_.data(), begin, end, chunk_, out, tests);
  }

  std::optional<SceneView<S>> scene_;
  std::optional<SampledMotion<S>> motion_;
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  std::vector<LeafSlot> own_leaves_;  ///< found with themselves, and not taken yet
  std::vector<FoundPair> chunk_;
  std::vector<std::uint32_t> to_fetch_;
  WideTraversal lazy_{};
};

/// Checks that both bodies of each queried pair have one layout: throws std::invalid_argument unless, for
/// each pair of bodies, the hierarchies hierarchy_of(body) have the same width and leaf size.
template <class HierarchyOf>
void check_layouts(std::span<const BodyPair> pairs, HierarchyOf&& hierarchy_of) {
  for (const BodyPair& pair : pairs)
    if (!hierarchy_of(pair.first).suits(hierarchy_of(pair.second)))
      throw std::invalid_argument("topologies of all bodies need one width and leaf size");
}

extern template class WideQuery<float>;
extern template class WideQuery<double>;

}  // namespace kbvh
