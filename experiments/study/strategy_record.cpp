#include "experiments/study/strategy_record.hpp"

#include "core/contract/about.hpp"

namespace kbvh::experiments {

using nlohmann::json;

json about_strategy(const Info& info) {
  return {{"id", info.id},
          {"title", info.title},
          {"family", info.family},
          {"baseline", info.baseline},
          {"guarantee", name(info.guarantee)},
          {"tightness", name(info.tightness)},
          {"foresight", name(info.foresight)},
          {"citation", info.citation},
          {"about", about(info.id)},
          {"own_scalar", info.own_scalar},
          {"version", info.version},
          {"instructions", info.instructions},
          {"remark", info.remark}};
}

json in_words(const BuilderConfig& builder) {
  return {{"method", name(builder.method)}, {"width", builder.width}, {"leaf_size", builder.leaf_size}};
}

json strategy_record(const ContestantSpec& spec) {
  const Info& info = spec.entry->info;
  json record = about_strategy(info);
  record["label"] = spec.label;
  record["builder"] = info.topology.own ? json() : in_words(spec.builder);
  record["params"] = json::object();
  for (const auto& [key, value] : spec.params) record["params"][key] = value;
  return record;
}

}  // namespace kbvh::experiments
