#pragma once
#include <limits>
#include <string>

namespace kbvh {

/// A choice's knowledge about a scene and the work so far. Counts and plans, never times.
struct Observed {
  double frames_per_segment = 1;  ///< of the current segment; infinite if it has no end
  double changes_per_frame = 0;   ///< frames with changes of plans, as a share of the last frames
  double candidates = 0;          ///< in a frame, of leaf_slabs
  /// Candidates of boxes alone over these; measured while another strategy was active.
  double boxed = 1.3;
  /// Box tests in a frame of leaf_slabs, which counts comparisons of slabs as box tests, and of bottom_up.
  double slab_tests = 0, plain_tests = 0;  // estimated while others answer
  /// `boxed` where leaf_slabs and bottom_up searched two frames in a row; 1, the best possible value, before
  /// bottom_up is tried; infinite where it is not to be tried.
  double plain_boxed = std::numeric_limits<double>::infinity();
  bool plain_known = false;  ///< the cost of bottom_up is measured, not hoped
  bool near = false;         ///< bodies may be near each other
  double reads = 0;          ///< vertices that a refit reads
  double primitives = 0;     ///< of moving bodies
  double bodies = 0;         ///< that move
  double step = 0;   ///< mean step of a vertex per frame relative to another body, in usual leaf sides
  double slide = 0;  ///< the same for primitives relative to their candidates
  bool many_bodies = false;  ///< more than a thousand pairs of bodies
  double spread = 1;         ///< how different the steps are among a body's vertices; 0: all the same
  double join_factor = 1;    ///< cost of the join by its work, over its prediction (ObservedJoin)
  double apart_factor = 1;   ///< the same where bodies are apart, if more
  bool rays_only = false;    ///< only rays are asked for, no pairs
  double aged = 0;           ///< share of box tests in refitted trees that new ones would save
  /// Growth per frame of the tests beyond those of new trees, in lbvh_drift and drift_rebuild.
  double ageing = 0, sorted_ageing = 0;
};

/// Describes in words what was last observed.
std::string last_seen(const Observed& seen);

// The predicted costs of a frame, in nanoseconds of one machine; only their order matters.

/// leaf_slabs: reads all vertices, and searches in trees that age.
double refit_cost(const Observed& seen);
/// bottom_up: the same trees without slabs. It has more candidates, and less work on pairs of leaves.
double plain_cost(const Observed& seen);
/// lbvh_drift: refits trees of its own, and builds new ones when the surplus of tests has grown.
double rebuilt_cost(const Observed& seen);
/// drift_rebuild: the same with the trees of a refit, whose builds cost more and give better trees.
double sorted_cost(const Observed& seen);
/// drift_boxes; infinite where only rays are asked for, because these do not show how old its trees are. One
/// search serves the frames in which a leaf moves by a part of its size. Where bodies deform, more pairs come
/// near in these frames than a query takes to find.
double drift_cost(const Observed& seen);
/// interval_join: one join serves a segment. Its cost grows with the distance that primitives move past each
/// other within the segment. A translating body passes by others; the touching part of a deforming body stays
/// in place. Infinite where plans change, segments have no end, or only rays are asked for.
double join_cost(const Observed& seen);

}  // namespace kbvh
