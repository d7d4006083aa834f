// Embree 3.13 (Wald et al. 2014) as a contestant: one scene of user geometry per body, refitted, and
// rtcCollide.
//
// - RTC_BUILD_QUALITY_REFIT of a geometry is ignored (a full rebuild) unless its scene is
// RTC_BUILD_QUALITY_LOW;
//   compact scenes refit several times faster.
// - rtcCollide takes user geometry only, and may call back from several threads with denormals flushed: the
//   callback collects ids under a lock, and kbvh's test follows after the floating-point state is restored.
// - Every instance asks for one thread. In Embree 3 with TBB that limit is process-wide while a device lives.
// - rtcCollide compares node boxes but not those of primitives: the candidates of two leaves are all their
// pairs.
// - Denormal bounds are widened to the smallest normal number, so that flushing them cannot lose a pair;
// bounds
//   beyond 1.8e18, which Embree takes for invalid, are clamped. Both are monotone: what touches still does.
// - The hierarchy cannot be seen, so there is no audit. Float scenes only.
#include <embree3/rtcore.h>

#include <atomic>
#include <mutex>
#include <type_traits>
#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include "core/registry.hpp"

namespace kbvh {
namespace {

/// Embree flushes denormals and may not say so afterwards: what comes after must not notice.
class KeepFloatingPointState {
 public:
#if defined(__SSE__)
  KeepFloatingPointState() : state_(_mm_getcsr()) {}
  ~KeepFloatingPointState() {
    _mm_setcsr(state_);
  }

 private:
  unsigned state_;
#else
  KeepFloatingPointState() {}
  ~KeepFloatingPointState() {}
#endif
};

struct ReleaseDevice {
  using pointer = RTCDevice;
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  using pointer = RTCScene;
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
struct ReleaseGeometry {
  using pointer = RTCGeometry;
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};

template <class S, class Count>
class EmbreeRefit final : public Strategy<S> {
  static_assert(std::is_same_v<S, float>);

 public:
  static constexpr Foresight foresight = Foresight::none;

  EmbreeRefit(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies /*none*/,
              const Params& /*params*/)
      : Strategy<S>(scene, motion), bodies_(scene.body_count()) {
    const KeepFloatingPointState keep;
    device_.reset(rtcNewDevice("threads=1,set_affinity=0"));
    if (!device_)
      throw std::runtime_error("Embree cannot make a device: error " +
                               std::to_string(int(rtcGetDeviceError(nullptr))));
    rtcSetDeviceMemoryMonitorFunction(device_.get(), &count_memory, &memory_);
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      for (std::uint32_t v = 0; v < scene.vertex_count(body); ++v) motion.position(body, v);
      build(body);
    }
    check();
  }

  void reset(double t) override {
    this->clear_triangle_stats();
    time_ = t;
    for (BodyState& state : bodies_) refit(state);
    count_.table = {};
  }

  void advance(double t) override {
    if (t < time_)
      throw std::invalid_argument("cannot advance from t = " + std::to_string(time_) + " back to " +
                                  std::to_string(t));
    time_ = t;
    for (BodyState& state : bodies_)
      if (state.moves) refit(state);
  }

  QueryStatus candidates_at(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    const KeepFloatingPointState keep;
    collected_.out = &out;
    for (const BodyPair& pair : this->scene_.pairs()) {
      if (!bodies_[pair.first].scene || !bodies_[pair.second].scene) continue;
      collected_.bodies = pair;
      const std::size_t begin = out.size();
      rtcCollide(bodies_[pair.first].scene.get(), bodies_[pair.second].scene.get(), &collect, &collected_);
      filter(pair, out, begin);
    }
    check();
    return {};
  }

  void flight_plans_changed(double /*t*/, std::span<const PlanChange<S>> changes) override {
    for (const auto& change : changes) bodies_[change.body].moves = true;
  }

  /// What Embree has allocated, by its own account.
  std::size_t bytes() const override {
    return std::size_t(memory_.load()) + bodies_.size() * sizeof(BodyState);
  }

 private:
  struct BodyState {
    const Primitives* primitives = nullptr;
    const S* positions = nullptr;
    std::uint32_t body = 0;
    bool moves = false;
    std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene> scene;  // none for an empty body
    std::unique_ptr<std::remove_pointer_t<RTCGeometry>, ReleaseGeometry> geometry;
  };
  struct Collected {
    std::mutex mutex;
    BodyPair bodies{};
    PairBuffer* out = nullptr;
  };

  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  void build(std::uint32_t body) {
    BodyState& state = bodies_[body];
    state.primitives = &this->scene_.primitives(body);
    state.positions = this->sampled_.positions(body);
    state.body = body;
    state.moves = this->scene_.moving(body);
    if (state.primitives->count() == 0) return;
    state.scene.reset(rtcNewScene(device_.get()));
    rtcSetSceneBuildQuality(state.scene.get(), RTC_BUILD_QUALITY_LOW);
    rtcSetSceneFlags(state.scene.get(), RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_COMPACT);
    state.geometry.reset(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_USER));
    rtcSetGeometryBuildQuality(state.geometry.get(), RTC_BUILD_QUALITY_REFIT);
    rtcSetGeometryUserPrimitiveCount(state.geometry.get(), state.primitives->count());
    rtcSetGeometryUserData(state.geometry.get(), &state);
    rtcSetGeometryBoundsFunction(state.geometry.get(), &fit, nullptr);
    rtcCommitGeometry(state.geometry.get());
    rtcAttachGeometry(state.scene.get(), state.geometry.get());
    rtcCommitScene(state.scene.get());
  }

  void refit(BodyState& state) {
    if (!state.scene) return;
    const KeepFloatingPointState keep;
    state.positions = this->sampled_.positions(state.body);
    rtcCommitGeometry(state.geometry.get());
    rtcCommitScene(state.scene.get());
    check();
    // Nodes and writes are Embree's secret.
    count_.add(Counter::vertex_reads, state.primitives->vertices.size());
  }

  using Lanes = Eigen::Array4f;
  struct Bounds {
    Lanes lower, upper;  // the last lane means nothing
  };
  static Bounds bounds(const BodyState& state, std::uint32_t primitive) {
    const auto vertices = (*state.primitives)[primitive];
    const auto position = [&](std::uint32_t v) {
      return Eigen::Map<const Lanes>(state.positions + std::size_t(3) * v);
    };
    Bounds box{position(vertices[0]), position(vertices[0])};
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      const Lanes p = position(vertices[i]);
      box.lower = box.lower.min(p);
      box.upper = box.upper.max(p);
    }
    return box;
  }

  static void fit(const RTCBoundsFunctionArguments* args) {
    const BodyState& state = *static_cast<const BodyState*>(args->geometryUserPtr);
    const Bounds tight = bounds(state, args->primID);
    constexpr float twice_smallest = 2 * std::numeric_limits<float>::min(), largest = 1.8e18f;
    const Lanes lower = (tight.lower - twice_smallest).max(-largest).min(largest);
    const Lanes upper = (tight.upper + twice_smallest).max(-largest).min(largest);
    RTCBounds& box = *args->bounds_o;
    box.lower_x = lower[0], box.lower_y = lower[1], box.lower_z = lower[2];
    box.upper_x = upper[0], box.upper_y = upper[1], box.upper_z = upper[2];
  }

  /// Drops the pairs from `begin` on whose boxes are apart. All partners of a primitive come in a row.
  void filter(const BodyPair& pair, PairBuffer& out, std::size_t begin) {
    const BodyState &a = bodies_[pair.first], &b = bodies_[pair.second];
    count_.add(Counter::box_tests, out.size() - begin);
    std::size_t kept = begin;
    std::uint32_t current = none;
    Bounds box_a{Lanes::Zero(), Lanes::Zero()};
    for (std::size_t i = begin; i < out.size(); ++i) {
      if (out[i].primitive_a != current) box_a = bounds(a, current = out[i].primitive_a);
      const Bounds box_b = bounds(b, out[i].primitive_b);
      const auto apart = ((box_a.lower > box_b.upper) || (box_b.lower > box_a.upper)).eval();
      if (!(apart[0] | apart[1] | apart[2])) out[kept++] = out[i];
    }
    out.resize(kept);
  }

  static void collect(void* user, RTCCollision* collisions, unsigned count) {
    auto& collected = *static_cast<Collected*>(user);
    const std::lock_guard<std::mutex> lock(collected.mutex);
    for (unsigned i = 0; i < count; ++i)
      collected.out->push_back(
          {collected.bodies.first, collisions[i].primID0, collected.bodies.second, collisions[i].primID1});
  }

  static bool count_memory(void* user, ssize_t bytes, bool /*after*/) {
    *static_cast<std::atomic<std::int64_t>*>(user) += bytes;
    return true;
  }

  void check() const {
    const RTCError error = rtcGetDeviceError(device_.get());
    if (error != RTC_ERROR_NONE)
      throw std::runtime_error("Embree reports error " + std::to_string(int(error)));
  }

  std::atomic<std::int64_t> memory_{0};  // outlives the device
  std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseDevice> device_;
  std::vector<BodyState> bodies_;
  Collected collected_;
  Count count_;
  double time_ = 0;

 protected:
  Counters counted() const override { return count_.table; }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(embree) {
  using namespace kbvh;
  Info info;
  info.id = "embree_refit";
  info.title = "Embree, refit";
  info.family = "embree";
  info.citation = "Wald et al. 2014 (Embree 3.13)";
  info.tightness = Tightness::conservative;
  info.guarantee = Guarantee::candidate_superset;
  info.positions = PositionUse::all;
  info.can.plan_changes = true;
  info.topology.own = true;
  info.own_scalar = "float";
  std::vector<StrategyEntry> entries;
  entries.push_back(make_entry<EmbreeRefit, Scalars::float_only>(std::move(info)));
  return entries;
}
