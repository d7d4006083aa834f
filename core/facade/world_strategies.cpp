#include <algorithm>
#include <utility>

#include "core/contract/about.hpp"
#include "core/contract/registry.hpp"
#include "core/facade/world.hpp"

namespace kbvh {

std::vector<std::string> World::strategies() {
  std::vector<std::string> ids;
  for (const StrategyEntry& entry : registry()) ids.push_back(entry.info.id);
  return ids;
}
std::vector<std::pair<std::string, std::string>> World::counter_meanings() {
  std::vector<std::pair<std::string, std::string>> all;
  for (std::size_t c = 0; c < std::size_t(Counter::count); ++c)
    all.emplace_back(name(Counter(c)), meaning(Counter(c)));
  return all;
}
std::vector<WorldStrategy> World::strategy_descriptions() {
  std::vector<WorldStrategy> all;
  for (const StrategyEntry& entry : registry()) {
    const Info& info = entry.info;
    WorldStrategy& made = all.emplace_back();
    std::string foresight = name(info.foresight);
    std::replace(foresight.begin(), foresight.end(), '_', ' ');
    made = {info.id, info.title, info.family, info.citation, std::string(about(info.id)), foresight};
    made.tight = info.tightness == Tightness::tight;
    made.exact = info.guarantee == Guarantee::exact;
    made.events = info.can.events;
    made.plan_changes = info.can.plan_changes;
    made.geometry_changes = info.can.geometry_changes;
    made.spans = info.can.spans;
    made.self_pairs = info.can.self_pairs;
    made.has_float32 = info.has_float;
    made.has_float64 = info.has_double;
    if (!info.topology.own) made.widths = info.topology.widths;
    for (const Parameter& parameter : info.parameters)
      made.parameters.push_back({parameter.name, parameter.default_value, admissible(parameter),
                                 parameter.meaning, parameter.allowed, parameter.least, parameter.most,
                                 parameter.numbers == Numbers::whole});
    made.baseline = info.baseline;
    made.guarantee = name(info.guarantee);
    made.tightness = name(info.tightness);
    made.abilities = names(info.can);
    for (const PrimitiveKind kind : info.primitives) made.primitives.push_back(name(kind));
    made.max_primitive_pairs = info.max_primitive_pairs;
    made.max_coordinate = info.max_coordinate;
    if (info.topology.own) continue;
    made.method = name(info.topology.preferred.method);
    made.width = info.topology.preferred.width;
    made.leaf_size = info.topology.preferred.leaf_size;
  }
  return all;
}

}  // namespace kbvh
