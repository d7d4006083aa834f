#include "core/families/linear/linear_settings.hpp"

namespace kbvh {

std::vector<Parameter> linear_parameters() {
  return {
      {"pieces",
       "1",
       {},
       "each segment between keyframes is cut into so many, for tighter boxes",
       1,
       SegmentCuts::most,
       Numbers::whole},
      {"max_looseness",
       "0",
       {},
       "a segment is cut into twice as many pieces while boxes in the middle of its first have more surface "
       "than tight ones by this share; 0: nobody looks",
       0},
      {"remember_mb",
       "0",
       {},
       "megabytes for boxes at ends of segments that are used again when the clip plays again; a study plays "
       "it again for each repetition, so that its times are then those of a loop and not of a first time",
       0,
       1e6}};
}

LinearSettings linear_settings(const Params& params) {
  return {{std::uint32_t(params.number("pieces")), params.number("max_looseness")},
          std::size_t(params.number("remember_mb") * 1e6)};
}

}  // namespace kbvh
