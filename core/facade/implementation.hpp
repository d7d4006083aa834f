#pragma once
// Internal to the façade.
#include <memory>

#include "core/facade/world.hpp"

namespace kbvh {

/// A world without its scalar type.
class detail::WorldImplementation {
 public:
  virtual ~WorldImplementation() = default;
  virtual std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                                 std::span<const double> times, std::span<const float> positions) = 0;
  virtual std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                                 std::span<const double> times, std::span<const double> positions) = 0;
  virtual std::uint32_t add_unknown_body(const std::string& name, const Connectivity& connectivity,
                                         std::span<const float> positions) = 0;
  virtual std::uint32_t add_unknown_body(const std::string& name, const Connectivity& connectivity,
                                         std::span<const double> positions) = 0;
  virtual void add_pair(std::uint32_t a, std::uint32_t b) = 0;
  virtual void start(const std::string& strategy, const std::map<std::string, std::string>& params, double t,
                     const std::map<std::string, std::string>& topology) = 0;
  virtual void reset(double t) = 0;
  virtual void advance(double t) = 0;
  virtual double time() const = 0;
  virtual void set_positions(std::uint32_t body, std::span<const float> positions) = 0;
  virtual void set_positions(std::uint32_t body, std::span<const double> positions) = 0;
  virtual void change_plans(const std::vector<WorldPlan>& plans) = 0;
  virtual void change_geometry(const WorldEdit& edit) = 0;
  virtual void pairs(std::vector<WorldPair>& out) = 0;
  virtual void changes(std::vector<WorldPair>& begun, std::vector<WorldPair>& ended) = 0;
  virtual void spans(double t, std::vector<WorldSpan>& out) = 0;
  virtual void contacts(double t, std::vector<WorldContact>& out) = 0;
  virtual double next_knot() const = 0;
  virtual void hits(WorldRayQuery query, std::span<const WorldRay> rays, std::vector<WorldHit>& out) = 0;
  virtual void positions(std::uint32_t body, std::vector<double>& out) = 0;
  virtual void positions(std::uint32_t body, double t, std::vector<double>& out) const = 0;
  virtual bool hierarchy(std::uint32_t body, WorldHierarchy& out) const = 0;
  virtual bool realisers(std::uint32_t body, std::vector<std::uint32_t>& out) const = 0;
  virtual void watched_pairs(std::vector<WorldWatch>& out) const = 0;
  virtual std::vector<WorldCounter> counters() const = 0;
  virtual bool has_events() const = 0;
  virtual double next_event_time() const = 0;
  virtual void scheduled_events(std::vector<WorldEvent>& out) const = 0;
  virtual bool step_event(double until, WorldStep& out) = 0;
  virtual WorldPositions current_positions(std::uint32_t body) = 0;
  virtual std::vector<double> frame_times(std::uint32_t per_keyframe) const = 0;
  virtual void true_pairs(std::vector<WorldPair>& out) = 0;
  virtual bool audit(std::uint32_t body, WorldAudit& out) = 0;
  virtual WorldVerdict verify(const std::string& strategy, std::span<const double> frames,
                              const std::map<std::string, std::string>& params,
                              const std::map<std::string, std::string>& topology) const = 0;
};

/// Makes a world in the given precision.
std::unique_ptr<detail::WorldImplementation> make_world(Precision precision);

}  // namespace kbvh
