#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

const std::vector<std::string>& synthetic_scene_names() {
  static const std::vector<std::string> names{"soups",
                                              "sheets",
                                              "static_obstacle",
                                              "nothing_moves",
                                              "four_bodies_own_keyframes",
                                              "one_triangle_and_none",
                                              "integer_ties",
                                              "all_cross_at_once",
                                              "pure_translation_far",
                                              "tiny",
                                              "huge",
                                              "keyframes_a_millionth_apart",
                                              "degenerate_triangles",
                                              "polygons",
                                              "points_against_nets",
                                              "plan_changes",
                                              "plan_changes_ties",
                                              "zero_motion",
                                              "coincident_intervals",
                                              "extreme_velocities",
                                              "extreme_plan_changes",
                                              "plans_start_at_rest",
                                              "plans_move_the_obstacle",
                                              "far_sheets",
                                              "far_waves",
                                              "far_translation",
                                              "far_vertex",
                                              "far_ground"};
  return names;
}

const std::vector<std::string>& far_scene_names() {
  static const std::vector<std::string> names{"far_sheets", "far_waves", "far_translation", "far_vertex",
                                              "far_ground"};
  return names;
}

const std::vector<std::string>& geometry_scene_names() {
  static const std::vector<std::string> names{"geometry_changes",         "geometry_changes_shared",
                                              "geometry_changes_ties",    "geometry_to_nothing",
                                              "geometry_changes_at_rest", "geometry_changes_polygons",
                                              "geometry_changes_points"};
  return names;
}

const std::vector<std::string>& self_scene_names() {
  static const std::vector<std::string> names{
      "self_rolled_cloth",    "self_soup_alone",       "self_sheets_crumpled",
      "self_coincident",      "self_degenerate",       "self_polygons",
      "self_points_and_nets", "self_nothing_moves",    "self_one_triangle_and_none",
      "self_plan_changes",    "self_geometry_changes", "self_geometry_to_nothing"};
  return names;
}

std::vector<std::string> all_synthetic_names() {
  std::vector<std::string> names = synthetic_scene_names();
  names.insert(names.end(), geometry_scene_names().begin(), geometry_scene_names().end());
  names.insert(names.end(), self_scene_names().begin(), self_scene_names().end());
  return names;
}

}  // namespace kbvh::test
