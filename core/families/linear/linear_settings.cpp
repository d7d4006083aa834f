#include "core/families/linear/linear_settings.hpp"

#include <cmath>

namespace kbvh {

std::vector<Parameter> linear_parameters() {
  return {
      {"pieces",
       "1",
       {},
       "each segment between keyframes is cut into so many, for tighter boxes; 1 to 64",
       1},
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
       0}};
}

LinearSettings linear_settings(const Params& params) {
  const double wanted = params.number("pieces"), looseness = params.number("max_looseness");
  if (!(wanted >= 1 && wanted <= SegmentCuts::most) || wanted != std::floor(wanted))
    throw ConfigError("pieces must be a whole number from 1 to 64, got " + params.word("pieces"));
  if (!(looseness >= 0))
    throw ConfigError("max_looseness must not be negative, got " + params.word("max_looseness"));
  const double remembered = params.number("remember_mb");
  if (!(remembered >= 0 && remembered < 1e6))
    throw ConfigError("remember_mb must be from 0 to a million, got " + params.word("remember_mb"));
  return {{std::uint32_t(wanted), looseness}, std::size_t(remembered * 1e6)};
}

}  // namespace kbvh
