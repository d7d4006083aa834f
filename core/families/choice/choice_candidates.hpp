#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace kbvh {

/// What is known about a scene and its refit. Counts and plans, never times; work in nanoseconds.
struct Observed {
  double reads = 0, primitives = 0, bodies = 0;  ///< vertices that a refit reads; of moving bodies
  double refit = 0, search = 0;   ///< work of leaf_slabs in a frame, and its part without the update
  double candidates = 0;          ///< found in the last frame
  double frames = 1;              ///< per segment of the plans
  double changes_per_frame = 0;   ///< frames with changes of plans, as a share of the last frames
  double growth = 1, ageing = 0;  ///< of refitted boxes: surfaces over those at the start; search per frame
};

/// What a candidate answers at once.
enum class ChoiceUnit : std::uint8_t {
  frame,
  frames,   ///< `frames_of_unit` frames: one search serves several
  segment,  ///< of the flight plans
};

/// A candidate of the strategy `auto`: what it is, its work by its counts, and its work as predicted before
/// its first unit. All work is in nanoseconds; only ratios matter.
struct ChoiceCandidate {
  struct Costs {
    double frame = 0, body = 0;  ///< of a frame, and of each moving body in it
    double read = 0;             ///< of each vertex that a refit reads: in a frame, or once for a segment
    double box_test = 0, candidate = 0;
    double span_test = 0, triangle_test = 0;  ///< of a join
    double build = 0;  ///< of a primitive, at the start and when a tree has aged; 0: no trees are built
    double cold = 0;   ///< of a primitive, in the first frame since `reset`: memory that is not warm
  };
  struct Prediction {
    double expected, hoped;  ///< work of a frame: usual, and at best
  };
  const char* id;
  std::map<std::string, std::string> params;
  ChoiceUnit unit;
  Costs costs;
  Prediction (*predict)(const Observed&, const Costs&);
};
constexpr int frames_of_unit = 8;

/// Returns the candidates. To add a candidate, add a line: any registered strategy is suitable that follows
/// plan changes, answers rays and needs no more foresight than the next keyframe.
const std::vector<ChoiceCandidate>& choice_candidates();

/// Returns the work per frame of building and ageing trees, for the period between builds that minimises it,
/// if the surplus of searches grows linearly. `build`: the work of one build; `ageing`: growth per frame.
double upkeep(double build, double ageing);

/// Describes in words what was last observed.
std::string last_seen(const Observed& seen);

}  // namespace kbvh
