// Embree 3 (Wald et al. 2014) as a contestant: one scene per body, refitted, and rtcCollide.
//
// Refit. Embree refits a geometry of RTC_BUILD_QUALITY_REFIT only if its scene is both RTC_BUILD_QUALITY_LOW
// and RTC_SCENE_FLAG_DYNAMIC; otherwise it rebuilds, which takes 30 times as long. Any non-default tri_accel
// or object_accel of the device disables the refit, too. Robust scenes, other instruction sets and vertices
// of 16 bytes gain nothing.
//
// Geometry. rtcCollide accepts user geometry only, and a refit of user geometry calls back for every
// primitive. Embree refits triangle geometry by itself and faster, but rtcCollide does not accept it. Hence
// the parameter `geometry`:
// - user: the update refits user geometry, and the query collides it. There is one hierarchy, and both times
//   are Embree's.
// - triangles: the update refits triangle geometry over shared buffers, which is Embree's fastest refit. No
//   query of pairs reads it: the query first refits user geometry, so ITS TIME INCLUDES A SECOND REFIT AND
//   MUST NOT BE QUOTED. A body with primitives other than triangles gets one triangle (lower, upper, lower)
//   per primitive, which has the primitive's box; writing these triangles is part of the update.
// Comparisons therefore take the update from `triangles`, and query and total from `user`. Rays read
// triangles in either case.
//
// Layout. Compact scenes (`layout=compact`) refit fastest: their leaves hold indices, so a refit writes nodes
// only. Embree's default scenes (`layout=default`) copy the triangles into the leaves, and answer rays
// faster.
//
// Threads. A device that is made with a number of threads limits TBB in the whole process while it exists:
// with one thread, every other contestant of a run would have only one, too. The adapter therefore makes the
// device without a number (threads=0), and makes every call within as many threads as the parameter asks for
// (LibraryThreads). rtcCollide calls back from all of them. Each thread collects pairs in a list of its own,
// so the order of pairs differs from call to call. The triangles are tested by the same number of kbvh's
// threads.
//
// Candidates. rtcCollide compares the boxes of nodes, and therefore the box of each primitive with a leaf of
// its own. For larger leaves it reports all pairs, several at a time; the adapter filters these by the
// primitives' boxes.
//
// Denormals. Embree flushes them. The adapter widens denormal bounds to the smallest normal number, so that
// flushing cannot lose a pair. This is monotone, like flushing: boxes that touch still touch. kbvh's own test
// follows after the floating-point state is restored. Upper bounds are an ulp or two larger, because Embree's
// builder asserts that the box of all primitives is not a point.
//
// Range. Coordinates up to 1.8e18 (largest_coordinate): Embree treats bounds from 1.844e18 on as invalid,
// silently leaves their primitives out, and aborts the program if no primitives are left.
//
// Rays. rtcIntersect1 and rtcOccluded1 on triangle geometry, body after body: the triangles of all polygons
// are in a scene that is refitted like the others. With geometry=triangles and bodies of triangles the update
// itself refits it. Otherwise the first ray of a frame that enters the body triggers the refit, so the time
// of rays includes it. Rays enter bodies front to back, and skip those behind the closest hit so far. Embree
// decides in float, with no bound on its error, and may miss rays through edges and corners: its answers are
// marked approximate, and their differences from the truth are counted.
//
// Embree does not show its hierarchy, so there is no audit. Float scenes only.
#include <Eigen/Core>
#include <atomic>
#include <cmath>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

#include "core/base/assert.hpp"
#include "core/contract/registry.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/parallel/library_threads.hpp"
#include "core/scene/pairs_by_thread.hpp"
#include "core/topology/probe_traversal.hpp"
#include "embree.hpp"

namespace kbvh {
namespace {

template <class S>
class EmbreeRefit final : public CountedStrategy<S>, public AnswersRays<S>, public TakesPlanChanges<S> {
  static_assert(std::is_same_v<S, float>);

 public:
  static constexpr Foresight foresight = Foresight::none;

  EmbreeRefit(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies /*none*/,
              const Params& params)
      : CountedStrategy<S>(scene, motion),
        refits_(params.word("geometry") == "triangles" ? Refits::triangles : Refits::boxes),
        layout_(params.word("layout") == "compact" ? SceneLayout::compact : SceneLayout::usual),
        threads_(threads_of(params)),
        bodies_(scene.body_count()),
        near_bodies_(scene.pairs(), scene.body_count()) {
    threads_.call([&] { make_device(scene, motion); });
  }

  void reset_to(double /*t*/) override {
    threads_.call([&] {
      for (BodyState& state : bodies_) {
        state.moves = this->scene_.moving(state.body);
        update(state);
      }
    });
  }

  void advance_to(double /*t*/) override {
    threads_.call([&] {
      for (BodyState& state : bodies_)
        if (state.moves) update(state);
    });
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    threads_.call([&] { collide(out); });
    return {};
  }

  void confirm_candidates(double /*t*/, PairBuffer& pairs) override {
    shared_confirmation_.confirm(this->scene_, this->sampled_, pairs, this->triangle_stats_);
  }

  void find_hits(double /*t*/, const RayProbes<S>& rays) override {
    threads_.call([&] { trace(rays.query, rays.rays, rays.hits); });
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    for (const auto& change : changes) bodies_[change.body].moves = true;
  }

  /// Returns the bytes that Embree reports as allocated, plus those of this adapter's own buffers.
  std::size_t bytes() const override {
    std::size_t total = std::size_t(memory_.load()) + bodies_.size() * sizeof(BodyState) +
                        collected_.found.bytes() + shared_confirmation_.bytes();
    for (const BodyState& state : bodies_)
      total += state.own_vertices.size() * sizeof(float) +
               (state.own_indices.size() + state.cut_indices.size() + state.cut_primitives.size()) *
                   sizeof(std::uint32_t);
    return total;
  }

 private:
  enum class Refits : std::uint8_t { boxes, triangles };
  struct BodyState {
    const Primitives* primitives = nullptr;
    const S* positions = nullptr;
    std::uint32_t body = 0;
    bool moves = false;
    bool only_triangles = false;  // all primitives have three vertices
    bool boxes_are_old = false;
    RefitScene boxes;
    RefitScene triangles;  // made on demand by `geometry`
    const float* shared_vertices = nullptr;
    std::vector<float>
        own_vertices;  // three per primitive and padding, for bodies with primitives other than triangles
    std::vector<std::uint32_t> own_indices;
    // For rays, made when the first one is asked.
    RefitScene own_cuts;  // unless `triangles` serves
    bool cuts_are_triangles = false, cuts_are_old = true;
    const float* cut_vertices = nullptr;
    std::vector<std::uint32_t> cut_indices, cut_primitives;  // empty for bodies of triangles

    RefitScene& cuts() { return cuts_are_triangles ? triangles : own_cuts; }
  };
  struct Collected {
    BodyPair bodies{};
    const BodyState* a = nullptr;
    const BodyState* b = nullptr;
    PairsByThread found;
  };

  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  void make_device(const SceneView<S>& scene, const SampledMotion<S>& motion) {
    // Evaluates positions before Embree changes the floating-point state, which the threads would inherit.
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      for (std::uint32_t v = 0; v < scene.vertex_count(body); ++v) motion.position(body, v);
    const KeepFloatingPointState keep;
    device_.reset(rtcNewDevice(LibraryThreads::are_limited() ? "threads=0,set_affinity=0"
                                                             : "threads=1,set_affinity=0"));
    if (!device_) fail("Embree cannot make a device", rtcGetDeviceError(nullptr));
    rtcSetDeviceMemoryMonitorFunction(device_.get(), &count_memory, &memory_);
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) build(body);
    check();
  }

  void collide(PairBuffer& out) {
    const KeepFloatingPointState keep;
    for (BodyState& state : bodies_)
      if (state.boxes_are_old) {
        refit_boxes(state);
        KBVH_ASSERT(bounds_triangles(state));
      }
    collected_.found.start(out);
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) { return to_double(bounds_of_scene(bodies_[body].boxes)); };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (!bodies_[pair.first].boxes.scene || !bodies_[pair.second].boxes.scene) continue;
      collected_.bodies = pair;
      collected_.a = &bodies_[pair.first];
      collected_.b = &bodies_[pair.second];
      rtcCollide(collected_.a->boxes.scene.get(), collected_.b->boxes.scene.get(), &collect, &collected_);
      tests += collected_.found.collect();
    }
    this->count_.add(Counter::box_tests, tests);
    check();
  }

  /// Returns the box of a body of polygons. Uses boxes that the update has refitted, if any; a body behind
  /// others is not refitted for rays.
  Box<float> box_for_rays(BodyState& state) {
    if (state.primitives->kind != PrimitiveKind::polygons || !state.boxes.scene) return {};
    if (!state.boxes_are_old) return bounds_of_scene(state.boxes);
    bring_cuts_up_to_date(state);
    return bounds_of_scene(state.cuts());
  }

  /// A ray that Embree follows, as a search of bodies in front of what it has found.
  struct ByEmbree {
    RaySlabs boxes;
    const RTCRayHit* found;
    RaySlabs box_test() const { return boxes; }
    double limit() const { return double(found->ray.tfar); }
  };
  void trace(RayQuery query, std::span<const Ray<S>> rays, std::span<RayHit> hits) {
    const KeepFloatingPointState keep;
    std::uint64_t tests = 0;
    ray_order_.start(this->scene_, &RayProbes<S>::meets,
                     [&](std::uint32_t body) { return box_for_rays(bodies_[body]); });
    for (std::size_t i = 0; i < rays.size(); ++i) {
      hits[i] = {};
      RTCRayHit found = ray_of(rays[i]);
      tests += ray_order_.follow(
          ByEmbree{RaySearch<S>(rays[i], query).box_test(), &found}, [&](std::uint32_t body, bool) {
            BodyState& state = bodies_[body];
            bring_cuts_up_to_date(state);
            RTCIntersectContext context;
            rtcInitIntersectContext(&context);
            if (query == RayQuery::any) {
              rtcOccluded1(state.cuts().scene.get(), &context, &found.ray);
              if (found.ray.tfar >= 0) return false;
              hits[i] = {state.body, RayHit::none, std::numeric_limits<double>::quiet_NaN()};
              return true;
            }
            found.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            rtcIntersect1(state.cuts().scene.get(), &context, &found);
            if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
            const std::uint32_t triangle = found.hit.primID;
            hits[i] = {state.body, state.cut_primitives.empty() ? triangle : state.cut_primitives[triangle],
                       double(found.ray.tfar)};
            return false;
          });
    }
    ray_order_.count(this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
    check();
  }

  void build(std::uint32_t body) {
    BodyState& state = bodies_[body];
    const Primitives& primitives = *(state.primitives = &this->scene_.primitives(body));
    state.positions = this->sampled_.positions(body);
    state.body = body;
    state.moves = this->scene_.moving(body);
    const std::uint32_t count = primitives.count();
    if (count == 0) return;
    state.only_triangles = true;
    for (std::uint32_t p = 0; p <= count; ++p)
      state.only_triangles = state.only_triangles && primitives.offsets[p] == 3 * p;
    RTCGeometry geometry = state.boxes.make(device_.get(), RTC_GEOMETRY_TYPE_USER, layout_);
    rtcSetGeometryUserPrimitiveCount(geometry, count);
    rtcSetGeometryUserData(geometry, &state);
    rtcSetGeometryBoundsFunction(
        geometry, state.only_triangles ? &fit<&bounds_of_triangle> : &fit<&bounds_of_any>, nullptr);
    state.boxes.build();
    if (refits_ == Refits::boxes) return;

    geometry = state.triangles.make(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE, layout_);
    const std::uint32_t* indices = primitives.vertices.data();
    if (!state.only_triangles) {
      state.own_vertices.resize(std::size_t(9) * count + 1);
      for (std::uint32_t i = 0; i < 3 * count; ++i) state.own_indices.push_back(i);
      indices = state.own_indices.data();
    }
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices, 0,
                               3 * sizeof(std::uint32_t), count);
    share_vertices(state);
    state.triangles.build();
  }

  /// Embree reads 16 bytes at the last vertex, too: playback pads positions by one scalar, just enough.
  void share_vertices(BodyState& state) {
    const float* vertices = state.positions;
    std::size_t count = this->scene_.vertex_count(state.body);
    if (!state.only_triangles) {
      vertices = state.own_vertices.data();
      count = std::size_t(3) * state.primitives->count();
      for (std::uint32_t p = 0; p < state.primitives->count(); ++p) {
        const Bounds box = bounds(state, p);
        for (std::size_t i = 0; i < 9; ++i)
          state.own_vertices[std::size_t(9) * p + i] =
              (i / 3 == 1 ? box.upper : box.lower)[Eigen::Index(i % 3)];
      }
    }
    RTCGeometry geometry = state.triangles.geometry.get();
    if (vertices != state.shared_vertices)
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0,
                                 3 * sizeof(float), count);
    else
      rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    state.shared_vertices = vertices;
  }

  void update(BodyState& state) {
    if (!state.boxes.scene) return;
    const KeepFloatingPointState keep;
    state.cuts_are_old = true;
    if (refits_ == Refits::triangles) {
      state.positions = this->sampled_.positions(state.body);
      share_vertices(state);
      state.triangles.refit();
      state.boxes_are_old = true;
    } else {
      refit_boxes(state);
    }
    check();
    // Embree does not report node visits and writes.
    this->count_.add(Counter::vertex_reads, state.primitives->vertices.size());
  }

  void refit_boxes(BodyState& state) {
    state.positions = this->sampled_.positions(state.body);
    state.boxes.refit();
    state.boxes_are_old = false;
  }

  /// Makes or refits the triangles that rays meet.
  void bring_cuts_up_to_date(BodyState& state) {
    const Primitives& primitives = *state.primitives;
    if (!state.boxes.scene || primitives.kind != PrimitiveKind::polygons || !state.cuts_are_old) return;
    state.cuts_are_old = false;
    state.positions = this->sampled_.positions(state.body);
    state.cuts_are_triangles = refits_ == Refits::triangles && state.only_triangles;
    if (state.cuts_are_triangles) return;
    const bool fresh = !state.own_cuts.scene;
    if (fresh) {
      RTCGeometry geometry = state.own_cuts.make(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE, layout_);
      if (!state.only_triangles) list_cuts(state);
      const auto& indices = state.only_triangles ? primitives.vertices : state.cut_indices;
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices.data(), 0,
                                 3 * sizeof(std::uint32_t), indices.size() / 3);
    }
    if (state.positions != state.cut_vertices)
      rtcSetSharedGeometryBuffer(state.own_cuts.geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                 state.positions, 0, 3 * sizeof(float),
                                 this->scene_.vertex_count(state.body));
    else
      rtcUpdateGeometryBuffer(state.own_cuts.geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0);
    state.cut_vertices = state.positions;
    fresh ? state.own_cuts.build() : state.own_cuts.refit();
  }
  static void list_cuts(BodyState& state) {
    for (std::uint32_t p = 0; p < state.primitives->count(); ++p) {
      const PolygonTriangles triangles = state.primitives->triangles(p);
      for (std::uint32_t i = 0; i < triangles.count(); ++i) {
        for (const std::uint32_t vertex : triangles[i]) state.cut_indices.push_back(vertex);
        state.cut_primitives.push_back(p);
      }
    }
  }

  using Lanes = Eigen::Array4f;
  struct Bounds {
    Lanes lower, upper;  // the last lane is unused
  };
  static auto position(const BodyState& state, std::uint32_t v) {
    return Eigen::Map<const Lanes>(state.positions + std::size_t(3) * v);
  }
  static Bounds bounds(const BodyState& state, std::uint32_t primitive) {
    return state.only_triangles ? bounds_of_triangle(state, primitive) : bounds_of_any(state, primitive);
  }
  static Bounds bounds_of_triangle(const BodyState& state, std::uint32_t primitive) {
    const std::uint32_t* vertices = state.primitives->vertices.data() + std::size_t(3) * primitive;
    const Lanes a = position(state, vertices[0]), b = position(state, vertices[1]),
                c = position(state, vertices[2]);
    return {a.min(b).min(c), a.max(b).max(c)};
  }
  static Bounds bounds_of_any(const BodyState& state, std::uint32_t primitive) {
    const auto vertices = (*state.primitives)[primitive];
    Bounds box{position(state, vertices[0]), position(state, vertices[0])};
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      const Lanes p = position(state, vertices[i]);
      box.lower = box.lower.min(p);
      box.upper = box.upper.max(p);
    }
    return box;
  }

  template <auto bounds_of>
  static void fit(const RTCBoundsFunctionArguments* args) {
    hand_over(bounds_of(*static_cast<const BodyState*>(args->geometryUserPtr), args->primID),
              *args->bounds_o);
  }
  /// Half of a refit's time is spent here and above: whole registers are stored, with Embree's own padding.
  static void hand_over(const Bounds& tight, RTCBounds& box) {
    constexpr float twice_smallest = 2 * std::numeric_limits<float>::min();
    constexpr float ulp = std::numeric_limits<float>::epsilon();
    const Lanes sides[2] = {tight.lower - twice_smallest,
                            tight.upper + (tight.upper.abs() * ulp + twice_smallest)};
    static_assert(sizeof(RTCBounds) == sizeof(sides));
    std::memcpy(&box, sides, sizeof(box));
  }

  /// The root box of the triangles, which no query reads, must lie within that of the boxes.
  static bool bounds_triangles(const BodyState& state) {
    RTCBounds boxes, triangles;
    rtcGetSceneBounds(state.boxes.scene.get(), &boxes);
    rtcGetSceneBounds(state.triangles.scene.get(), &triangles);
    const auto within = [](float lower, float inner_lower, float inner_upper, float upper) {
      return lower <= inner_lower && inner_upper <= upper;
    };
    return within(boxes.lower_x, triangles.lower_x, triangles.upper_x, boxes.upper_x) &&
           within(boxes.lower_y, triangles.lower_y, triangles.upper_y, boxes.upper_y) &&
           within(boxes.lower_z, triangles.lower_z, triangles.upper_z, boxes.upper_z);
  }

  /// Appends the partners whose boxes overlap. All partners of a primitive come in a row.
  static void append_overlapping(const Collected& to, std::span<const RTCCollision> candidates,
                                 PairsByThread::Found& found) {
    found.box_tests += candidates.size();
    std::uint32_t current = none;
    Bounds box_a{Lanes::Zero(), Lanes::Zero()};
    for (const RTCCollision& candidate : candidates) {
      if (candidate.primID0 != current) box_a = bounds(*to.a, current = candidate.primID0);
      const Bounds box_b = bounds(*to.b, candidate.primID1);
      bool overlap = true;
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        overlap =
            overlap & (box_a.lower[axis] <= box_b.upper[axis]) & (box_b.lower[axis] <= box_a.upper[axis]);
      if (overlap)
        found.pairs->push_back({to.bodies.first, candidate.primID0, to.bodies.second, candidate.primID1});
    }
  }

  static void collect(void* user, RTCCollision* collisions, unsigned count) {
    auto& collected = *static_cast<Collected*>(user);
    PairsByThread::Found& found = collected.found.mine();
    const BodyPair& bodies = collected.bodies;
    if (count == 1)
      found.pairs->push_back({bodies.first, collisions->primID0, bodies.second, collisions->primID1});
    else
      append_overlapping(collected, {collisions, count}, found);
  }

  static bool count_memory(void* user, ssize_t bytes, bool /*after*/) {
    *static_cast<std::atomic<std::int64_t>*>(user) += bytes;
    return true;
  }

  void check() const {
    const RTCError error = rtcGetDeviceError(device_.get());
    if (error != RTC_ERROR_NONE) fail("Embree reports an error", error);
  }

  /// Throws std::bad_alloc if memory ran out, because that is no fault of Embree.
  [[noreturn]] static void fail(const char* what, RTCError error) {
    if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    throw std::runtime_error(what + (": number " + std::to_string(int(error))));
  }

  Refits refits_;
  SceneLayout layout_;
  LibraryThreads threads_;
  std::atomic<std::int64_t> memory_{0};  // must outlive the device
  DevicePointer device_;
  std::vector<BodyState> bodies_;
  NearBodies near_bodies_;
  BodyOrder ray_order_;
  Collected collected_;
  SharedConfirmation<S> shared_confirmation_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(embree) {
  using namespace kbvh;
  Info info;
  info.id = "embree_refit";
  info.title = "Embree, refit";
  info.family = "embree";
  info.citation = "Wald et al. 2014";
  const EmbreeFacts embree = embree_facts();
  info.version = embree.version;
  info.instructions = embree.instructions;
  info.remark =
      "its update at its best is that of geometry=triangles, which rtcCollide cannot query; its query and "
      "total are "
      "those of geometry=user, whose refit calls back for each primitive";
  info.tightness = Tightness::conservative;
  info.guarantee = Guarantee::candidate_superset;
  info.rays_guarantee = Guarantee::approximate;
  info.positions = PositionUse::all;
  info.topology.own = true;
  info.own_scalar = "float";
  info.max_coordinate = largest_coordinate;
  info.parameters = {{"geometry",
                      "user",
                      {"user", "triangles"},
                      "geometry that the update refits: user geometry, which the query collides; or triangle "
                      "geometry, Embree's fastest refit, which Embree cannot collide: the query then refits "
                      "user geometry first, and its time must not be quoted"},
                     {"layout",
                      "compact",
                      {"compact", "default"},
                      "Embree's scene: compact refits fastest, its default answers rays faster"},
                     threads_parameter("positions, refit, query and triangle tests")};
  std::vector<StrategyEntry> entries;
  entries.push_back(make_entry<EmbreeRefit, Scalars::float_only>(std::move(info)));
  return entries;
}
