#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/facade/conversions.hpp"
#include "core/facade/implementation.hpp"
#include "core/facade/judgement.hpp"
#include "core/motion/admissible.hpp"
#include "core/scene/cut_polygons.hpp"

namespace kbvh {
namespace {

using namespace facade;

template <class S>
class TypedWorld final : public detail::WorldImplementation {
 public:
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> times, std::span<const float> positions) override {
    return add(name, connectivity, times, converted<S>(positions));
  }
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> times, std::span<const double> positions) override {
    return add(name, connectivity, times, converted<S>(positions));
  }
  std::uint32_t add_unknown_body(const std::string& name, const Connectivity& connectivity,
                                 std::span<const float> positions) override {
    return add_unknown(name, connectivity, converted<S>(positions));
  }
  std::uint32_t add_unknown_body(const std::string& name, const Connectivity& connectivity,
                                 std::span<const double> positions) override {
    return add_unknown(name, connectivity, converted<S>(positions));
  }

  void add_pair(std::uint32_t a, std::uint32_t b) override {
    check_not_started();
    check_body(a);
    check_body(b);
    const BodyPair pair{std::min(a, b), std::max(a, b)};
    for (const BodyPair& known : scene_.pairs)
      if (known.first == pair.first && known.second == pair.second)
        throw std::invalid_argument("bodies " + std::to_string(a) + " and " + std::to_string(b) +
                                    " are a pair already");
    scene_.pairs.push_back(pair);
  }

  void start(const std::string& strategy, const std::map<std::string, std::string>& params, double t,
             const std::map<std::string, std::string>& topology) override {
    check_not_started();
    const Contestant contestant = contestant_of(strategy, params, topology);
    played_ = std::make_unique<Scene<S>>(whole_scene());
    auto session = std::make_unique<Session<S>>(*played_, contestant);
    session->reset(t);
    session_ = std::move(session);
    fetched_for_questions_ = 0;
    given_.resize(played_->bodies.size());
  }

  void reset(double t) override {
    session().reset(t);
    fetched_for_questions_ = 0;
  }
  void advance(double t) override { session().advance(t, ignored_); }
  double time() const override { return session().playback().time(); }

  void set_positions(std::uint32_t body, std::span<const float> positions) override { set(body, positions); }
  void set_positions(std::uint32_t body, std::span<const double> positions) override { set(body, positions); }

  void change_plans(const std::vector<WorldPlan>& plans) override {
    std::vector<PlanChange<S>> changes;
    for (const WorldPlan& plan : plans) {
      PlanChange<S>& change = changes.emplace_back();
      change.body = plan.body;
      change.vertex = plan.vertex;
      change.times = plan.times;
      change.positions = converted<S>(std::span<const double>(plan.positions));
      for (int axis = 0; axis < 3; ++axis) change.velocity[axis] = S(plan.velocity[axis]);
    }
    if (!session().info().can.plan_changes)
      throw std::logic_error("'" + session().info().id + "' does not declare flight-plan changes");
    session().change_plans(changes, ignored_);
  }
  void change_geometry(const WorldEdit& edit) override {
    session();
    GeometryChange<S> change;
    for (const WorldEdit::Vertex& vertex : edit.vertices) {
      check_body(vertex.body);
      if (played_->bodies[vertex.body].plans.is_handed_in())
        throw std::invalid_argument("body '" + played_->bodies[vertex.body].name +
                                    "' gets no vertices: its positions are set frame by frame");
      auto& made = change.vertices.emplace_back();
      made.body = vertex.body;
      for (int axis = 0; axis < 3; ++axis) {
        made.position[axis] = S(vertex.position[axis]);
        made.plan.velocity[axis] = S(vertex.velocity[axis]);
      }
    }
    for (const WorldEdit::Primitive& primitive : edit.primitives)
      change.primitives.push_back({primitive.body, primitive.vertices});
    for (const WorldEdit::Id& id : edit.removed_primitives)
      change.removed_primitives.push_back({id.body, id.id});
    for (const WorldEdit::Id& id : edit.removed_vertices) change.removed_vertices.push_back({id.body, id.id});
    session().change_geometry(change, ignored_);
  }

  void pairs(std::vector<WorldPair>& out) override {
    session().query(pairs_, ignored_);
    replace(out, pairs_);
  }
  void changes(std::vector<WorldPair>& begun, std::vector<WorldPair>& ended) override {
    if (&begun == &ended) throw std::invalid_argument("changes need two lists, not one twice");
    session().changes(Answer::pairs, pairs_, ended_, ignored_);
    replace(begun, pairs_);
    replace(ended, ended_);
  }
  void spans(double t, std::vector<WorldSpan>& out) override {
    if (!session().info().can.spans)
      throw std::logic_error("'" + session().info().id + "' does not declare spans");
    if (!(t >= time()) || !std::isfinite(t))
      throw std::invalid_argument("spans from t = " + number_text(time()) + " to t = " + number_text(t));
    spans_.clear();
    session().spans(t, spans_);
    out.clear();
    for (const PairSpan& span : spans_) out.push_back({plain(span.pair), span.begin, span.end});
  }
  void contacts(double t, std::vector<WorldContact>& out) override {
    contacts_.clear();
    session().contacts(t, contacts_, ignored_);
    out.clear();
    for (const Contact& contact : contacts_)
      out.push_back({WorldContact::Kind(contact.kind), contact.body_a, contact.feature_a, contact.body_b,
                     contact.feature_b, contact.begin, contact.end});
  }
  double next_knot() const override { return session().next_knot(); }
  void hits(WorldRayQuery query, std::span<const WorldRay> rays, std::vector<WorldHit>& out) override {
    rays_.clear();
    for (const WorldRay& ray : rays) rays_.push_back(typed<S>(ray));
    hits_.resize(rays.size());
    session().hits(RayQuery(query), rays_, std::span<RayHit>(hits_), ignored_);
    out.clear();
    for (const RayHit& hit : hits_) out.push_back({hit.body, hit.primitive, hit.parameter});
  }

  void positions(std::uint32_t body, std::vector<double>& out) override {
    check_body(body);
    Playback<S>& playback = session().playback();
    const FlightPlans<S>& plans = playback.plans(body);
    const std::size_t size = std::size_t(3) * plans.vertex_count();
    const S* numbers = playback.positions(body);
    std::vector<S> evaluated;
    if (!plans.is_handed_in() && !playback.all_current(body)) {
      evaluated.resize(size + 1);
      plans.evaluate(playback.time(), evaluated.data());
      numbers = evaluated.data();
    }
    out.assign(numbers, numbers + size);
  }
  bool hierarchy(std::uint32_t body, WorldHierarchy& out) const override {
    check_body(body);
    const std::uint64_t fetched = session().playback().fetched();
    const auto view = session().strategy().audit_view(body);
    fetched_for_questions_ += session().playback().fetched() - fetched;
    out = {};
    if (!view) return false;
    const Topology& topology = view->topology;
    const EventSource<S>* const source = session().strategy().events();
    out.primitives = topology.primitives;
    for (std::uint32_t i = 0; i < topology.size(); ++i) {
      const TopologyNode node = topology.nodes[i];
      WorldNode& made = out.nodes.emplace_back();
      made = {topology.parents[i],
              node.first(),
              node.count(),
              node.is_leaf(),
              !view->stale.empty() && view->stale[i] != 0,
              {},
              {},
              i};
      for (int axis = 0; axis < 3; ++axis) {
        made.lower[axis] = view->boxes[i].lower[axis];
        made.upper[axis] = view->boxes[i].upper[axis];
      }
    }
    // The view numbers the nodes of an edited tree anew; children keep their order.
    if (source != nullptr)
      for (WorldNode& node : out.nodes)
        for (std::uint32_t i = 0; !node.leaf && i < node.count; ++i)
          out.nodes[node.first + i].event_node = source->tree(body).nodes[node.event_node].first() + i;
    return true;
  }
  void positions(std::uint32_t body, double t, std::vector<double>& out) const override {
    check_body(body);
    const FlightPlans<S>& plans = session().playback().plans(body);
    if (plans.is_handed_in())
      throw std::logic_error("the motion of body '" + scene_.bodies[body].name +
                             "' is not known, so it has no positions at t = " + number_text(t));
    if (!std::isfinite(t)) throw std::invalid_argument("there are no positions at t = " + number_text(t));
    std::vector<S> numbers(std::size_t(3) * plans.vertex_count() + 1);
    plans.evaluate(t, numbers.data());
    out.assign(numbers.begin(), numbers.end() - 1);
  }
  bool realisers(std::uint32_t body, std::vector<std::uint32_t>& out) const override {
    check_body(body);
    out.clear();
    const EventSource<S>* const source = session().strategy().events();
    WorldHierarchy tree;
    if (source == nullptr || !hierarchy(body, tree)) return false;
    for (const WorldNode& node : tree.nodes)
      for (std::uint32_t side = 0; side < 6; ++side)
        out.push_back(source->realiser(body, node.event_node, side));
    return true;
  }
  void watched_pairs(std::vector<WorldWatch>& out) const override {
    out.clear();
    const EventSource<S>* const source = session().strategy().events();
    if (source == nullptr) return;
    std::vector<WatchedPair> pairs;
    source->watched_pairs(pairs);
    for (const WatchedPair& pair : pairs)
      out.push_back({pair.body, pair.node, pair.other_body, pair.other_node, pair.overlapping, pair.listed});
    std::sort(out.begin(), out.end());
  }
  std::vector<WorldCounter> counters() const override {
    Counters table = session().strategy().counters();
    std::uint64_t& fetched = table[Counter::positions_fetched];
    fetched -= std::min(fetched, fetched_for_questions_);
    std::vector<WorldCounter> out;
    for (std::size_t c = 0; c < table.values.size(); ++c) out.push_back({name(Counter(c)), table.values[c]});
    for (const Counters::Named& counter : table.named)
      out.push_back({std::string(counter.name), counter.value});
    return out;
  }

  bool has_events() const override { return session().strategy().events() != nullptr; }
  double next_event_time() const override { return events().next_event_time(); }
  void scheduled_events(std::vector<WorldEvent>& out) const override {
    std::vector<ScheduledEvent<S>> queue;
    events().scheduled_events(queue);
    out.clear();
    for (const ScheduledEvent<S>& event : queue) out.push_back(plain(event));
  }
  bool step_event(double until, WorldStep& out) override {
    events();
    if (!session().step_event(until, done_)) return false;
    out.event = plain(done_.event);
    out.touched.clear();
    out.rescheduled.clear();
    for (const BoundNotice<S>& notice : done_.touched)
      out.touched.push_back({notice.body, notice.node, notice.side, notice.old_vertex, notice.new_vertex});
    for (const ScheduledEvent<S>& event : done_.rescheduled) out.rescheduled.push_back(plain(event));
    return true;
  }

  WorldPositions current_positions(std::uint32_t body) override {
    check_body(body);
    const S* const numbers = fetched(body);
    return {sizeof(S) == 4 ? Precision::float32 : Precision::float64,
            session().playback().plans(body).vertex_count(), numbers};
  }
  std::vector<double> frame_times(std::uint32_t per_keyframe) const override {
    if (per_keyframe == 0) throw std::invalid_argument("0 frames per keyframe interval");
    return kbvh::frame_times(scene_, per_keyframe);
  }
  void true_pairs(std::vector<WorldPair>& out) override {
    const PairBuffer pairs = brute_force_pairs(session().scene(), session().playback());
    replace(out, pairs);
  }
  bool audit(std::uint32_t body, WorldAudit& out) override {
    check_body(body);
    out = {};
    const auto view = session().strategy().audit_view(body);
    if (!view) return false;
    out = plain(kbvh::audit(*view, session().scene().bodies[body].primitives, fetched(body)));
    return true;
  }
  WorldVerdict verify(const std::string& strategy, std::span<const double> frames,
                      const std::map<std::string, std::string>& params,
                      const std::map<std::string, std::string>& topology) const override {
    check_frames(frames);
    for (const Body<S>& body : scene_.bodies)
      if (body.plans.is_handed_in())
        throw std::invalid_argument("body '" + body.name +
                                    "' cannot be verified: its positions are set frame by frame");
    const Contestant contestant = contestant_of(strategy, params, topology);
    const Scene<S> scene = whole_scene();
    Session<S> session(scene, contestant);
    Oracle<S> oracle(scene);
    return plain(kbvh::verify(session, frames, oracle));
  }

 private:
  static Contestant contestant_of(const std::string& strategy,
                                  const std::map<std::string, std::string>& params,
                                  const std::map<std::string, std::string>& topology) {
    const StrategyEntry& entry = find_strategy(strategy);
    for (const auto& [key, value] : topology)
      if (key != "method" && key != "width" && key != "leaf_size")
        throw std::invalid_argument("a topology has the keys method, width and leaf_size, not '" + key + "'");
    const auto method = topology.find("method");
    return {
        &entry, params,
        suitable_builder(
            entry.info, method == topology.end() ? std::nullopt : std::optional(build_method(method->second)),
            number_of(topology, "width"), number_of(topology, "leaf_size"))};
  }
  /// Copies the scene as it is played: the added bodies stay if a strategy does not suit them.
  Scene<S> whole_scene() const {
    Scene<S> scene = scene_;
    if (scene.pairs.empty()) scene.pairs = all_pairs(scene.bodies);
    validate(scene);
    return scene;
  }
  /// Returns the positions of a body, evaluated for a question.
  const S* fetched(std::uint32_t body) {
    Playback<S>& playback = session().playback();
    const std::uint64_t before = playback.fetched();
    playback.fetch_all(body);
    fetched_for_questions_ += playback.fetched() - before;
    return playback.positions(body);
  }

  std::uint32_t add(const std::string& name, const Connectivity& connectivity, std::span<const double> times,
                    std::vector<S> positions) {
    const std::size_t frames = times.size();
    if (frames == 0 || positions.size() % (3 * frames) != 0)
      throw std::invalid_argument("body '" + name + "': " + std::to_string(positions.size()) +
                                  " coordinates for " + std::to_string(frames) + " keyframes");
    const auto vertices = std::uint32_t(positions.size() / (3 * frames));
    return add(name, connectivity,
               FlightPlans<S>(vertices, {times.begin(), times.end()}, std::move(positions)));
  }
  std::uint32_t add_unknown(const std::string& name, const Connectivity& connectivity,
                            std::vector<S> positions) {
    if (positions.size() % 3 != 0)
      throw std::invalid_argument("body '" + name + "': " + std::to_string(positions.size()) +
                                  " coordinates are no positions");
    const auto vertices = std::uint32_t(positions.size() / 3);
    return add(name, connectivity, FlightPlans<S>::handed_in(vertices, std::move(positions)));
  }
  std::uint32_t add(const std::string& name, const Connectivity& connectivity, FlightPlans<S> plans) {
    check_not_started();
    Scene<S> alone;
    alone.bodies.push_back({name, primitives_of(connectivity), std::move(plans)});
    validate(alone);
    cut_polygons(alone);
    scene_.bodies.push_back(std::move(alone.bodies[0]));
    return std::uint32_t(scene_.bodies.size() - 1);
  }

  template <class T>
  void set(std::uint32_t body, std::span<const T> positions) {
    check_body(body);
    session();
    const Body<S>& target = played_->bodies[body];
    if (!target.plans.is_handed_in())
      throw std::logic_error("the motion of body '" + target.name + "' is known; positions cannot be set");
    const std::size_t size = std::size_t(3) * target.plans.vertex_count();
    if (positions.size() != size && positions.size() != size + 1)
      throw std::invalid_argument("body '" + target.name + "' has " + std::to_string(size) +
                                  " coordinates, not " + std::to_string(positions.size()));
    for (std::size_t i = 0; i < size; ++i)
      if (!(std::abs(S(positions[i])) <= admissible_magnitude<S>))
        throw std::invalid_argument("body '" + target.name + "', vertex " + std::to_string(i / 3) +
                                    ": coordinate " + number_text(double(positions[i])) +
                                    " is not finite or not admissible");
    if constexpr (std::is_same_v<S, T>)
      if (positions.size() == size + 1) {
        session().hand_in(body, positions.data());
        return;
      }
    // Two alternating copies: a sweep begins at the positions that the motion view still shows.
    std::vector<S>* const copies = given_[body].array;
    std::vector<S>& copy = copies[session().playback().positions(body) == copies[0].data() ? 1 : 0];
    copy.resize(size + 1);
    for (std::size_t i = 0; i < size; ++i) copy[i] = S(positions[i]);
    session().hand_in(body, copy.data());
  }

  void check_not_started() const {
    if (session_) throw std::logic_error("the world has started, so its scene is fixed");
  }
  void check_body(std::uint32_t body) const {
    if (body >= scene_.bodies.size())
      throw std::invalid_argument("there is no body " + std::to_string(body) + " among " +
                                  std::to_string(scene_.bodies.size()));
  }
  Session<S>& session() const {
    if (!session_) throw std::logic_error("the world has not started: call start first");
    return *session_;
  }
  EventSource<S>& events() const {
    EventSource<S>* const source = session().strategy().events();
    if (source == nullptr) throw std::logic_error("'" + session().info().id + "' does not declare events");
    return *source;
  }

  struct Copies {
    std::vector<S> array[2];
  };
  Scene<S> scene_;
  std::unique_ptr<Scene<S>> played_;  ///< the session refers to it
  std::unique_ptr<Session<S>> session_;
  std::vector<Copies> given_;                        ///< [body]
  mutable std::uint64_t fetched_for_questions_ = 0;  ///< positions that are no work of the strategy
  PhaseTimes ignored_;
  PairBuffer pairs_, ended_;
  SpanBuffer spans_;
  ContactBuffer contacts_;
  std::vector<Ray<S>> rays_;
  std::vector<RayHit> hits_;
  EventDescription<S> done_;
};

}  // namespace

std::unique_ptr<detail::WorldImplementation> make_world(Precision precision) {
  if (precision == Precision::float32) return std::make_unique<TypedWorld<float>>();
  return std::make_unique<TypedWorld<double>>();
}

}  // namespace kbvh
