#pragma once
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// Returns all intersecting primitive pairs of the scene's body pairs at the playback's current time, sorted,
/// by testing every pair exactly: no boxes, no sweep. It shares with strategies the triangle test and the
/// triangles of polygons. At the time at which polygons are cut, simple planar ones are decided by the
/// even-odd rule instead, without their triangles (polygon_region.hpp). O(primitives^2).
template <class S>
PairBuffer brute_force_pairs(const Scene<S>& scene, Playback<S>& playback);

/// Returns the same set by sort-and-sweep along the axis of largest extent and the exact test; itself
/// verified against `brute_force_pairs`. O(n log n + overlaps on one axis).
template <class S>
PairBuffer sweep_pairs(const Scene<S>& scene, Playback<S>& playback);

/// The true pairs of a scene at any time, computed once per (scene, script, scalar, t) and kept; optionally
/// cached on disk for later runs of the same scene.
template <class S>
class Oracle {
 public:
  /// An empty `cache_folder` means memory only. A damaged or foreign cache file is ignored and rewritten; see
  /// `problem`. `script` is the hash of the replayed plan script; 0: the scene's own plans.
  explicit Oracle(const Scene<S>& scene, std::filesystem::path cache_folder = {}, std::uint64_t script = 0);
  ~Oracle();
  std::uint64_t script() const { return script_; }
  /// Returns the sorted pairs at the playback's current time. The playback must follow the scene's own plans,
  /// and the script up to that time.
  const PairBuffer& pairs(Playback<S>& playback);
  /// Returns the pairs after the first `changes` changes of geometry that the script makes; `scene` is in the
  /// state after these. Without such changes, the same as above. With them, pairs are kept in memory only.
  const PairBuffer& pairs(Playback<S>& playback, const Scene<S>& scene, std::uint32_t changes);
  /// Returns the pairs at t after that many changes of geometry if `pairs` has returned them before; else
  /// null.
  const PairBuffer* known(double t, std::uint32_t changes) const;
  /// Writes new entries to the cache, as the destructor does.
  void keep();
  /// Returns a sentence about a defect of the cache, or an empty text. Such a defect costs time but changes
  /// no result.
  const std::string& problem() const { return problem_; }

 private:
  bool load();
  bool save() const;
  const Scene<S>* scene_;
  std::uint64_t script_;
  std::filesystem::path file_;
  std::map<double, PairBuffer> known_;
  std::map<std::pair<std::uint32_t, double>, PairBuffer> changed_;  ///< by changes and time
  bool grown_ = false;
  std::string problem_;
};

}  // namespace kbvh
