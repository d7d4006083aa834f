#include "core/facade/world.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include "core/facade/judgement.hpp"
#include "core/facade/typed_world.hpp"

namespace kbvh {

using namespace facade;

struct detail::WorldImplementation {
  std::variant<TypedWorld<float>, TypedWorld<double>> typed;
};

World::World(Precision precision) : implementation_(std::make_unique<detail::WorldImplementation>()) {
  if (precision == Precision::float64) implementation_->typed.emplace<TypedWorld<double>>();
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

template <class Work>
decltype(auto) World::in_scalar(const Work& work) {
  return std::visit(work, implementation_->typed);
}
template <class Work>
decltype(auto) World::in_scalar(const Work& work) const {
  return std::visit(work, std::as_const(implementation_->typed));
}

// ---- The scene, before `start`

std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const double> times, std::span<const float> positions,
                              const WorldCurves& curves) {
  return in_scalar([&](auto& world) { return world.add(name, connectivity, times, positions, curves); });
}
std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const double> times, std::span<const double> positions,
                              const WorldCurves& curves) {
  return in_scalar([&](auto& world) { return world.add(name, connectivity, times, positions, curves); });
}
std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const float> positions) {
  return in_scalar([&](auto& world) { return world.add(name, connectivity, positions); });
}
std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const double> positions) {
  return in_scalar([&](auto& world) { return world.add(name, connectivity, positions); });
}

std::uint32_t World::add_body_over(std::uint32_t body, const std::string& name,
                                   const Connectivity& connectivity) {
  return in_scalar([&](auto& world) { return world.add_over(body, name, connectivity); });
}

void World::set_radius(double radius) {
  in_scalar([&](auto& world) { world.set_radius(radius); });
}

void World::add_pair(std::uint32_t body_a, std::uint32_t body_b) {
  in_scalar([&](auto& world) {
    world.check_not_started();
    world.check_body(body_a);
    world.check_body(body_b);
    const BodyPair pair{std::min(body_a, body_b), std::max(body_a, body_b)};
    for (const BodyPair& known : world.scene.pairs)
      if (known.first == pair.first && known.second == pair.second)
        throw std::invalid_argument("bodies " + std::to_string(body_a) + " and " + std::to_string(body_b) +
                                    " are a pair already");
    world.scene.pairs.push_back(pair);
  });
}

void World::start(const std::string& strategy, const std::map<std::string, std::string>& params, double t,
                  const std::map<std::string, std::string>& topology) {
  in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.check_not_started();
    const Contestant contestant = contestant_of(strategy, params, topology);
    world.check_takes_radius(contestant.entry->info);
    world.played = std::make_unique<Scene<S>>(world.whole_scene());
    auto session = std::make_unique<Session<S>>(*world.played, contestant);
    session->reset(t);
    world.started = std::move(session);
    world.fetched_for_questions = 0;
    world.given.resize(world.played->bodies.size());
  });
}

// ---- Time

void World::reset(double t) {
  in_scalar([&](auto& world) {
    world.session().reset(t);
    world.fetched_for_questions = 0;
  });
}
void World::advance(double t) {
  in_scalar([&](auto& world) { world.session().advance(t, world.ignored); });
}
double World::time() const {
  return in_scalar([](const auto& world) { return world.time(); });
}

void World::set_positions(std::uint32_t body, std::span<const float> positions) {
  in_scalar([&](auto& world) { world.set(body, positions); });
}
void World::set_positions(std::uint32_t body, std::span<const double> positions) {
  in_scalar([&](auto& world) { world.set(body, positions); });
}
void World::set_positions(std::uint32_t body, std::span<const float> positions,
                          std::span<const std::uint32_t> moved) {
  in_scalar([&](auto& world) { world.set(body, positions, moved); });
}
void World::set_positions(std::uint32_t body, std::span<const double> positions,
                          std::span<const std::uint32_t> moved) {
  in_scalar([&](auto& world) { world.set(body, positions, moved); });
}

void World::change_plans(const std::vector<WorldPlan>& plans) {
  in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.check_no_radius("takes no changes of plans");
    std::vector<PlanChange<S>> changes;
    for (const WorldPlan& plan : plans) {
      PlanChange<S>& change = changes.emplace_back();
      change.body = plan.body;
      change.vertex = plan.vertex;
      change.times = plan.times;
      change.positions = converted<S>(std::span<const double>(plan.positions));
      for (int axis = 0; axis < 3; ++axis) change.velocity[axis] = S(plan.velocity[axis]);
    }
    if (!world.session().info().can.plan_changes)
      throw std::logic_error("'" + world.session().info().id + "' does not declare flight-plan changes");
    world.session().change_plans(changes, world.ignored);
  });
}

void World::change_geometry(const WorldEdit& edit) {
  in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.session();
    if (!edit.vertices.empty() || !edit.removed_vertices.empty())
      world.check_no_radius("takes no changes of vertices");
    GeometryChange<S> change;
    for (const WorldEdit::Vertex& vertex : edit.vertices) {
      world.check_body(vertex.body);
      if (world.played->bodies[vertex.body].plans.is_handed_in())
        throw std::invalid_argument("body '" + world.played->bodies[vertex.body].name +
                                    "' gets no vertices: its positions are set frame by frame");
      auto& made = change.vertices.emplace_back();
      made.body = vertex.body;
      for (int axis = 0; axis < 3; ++axis) {
        made.position[axis] = S(vertex.position[axis]);
        made.plan.velocity[axis] = S(vertex.velocity[axis]);
      }
    }
    for (const WorldEdit::Primitive& primitive : edit.primitives)
      change.primitives.push_back({primitive.body, world.as_played(primitive.body, primitive.vertices)});
    for (const WorldEdit::Id& id : edit.removed_primitives)
      change.removed_primitives.push_back({id.body, id.id});
    for (const WorldEdit::Id& id : edit.removed_vertices) change.removed_vertices.push_back({id.body, id.id});
    world.session().change_geometry(change, world.ignored);
  });
}

// ---- Questions

void World::pairs(std::vector<WorldPair>& out) {
  in_scalar([&](auto& world) {
    world.session().query(world.pairs, world.ignored);
    replace(out, world.pairs);
  });
}
void World::changes(std::vector<WorldPair>& begun, std::vector<WorldPair>& ended) {
  if (&begun == &ended) throw std::invalid_argument("changes need two lists, not one twice");
  in_scalar([&](auto& world) {
    world.session().changes(Answer::pairs, world.pairs, world.ended, world.ignored);
    replace(begun, world.pairs);
    replace(ended, world.ended);
  });
}
void World::spans(double t, std::vector<WorldSpan>& out) {
  in_scalar([&](auto& world) {
    if (!world.session().info().can.spans)
      throw std::logic_error("'" + world.session().info().id + "' does not declare spans");
    if (!(t >= world.time()) || !std::isfinite(t))
      throw std::invalid_argument("spans from t = " + number_text(world.time()) +
                                  " to t = " + number_text(t));
    world.spans.clear();
    world.session().spans(t, world.spans);
    out.clear();
    for (const PairSpan& span : world.spans) out.push_back({plain(span.pair), span.begin, span.end});
  });
}
void World::contacts(double t, std::vector<WorldContact>& out) {
  in_scalar([&](auto& world) {
    world.check_no_radius("finds no contacts");
    world.contacts.clear();
    world.session().contacts(t, world.contacts, world.ignored);
    out.clear();
    for (const Contact& contact : world.contacts)
      out.push_back({WorldContact::Kind(contact.kind), contact.body_a, contact.feature_a, contact.body_b,
                     contact.feature_b, contact.begin, contact.end});
  });
}
double World::next_knot() const {
  return in_scalar([](const auto& world) { return world.session().next_knot(); });
}
void World::hits(WorldRayQuery query, std::span<const WorldRay> rays, std::vector<WorldHit>& out) {
  in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.check_no_radius("answers no rays");
    world.rays.clear();
    for (const WorldRay& ray : rays) world.rays.push_back(typed<S>(ray));
    world.hits.resize(rays.size());
    world.session().probe(RayProbes<S>{RayQuery(query), world.rays, std::span<RayHit>(world.hits)},
                          world.ignored);
    out.clear();
    for (const RayHit& hit : world.hits) out.push_back({hit.body, hit.primitive, hit.parameter});
  });
}

void World::within(std::span<const WorldBall> balls, std::vector<WorldBallHit>& out) {
  in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.check_no_radius("answers no balls");
    world.balls.clear();
    for (const auto& [centre, radius] : balls)
      world.balls.push_back({{S(centre[0]), S(centre[1]), S(centre[2])}, S(radius)});
    world.ball_hits.clear();
    world.session().probe(BallProbes<S>{world.balls, &world.ball_hits}, world.ignored);
    std::sort(world.ball_hits.begin(), world.ball_hits.end());
    out.clear();
    for (const BallHit& hit : world.ball_hits) out.push_back({hit.ball, hit.body, hit.primitive});
  });
}

void World::positions(std::uint32_t body, std::vector<double>& out) {
  in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.check_body(body);
    Playback<S>& playback = world.session().playback();
    const FlightPlans<S>& plans = world.vertex_plans(body);
    const std::size_t size = std::size_t(3) * plans.vertex_count();
    const S* numbers = world.radius ? world.vertex_positions(body) : playback.positions(body);
    std::vector<S> evaluated;
    if (!world.radius && !plans.is_handed_in() && !playback.all_current(body)) {
      evaluated.resize(size + 1);
      plans.evaluate(playback.time(), evaluated.data());
      numbers = evaluated.data();
    }
    out.assign(numbers, numbers + size);
  });
}
void World::positions(std::uint32_t body, double t, std::vector<double>& out) const {
  in_scalar([&]<class S>(const TypedWorld<S>& world) {
    world.check_body(body);
    const FlightPlans<S>& plans = world.vertex_plans(body);
    if (plans.is_handed_in())
      throw std::logic_error("the motion of body '" + world.scene.bodies[body].name +
                             "' is not known, so it has no positions at t = " + number_text(t));
    if (!std::isfinite(t)) throw std::invalid_argument("there are no positions at t = " + number_text(t));
    std::vector<S> numbers(std::size_t(3) * plans.vertex_count() + 1);
    plans.evaluate(t, numbers.data());
    out.assign(numbers.begin(), numbers.end() - 1);
  });
}

bool World::hierarchy(std::uint32_t body, WorldHierarchy& out) const {
  return in_scalar([&]<class S>(const TypedWorld<S>& world) {
    world.check_body(body);
    Session<S>& session = world.session();
    const std::uint64_t fetched = session.playback().fetched();
    const auto view = session.strategy().audit_view(body);
    world.fetched_for_questions += session.playback().fetched() - fetched;
    out = {};
    if (!view) return false;
    const Topology& topology = view->topology;
    const EventSource<S>* const source = session.strategy().events();
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
    // The view renumbers the nodes of an edited tree; children keep their order.
    if (source != nullptr)
      for (WorldNode& node : out.nodes)
        for (std::uint32_t i = 0; !node.leaf && i < node.count; ++i)
          out.nodes[node.first + i].event_node = source->tree(body).nodes[node.event_node].first() + i;
    return true;
  });
}
bool World::realisers(std::uint32_t body, std::vector<std::uint32_t>& out) const {
  return in_scalar([&]<class S>(const TypedWorld<S>& world) {
    world.check_body(body);
    out.clear();
    const EventSource<S>* const source = world.session().strategy().events();
    WorldHierarchy tree;
    if (source == nullptr || !hierarchy(body, tree)) return false;
    for (const WorldNode& node : tree.nodes)
      for (std::uint32_t side = 0; side < 6; ++side)
        out.push_back(source->realiser(body, node.event_node, side));
    return true;
  });
}
void World::watched_pairs(std::vector<WorldWatch>& out) const {
  out.clear();
  std::vector<WatchedPair> pairs;
  in_scalar([&](const auto& world) {
    if (const auto* const source = world.session().strategy().events()) source->watched_pairs(pairs);
  });
  for (const WatchedPair& pair : pairs)
    out.push_back({pair.body, pair.node, pair.other_body, pair.other_node, pair.overlapping, pair.listed});
  std::sort(out.begin(), out.end());
}

std::vector<WorldCounter> World::counters() const {
  return in_scalar([](const auto& world) {
    Counters table = world.session().strategy().counters();
    std::uint64_t& fetched = table[Counter::positions_fetched];
    fetched -= std::min(fetched, world.fetched_for_questions);
    std::vector<WorldCounter> out;
    for (std::size_t c = 0; c < table.values.size(); ++c) out.push_back({name(Counter(c)), table.values[c]});
    for (const Counters::Named& counter : table.named)
      out.push_back({std::string(counter.name), counter.value});
    return out;
  });
}
WorldPositions World::current_positions(std::uint32_t body) {
  return in_scalar([&]<class S>(TypedWorld<S>& world) -> WorldPositions {
    world.check_body(body);
    const S* const numbers = world.radius ? world.vertex_positions(body) : world.fetched(body);
    return {sizeof(S) == 4 ? Precision::float32 : Precision::float64, world.vertex_plans(body).vertex_count(),
            numbers};
  });
}

// ---- Judgement

std::vector<double> World::frame_times(std::uint32_t per_keyframe) const {
  if (per_keyframe == 0) throw std::invalid_argument("0 frames per keyframe interval");
  return in_scalar([&](const auto& world) { return kbvh::frame_times(world.scene, per_keyframe); });
}
void World::true_pairs(std::vector<WorldPair>& out) {
  in_scalar([&](auto& world) {
    replace(out, brute_force_pairs(world.session().scene(), world.session().playback()));
  });
}
bool World::audit(std::uint32_t body, WorldAudit& out) {
  return in_scalar([&](auto& world) {
    world.check_body(body);
    out = {};
    const auto view = world.session().strategy().audit_view(body);
    if (!view) return false;
    out = plain(kbvh::audit(*view, world.session().scene().bodies[body].primitives, world.fetched(body)));
    return true;
  });
}
WorldVerdict World::verify(const std::string& strategy, std::span<const double> frames,
                           const std::map<std::string, std::string>& params,
                           const std::map<std::string, std::string>& topology) const {
  return in_scalar([&]<class S>(const TypedWorld<S>& world) {
    check_frames(frames);
    for (const Body<S>& body : world.scene.bodies)
      if (body.plans.is_handed_in())
        throw std::invalid_argument("body '" + body.name +
                                    "' cannot be verified: its positions are set frame by frame");
    const Contestant contestant = contestant_of(strategy, params, topology);
    world.check_takes_radius(contestant.entry->info);
    const Scene<S> scene = world.whole_scene();
    Session<S> session(scene, contestant);
    Oracle<S> oracle(scene);
    return plain(kbvh::verify(session, frames, oracle));
  });
}

// ---- Single events, for event-driven strategies

bool World::has_events() const {
  return in_scalar([](const auto& world) { return world.session().strategy().events() != nullptr; });
}
double World::next_event_time() const {
  return in_scalar([](const auto& world) { return world.events().next_event_time(); });
}
void World::scheduled_events(std::vector<WorldEvent>& out) const {
  in_scalar([&]<class S>(const TypedWorld<S>& world) {
    std::vector<ScheduledEvent<S>> queue;
    world.events().scheduled_events(queue);
    out.clear();
    for (const ScheduledEvent<S>& event : queue) out.push_back(plain(event));
  });
}
bool World::step_event(double until, WorldStep& out) {
  return in_scalar([&]<class S>(TypedWorld<S>& world) {
    world.events();
    if (!world.session().step_event(until, world.done)) return false;
    out.event = plain(world.done.event);
    out.touched.clear();
    out.rescheduled.clear();
    for (const BoundNotice<S>& notice : world.done.touched)
      out.touched.push_back({notice.body, notice.node, notice.side, notice.old_vertex, notice.new_vertex});
    for (const ScheduledEvent<S>& event : world.done.rescheduled) out.rescheduled.push_back(plain(event));
    return true;
  });
}

}  // namespace kbvh
