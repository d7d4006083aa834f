#include "experiments/results/record_times.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Reads means per frame as sums over frames.
PhaseTimes phases_of(const json& means, std::size_t frames) {
  const auto sum = [&](const char* name) { return means.value(name, 0.0) * double(frames); };
  return {sum("motion"),         sum("update"),       sum("traversal"),
          sum("triangle_tests"), sum("plan_changes"), sum("geometry_changes")};
}

}  // namespace

RawTimes raw_times(const json& record) {
  const json& times = record.at("times");
  RawTimes raw;
  raw.session = record.value("run", std::string());
  bool of_frames = true;
  for (const json& one : times.at("repetitions")) of_frames = of_frames && one.contains("totals");
  raw.by = of_frames && times.value("by", "frames") == "frames" ? By::frames : By::clips;
  if (of_frames && times.contains("steady_from") && times.at("steady_from").is_number_unsigned())
    raw.steady_from = times.at("steady_from").get<std::size_t>();
  for (const json& one : times.at("repetitions")) {
    if (of_frames) {
      raw.totals.push_back(one.at("totals").get<std::vector<double>>());
      raw.motions.push_back(one.at("motions").get<std::vector<double>>());
    } else {
      const PhaseTimes mean = phases_of(one, 1);
      raw.totals.push_back({mean.total()});
      raw.motions.push_back({mean.motion});
    }
    raw.clip.push_back(phases_of(one, raw.frames()));
    if (raw.steady_from) raw.steady.push_back(phases_of(one.at("steady"), raw.frames() - *raw.steady_from));
  }
  return raw;
}

}  // namespace kbvh::experiments
