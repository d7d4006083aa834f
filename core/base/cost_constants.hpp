#pragma once

/// The constants of all cost models by which strategies choose: measured once, and kept here with the commit
/// that fitted them, so that they can be fitted again. Choices multiply them by counts of the scene, never by
/// times, so that a choice does not depend on the machine or its load.
namespace kbvh::costs {

/// drift_boxes and DriftModel, in box tests of a query. Fitted in 4238658; `clear_gain` and `kept_listed` in
/// 167e5b8, the steps in c6e0cf1.
struct Drift {
  static constexpr double refitting = 0.2;    ///< reading a vertex in a refit
  static constexpr double observing = 0.15;   ///< reading a vertex twice in memory order
  static constexpr double searching = 1.3;    ///< a box test of a search
  static constexpr double listing = 4;        ///< listing a pair
  static constexpr double checking = 5;       ///< testing whether a listed pair overlaps now
  static constexpr double kept_listed = 2.3;  ///< listed pairs without overlap, over those that are tested
  static constexpr double growth = 1.3;       ///< exponent of counts over the frames of a search
  static constexpr double clear_gain = 0.9;   ///< smaller predicted gains are within the prediction's error
  static constexpr double longest_step = 0.12, first_reach = 0.15, longest_reach = 0.3;  ///< in leaf sides
};

/// inflated_lazy with tuned margins, in box tests of a query. Fitted in 734fb07; `meeting` in 154f79e.
struct InflatedBoxes {
  static constexpr double reading = 0.6;     ///< reading a vertex in a check
  static constexpr double evaluating = 1.2;  ///< evaluating a vertex that no query reads
  static constexpr double writing = 0.2;     ///< writing the boxes of a vertex
  static constexpr double opened = 0.4;      ///< further tests for a margin of one leaf side
  static constexpr double meeting = 64;      ///< tests of two small bodies that meet
};

/// interval_join ahead of time, in box tests of the join: only for even slices of work. Fitted in 2f76992.
struct JoinAhead {
  static constexpr double node = 35;   ///< making the boxes of a node
  static constexpr double answer = 5;  ///< sorting in an answer
};

/// Trees that age (drift_rebuild, partial_rebuild, lbvh_drift), in box tests of a search for pairs. Fitted in
/// d2994f5 (plan field, AVX-512): a test takes 0.6 to 1.4 ns for pairs, and 8 to 18 ns for rays, including
/// the triangle tests that follow.
struct Ageing {
  static constexpr double ray_test = 12;
};

/// The work of a frame that a choice has observed, in nanoseconds computed from counts (Intel Xeon with
/// AVX-512).
/// - Refits, a body and a candidate that slabs leave out: from the update, search and triangle tests of
///   leaf_slabs and bottom_up, each phase by its own count, on all scenes of experiments/plans/auto.json
///   except those that age and the seven left out, l = 1, at 19cb3bc. On these, a vertex read takes 0.40 to
///   0.59 (hidden crowd 0.8), a box test 1.2 to 2.9 with slabs and 0.8 to 2.1 without, a triangle test 15 to
///   31 (where there are more than ten). Trees that have aged make millions of tests, of 0.6 to 0.8 each.
/// - The join: fitted to the runs of 19 scenes at l = 1, 3, 10 and 30 (c80e232). Measured times differ from
///   these sums by 9 %, root mean square, and by up to 26 % on the running figures, which were not among the
///   19.
struct Work {
  /// A frame of a refit.
  struct Refit {
    double read, box_test, triangle_test;
    constexpr double of(double reads, double box_tests, double triangle_tests) const {
      return read * reads + box_test * box_tests + triangle_test * triangle_tests;
    }
  };
  static constexpr Refit slabs{0.45, 1.65, 18}, plain{0.45, 1.1, 18};
  static constexpr double plain_candidate = 11.5;  ///< a candidate that slabs leave out: seldom a hit
  static constexpr double body = 100;              ///< a moving body, of a refit
  static constexpr double rebuilt_primitive = 5;   ///< of lbvh_drift without its builds
  /// interval_join: the reads of a refit once a segment, box tests of its search, and the work of its frames.
  static constexpr double join_read = 3.05, join_box_test = 2.42, span_test = 92, join_triangle_test = 64,
                          join_fetch = 3.3;
  static constexpr double hope = 0.55;  ///< of a predicted cost, before the first trial
};

/// auto, in the same nanoseconds; only their order matters.
/// - `watch_read` to `unfit`: drift_boxes. Reads, bodies, steps and kept candidates from the same runs as the
///   refits (l = 1, 10 and 30), the search fitted in c6e0cf1, 167e5b8 and ef3f1d8 on Zen 5, times 1.7.
/// - `join_frame` to `join_apart`: the join before it has worked, as shares of a refit. Fitted on Zen 5 to
///   figures, a skirt and a tablecloth (experiments/plans/motion.json) at l = 1, 3, 7 and 30, except
///   `join_slide` and `join_apart`.
/// - `build_primitive` to `surplus_test`, and Work::rebuilt_primitive: from the updates, builds and box tests
///   of lbvh_drift and drift_rebuild on the five scenes of plan `auto` that age, l = 1 and 10, at 42dc54a.
/// - `start_primitive`: from the first frames of lbvh_drift (0.65 to 0.75 ms for 16k triangles, 19cb3bc).
struct Choice {
  static constexpr double watch_read = 0.2, watch_body = 140;  ///< vertices and bodies whose drift is read
  static constexpr double watch_step = 4;                      ///< a step of a leaf, over resting
  static constexpr double search_read = 0.6, search_candidate = 153;  ///< one search of drift_boxes
  static constexpr double kept_candidate = 28;  ///< a candidate of boxes alone in a frame of drift_boxes
  static constexpr double unfit = 1.2;          ///< drift_boxes that fall back, over a refit
  static constexpr double join_frame = 0.12, join_segment = 4.2, join_frames = 1;  ///< of a refit
  static constexpr double join_moves = 0.25;                                       ///< of a join
  static constexpr double join_slide = 0.2, join_apart = 1.5;                      ///< of a refit
  static constexpr double build_primitive = 9, sort_primitive = 70;  ///< a build of lbvh_drift, drift_rebuild
  static constexpr double sorts = 1.05;       ///< drift_rebuild where nothing ages, over a refit: set by hand
  static constexpr double built_tests = 1.3;  ///< of lbvh_drift's new trees, over those of drift_rebuild
  static constexpr double surplus_test = 0.65;   ///< a box test in a tree that has aged
  static constexpr double start_primitive = 45;  ///< the excess of either's first frame over another one
};

}  // namespace kbvh::costs
