#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/theory/envelope_report.hpp"

/// The measurements of the checks as plain numbers: verdicts are functions of these alone.
namespace kbvh::theory {

/// One clip through the kinetic AABB tree (AVL queue, binary, one primitive per leaf), event by event. Sums
/// and maxima are over events; trees of all moving bodies are taken together.
struct CountRun {
  std::string scene;  ///< its family
  std::uint64_t triangles = 0, vertices = 0, nodes = 0;
  std::uint64_t depth = 0;     ///< of the deepest leaf; the root has 0
  std::uint64_t segments = 0;  ///< of the flight plans: keyframes - 1
  std::uint64_t events = 0, values = 0;
  std::uint64_t silent_events = 0;  ///< without any change of a realiser
  /// Segments x sum over nodes and sides of (vertices below - 1): envelopes of lines have no more
  /// breakpoints.
  double breakpoint_bound = 0;
  std::uint64_t queue_peak = 0;                          ///< most events scheduled at once
  std::uint64_t most_of_node = 0;                        ///< most events scheduled for one node at a keyframe
  std::uint64_t bytes = 0;                               ///< of trees and queue
  std::uint64_t sum_visited = 0, max_visited = 0;        ///< nodes of the path upwards
  std::uint64_t sum_steps = 0, max_steps = 0;            ///< comparisons in the queue
  std::uint64_t sum_operations = 0, max_operations = 0;  ///< on the queue
  std::uint64_t sum_certificates = 0, max_certificates = 0;  ///< examined candidate pairs
  /// Certificates (of a node and side) that involve one vertex, as winner or as possible loser; over the
  /// first, a middle and the last keyframe.
  std::uint64_t max_vertex_certificates = 0;
  double mean_vertex_certificates = 0;
  std::uint64_t max_leaves_of_vertex = 0;
  /// Changes of single vertices' plans at the first keyframe: examined candidate pairs, queue comparisons.
  std::uint64_t updates = 0, sum_update_certificates = 0, max_update_certificates = 0, max_update_steps = 0;
  /// Largest share that an update needed of 6 x the candidates of all nodes above the vertex.
  double update_share = 0;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(CountRun, scene, triangles, vertices, nodes, depth, segments, events,
                                   values, silent_events, breakpoint_bound, queue_peak, most_of_node, bytes,
                                   sum_visited, max_visited, sum_steps, max_steps, sum_operations,
                                   max_operations, sum_certificates, max_certificates,
                                   max_vertex_certificates, mean_vertex_certificates, max_leaves_of_vertex,
                                   updates, sum_update_certificates, max_update_certificates,
                                   max_update_steps, update_share)

/// One clip of vertices on curves through the kinetic AABB tree. Sums and maxima are over bounds (nodes x
/// sides) and segments.
struct CurveRun {
  std::string scene;
  std::uint64_t triangles = 0, vertices = 0, segments = 0;
  std::uint64_t order = 0;  ///< two plans of a segment cross at most this often: their degree
  std::uint64_t events = 0, changes = 0, bounds = 0;
  std::uint64_t pieces = 0, over_lambda = 0;  ///< bounds x segments; with more changes than lambda_s(n) - 1
  std::uint64_t most_changes = 0;             ///< of one bound in one segment
  double fullest = 0;                         ///< share of lambda_s(n) - 1, n >= 8 vertices below
  std::uint64_t built = 0;                    ///< `most_changes` for which the scene was built; 0: for none
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(CurveRun, scene, triangles, vertices, segments, order, events, changes,
                                   bounds, pieces, over_lambda, most_changes, fullest, built)

/// The same clip with the log of every change, checked against independently computed exact envelopes; rows
/// are the clip's segments.
struct ExactRun : EnvelopeReport {
  std::string scene;
  std::uint64_t triangles = 0, vertices = 0, keyframes = 0;
  std::uint64_t events = 0;
  std::uint64_t momentary_events = 0;               ///< all their changes last for no time
  std::uint64_t audited_instants = 0, audited = 0;  ///< between events and at keyframes; realisers compared
  std::uint64_t faults = 0;                         ///< of these, exceeded by a vertex
  std::uint64_t path_bounds = 0, path_faults = 0;   ///< on the paths touched by events, at their instants
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ExactRun, scene, triangles, vertices, keyframes, violation, bounds, events,
                                   logged, net, envelope, canonical, several_steps, choices, momentary_events,
                                   pieces, over_lambda, most_breakpoints, fullest, audited_instants, audited,
                                   faults, path_bounds, path_faults)

/// One clip at one number l of frames per keyframe interval.
struct FrameRun {
  std::string scene;
  std::uint64_t triangles = 0, l = 0, frames = 0;  ///< frames after the first
  std::uint64_t events = 0, values = 0;            ///< of the kinetic tree
  std::uint64_t same_log = 0;          ///< 1: every change equals that of the smallest l, in order
  std::uint64_t bottom_up_values = 0;  ///< of the strategy bottom_up on the same topology
  /// Frames in which the kinetic tree writes more values than bottom-up; frames in which the realiser of some
  /// bound changes more than once; and the former without the latter.
  std::uint64_t worse_frames = 0, repeated_frames = 0, worse_without_repeat = 0;
  std::uint64_t most_of_bound = 0;  ///< changes of one bound in one frame
  double worst_share = 0;           ///< of kinetic values over bottom-up's in one frame
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FrameRun, scene, triangles, l, frames, events, values, same_log,
                                   bottom_up_values, worse_frames, repeated_frames, worse_without_repeat,
                                   most_of_bound, worst_share)

/// All vertices translated by the same step per keyframe.
struct TranslationRun {
  std::string scene;
  std::uint64_t exact = 0;  ///< 1: no coordinate was rounded
  std::uint64_t triangles = 0, vertices = 0, keyframes = 0;
  std::uint64_t rounded = 0;  ///< keyframe coordinates that differ from the exact translation
  std::uint64_t events = 0;
  std::uint64_t separated_ties =
      0;  ///< events of vertices with equal coordinates at the start of their segment
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TranslationRun, scene, exact, triangles, vertices, keyframes, rounded,
                                   events, separated_ties)

/// Changes of flight plans at keyframes (where the stored position is the plan's) and at frames between them
/// (where it is the plan's, rounded).
struct PlanRun {
  std::string scene;
  std::uint64_t triangles = 0, updates = 0, updates_at_keyframes = 0, changed_plans = 0;
  std::uint64_t topology_changes = 0;                   ///< updates after which nodes or primitives differ
  std::uint64_t invalid_before = 0, invalid_after = 0;  ///< realisers exceeded by a vertex, exact
  std::uint64_t moved_at_keyframes = 0, moved_between = 0;  ///< realisers that the update itself changed
  std::string violation;                                    ///< of the envelopes between updates
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PlanRun, scene, triangles, updates, updates_at_keyframes, changed_plans,
                                   topology_changes, invalid_before, invalid_after, moved_at_keyframes,
                                   moved_between, violation)

/// Valid but not tight hierarchies, for comparison with the kinetic tree of the same topology.
struct LooseRun {
  std::string scene;
  std::uint64_t triangles = 0, bounds = 0, l = 0, frames = 0, segments = 0;
  std::uint64_t swept_outside = 0, linear_outside = 0;  ///< (node, frame) pairs that do not contain a vertex
  double swept_looseness = 0, linear_looseness = 0;     ///< summed area over tight, minus one
  std::uint64_t swept_values = 0;                       ///< computed once, before the clip
  std::uint64_t swept_updates = 0;                      ///< after that
  std::uint64_t linear_values = 0;                      ///< computed at keyframes
  std::uint64_t linear_updates = 0;                     ///< between them
  std::uint64_t kinetic_events = 0, kinetic_values = 0, bottom_up_values = 0;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(LooseRun, scene, triangles, bounds, l, frames, segments, swept_outside,
                                   linear_outside, swept_looseness, linear_looseness, swept_values,
                                   swept_updates, linear_values, linear_updates, kinetic_events,
                                   kinetic_values, bottom_up_values)

/// The kinetic BoxTree of the same topology, for comparison with the AABB tree.
struct BoxTreeRun {
  std::string scene;
  std::uint64_t triangles = 0, trees = 0, nodes = 0, inner_nodes = 0, depth = 0;
  std::uint64_t certificates = 0;  ///< places for events: two per inner node, and the roots' own
  std::uint64_t most_of_planes = 0,
                queue_peak = 0;  ///< scheduled events: for one inner node's planes; in total
  std::uint64_t events = 0, values = 0, silent_events = 0, bytes = 0;
  std::uint64_t aabb_events = 0, aabb_values = 0, aabb_bytes = 0;
  std::uint64_t searches = 0, searched = 0, most_searched = 0;  ///< nodes visited by certificate searches
  std::uint64_t max_vertex_certificates = 0, max_leaves_of_vertex = 0;
  std::uint64_t proved = 0;  ///< bounds checked against exact envelopes
  std::string violation;     ///< the first, empty if there is none
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(BoxTreeRun, scene, triangles, trees, nodes, inner_nodes, depth,
                                   certificates, most_of_planes, queue_peak, events, values, silent_events,
                                   bytes, aabb_events, aabb_values, aabb_bytes, searches, searched,
                                   most_searched, max_vertex_certificates, max_leaves_of_vertex, proved,
                                   violation)

/// The cost of certificate searches in BoxTrees with forced axes.
struct SearchRun {
  std::string tree;
  std::uint64_t leaves = 0, events = 0;
  std::uint64_t searches = 0, searched = 0, most_searched = 0;
  std::uint64_t events_of_root = 0, searched_by_root = 0;  ///< at the two planes of the root
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SearchRun, tree, leaves, events, searches, searched, most_searched,
                                   events_of_root, searched_by_root)

/// Kinetic incremental collision detection on a clip, event by event.
struct SeparationRun {
  /// Events of one kind: affected pairs, and cost of the queues.
  struct Kind {
    std::uint64_t events = 0, pairs = 0, most_pairs = 0, steps = 0, operations = 0;
    double most_steps_per_operation = 0;  ///< comparisons per operation on the queue, mean of one event
  };
  std::string scene;
  std::uint64_t polygons = 0;  ///< of all bodies
  Kind overlap, parents, leaves, changes;
  std::uint64_t list_peak = 0, queue_peak = 0, bytes = 0;
  std::uint64_t most_of_box = 0;  ///< largest number of pairs with one box, at keyframes
  std::uint64_t audits = 0, entries = 0, differences = 0;  ///< list against traversals between events
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SeparationRun::Kind, events, pairs, most_pairs, steps, operations,
                                   most_steps_per_operation)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SeparationRun, scene, polygons, overlap, parents, leaves, changes,
                                   list_peak, queue_peak, bytes, most_of_box, audits, entries, differences)

/// The largest sizes of the separation list at keyframes.
struct ListSizeRun {
  std::string scene;
  std::uint64_t polygons = 0, list = 0, overlapping = 0;  ///< all pairs of the list; overlapping leaves
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ListSizeRun, scene, polygons, list, overlapping)

/// One clip with queries through a kinetic AABB tree with `width` children per node (C1).
struct OrderRun {
  std::string scene;
  std::uint64_t triangles = 0, width = 2;
  std::uint64_t events = 0, values = 0;       ///< events; changes of bounds
  std::uint64_t certificates = 0, steps = 0;  ///< certificates made; comparisons in the queue
  std::uint64_t box_tests = 0;                ///< of all queries
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(OrderRun, scene, triangles, width, events, values, certificates, steps,
                                   box_tests)

/// One clip with queries through a kinetic BoxTree, parts of which may be rebuilt (C2).
struct RebuildRun {
  std::string scene;
  std::uint64_t triangles = 0;
  std::string rebuild;                    ///< how: "never", "median" or "sah"
  std::uint64_t events = 0, visited = 0;  ///< events; nodes that updates visit, with all searches
  std::uint64_t box_tests = 0;            ///< of all queries
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RebuildRun, scene, triangles, rebuild, events, visited, box_tests)

/// The contacts of one clip (C3).
struct SweepRun {
  std::string scene;
  std::uint64_t triangles = 0;
  std::uint64_t sweeps = 0, tested_all = 0;   ///< keyframe intervals; those in which all pairs were tested
  std::uint64_t contacts = 0, different = 0;  ///< of the list; in only one of these and another answer
  std::uint64_t list_pairs = 0, refit_pairs = 0;  ///< pairs of triangles that reached their test
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SweepRun, scene, triangles, sweeps, tested_all, contacts, different,
                                   list_pairs, refit_pairs)

/// One clip on curves through the kinetic AABB tree (C4).
struct MotionRun {
  std::string scene;
  std::uint64_t triangles = 0, segments = 0, degree = 0, frames = 0;
  std::uint64_t pairs = 0, different = 0;  ///< of the oracle, over all frames; in only one of both answers
  std::uint64_t events = 0, events_at_keyframes = 0;  ///< at 10 frames per keyframe; at 1
  std::uint64_t events_on_lines = 0;                  ///< with lines between the keyframes
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(MotionRun, scene, triangles, segments, degree, frames, pairs, different,
                                   events, events_at_keyframes, events_on_lines)

/// The growth of the number of events of a family of scenes with its vertices.
struct GrowthFit {
  std::string scene;
  std::vector<std::uint64_t> triangles, vertices, events;
  double exponent = 0, low = 0, high = 0;  ///< of events ~ (n log2 n)^exponent, with its 95% interval
  double constant = 0;                     ///< of events ~ constant n log2 n
  double worst = 0;                        ///< largest relative residual of that
  std::vector<double> residuals;           ///< events / (constant n log2 n) - 1
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(GrowthFit, scene, triangles, vertices, events, exponent, low, high,
                                   constant, worst, residuals)

}  // namespace kbvh::theory
