// Selects the tables of this room's kernels.
#include "core/families/build/kernels/build_wide.hpp"
#include "core/families/build/kernels/clusters.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

KBVH_DEFINE_KERNEL_CHOICE(BuildKernels, build_kernels, build)

const ClusterKernels& cluster_kernels(KernelSet set) {
  return KBVH_SELECT_KERNELS(set, clusters);
}

}  // namespace kbvh
