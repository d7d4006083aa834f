#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace kbvh {

/// What is known about a scene and its refit. Counts and plans, never times; work in nanoseconds.
struct Observed {
  double reads = 0, primitives = 0, bodies = 0;  ///< vertices that a refit reads; of moving bodies
  double refit = 0;                              ///< estimated work of the cheapest refit in a frame
  double box_tests = 0, pairs = 0;  ///< of leaf_slabs in a frame: box tests, candidates; follow contacts
  double frames = 1;                ///< per segment of the plans
  double changes_per_frame = 0;     ///< frames with changes of plans, as a share of the last frames
  double growth = 1, ageing = 0;    ///< of refitted boxes: surfaces over those at the start; tests per frame
  bool translates = false;          ///< all vertices of a body move alike
};

/// What a candidate answers at once.
enum class ChoiceUnit : std::uint8_t {
  frame,
  frames,   ///< `frames_of_unit` frames: one search serves several
  segment,  ///< of the flight plans: one search serves all its frames
};
constexpr int frames_of_unit = 8;

/// Work beyond the columns of the table, in nanoseconds.
struct ChoicePrices {
  static constexpr double span_test = 34;   ///< two triangles of a join decided for a span of time
  static constexpr double frame_test = 54;  ///< two triangles of a join at one frame
  static constexpr double fetch = 3.4;      ///< a position that they fetch
  /// Starting a candidate, per primitive: its hierarchy comes from memory, about 250 bytes at 25 GB/s.
  static constexpr double start = 10;
};

/// A candidate of the strategy `auto`: what it is, what its work costs in nanoseconds, and its work per frame
/// as predicted before its first unit.
struct ChoiceCandidate {
  struct Prediction {
    double expected, hoped;  ///< usual, and at best
  };
  const char* id;
  std::map<std::string, std::string> params;
  ChoiceUnit unit;
  double frame;     ///< a frame, whatever happens in it
  double read;      ///< a vertex that a refit reads: in a frame, or once for a segment
  double body;      ///< a moving body: in a frame, or once for a segment
  double box_test;  ///< of its search, in a frame or once for a segment
  double pair;      ///< a candidate pair, with its exact test
  double build;     ///< a primitive in the build of a tree; 0: no trees are built
  Prediction (*predict)(const Observed&, const ChoiceCandidate&);

  /// Returns the work of an update, without the search.
  double update(const Observed& seen) const { return frame + body * seen.bodies + read * seen.reads; }
};

/// Returns the candidates. To add a candidate, add a line: any registered strategy is suitable that follows
/// plan changes, answers rays, reports its work (ReportsWork) and needs no more foresight than the next
/// keyframe.
const std::vector<ChoiceCandidate>& choice_candidates();

/// Returns the work per frame of building and ageing trees, for the period between builds that minimises it,
/// if the surplus of searches grows linearly. `build`: the work of one build; `ageing`: growth per frame.
double upkeep(double build, double ageing);

/// Describes in words what was last observed.
std::string last_seen(const Observed& seen);

}  // namespace kbvh
