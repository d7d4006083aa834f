#include "core/facade/world.hpp"

#include <utility>

#include "core/facade/implementation.hpp"

namespace kbvh {

World::World(Precision precision) : implementation_(make_world(precision)) {}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const double> times, std::span<const float> positions) {
  return implementation_->add_body(name, connectivity, times, positions);
}
std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const double> times, std::span<const double> positions) {
  return implementation_->add_body(name, connectivity, times, positions);
}
std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const float> positions) {
  return implementation_->add_unknown_body(name, connectivity, positions);
}
std::uint32_t World::add_body(const std::string& name, const Connectivity& connectivity,
                              std::span<const double> positions) {
  return implementation_->add_unknown_body(name, connectivity, positions);
}
void World::add_pair(std::uint32_t body_a, std::uint32_t body_b) {
  implementation_->add_pair(body_a, body_b);
}
void World::start(const std::string& strategy, const std::map<std::string, std::string>& params, double t,
                  const std::map<std::string, std::string>& topology) {
  implementation_->start(strategy, params, t, topology);
}
void World::reset(double t) {
  implementation_->reset(t);
}
void World::advance(double t) {
  implementation_->advance(t);
}
double World::time() const {
  return implementation_->time();
}
void World::set_positions(std::uint32_t body, std::span<const float> positions) {
  implementation_->set_positions(body, positions);
}
void World::set_positions(std::uint32_t body, std::span<const double> positions) {
  implementation_->set_positions(body, positions);
}
void World::change_plans(const std::vector<WorldPlan>& plans) {
  implementation_->change_plans(plans);
}
void World::change_geometry(const WorldEdit& edit) {
  implementation_->change_geometry(edit);
}
void World::pairs(std::vector<WorldPair>& out) {
  implementation_->pairs(out);
}
void World::changes(std::vector<WorldPair>& begun, std::vector<WorldPair>& ended) {
  implementation_->changes(begun, ended);
}
void World::spans(double t, std::vector<WorldSpan>& out) {
  implementation_->spans(t, out);
}
void World::contacts(double t, std::vector<WorldContact>& out) {
  implementation_->contacts(t, out);
}
double World::next_knot() const {
  return implementation_->next_knot();
}
void World::hits(WorldRayQuery query, std::span<const WorldRay> rays, std::vector<WorldHit>& out) {
  implementation_->hits(query, rays, out);
}
void World::positions(std::uint32_t body, std::vector<double>& out) {
  implementation_->positions(body, out);
}
void World::positions(std::uint32_t body, double t, std::vector<double>& out) const {
  std::as_const(*implementation_).positions(body, t, out);
}
bool World::realisers(std::uint32_t body, std::vector<std::uint32_t>& out) const {
  return implementation_->realisers(body, out);
}
void World::watched_pairs(std::vector<WorldWatch>& out) const {
  implementation_->watched_pairs(out);
}
bool World::hierarchy(std::uint32_t body, WorldHierarchy& out) const {
  return implementation_->hierarchy(body, out);
}
std::vector<WorldCounter> World::counters() const {
  return implementation_->counters();
}
bool World::has_events() const {
  return implementation_->has_events();
}
double World::next_event_time() const {
  return implementation_->next_event_time();
}
void World::scheduled_events(std::vector<WorldEvent>& out) const {
  implementation_->scheduled_events(out);
}
bool World::step_event(double until, WorldStep& out) {
  return implementation_->step_event(until, out);
}
WorldPositions World::current_positions(std::uint32_t body) {
  return implementation_->current_positions(body);
}
std::vector<double> World::frame_times(std::uint32_t per_keyframe) const {
  return implementation_->frame_times(per_keyframe);
}
void World::true_pairs(std::vector<WorldPair>& out) {
  implementation_->true_pairs(out);
}
bool World::audit(std::uint32_t body, WorldAudit& out) {
  return implementation_->audit(body, out);
}
WorldVerdict World::verify(const std::string& strategy, std::span<const double> frames,
                           const std::map<std::string, std::string>& params,
                           const std::map<std::string, std::string>& topology) const {
  return implementation_->verify(strategy, frames, params, topology);
}

}  // namespace kbvh
