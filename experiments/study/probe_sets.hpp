#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/judge/probe_oracle.hpp"
#include "core/judge/session.hpp"

namespace kbvh::experiments {

/// The probes of a study: the same at every frame, for all contestants.
struct ProbeStudy {
  enum class Sought : std::uint8_t {
    coherent_rays,    ///< a square grid of pixels of a camera that sees the scene's box
    incoherent_rays,  ///< from random points of the scene's box in random directions
    within,           ///< the primitives within a distance of random points of the scene's box
  };
  Sought sought = Sought::coherent_rays;
  std::uint32_t count = 16384;  ///< of coherent rays, the next smaller square
  RayQuery query = RayQuery::closest;
  double radius = 0.01;  ///< of points: as a share of the diagonal of the scene's box
  bool operator==(const ProbeStudy&) const = default;
};

/// Reads "coherent", "incoherent:10000", "coherent:4096:any". Throws std::invalid_argument that names the
/// wrong part.
ProbeStudy ray_study(std::string_view text);
/// Reads the number of points and the radius as a share of the box's diagonal: "1000:0.01". Throws likewise.
ProbeStudy within_study(std::string_view text);
/// Returns the key of a plan that asks for these probes: "rays", "within".
const char* key_of(const ProbeStudy& study);
/// Returns the text with all its parts.
std::string text_of(const ProbeStudy& study);
/// Returns the suffix that tables add to a scene's name: " (coherent rays)", " (incoherent rays, any)",
/// " (within 0.01)".
std::string suffix_of(const ProbeStudy& study);
/// Returns whether a contestant answers them.
bool answers(const Info& contestant, const ProbeStudy& study);

/// The probes of a study on one scene, with space for the answers of one call.
template <class S>
class ProbeSet {
 public:
  virtual ~ProbeSet() = default;
  virtual std::size_t size() const = 0;
  /// Asks a contestant, and returns the number of hits.
  std::uint64_t ask(Session<S>& session, PhaseTimes& times);
  /// Returns the question, for checks of its range.
  virtual Probes<S> probes() = 0;
  /// Compares some of the last answers with brute force, whose answers are kept by frame.
  virtual ProbeCheck check(Session<S>& session, std::size_t frame) = 0;
  /// Keeps those last answers of a frame that are compared.
  virtual void remember(std::size_t frame) = 0;
  virtual void forget() = 0;
  /// Returns the first probe whose last answer differs from what is remembered of this frame, or "".
  virtual std::string differs(std::size_t frame) const = 0;
  /// Marks the bodies that the last answers name.
  virtual void mark_bodies(std::vector<bool>& seen) const = 0;

 protected:
  virtual void clear_answers() = 0;
  virtual std::uint64_t hits() const = 0;
};

/// Makes the probes for the box around a scene's first, middle and last frame. Deterministic.
template <class S>
std::unique_ptr<ProbeSet<S>> make_probes(const ProbeStudy& study, const Scene<S>& scene,
                                         const std::vector<double>& frames);

}  // namespace kbvh::experiments
