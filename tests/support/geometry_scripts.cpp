#include "tests/support/geometry_scripts.hpp"

#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

namespace {

/// The ids that a scene has after the changes so far.
struct LivingBody {
  std::vector<std::vector<std::uint32_t>> corners;  ///< of every primitive ever
  std::vector<std::uint32_t> primitives;            ///< living
  std::vector<std::uint32_t> uses;                  ///< of every vertex ever
  std::vector<std::uint8_t> removed;                ///< of every vertex ever
};

template <class S>
class Writer {
 public:
  Writer(const Scene<S>& scene, const GeometryScriptStyle& style)
      : style_(style), random_(style.seed), bodies_(scene.bodies.size()) {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Primitives& primitives = scene.bodies[b].primitives;
      bodies_[b].uses.assign(scene.bodies[b].plans.vertex_count(), 0);
      bodies_[b].removed.assign(scene.bodies[b].plans.vertex_count(), 0);
      for (std::uint32_t p = 0; p < primitives.count(); ++p)
        enter(bodies_[b], {primitives[p].begin(), primitives[p].end()});
      kinds_.push_back(primitives.kind);
    }
  }

  typename PlanScript<S>::Step step(double t) {
    typename PlanScript<S>::Step step{t};
    const std::uint32_t body = random_.below(std::uint32_t(bodies_.size()));
    if (style_.to_nothing && random_.below(4) == 0) {
      while (!bodies_[body].primitives.empty()) remove(step.geometry, body);
      remove_unused(step.geometry, body);
      if (random_.below(2) == 0) insert(step.geometry, t, body);
      return step;
    }
    if (style_.plans) change_plans(step, t);  // before anything is removed or new
    for (std::uint32_t i = random_.below(6); i-- > 0;) remove(step.geometry, any_body());
    for (std::uint32_t i = random_.below(3); i-- > 0;) replace(step.geometry, any_body());
    if (random_.below(2) == 0) remove_unused(step.geometry, any_body());
    for (std::uint32_t i = random_.below(8); i-- > 0;) insert(step.geometry, t, any_body());
    return step;
  }

 private:
  std::uint32_t any_body() { return random_.below(std::uint32_t(bodies_.size())); }
  S coordinate() { return style_.integers ? S(random_.below(4)) : S(random_.unit()); }

  std::uint32_t enter(LivingBody& body, std::vector<std::uint32_t> corners) {
    for (const std::uint32_t v : corners) ++body.uses[v];
    const auto id = std::uint32_t(body.corners.size());
    body.primitives.push_back(id);
    body.corners.push_back(std::move(corners));
    return id;
  }
  /// Removes a primitive that is older than the change. Returns its id, or none.
  std::int64_t remove(GeometryChange<S>& change, std::uint32_t b) {
    LivingBody& body = bodies_[b];
    std::uint32_t first_new = std::uint32_t(body.corners.size());
    for (const auto& primitive : change.primitives) first_new -= primitive.body == b ? 1 : 0;
    if (body.primitives.empty()) return -1;
    const std::uint32_t at = random_.below(std::uint32_t(body.primitives.size()));
    const std::uint32_t id = body.primitives[at];
    if (id >= first_new) return -1;
    body.primitives[at] = body.primitives.back();
    body.primitives.pop_back();
    for (const std::uint32_t v : body.corners[id]) --body.uses[v];
    change.removed_primitives.push_back({b, id});
    return id;
  }
  /// The same primitive under a new id.
  void replace(GeometryChange<S>& change, std::uint32_t b) {
    const std::int64_t id = remove(change, b);
    if (id < 0) return;
    const auto corners = bodies_[b].corners[std::size_t(id)];
    enter(bodies_[b], corners);
    change.primitives.push_back({b, corners});
  }
  void remove_unused(GeometryChange<S>& change, std::uint32_t b) {
    LivingBody& body = bodies_[b];
    std::uint32_t first_new = std::uint32_t(body.uses.size());
    for (const auto& vertex : change.vertices) first_new -= vertex.body == b ? 1 : 0;
    for (std::uint32_t v = 0; v < first_new; ++v)
      if (body.uses[v] == 0 && body.removed[v] == 0 && random_.below(2) == 0) {
        body.removed[v] = 1;
        change.removed_vertices.push_back({b, v});
      }
  }
  PlanChange<S> plan(double t) {
    PlanChange<S> plan;
    const std::uint32_t kind = random_.below(4);
    if (kind != 0)
      for (S& v : plan.velocity) v = S(0.5 * random_.unit());
    if (kind >= 2)
      for (std::uint32_t k = 1; k <= 2; ++k) {
        plan.times.push_back(t + 0.2 * k);
        for (int axis = 0; axis < 3; ++axis) plan.positions.push_back(coordinate());
      }
    return plan;
  }
  void insert(GeometryChange<S>& change, double t, std::uint32_t b) {
    LivingBody& body = bodies_[b];
    const std::uint32_t size = kinds_[b] == PrimitiveKind::points ? 1 : random_.below(8) == 0 ? 5 : 3;
    std::vector<std::uint32_t> corners;
    S centre[3];
    for (S& c : centre) c = coordinate();
    const bool all_new = random_.below(2) == 0;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t old = body.uses.empty() ? 0 : random_.below(std::uint32_t(body.uses.size()));
      if (!all_new && random_.below(2) == 0 && !body.uses.empty() && body.removed[old] == 0) {
        corners.push_back(old);
        continue;
      }
      typename GeometryChange<S>::NewVertex vertex;
      vertex.body = b;
      for (int axis = 0; axis < 3; ++axis)
        vertex.position[axis] = style_.integers ? coordinate() : centre[axis] + S(0.25) * coordinate();
      vertex.plan = plan(t);
      change.vertices.push_back(vertex);
      corners.push_back(std::uint32_t(body.uses.size()));
      body.uses.push_back(0);
      body.removed.push_back(0);
    }
    enter(body, corners);
    change.primitives.push_back({b, corners});
  }
  void change_plans(typename PlanScript<S>::Step& step, double t) {
    for (std::uint32_t i = random_.below(6); i-- > 0;) {
      const std::uint32_t b = any_body();
      if (bodies_[b].uses.empty()) continue;
      PlanChange<S> change = plan(t);
      change.body = b;
      change.vertex = random_.below(std::uint32_t(bodies_[b].uses.size()));
      bool usable = bodies_[b].removed[change.vertex] == 0;
      for (const auto& other : step.changes)
        usable = usable && (other.body != b || other.vertex != change.vertex);
      if (usable) step.changes.push_back(change);
    }
  }

  GeometryScriptStyle style_;
  Random random_;
  std::vector<LivingBody> bodies_;
  std::vector<PrimitiveKind> kinds_;
};

}  // namespace

template <class S>
PlanScript<S> make_geometry_script(const Scene<S>& scene, const std::vector<double>& frames,
                                   const GeometryScriptStyle& style) {
  Writer<S> writer(scene, style);
  Random random(style.seed + 1000);
  PlanScript<S> script;
  for (std::size_t f = 0; f + 1 < frames.size(); f += 1 + random.below(2))
    script.steps.push_back(writer.step(frames[f]));
  return script;
}

template PlanScript<float> make_geometry_script(const Scene<float>&, const std::vector<double>&,
                                                const GeometryScriptStyle&);
template PlanScript<double> make_geometry_script(const Scene<double>&, const std::vector<double>&,
                                                 const GeometryScriptStyle&);

}  // namespace kbvh::test
