#pragma once
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/study/measure.hpp"
#include "experiments/study/probe_sets.hpp"

namespace kbvh::experiments {

/// A contestant, with its record's data about probes.
template <class S>
struct ProbeEntrant : Entrant<S> {
  ProbeCheck check;
  std::uint64_t hits = 0;  ///< of all probes at all frames
  /// Bodies of polygons that no probe of a frame meets, summed over frames: of rays, what occlusion culling
  /// can skip.
  std::uint64_t hidden_bodies = 0;
};

/// Like Measurement, for probes instead of pairs: every frame is one update, and one call with all probes.
template <class S>
class ProbeMeasurement : public Entrants<ProbeEntrant<S>> {
 public:
  ProbeMeasurement(const Scene<S>& scene, std::vector<double> frames, const ProbeStudy& study,
                   const PlanScript<S>* script);

  /// Verifies a contestant, comparing some of the probes of every n-th frame and of the last with brute
  /// force. Then replays exactly the timed calls: an exact contestant must answer the compared probes as
  /// before.
  void add(const ContestantSpec& spec, std::uint64_t oracle_every);
  void play(std::size_t i);
  nlohmann::json extras(std::size_t i) const;
  /// Returns why the probes are beyond the range of a contestant, as the end of a sentence that begins with
  /// its id; or "".
  std::string beyond_range(const Info& contestant) const;

 private:
  void verify(ProbeEntrant<S>& entrant, std::uint64_t oracle_every);
  void replay(Measured& measured);
  bool is_exact(const Info& contestant) const;

  const Scene<S>* scene_;
  std::vector<double> frames_;
  ProbeStudy study_;
  const PlanScript<S>* script_;
  std::unique_ptr<ProbeSet<S>> probes_;
  std::optional<std::size_t> steady_from_;
};

extern template class ProbeMeasurement<float>;
extern template class ProbeMeasurement<double>;

}  // namespace kbvh::experiments
