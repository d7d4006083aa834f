// Selects the tables of this room's kernels.
#include "core/families/average/kernels/meeting.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(MeetingKernels, meeting_kernels, meeting)

}  // namespace kbvh
