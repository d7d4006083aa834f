#include "analysis/lab/engine/pack.hpp"

#include <algorithm>
#include <span>

namespace kbvh::lab {

using nlohmann::json;

void PackedEvents::add(const WorldEvent& event) {
  const std::uint32_t flags =
      (event.exact ? 1U : 0U) | (event.winner_piece.ray ? 2U : 0U) | (event.loser_piece.ray ? 4U : 0U);
  words_.insert(words_.end(), {std::uint32_t(event.kind), event.body, event.node, event.side, event.winner,
                               event.loser, event.other_body, event.other_node, flags});
  numbers_.insert(numbers_.end(), {event.time, event.error});
  for (const WorldPiece* piece : {&event.winner_piece, &event.loser_piece})
    numbers_.insert(numbers_.end(), {piece->t0, piece->t1, piece->x0, piece->x1});
}

void PackedSteps::add(const WorldStep& step) {
  events_.add(step.event);
  for (const WorldBoundChange& change : step.touched)
    touched_.insert(touched_.end(),
                    {change.body, change.node, change.side, change.old_vertex, change.new_vertex});
  touched_ends_.push_back(std::uint32_t(touched_.size() / 5));
  for (const WorldEvent& event : step.rescheduled) rescheduled_.add(event);
  rescheduled_ends_.push_back(std::uint32_t(rescheduled_.size()));
}

json strategies_json() {
  json all = json::array();
  for (const WorldStrategy& strategy : World::strategy_descriptions()) {
    json parameters = json::array();
    for (const WorldParameter& parameter : strategy.parameters)
      parameters.push_back({{"name", parameter.name},
                            {"default", parameter.default_value},
                            {"allowed", parameter.allowed},
                            {"admissible", parameter.admissible},
                            {"meaning", parameter.meaning}});
    json precisions = json::array();
    if (strategy.has_float64) precisions.push_back("float64");
    if (strategy.has_float32) precisions.push_back("float32");
    all.push_back({{"id", strategy.id},
                   {"title", strategy.title},
                   {"family", strategy.family},
                   {"citation", strategy.citation},
                   {"about", strategy.about},
                   {"foresight", strategy.foresight},
                   {"tight", strategy.tight},
                   {"exact", strategy.exact},
                   {"events", strategy.events},
                   {"planChanges", strategy.plan_changes},
                   {"geometryChanges", strategy.geometry_changes},
                   {"spans", strategy.spans},
                   {"selfPairs", strategy.self_pairs},
                   {"widths", strategy.widths},
                   {"precisions", precisions},
                   {"parameters", parameters}});
  }
  return all;
}

json counters_json() {
  json all = json::array();
  for (const auto& [name, meaning] : World::counter_meanings())
    all.push_back({{"name", name}, {"meaning", meaning}});
  return all;
}

namespace {

/// Replaces the boxes by those of the realisers at the given positions. Parents come before their children.
void fit_to_realisers(WorldHierarchy& tree, const std::vector<std::uint32_t>& realisers,
                      const std::vector<double>& positions) {
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    WorldNode& node = tree.nodes[i];
    const WorldNode& parent = tree.nodes[node.parent];
    for (std::size_t side = 0; side < 6; ++side) {
      const std::size_t axis = side / 2;
      const std::uint32_t vertex = realisers[6 * i + side];
      (side % 2 == 0 ? node.lower : node.upper)[axis] =
          vertex != world_no_vertex ? positions[std::size_t(3) * vertex + axis]
                                    : (side % 2 == 0 ? parent.lower : parent.upper)[axis];
    }
    node.stale = false;
  }
}

json hierarchy_json(World& world, std::uint32_t body, const Moment& moment, Answer& answer) {
  WorldHierarchy tree;
  if (!world.hierarchy(body, tree)) return nullptr;
  std::vector<std::uint32_t> realisers;
  const bool realised = world.realisers(body, realisers);
  if (moment.between_frames && realised) {
    std::vector<double> positions;
    world.positions(body, moment.time, positions);
    fit_to_realisers(tree, realisers, positions);
  }
  std::vector<std::uint32_t> parent, first, count, leaf, stale, event_node, depth;
  std::vector<double> bounds;
  for (const WorldNode& node : tree.nodes) {
    depth.push_back(parent.empty() ? 0 : depth[node.parent] + 1);
    parent.push_back(node.parent);
    first.push_back(node.first);
    count.push_back(node.count);
    leaf.push_back(node.leaf ? 1 : 0);
    stale.push_back(node.stale ? 1 : 0);
    event_node.push_back(node.event_node);
    bounds.insert(bounds.end(), node.lower, node.lower + 3);
    bounds.insert(bounds.end(), node.upper, node.upper + 3);
  }
  return {{"parent", answer.add(std::move(parent))},
          {"first", answer.add(std::move(first))},
          {"count", answer.add(std::move(count))},
          {"leaf", answer.add(std::move(leaf))},
          {"stale", answer.add(std::move(stale))},
          {"eventNode", answer.add(std::move(event_node))},
          {"depth", answer.add(std::move(depth))},
          {"bounds", answer.add(std::move(bounds))},
          {"realisers", realised ? answer.add(std::move(realisers)) : json(nullptr)},
          {"primitives", answer.add(std::move(tree.primitives))}};
}

}  // namespace

json state_json(World& world, std::uint32_t bodies, const Moment& moment, const Wanted& wanted,
                const std::vector<WorldPair>& pairs, Answer& answer) {
  json state{{"time", moment.time}, {"betweenFrames", moment.between_frames}};
  if (wanted.positions) {
    json& list = state["positions"] = json::array();
    std::vector<double> positions;
    for (std::uint32_t body = 0; body < bodies; ++body) {
      if (moment.between_frames)
        world.positions(body, moment.time, positions);
      else
        world.positions(body, positions);
      list.push_back(answer.add(positions));
    }
  }
  if (wanted.nodes) {
    json& list = state["hierarchies"] = json::array();
    for (std::uint32_t body = 0; body < bodies; ++body)
      list.push_back(hierarchy_json(world, body, moment, answer));
  }
  if (wanted.pairs) {
    std::vector<std::uint32_t> words;
    for (const WorldPair& pair : std::span(pairs).first(std::min(pairs.size(), wanted.most_pairs)))
      words.insert(words.end(), {pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b});
    state["pairsCount"] = pairs.size();
    state["pairs"] = answer.add(std::move(words));
    std::vector<WorldWatch> watched;
    world.watched_pairs(watched);
    words.clear();
    for (const WorldWatch& pair : watched)
      words.insert(words.end(), {pair.body, pair.node, pair.other_body, pair.other_node,
                                 pair.overlapping ? 1U : 0U, pair.listed ? 1U : 0U});
    state["watched"] = answer.add(std::move(words));
  }
  if (wanted.queue) {
    PackedEvents packed;
    if (world.has_events()) {
      std::vector<WorldEvent> queue;
      world.scheduled_events(queue);
      state["queueLength"] = queue.size();
      queue.resize(std::min(queue.size(), wanted.most_events));
      for (const WorldEvent& event : queue) packed.add(event);
    }
    state["queue"] = packed.moved_to(answer);
  }
  if (wanted.counters)
    for (const WorldCounter& counter : world.counters()) state["counters"][counter.name] = counter.value;
  return state;
}

}  // namespace kbvh::lab
