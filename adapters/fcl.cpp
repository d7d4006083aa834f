// FCL (Pan et al. 2012) as contestants: its BVHModel of boxes or of 18-DOPs and its mesh traversal, in float
// and in double.
//
// How FCL is driven:
// - Each frame is passed by beginReplaceModel and endReplaceModel(refit, bottomup). begin/endUpdateModel
//   would fit boxes to the previous and the current frame together, which suits continuous tests only.
// - The adapter drives FCL's traversal node itself, because fcl::collide() copies both models on every call.
// - leafTesting only collects primitive ids. kbvh's exact test confirms them, as for all contestants. The
//   contestants `fcl_*_own_verdict` confirm with FCL's separating-axis test in floating point instead, so
//   they are approximate. They confirm after the traversal, not within it, so that both phases have their own
//   times.
// - Copies of a model share splitter and fitter, so the adapter creates the model of each body separately.
// - FCL takes triangles only, one per leaf. The adapter passes a primitive of fewer vertices as a degenerate
//   triangle, and a primitive of more vertices as the triangle (lower, upper, first vertex) over two vertices
//   that follow the body's own. That triangle has the polygon's box, so a leaf is a primitive, points and
//   control nets are answered, and no pair is reported twice. Cutting polygons would need more leaves: this
//   choice favours FCL. An 18-DOP does not follow from that triangle, so `fcl_*_kdop18` has the triangles of
//   polygons as leaves, drops repeated pairs, and takes no control nets.
// - FCL rounds the sides of its 18-DOPs to nearest. Each side is a sum of two coordinates, and its rounding
//   is monotone in the exact sum: bodies that overlap still overlap, but a vertex may lie half a unit in the
//   last place outside of its 18-DOP. Hence there is no audit of 18-DOPs.
// - FCL's test of two AABBs is closed, and its AABBs are unions of vertices: they are tight to the last bit.
// - FCL recurses in its mean-split tree and in its traversal. The depth of the recursion is bounded by the
//   number of primitives, not by its logarithm.
// - The float version does not accept double scenes: rounding the positions would lose pairs.
// - Range. FCL descends into the box with the larger squared diagonal. With coordinates up to X that is 12
//   X^2, which overflows in float above 5e18; both sides then count as equal, and a query tests 1.4 times as
//   many boxes. Its triangle test projects on axes that are products of three edges: sums of at most 192 X^4,
//   which overflow above 1.1e9 in float and 3e76 in double; a thousand times beyond, it misses every pair.
#include <fcl/config.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/bv/AABB.h>
#include <fcl/math/bv/kDOP.h>
#include <fcl/math/bv/utility.h>  // BVHModel uses its fit() without including it
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>
#include <fcl/narrowphase/detail/traversal/collision/mesh_collision_traversal_node.h>
#include <fcl/narrowphase/detail/traversal/collision_node.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/continuous/impact.hpp"
#include "core/contract/registry.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/lane_box.hpp"
#include "instructions.hpp"

namespace kbvh {
namespace {

enum class Mode : std::uint8_t { bottom_up, top_down, rebuild };
enum class Verdict : std::uint8_t { kbvh, own };

template <class Own>
using Kdop18 = fcl::KDOP<Own, 18>;

template <class Own>
Box<double> box_of(const fcl::AABB<Own>& bounds) {
  Box<double> box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = double(bounds.min_[axis]);
    box.upper[axis] = double(bounds.max_[axis]);
  }
  return box;
}
template <class Own>
Box<double> box_of(const Kdop18<Own>& bounds) {
  Box<double> box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = double(bounds.dist(std::size_t(axis)));
    box.upper[axis] = double(bounds.dist(std::size_t(axis + 9)));
  }
  return box;
}

/// FCL's simultaneous traversal of two models, with leaves that are collected instead of tested.
template <class Own, class Bounds>
class LeafCollector final : public fcl::detail::MeshCollisionTraversalNode<Bounds> {
 public:
  BodyPair bodies{};
  PairBuffer* out = nullptr;
  const std::uint32_t *primitives_a = nullptr, *primitives_b = nullptr;  // of triangles; null: their indices

  void leafTesting(int leaf_a, int leaf_b) const override {
    const auto a = std::uint32_t(this->model1->getBV(leaf_a).primitiveId());
    const auto b = std::uint32_t(this->model2->getBV(leaf_b).primitiveId());
    out->push_back({bodies.first, primitives_a == nullptr ? a : primitives_a[a], bodies.second,
                    primitives_b == nullptr ? b : primitives_b[b]});
  }
};

template <class Own, template <class> class Bounds, Mode mode, Verdict verdict, class S>
class Fcl final : public CountedStrategy<S>, public TakesPlanChanges<S> {
  static_assert(sizeof(Own) >= sizeof(S), "rounding positions would lose pairs");
  static constexpr bool boxes = std::is_same_v<Bounds<Own>, fcl::AABB<Own>>;
  using Model = fcl::BVHModel<Bounds<Own>>;
  using Collector = LeafCollector<Own, Bounds<Own>>;
  using Vector = fcl::Vector3<Own>;

 public:
  static constexpr Foresight foresight = Foresight::none;

  Fcl(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies /*none*/,
      const Params& /*params*/)
      : CountedStrategy<S>(scene, motion),
        bodies_(scene.body_count()),
        near_bodies_(scene.pairs(), scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      for (std::uint32_t v = 0; v < scene.vertex_count(body); ++v) motion.position(body, v);
      build(body);
    }
    if (near_bodies_.searches()) return;  // one node per pair of bodies would need too much memory
    for (const BodyPair& pair : scene.pairs())
      if (bodies_[pair.first].model && bodies_[pair.second].model) collectors_.push_back(collector(pair));
  }

  void reset_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      bodies_[body].moves = this->scene_.moving(body);
      update(body);
    }
  }

  void advance_to(double /*t*/) override {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      if (bodies_[body].moves) update(body);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    for (const auto& node : collectors_) collide(*node, out);
    if (!near_bodies_.searches()) return {};
    std::uint64_t tests = 0;
    const auto root_of = [&](std::uint32_t body) {
      const Model* model = bodies_[body].model.get();
      return model == nullptr ? Box<double>{} : box_of(model->getBV(0).bv);
    };
    for (const std::uint32_t i : near_bodies_.find(root_of, tests))
      collide(*collector(this->scene_.pairs()[i]), out);
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  void confirm_candidates(double t, PairBuffer& pairs) override {
    if constexpr (verdict == Verdict::kbvh)
      Strategy<S>::confirm_candidates(t, pairs);
    else
      std::erase_if(pairs, [&](const PrimitivePair& pair) { return !own_verdict(pair); });
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    for (const auto& change : changes) bodies_[change.body].moves = true;
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    if (!boxes) return std::nullopt;
    AuditView view;
    const Model* model = bodies_[body].model.get();
    if (model == nullptr) return view;
    // FCL numbers siblings next to each other and after their parent, like a topology.
    const auto size = std::uint32_t(model->getNumBVs());
    view.topology.parents.assign(size, 0);
    view.topology.depths.assign(size, 0);
    for (std::uint32_t i = 0; i < size; ++i) {
      const auto& node = model->getBV(int(i));
      view.boxes.push_back(box_of(node.bv));
      if (node.isLeaf()) {
        view.topology.nodes.push_back(TopologyNode::leaf(std::uint32_t(view.topology.primitives.size()), 1));
        view.topology.primitives.push_back(std::uint32_t(node.primitiveId()));
        continue;
      }
      const auto child = std::uint32_t(node.leftChild());
      view.topology.nodes.push_back(TopologyNode::inner(child, 2));
      for (std::uint32_t k = child; k < child + 2; ++k) {
        view.topology.parents[k] = i;
        view.topology.depths[k] = std::uint8_t(std::min(255, view.topology.depths[i] + 1));
      }
    }
    return view;
  }

  /// Computes the size of FCL's arrays; FCL's own memUsage() returns a status code instead.
  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const BodyState& state : bodies_) {
      if (!state.model) continue;
      const auto triangles = std::size_t(state.model->num_tris);
      total += sizeof(Model) + (2 * triangles - 1) * (sizeof(fcl::BVNode<Bounds<Own>>) + sizeof(unsigned)) +
               triangles * sizeof(fcl::Triangle) + std::size_t(state.model->num_vertices) * sizeof(Vector) +
               (state.polygons.size() + state.primitives.size()) * sizeof(std::uint32_t);
    }
    return total;
  }

 private:
  struct BodyState {
    std::unique_ptr<Model> model;           // none for a body without primitives: FCL refuses empty models
    std::vector<std::uint32_t> polygons;    // primitives of more than 3 vertices, passed as boxes
    std::vector<std::uint32_t> primitives;  // of triangles, where polygons are cut
    std::uint64_t fitted_vertices = 0;      // vertex reads of a refit
    bool moves = false;
  };

  static Vector vector(const S* p) { return Vector(Own(p[0]), Own(p[1]), Own(p[2])); }

  template <class Add>
  void for_each_vertex(std::uint32_t body, Add&& add) const {
    const S* positions = this->sampled_.positions(body);
    const std::uint32_t count = this->scene_.vertex_count(body);
    for (std::uint32_t v = 0; v < count; ++v) add(vector(positions + std::size_t(3) * v));
    for (std::uint32_t polygon : bodies_[body].polygons) {
      const Box<S> box = primitive_box(this->scene_.primitives(body)[polygon], positions);
      add(vector(box.lower));
      add(vector(box.upper));
    }
  }

  /// Makes FCL's traversal of two bodies that both have triangles.
  std::unique_ptr<Collector> collector(const BodyPair& pair) {
    auto node = std::make_unique<Collector>();
    fcl::Transform3<Own> here = fcl::Transform3<Own>::Identity();
    if (!fcl::detail::initialize(*node, *bodies_[pair.first].model, here, *bodies_[pair.second].model, here,
                                 fcl::CollisionRequest<Own>(), result_))
      throw std::runtime_error("FCL refuses to traverse bodies " + std::to_string(pair.first) + " and " +
                               std::to_string(pair.second));
    node->bodies = pair;
    const auto primitives_of = [&](std::uint32_t body) {
      return bodies_[body].primitives.empty() ? nullptr : bodies_[body].primitives.data();
    };
    node->primitives_a = primitives_of(pair.first);
    node->primitives_b = primitives_of(pair.second);
    return node;
  }
  void collide(Collector& node, PairBuffer& out) {
    const auto begin = std::ptrdiff_t(out.size());
    node.out = &out;
    node.enable_statistics = !this->is_timed();
    node.num_bv_tests = 0;
    fcl::detail::collide<Own>(&node);
    if (node.primitives_a != nullptr || node.primitives_b != nullptr) {
      std::sort(out.begin() + begin, out.end());
      out.erase(std::unique(out.begin() + begin, out.end()), out.end());
    }
    this->count_.add(Counter::box_tests, std::uint64_t(node.num_bv_tests));
  }
  void build(std::uint32_t body) {
    BodyState& state = bodies_[body];
    state.moves = this->scene_.moving(body);
    const Primitives& primitives = this->scene_.primitives(body);
    if (primitives.count() == 0) return;
    std::vector<fcl::Triangle> triangles;
    triangles.reserve(primitives.count());
    std::vector<std::uint32_t> owners;
    std::uint32_t next = this->scene_.vertex_count(body);
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      const auto v = primitives[p];
      if (v.size() <= 3) {
        triangles.emplace_back(v[0], v[v.size() / 2], v.back());
        owners.push_back(p);
      } else if (!boxes) {
        const PolygonTriangles cut = primitives.triangles(p);
        for (std::uint32_t i = 0; i < cut.count(); ++i) {
          const auto corners = cut[i];
          triangles.emplace_back(corners[0], corners[1], corners[2]);
          owners.push_back(p);
        }
      } else {
        triangles.emplace_back(next, next + 1, v[0]);
        next += 2;
        state.polygons.push_back(p);
      }
    }
    std::vector<Vector> vertices;
    vertices.reserve(next);
    for_each_vertex(body, [&](const Vector& p) { vertices.push_back(p); });
    if (!boxes && triangles.size() > primitives.count()) state.primitives = std::move(owners);
    state.model = std::make_unique<Model>();
    Model& model = *state.model;
    check(model.beginModel(int(triangles.size()), int(vertices.size())), body);
    check(model.addSubModel(vertices, triangles), body);
    check(model.endModel(), body);
    state.fitted_vertices = mode == Mode::bottom_up ? 3 * triangles.size() : vertices_below_nodes(model);
  }

  void update(std::uint32_t body) {
    BodyState& state = bodies_[body];
    if (!state.model) return;
    Model& model = *state.model;
    check(model.beginReplaceModel(), body);
    for_each_vertex(body, [&](const Vector& p) { model.replaceVertex(p); });
    check(model.endReplaceModel(mode != Mode::rebuild, mode == Mode::bottom_up), body);
    const auto nodes = std::uint64_t(model.getNumBVs());
    // A rebuild reads everything below a node to fit its box, to find its mean, and to divide it.
    if (mode == Mode::rebuild && !this->is_timed()) state.fitted_vertices = 3 * vertices_below_nodes(model);
    this->count_.add(Counter::nodes_visited, nodes);
    this->count_.add(Counter::values_written, (boxes ? 6 : 18) * nodes);
    this->count_.add(Counter::vertex_reads, state.fitted_vertices);
  }

  static std::uint64_t vertices_below_nodes(const Model& model) {
    std::uint64_t total = 0;
    for (int i = 0; i < model.getNumBVs(); ++i) total += 3 * std::uint64_t(model.getBV(i).num_primitives);
    return total;
  }

  static void check(int status, std::uint32_t body) {
    if (status != fcl::BVH_OK)
      throw std::runtime_error("FCL refuses body " + std::to_string(body) + " with status " +
                               std::to_string(status));
  }

  /// Performs FCL's triangle test on the triangles of polygons. FCL itself would compare only triangles with
  /// overlapping boxes.
  bool own_verdict(const PrimitivePair& pair) {
    const Primitives& primitives_a = this->scene_.primitives(pair.body_a);
    const Primitives& primitives_b = this->scene_.primitives(pair.body_b);
    if (primitives_a.kind != PrimitiveKind::polygons || primitives_b.kind != PrimitiveKind::polygons)
      return true;
    const PolygonTriangles a = primitives_a.triangles(pair.primitive_a),
                           b = primitives_b.triangles(pair.primitive_b);
    for (std::uint32_t i = 0; i < a.count(); ++i)
      for (std::uint32_t j = 0; j < b.count(); ++j) {
        const auto p = corners_of(pair.body_a, a[i]), q = corners_of(pair.body_b, b[j]);
        // Single triangles: the boxes have been compared already.
        if (a.count() * b.count() > 1 &&
            !fcl::AABB<Own>(p[0], p[1], p[2]).overlap(fcl::AABB<Own>(q[0], q[1], q[2])))
          continue;
        ++this->triangle_stats_.tests;
        if (fcl::detail::Intersect<Own>::intersect_Triangle(p[0], p[1], p[2], q[0], q[1], q[2])) return true;
      }
    return false;
  }

  std::array<Vector, 3> corners_of(std::uint32_t body, const std::array<std::uint32_t, 3>& triangle) const {
    const S* positions = this->sampled_.positions(body);
    const auto corner = [&](std::size_t i) { return vector(positions + std::size_t(3) * triangle[i]); };
    return {corner(0), corner(1), corner(2)};
  }

  std::vector<BodyState> bodies_;
  NearBodies near_bodies_;
  fcl::CollisionResult<Own> result_;  // stays empty: FCL tests no leaf
  std::vector<std::unique_ptr<Collector>> collectors_;
};

template <class Own, template <class> class Bounds, Mode mode, Verdict verdict>
struct Bind {
  template <class S>
  using Type = Fcl<Own, Bounds, mode, verdict, S>;
};

/// Performs FCL's own test of a vertex and a face, or of two edges, in linear motion: it finds the cubic's
/// roots in floating point, by bisection or Newton's method, and tests the inside with tolerances. These
/// tolerances are lengths, so FCL misses features that are small against them. The input is scaled by a power
/// of two, which rounds nothing, so that the largest coordinate lies between 512 and 1024.
bool fcl_impact(Contact::Kind kind, const MovingPoints& points) {
  fcl::Vector3d p[2][4];
  double largest = 0;
  for (const auto* end : {points.begin, points.end})
    for (int i = 0; i < 4; ++i)
      for (int d = 0; d < 3; ++d) largest = std::max(largest, std::abs(end[i][d]));
  const double scale = largest > 0 ? std::ldexp(1.0, 9 - std::ilogb(largest)) : 1;
  for (int end = 0; end < 2; ++end)
    for (int i = 0; i < 4; ++i) {
      const double* x = (end == 0 ? points.begin : points.end)[i];
      p[end][i] = fcl::Vector3d(scale * x[0], scale * x[1], scale * x[2]);
    }
  double time = 0;
  fcl::Vector3d place;
  using Test = fcl::detail::Intersect<double>;
  // FCL expects the face first.
  return kind == Contact::Kind::vertex_face ? Test::intersect_VF(p[0][1], p[0][2], p[0][3], p[0][0], p[1][1],
                                                                 p[1][2], p[1][3], p[1][0], &time, &place)
                                            : Test::intersect_EE(p[0][0], p[0][1], p[0][2], p[0][3], p[1][0],
                                                                 p[1][1], p[1][2], p[1][3], &time, &place);
}

template <class Own, Mode mode, Verdict verdict = Verdict::kbvh, template <class> class Bounds = fcl::AABB>
StrategyEntry entry(const std::string& name, const std::string& title) {
  constexpr bool boxes = std::is_same_v<Bounds<Own>, fcl::AABB<Own>>;
  constexpr bool single = std::is_same_v<Own, float>;
  constexpr Scalars scalars = single ? Scalars::float_only : Scalars::both;
  Info info;
  info.own_scalar = single ? "float" : "double";
  info.id = "fcl_" + info.own_scalar + "_" + name;
  info.title = "FCL " + info.own_scalar + ", " + title;
  info.family = "fcl";
  info.citation = "Pan, Chitta & Manocha 2012";
  info.version = "FCL " FCL_VERSION;
  info.instructions = compiled_instructions();
  info.tightness = boxes ? Tightness::tight : Tightness::none;
  if (!boxes) info.primitives = {PrimitiveKind::polygons, PrimitiveKind::points};
  info.guarantee = verdict == Verdict::own ? Guarantee::approximate : Guarantee::candidate_superset;
  info.positions = PositionUse::all;
  info.declares.restructures = mode == Mode::rebuild;
  info.topology.own = true;
  info.max_coordinate = verdict == Verdict::own ? (single ? 1e9 : 1e76)
                        : single                ? 5e18
                                                : std::numeric_limits<double>::infinity();
  if (verdict == Verdict::own && !single) info.own_impact = fcl_impact;
  return make_entry<Bind<Own, Bounds, mode, verdict>::template Type, scalars>(std::move(info));
}

template <class Own>
void append(std::vector<StrategyEntry>& entries) {
  entries.push_back(entry<Own, Mode::bottom_up>("bottom_up", "bottom-up refit"));
  entries.push_back(entry<Own, Mode::top_down>("top_down", "top-down refit"));
  entries.push_back(entry<Own, Mode::rebuild>("rebuild", "rebuild"));
  entries.push_back(entry<Own, Mode::bottom_up, Verdict::own>("own_verdict", "bottom-up refit, own test"));
  entries.push_back(
      entry<Own, Mode::bottom_up, Verdict::kbvh, Kdop18>("kdop18", "bottom-up refit of 18-DOPs"));
}

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(fcl) {
  std::vector<kbvh::StrategyEntry> entries;
  kbvh::append<float>(entries);
  kbvh::append<double>(entries);
  return entries;
}
