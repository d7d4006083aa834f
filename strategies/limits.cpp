// Not contestants but limits to compare contestants with, in the same run and over the same frames. They
// answer no query (guarantee: approximate, every pair is missed); only their update time has a meaning.
// - limit_moved_bytes: an update reads and writes the bytes of a wide refit, in order, and computes nothing.
//   Positions and vertex lists are read once, nodes are written once.
// - limit_plain_motion: an update interpolates every position in the scene's scalar with default rounding.
//   The correctly rounded evaluation (phase "motion") is compared with it.

#include "core/families/limits/kernels/limits.hpp"
#include "core/contract/registry.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S, Foresight wanted>
class Limit : public Strategy<S> {
 public:
  static constexpr Foresight foresight = wanted;
  Limit(const SceneView<S>& scene, const SampledMotion<S>& motion)
      : Strategy<S>(scene, motion), kernels_(&limit_kernels(active_kernel_set())) {}

  void reset_to(double t) override { update_all(t); }
  void advance_to(double t) override { update_all(t); }
  QueryStatus find_candidates(double /*t*/, PairBuffer& /*out*/, const Budget& /*budget*/) override {
    return {};
  }

 protected:
  virtual void update(std::uint32_t body, double t) = 0;
  const LimitKernels* kernels_;

 private:
  void update_all(double t) {
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body)
      if (this->scene_.moving(body)) update(body, t);
  }
};

template <class S>
class MovedBytes final : public Limit<S, Foresight::none> {
 public:
  MovedBytes(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies, const Params&)
      : Limit<S, Foresight::none>(scene, motion), hierarchies_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      hierarchies_[body].assign(std::move(topologies[body]), scene.primitives(body), active_kernel_set());
  }
  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const auto& hierarchy : hierarchies_) total += hierarchy.bytes();
    return total;
  }

 private:
  void update(std::uint32_t body, double) override {
    auto& hierarchy = hierarchies_[body];
    const WideArrays<S> arrays = hierarchy.arrays();
    const std::size_t nodes = hierarchy.node_count();
    const struct {
      const void* data;
      void* target;  ///< null: read only
      std::size_t bytes;
    } arrays_moved[] = {
        {this->sampled_.positions(body), nullptr,
         std::size_t(3) * this->scene_.vertex_count(body) * sizeof(S)},
        {arrays.vertices, nullptr, hierarchy.listed_vertices() * sizeof(std::uint32_t)},
        {arrays.nodes, nullptr, nodes * sizeof(WideNode)},
        {nullptr, arrays.child_bounds, nodes * lane_scalars(hierarchy.topology().width) * sizeof(S)},
        {nullptr, arrays.node_bounds, nodes * 8 * sizeof(S)}};
    Workers& workers = this->sampled_.workers();
    if (!workers.several()) {
      for (const auto& one : arrays_moved) move(one.data, one.target, 0, one.bytes, sum_);
      return;
    }
    sums_.assign(workers.threads(), {sum_});
    for (const auto& one : arrays_moved) {
      const Parts cut{one.bytes, std::size_t(1) << 15};
      workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t runner) {
        auto sum = unsigned(sums_[runner].value);
        move(one.data, one.target, cut.begin(part), cut.end(part), sum);
        sums_[runner].value = sum;
      });
    }
    for (const OwnCount& sum : sums_) sum_ ^= unsigned(sum.value);
  }
  void move(const void* data, void* target, std::size_t begin, std::size_t end, unsigned& sum) const {
    if (target == nullptr)
      sum ^= this->kernels_->read(static_cast<const char*>(data) + begin, end - begin);
    else
      this->kernels_->write(static_cast<char*>(target) + begin, end - begin, sum);
  }
  std::vector<OwnCount> sums_;  ///< [runner]
  std::vector<WideHierarchy<S>> hierarchies_;
  unsigned sum_ = 0;
};

template <class S>
class PlainMotion final : public Limit<S, Foresight::whole_clip> {
 public:
  PlainMotion(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies, const Params&)
      : Limit<S, Foresight::whole_clip>(scene, motion), motion_(motion) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      positions_.emplace_back(std::size_t(3) * scene.vertex_count(body));
  }
  std::size_t bytes() const override {
    std::size_t total = 0;
    for (const auto& positions : positions_) total += positions.size() * sizeof(S);
    return total;
  }

 private:
  void update(std::uint32_t body, double t) override {
    const FlightPlans<S>& plans = motion_.plans(body);
    const auto times = plans.keyframe_times();
    const std::size_t k = plans.segment_at(t), next = std::min(k + 1, times.size() - 1);
    const double ratio = next == k || t <= times[k] ? 0 : (t - times[k]) / (times[next] - times[k]);
    if constexpr (sizeof(S) == 4)
      this->kernels_->lerp_float(plans.keyframe(k), plans.keyframe(next), positions_[body].size(),
                                 float(ratio), positions_[body].data());
    else
      this->kernels_->lerp_double(plans.keyframe(k), plans.keyframe(next), positions_[body].size(), ratio,
                                  positions_[body].data());
  }
  ClipMotion<S> motion_;
  std::vector<std::vector<S>> positions_;
};

Info limit(const char* id, const char* title) {
  Info info;
  info.id = id;
  info.title = title;
  info.family = "limit";
  info.citation = "kbvh; a limit for comparison, not a contestant";
  info.tightness = Tightness::none;
  info.guarantee = Guarantee::approximate;
  return info;
}

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(limits) {
  using namespace kbvh;
  Info bytes = limit("limit_moved_bytes", "limit: moving the bytes of a refit");
  bytes.topology.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16};
  bytes.parameters = {threads_parameter("positions and the moved bytes")};
  Info motion = limit("limit_plain_motion", "limit: plain interpolation of all positions");
  motion.positions = PositionUse::fetched;
  motion.topology.own = true;
  return {make_entry<MovedBytes>(bytes), make_entry<PlainMotion>(motion)};
}
