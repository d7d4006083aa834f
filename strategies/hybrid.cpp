// Half bottom-up, half top-down (van den Bergen 1998, Larsson & Akenine-Moeller 2001). At every frame the
// upper levels are refitted, from boxes that the subtrees below compute directly from their vertices, in one
// pass over memory. Deeper boxes are computed when a query visits them, and not at all where no query comes.

#include <algorithm>

#include "core/contract/registry.hpp"
#include "core/families/wide/kernels/bounds.hpp"
#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

/// How a subtree is updated when a query enters it.
enum class Below : std::uint8_t {
  subtree,   ///< refitted as a whole, bottom-up
  top_down,  ///< one node at a time, each child's box from all vertices below it
};

/// Lists of T, one for each wide node, in one array.
template <class T>
struct Lists {
  std::vector<std::uint32_t> first{0};
  std::vector<T> entries;
  void close() { first.push_back(std::uint32_t(entries.size())); }
  std::span<const T> operator[](std::uint32_t i) const {
    return {entries.data() + first[i], entries.data() + first[i + 1]};
  }
  std::size_t bytes() const { return first.size() * sizeof(std::uint32_t) + entries.size() * sizeof(T); }
};

struct NodeRange {
  std::uint32_t begin, end;
};

/// The schedule of one body's boxes. Indices are those of wide nodes, which come before their children.
template <class S>
struct LazyBody {
  std::vector<std::uint32_t> level;    // of each node; the root's is 0
  std::vector<std::uint32_t> roots;    // roots of the subtrees that wait for a query
  std::vector<std::uint32_t> above;    // all nodes above them, children first
  std::vector<std::uint32_t> root_of;  // of each node at or below the cut
  Lists<VertexRun> vertices;           // unique vertices below a node whose box is computed from them
  std::vector<std::uint32_t> reads;    // number of these vertices
  Lists<NodeRange> below;              // of each root: its descendants, children first
  std::vector<std::uint32_t> boxes_below, reads_below;  // of each root: cost of refitting it with `below`
  std::vector<std::uint8_t> stale;                      // 1: the boxes of the node's children are not current
  std::uint64_t boxes_above = 0, reads_above = 0;       // cost of refitting `above`
};

template <class S>
class Hybrid final : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  Hybrid(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
         const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        below_(params.word("below") == "subtree" ? Below::subtree : Below::top_down),
        levels_(params.word("levels")) {
    bodies_.resize(scene.body_count());
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) prepare(body);
  }

  void reset_to(double t) override {
    Base::reset_to(t);
    for (auto& body : bodies_) std::fill(body.stale.begin(), body.stale.end(), 0);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    std::uint64_t tests = 0;
    const auto side_of = [&](std::uint32_t body) { return lazy_side(body); };
    const auto make = [&](std::uint32_t body, std::uint32_t node) { make_current(body, node); };
    const QueryStatus status = query_lazily(this->query_, this->near_bodies_, this->scene_.pairs(), budget,
                                            side_of, make, out, tests);
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    auto view = Base::audit_view(body);
    const LazyBody<S>& lazy = bodies_[body];
    const auto& hierarchy = this->hierarchies_[body];
    for (std::uint32_t node = 0; node < view->topology.size(); ++node) {
      const std::uint32_t parent = hierarchy.wide_parent(node);
      view->stale.push_back(parent != hierarchy.no_node && is_stale(lazy, parent) ? 1 : 0);
    }
    return view;
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes();
    for (const auto& body : bodies_)
      total += (body.level.size() + body.roots.size() + body.above.size() + body.root_of.size() +
                body.reads.size() + body.boxes_below.size() + body.reads_below.size()) *
                   sizeof(std::uint32_t) +
               body.vertices.bytes() + body.below.bytes() + body.stale.size();
    return total;
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);

  WideSide<S> lazy_side(std::uint32_t body) {
    return {.hierarchy = &this->hierarchies_[body], .body = body, .stale = bodies_[body].stale.data()};
  }
  WideSide<S> ray_side(std::uint32_t body) override { return lazy_side(body); }
  void make_row(std::uint32_t body, std::uint32_t node) override { make_current(body, node); }
  bool is_stale(const LazyBody<S>& lazy, std::uint32_t node) const {
    if (lazy.root_of[node] == none) return false;
    return lazy.stale[below_ == Below::subtree ? lazy.root_of[node] : node] != 0;
  }
  static std::uint32_t inner_count(const WideNode& node) { return node.count - node.leaf_count; }

  void prepare(std::uint32_t index) {
    auto& hierarchy = this->hierarchies_[index];
    LazyBody<S>& body = bodies_[index];
    const std::uint32_t nodes = hierarchy.node_count();
    const WideArrays<S> arrays = hierarchy.arrays();
    body.level.assign(nodes, 0);
    body.root_of.assign(nodes, none);
    body.stale.assign(nodes, 0);
    body.reads.assign(nodes, 0);
    std::uint32_t deepest = 0;
    for (std::uint32_t n = 0; n < nodes; ++n) {
      const WideNode& node = arrays.nodes[n];
      for (std::uint32_t c = 0; c < inner_count(node); ++c)
        body.level[node.first_child + c] = body.level[n] + 1;
      deepest = std::max(deepest, body.level[n]);
    }
    // Half of the levels, leaves included.
    const std::uint32_t cut = levels_ == "auto" ? (deepest + 2) / 2 : std::uint32_t(std::stoul(levels_));
    // If the root is a leaf, its box is in the only node's row.
    const bool leaf_only = !hierarchy.empty() && hierarchy.topology().nodes[0].is_leaf();
    for (std::uint32_t n = 0; n < nodes && !leaf_only; ++n) {
      const WideNode& node = arrays.nodes[n];
      if (body.level[n] == cut) {
        body.roots.push_back(n);
        body.root_of[n] = n;
      }
      for (std::uint32_t c = 0; c < inner_count(node); ++c)
        body.root_of[node.first_child + c] = body.root_of[n];
    }
    for (std::uint32_t n = nodes; n-- > 0;)
      if (body.level[n] < cut || leaf_only) {
        body.above.push_back(n);
        body.boxes_above += arrays.nodes[n].count;
        body.reads_above += hierarchy.leaf_vertices_of(n);
      }
    list_vertices(index);
    list_descendants(body, nodes);
    body.boxes_below.assign(nodes, 0);
    body.reads_below.assign(nodes, 0);
    for (std::uint32_t n = 0; n < nodes; ++n) {
      const std::uint32_t root = body.root_of[n];
      if (root == none) continue;
      body.boxes_below[root] += arrays.nodes[n].count;
      body.reads_below[root] += hierarchy.leaf_vertices_of(n);
    }
  }

  /// Lists the vertices below each node whose box is computed from them, as runs of consecutive ones.
  void list_vertices(std::uint32_t index) {
    auto& hierarchy = this->hierarchies_[index];
    LazyBody<S>& body = bodies_[index];
    const Topology& topology = hierarchy.topology();
    // The topology's leaves below each wide node are contiguous, because they are laid out left to right.
    std::vector<NodeRange> range(topology.size());
    std::vector<std::uint32_t> source(hierarchy.node_count(), none);
    for (std::uint32_t i = topology.size(); i-- > 0;) {
      const TopologyNode node = topology.nodes[i];
      range[i] = node.is_leaf()
                     ? NodeRange{node.first(), node.first() + node.count()}
                     : NodeRange{range[node.first()].begin, range[node.first() + node.count() - 1].end};
      if (!node.is_leaf()) source[hierarchy.wide_node(i)] = i;
    }
    std::vector<std::uint32_t> unique;
    const Primitives& primitives = this->scene_.primitives(index);
    for (std::uint32_t n = 0; n < hierarchy.node_count(); ++n) {
      const bool from_vertices =
          body.root_of[n] == n || (body.root_of[n] != none && below_ == Below::top_down);
      if (from_vertices) {
        unique.clear();
        for (std::uint32_t k = range[source[n]].begin; k < range[source[n]].end; ++k)
          for (const std::uint32_t v : primitives[topology.primitives[k]]) unique.push_back(v);
        std::sort(unique.begin(), unique.end());
        unique.erase(std::unique(unique.begin(), unique.end()), unique.end());
        body.reads[n] = std::uint32_t(unique.size());
        const std::size_t first = body.vertices.entries.size();
        for (const std::uint32_t v : unique) {
          auto& runs = body.vertices.entries;
          if (runs.size() > first && runs.back().first + runs.back().count == v)
            ++runs.back().count;
          else
            runs.push_back({v, 1});
        }
      }
      body.vertices.close();
    }
  }

  static void list_descendants(LazyBody<S>& body, std::uint32_t nodes) {
    std::vector<std::vector<NodeRange>> of(nodes);
    for (std::uint32_t n = nodes; n-- > 0;) {
      const std::uint32_t root = body.root_of[n];
      if (root == none || root == n) continue;
      if (!of[root].empty() && of[root].back().begin == n + 1)
        of[root].back().begin = n;
      else
        of[root].push_back({n, n + 1});
    }
    for (const auto& ranges : of) {
      body.below.entries.insert(body.below.entries.end(), ranges.begin(), ranges.end());
      body.below.close();
    }
  }

  void box_from_vertices(std::uint32_t index, std::uint32_t node) {
    const auto runs = bodies_[index].vertices[node];
    auto& hierarchy = this->hierarchies_[index];
    bounds_kernels<S>(hierarchy.kernels())
        .of_runs(runs.data(), runs.size(), this->sampled_.positions(index),
                 hierarchy.arrays().node_bounds + std::size_t(8) * node);
    this->count_.add(Counter::vertex_reads, bodies_[index].reads[node]);
  }

  void update(std::uint32_t index) override {
    auto& hierarchy = this->hierarchies_[index];
    if (hierarchy.empty()) return;
    LazyBody<S>& body = bodies_[index];
    for (const std::uint32_t root : body.roots) box_from_vertices(index, root);
    for (const std::uint32_t node : body.above)
      hierarchy.refit_nodes(this->sampled_.positions(index), node, node + 1);
    if (below_ == Below::subtree)
      for (const std::uint32_t root : body.roots) body.stale[root] = 1;
    else
      for (std::uint32_t n = 0; n < body.stale.size(); ++n) body.stale[n] = body.root_of[n] != none;
    count_boxes(this->count_, body.boxes_above + 1, body.reads_above);
  }

  /// Computes the boxes of a node's children; with `Below::subtree`, of everything below them, too.
  void make_current(std::uint32_t index, std::uint32_t node) {
    auto& hierarchy = this->hierarchies_[index];
    LazyBody<S>& body = bodies_[index];
    const S* positions = this->sampled_.positions(index);
    const WideArrays<S> arrays = hierarchy.arrays();
    std::uint64_t boxes = arrays.nodes[node].count, reads = hierarchy.leaf_vertices_of(node);
    if (below_ == Below::subtree) {
      for (const NodeRange range : body.below[node]) hierarchy.refit_nodes(positions, range.begin, range.end);
      boxes = body.boxes_below[node];
      reads = body.reads_below[node];
    } else {
      const WideNode& wide = arrays.nodes[node];
      for (std::uint32_t c = 0; c < inner_count(wide); ++c) box_from_vertices(index, wide.first_child + c);
    }
    hierarchy.refit_nodes(positions, node, node + 1);
    body.stale[node] = 0;
    count_boxes(this->count_, boxes, reads);
  }

  Below below_;
  std::string levels_;
  std::vector<LazyBody<S>> bodies_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(hybrid) {
  using namespace kbvh;
  return {make_entry<Hybrid>({
      .id = "hybrid",
      .title = "hybrid refit",
      .family = "refit",
      .citation = "van den Bergen 1998; Larsson & Akenine-Möller 2001",
      .baseline = true,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"levels",
                      "auto",
                      {"auto", "0", "1", "2", "3", "4", "6", "8", "12", "16"},
                      "levels refitted at every frame, counted from the root; auto: half of all levels"},
                     {"below",
                      "subtree",
                      {"subtree", "top_down"},
                      "work of a query that enters a subtree below them: refit it all, bottom-up, or one "
                      "node at a time, from all vertices below"}},
  })};
}
