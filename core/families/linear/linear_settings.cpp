#include "core/families/linear/linear_settings.hpp"

namespace kbvh {

std::vector<Parameter> linear_parameters() {
  return {{"pieces",
           "1",
           {},
           "number of pieces into which each segment between keyframes is cut, for tighter boxes",
           1,
           SegmentCuts::most,
           Numbers::whole},
          {"max_looseness",
           "0",
           {},
           "the number of pieces doubles while the boxes in the middle of the first piece exceed the surface "
           "of tight boxes by this share; 0: not measured",
           0},
          {"horizon",
           "0",
           {},
           "frames of a segment while plans change at run time; 0: chosen by the rate of changes",
           0,
           1024}};
}

LinearSettings linear_settings(const Params& params) {
  return {{std::uint32_t(params.number("pieces")), params.number("max_looseness")}, params.number("horizon")};
}

}  // namespace kbvh
