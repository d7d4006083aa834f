#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/judge/ray_oracle.hpp"
#include "experiments/study/measure.hpp"

namespace kbvh::experiments {

/// The rays of a study: the same at every frame, for all contestants.
struct RayStudy {
  enum class Pattern : std::uint8_t {
    coherent,    ///< a square grid of pixels of a camera that sees the scene's box
    incoherent,  ///< from random points of the scene's box in random directions
  };
  Pattern pattern = Pattern::coherent;
  std::uint32_t count = 16384;  ///< of coherent ones, the next smaller square
  RayQuery query = RayQuery::closest;
  bool operator==(const RayStudy&) const = default;
};

/// Reads "coherent", "incoherent:10000", "coherent:4096:any". Throws std::invalid_argument that names the
/// wrong part.
RayStudy ray_study(std::string_view text);
/// Returns the text with all its parts.
std::string text_of(const RayStudy& study);

/// Returns the suffix that tables add to a scene's name: " (coherent rays)", " (incoherent rays, any)".
std::string suffix_of(const RayStudy& study);

/// Makes the rays for the box around a scene's first, middle and last frame. Deterministic.
template <class S>
std::vector<Ray<S>> make_rays(const RayStudy& study, const Scene<S>& scene,
                              const std::vector<double>& frames);

/// A contestant, with its record's data about rays.
template <class S>
struct RayEntrant : Entrant<S> {
  RayCheck check;
  std::uint64_t hits = 0;  ///< of all rays at all frames
  /// Bodies of polygons that no ray of a frame meets, summed over frames: what occlusion culling can skip for
  /// these rays.
  std::uint64_t hidden_bodies = 0;
};

/// Like Measurement, for rays instead of pairs: every frame is one update, and one call with all rays.
template <class S>
class RayMeasurement : public Entrants<RayEntrant<S>> {
 public:
  RayMeasurement(const Scene<S>& scene, std::vector<double> frames, const RayStudy& study,
                 const PlanScript<S>* script);

  /// Verifies a contestant, comparing some of the rays of every n-th frame and of the last with brute force.
  /// Then replays exactly the timed calls: an exact contestant must answer the compared rays as before.
  void add(const ContestantSpec& spec, std::uint64_t oracle_every);
  void play(std::size_t i);
  nlohmann::json extras(std::size_t i) const;
  /// Returns why the rays are beyond the range of a contestant, as the end of a sentence that begins with its
  /// id; or "".
  std::string beyond_range(const Info& contestant) const;

 private:
  /// The answers to the compared rays at a frame; empty where none are compared.
  using Answers = std::vector<std::vector<RayHit>>;
  void verify(RayEntrant<S>& entrant, std::uint64_t oracle_every, Answers& answers);
  void replay(Measured& measured, const Answers& answers);
  std::uint64_t ask(Session<S>& session, PhaseTimes& times);

  const Scene<S>* scene_;
  std::vector<double> frames_;
  RayStudy study_;
  const PlanScript<S>* script_;
  std::vector<Ray<S>> rays_;
  std::vector<std::size_t> compared_;       ///< indices of the rays that are compared with brute force
  std::vector<std::vector<RayHit>> truth_;  ///< [frame], of these; empty until needed
  std::vector<RayHit> hits_;
  std::optional<std::size_t> steady_from_;
};

extern template class RayMeasurement<float>;
extern template class RayMeasurement<double>;

}  // namespace kbvh::experiments
