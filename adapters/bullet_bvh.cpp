// Bullet's quantised hierarchy of a triangle mesh (Coumans) as a contestant: btOptimizedBvh, updated by
// refit().
//
// - The hierarchy is always quantised: without quantisation refit() silently does nothing.
// - refit() enlarges the quantised bounds by 1.0, whatever the unit of the scene. A mesh of a few centimetres
//   is then a handful of cells wide, and thousands of its pairs are false. By default the adapter therefore
//   sets the mesh's own scaling (setScaling) to a power of two, which rounds nothing, so that the scene is
//   32768 to 65536 units wide. `scale=none` shows Bullet without scaling.
// - All bodies share one grid, so that cells of different bodies can be compared. Quantisation is monotone,
//   lower bounds go to even cells and upper bounds to odd cells, so the cells of touching boxes overlap: no
//   pair is lost. The grid extends 1/8 beyond the scene. The adapter lays out a new grid for all bodies when
//   the scene leaves the old one or shrinks to a quarter of it. Finding the scene's bounds is part of the
//   update.
// - Bullet's own query is a box against a tree (reportAabbOverlappingNodex). `query=primitives` asks it for
//   each primitive of the smaller body. Bullet's walk of two trees is not public. The default `query=trees`
//   therefore descends both of Bullet's arrays of nodes here, which is faster; the overlap test is Bullet's.
// - A cell's size is a share of the scene's, so it takes more than 20 times the box tests of `bottom_up`
//   where one vertex or triangle is far larger than everything else: the rest lies in a few cells.
// - Bullet stores a primitive's index in 21 bits.
// - The adapter passes a primitive of more than three vertices as the triangle (lower, upper, first vertex),
//   which has the polygon's box.
#include "bullet.hpp"

#include <BulletCollision/CollisionShapes/btOptimizedBvh.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <LinearMath/btAabbUtil2.h>

#include <Eigen/Core>
#include <cmath>
#include <type_traits>

#include "core/geometry/lane_box.hpp"

namespace kbvh::bullet {
namespace {

/// Collects the primitives in a quantised tree that overlap one box.
class BoxHits final : public btNodeOverlapCallback {
 public:
  PrimitivePair pair{};
  bool tree_is_first = false;
  PairBuffer* out = nullptr;

  void processNode(int /*part*/, int primitive) override {
    (tree_is_first ? pair.primitive_a : pair.primitive_b) = std::uint32_t(primitive);
    out->push_back(pair);
  }
};

template <class S>
class BulletBvh final : public Contestant {
  static_assert(std::is_same_v<S, float>);

 public:
  BulletBvh(const SceneView<float>& scene, const SampledMotion<float>& motion, Topologies /*none*/,
            const Params& params)
      : Contestant(scene, motion),
        scaled_(params.word("scale") == "fit"),
        trees_(params.word("query") == "trees"),
        bodies_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) make_mesh(body);
    lay_grid();
    for (BodyState& state : bodies_) {
      if (!state.mesh) continue;
      state.mesh->setScaling(btVector3(scale_, scale_, scale_));
      state.bvh = std::make_unique<btOptimizedBvh>();
      state.bvh->build(state.mesh.get(), true, grid_lower(), grid_upper());
    }
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    std::uint64_t tests = 0;
    // Returns the box of a body's vertices, rounded to cells like in both queries, so that every overlap
    // there is one here.
    const auto box_of = [&](std::uint32_t body) { return root_box(bodies_[body]); };
    for (const std::uint32_t i : this->near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (!bodies_[pair.first].bvh || !bodies_[pair.second].bvh) continue;
      if (trees_)
        descend(pair, out);
      else
        ask_for_each_primitive(pair, out);
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  /// The box of a node covers everything that the query cannot distinguish by its cells.
  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    const BodyState& state = bodies_[body];
    if (!state.bvh) return AuditView{};
    const btQuantizedBvhNode* nodes = &state.bvh->getQuantizedNodeArray()[0];
    const Grid grid(*state.bvh, scale_);
    return breadth_first(
        nodes,
        [](const btQuantizedBvhNode* node) { return node->isLeafNode() ? node->getTriangleIndex() : -1; },
        [](const btQuantizedBvhNode* node) {
          return std::pair{node + 1, right_child(node)};
        },
        [&](const btQuantizedBvhNode* node) { return grid.box(*node); });
  }

  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const BodyState& state : bodies_) {
      if (!state.bvh) continue;
      total += sizeof(btOptimizedBvh) + std::size_t(state.bvh->getQuantizedNodeArray().capacity()) * 16 +
               std::size_t(state.bvh->getSubtreeInfoArray().capacity()) * sizeof(btBvhSubtreeInfo) +
               state.indices.size() * sizeof(int) + state.vertices.size() * sizeof(float) +
               state.polygons.size() * sizeof(std::uint32_t);
    }
    return total;
  }

 private:
  struct BodyState {
    std::vector<int> indices;             // 3 per primitive
    std::vector<std::uint32_t> polygons;  // primitives of more than 3 vertices
    std::vector<float> vertices;  // the body's, then lower and upper corner of each polygon; empty: no copy
    std::unique_ptr<btTriangleIndexVertexArray> mesh;
    std::unique_ptr<btOptimizedBvh> bvh;  // none for a body without primitives
    Box<float> box;
  };

  /// The quantisation of a tree, determined by querying it: cell = (x - origin) * cells_per_unit, in scaled
  /// units.
  class Grid {
   public:
    Grid(const btOptimizedBvh& bvh, double scale) : scale_(scale) {
      const unsigned short zero[3] = {0, 0, 0};
      const btVector3 origin = bvh.unQuantize(zero);
      // Gives read access to the protected quantisation by deriving from the tree.
      struct Reader : btOptimizedBvh {
        static btVector3 of(const btOptimizedBvh& tree) { return tree.*(&Reader::m_bvhQuantization); }
      };
      const btVector3 cells = Reader::of(bvh);
      for (int axis = 0; axis < 3; ++axis) {
        origin_[axis] = double(origin[axis]);
        cells_[axis] = double(cells[axis]);
      }
    }
    Box<double> box(const btQuantizedBvhNode& node) const {
      Box<double> box;
      for (int axis = 0; axis < 3; ++axis) {
        // A cell's coordinate results from two roundings in float: errors of up to 65535 * 2^-23 of a cell.
        box.lower[axis] = (origin_[axis] + (node.m_quantizedAabbMin[axis] - .01) / cells_[axis]) / scale_;
        box.upper[axis] = (origin_[axis] + (node.m_quantizedAabbMax[axis] + .01) / cells_[axis]) / scale_;
      }
      return box;
    }

   private:
    double origin_[3], cells_[3], scale_;
  };

  static const btQuantizedBvhNode* right_child(const btQuantizedBvhNode* node) {
    const btQuantizedBvhNode* left = node + 1;
    return left + (left->isLeafNode() ? 1 : left->getEscapeIndex());
  }
  static Box<double> root_box(const BodyState& state) {
    return state.bvh ? to_double(state.box) : Box<double>{};
  }
  static bool cells_overlap(const btQuantizedBvhNode& a, const btQuantizedBvhNode& b) {
    return testQuantizedAabbAgainstQuantizedAabb(a.m_quantizedAabbMin, a.m_quantizedAabbMax,
                                                 b.m_quantizedAabbMin, b.m_quantizedAabbMax) != 0;
  }

  void make_mesh(std::uint32_t body) {
    const Primitives& primitives = this->scene_.primitives(body);
    if (primitives.count() == 0) return;
    if (primitives.count() >= (1u << 21))
      throw ConfigError("bullet_bvh takes fewer than 2097152 primitives in a body; body " +
                        std::to_string(body) + " has " + std::to_string(primitives.count()));
    BodyState& state = bodies_[body];
    int next = int(this->scene_.vertex_count(body));
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      const auto v = primitives[p];
      if (v.size() <= 3) {
        state.indices.insert(state.indices.end(), {int(v[0]), int(v[v.size() / 2]), int(v.back())});
      } else {
        state.indices.insert(state.indices.end(), {next, next + 1, int(v[0])});
        state.polygons.push_back(p);
        next += 2;
      }
    }
    if (!state.polygons.empty()) state.vertices.resize(std::size_t(3) * std::size_t(next));
    btIndexedMesh mesh;
    mesh.m_numTriangles = int(primitives.count());
    mesh.m_triangleIndexBase = reinterpret_cast<const unsigned char*>(state.indices.data());
    mesh.m_triangleIndexStride = 3 * sizeof(int);
    mesh.m_numVertices = next;
    mesh.m_vertexStride = 3 * sizeof(float);
    mesh.m_vertexType = PHY_FLOAT;
    state.mesh = std::make_unique<btTriangleIndexVertexArray>();
    state.mesh->addIndexedMesh(mesh, PHY_INTEGER);
    read_vertices(body);
  }

  /// Passes the current vertices to Bullet, and finds their box.
  void read_vertices(std::uint32_t body) {
    BodyState& state = bodies_[body];
    const float* positions = this->sampled_.positions(body);
    const std::size_t count = this->scene_.vertex_count(body);
    using Lanes = Eigen::Array4f;
    Lanes lower = Eigen::Map<const Lanes>(positions), upper = lower;
    for (std::size_t v = 1; v < count; ++v) {
      const Lanes p = Eigen::Map<const Lanes>(positions + 3 * v);
      lower = lower.min(p);
      upper = upper.max(p);
    }
    std::copy_n(lower.data(), 3, state.box.lower);
    std::copy_n(upper.data(), 3, state.box.upper);
    const float* shown = positions;
    if (!state.polygons.empty()) {
      float* next = std::copy_n(positions, 3 * count, state.vertices.data());
      for (std::uint32_t polygon : state.polygons) {
        const Box<float> box = primitive_box(this->scene_.primitives(body)[polygon], positions);
        next = std::copy_n(box.lower, 3, next);
        next = std::copy_n(box.upper, 3, next);
      }
      shown = state.vertices.data();
    }
    state.mesh->getIndexedMeshArray()[0].m_vertexBase = reinterpret_cast<const unsigned char*>(shown);
  }

  void update_all() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (bodies_[body].mesh) read_vertices(body);
    lay_grid();
    for (BodyState& state : bodies_) refit(state);
  }

  void update_moving() override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->moves_[body] && bodies_[body].mesh) read_vertices(body);
    if (!grid_fits()) {
      lay_grid();
      for (BodyState& state : bodies_) refit(state);
      return;
    }
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (this->moves_[body]) refit(bodies_[body]);
  }

  void refit(BodyState& state) {
    if (!state.mesh) return;
    state.mesh->setScaling(btVector3(scale_, scale_, scale_));
    state.bvh->refit(state.mesh.get(), grid_lower(), grid_upper());
    this->count_refit(state.indices.size() / 3);
  }

  Box<float> scene_box() const {
    Box<float> box;
    for (const BodyState& state : bodies_) box.extend(state.box);
    return box;
  }
  static double extent(const Box<float>& box) {
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis)
      largest = std::max(largest, double(box.upper[axis]) - double(box.lower[axis]));
    return largest;
  }

  bool grid_fits() const {
    const Box<float> box = scene_box();
    return box.empty() || (grid_.contains(box) && (extent(box) >= .25 * laid_extent_));
  }

  void lay_grid() {
    const Box<float> box = scene_box();
    if (box.empty()) return;
    laid_extent_ = extent(box);
    double largest = 0, furthest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = box.lower[axis], upper = box.upper[axis];
      furthest = std::max({furthest, std::abs(lower), std::abs(upper)});
      // Never flat, and never below the resolution of float at this distance from the origin.
      const double slack = (upper - lower) / 8 + laid_extent_ / 1024 +
                           std::max(std::abs(lower), std::abs(upper)) * 0x1p-20 +
                           std::numeric_limits<float>::min();
      grid_.lower[axis] = float(lower - slack);
      grid_.upper[axis] = float(upper + slack);
      largest = std::max(largest, upper - lower + 2 * slack);
    }
    if (!scaled_) return;
    // Bullet initialises its boxes with 1e18, so no coordinate may come near that value, and the scale itself
    // must be a float.
    const int wanted = 15 - std::ilogb(largest), limit = 57 - std::ilogb(std::max(furthest, largest));
    scale_ = std::ldexp(1.f, std::clamp(std::min(wanted, limit), -120, 120));
  }
  btVector3 grid_lower() const { return vector(grid_.lower) * scale_; }
  btVector3 grid_upper() const { return vector(grid_.upper) * scale_; }

  void descend(const BodyPair& pair, PairBuffer& out) {
    const btQuantizedBvhNode* a = &bodies_[pair.first].bvh->getQuantizedNodeArray()[0];
    const btQuantizedBvhNode* b = &bodies_[pair.second].bvh->getQuantizedNodeArray()[0];
    std::uint64_t tests = 1;
    stack_.clear();
    if (cells_overlap(*a, *b)) stack_.push_back({a, b});
    while (!stack_.empty()) {
      const auto [x, y] = stack_.back();
      stack_.pop_back();
      const bool leaf_x = x->isLeafNode(), leaf_y = y->isLeafNode();
      if (leaf_x && leaf_y) {
        out.push_back({pair.first, std::uint32_t(x->getTriangleIndex()), pair.second,
                       std::uint32_t(y->getTriangleIndex())});
        continue;
      }
      const btQuantizedBvhNode* xs[2] = {leaf_x ? x : x + 1, leaf_x ? nullptr : right_child(x)};
      const btQuantizedBvhNode* ys[2] = {leaf_y ? y : y + 1, leaf_y ? nullptr : right_child(y)};
      for (int i = 0; i < 2 - leaf_x; ++i)
        for (int j = 0; j < 2 - leaf_y; ++j)
          if (cells_overlap(*xs[i], *ys[j])) stack_.push_back({xs[i], ys[j]});
      tests += std::uint64_t(2 - leaf_x) * std::uint64_t(2 - leaf_y);
    }
    this->count_.add(Counter::box_tests, tests);
  }

  void ask_for_each_primitive(const BodyPair& pair, PairBuffer& out) {
    const bool tree_is_first =
        this->scene_.primitives(pair.first).count() > this->scene_.primitives(pair.second).count();
    const std::uint32_t asker = tree_is_first ? pair.second : pair.first;
    const BodyState& tree = bodies_[tree_is_first ? pair.first : pair.second];
    const Primitives& primitives = this->scene_.primitives(asker);
    const float* positions = this->sampled_.positions(asker);
    hits_.out = &out;
    hits_.tree_is_first = tree_is_first;
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      const Box<float> box = primitive_box(primitives[p], positions);
      if (!overlap(box, tree.box)) continue;
      hits_.pair = {pair.first, p, pair.second, p};
      tree.bvh->reportAabbOverlappingNodex(&hits_, vector(box.lower) * scale_, vector(box.upper) * scale_);
    }
  }

  bool scaled_, trees_;
  float scale_ = 1;
  Box<float> grid_;         // in scene units
  double laid_extent_ = 0;  // of the scene, at the time of the last grid
  std::vector<BodyState> bodies_;
  std::vector<std::pair<const btQuantizedBvhNode*, const btQuantizedBvhNode*>> stack_;
  BoxHits hits_;
};

}  // namespace
}  // namespace kbvh::bullet

KBVH_STRATEGY(bullet_bvh) {
  using namespace kbvh;
  Info info = bullet::info("bullet_bvh", "Bullet quantised BVH, refit");
  info.tightness = Tightness::conservative;
  info.max_coordinate = 1e18;
  info.parameters.push_back({"query",
                             "trees",
                             {"trees", "primitives"},
                             "descend both trees, or query Bullet once per primitive of the smaller body",
                             0});
  info.parameters.push_back({"scale",
                             "fit",
                             {"fit", "none"},
                             "scale the scene so that Bullet's margin of 1.0 is small, or use it unscaled",
                             0});
  return {make_entry<bullet::BulletBvh, Scalars::float_only>(std::move(info))};
}
