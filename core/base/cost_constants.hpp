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

}  // namespace kbvh::costs
