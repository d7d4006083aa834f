#pragma once
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// All intersecting primitive pairs of the scene's body pairs at the playback's current time, sorted, by
/// testing every pair exactly: no boxes, no sweep, nothing shared with any strategy but the triangle test.
/// O(primitives^2).
template <class S>
std::vector<PrimitivePair> brute_force_pairs(const Scene<S>& scene, Playback<S>& playback);

/// The same set by sort-and-sweep along the axis of largest extent and the exact test; itself verified
/// against `brute_force_pairs`. O(n log n + overlaps on one axis).
template <class S>
std::vector<PrimitivePair> sweep_pairs(const Scene<S>& scene, Playback<S>& playback);

/// The true pairs at any time of a scene, computed once per (scene, script, scalar, t) and kept; optionally
/// on disk, so that a later run of the same scene need not compute them again.
template <class S>
class Oracle {
 public:
  /// `cache_folder` empty: memory only. A damaged or foreign cache file is ignored and written anew; see
  /// `problem`. `script` is the hash of the plan script that is replayed, 0: plans are the scene's own.
  explicit Oracle(const Scene<S>& scene, std::filesystem::path cache_folder = {}, std::uint64_t script = 0);
  ~Oracle();
  std::uint64_t script() const { return script_; }
  /// Sorted pairs at the playback's current time; the playback must follow the scene's own plans, and the
  /// script up to that time.
  const std::vector<PrimitivePair>& pairs(Playback<S>& playback);
  /// Writes what is new to the cache, as the destructor does.
  void keep();
  /// What was wrong with the cache, as a sentence, or an empty text: it costs time, never a result.
  const std::string& problem() const { return problem_; }

 private:
  bool load();
  bool save() const;
  const Scene<S>* scene_;
  std::uint64_t script_;
  std::filesystem::path file_;
  std::map<double, std::vector<PrimitivePair>> known_;
  bool grown_ = false;
  std::string problem_;
};

}  // namespace kbvh
