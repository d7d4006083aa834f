// Boxes that are equal, lie in each other or on a line: every update takes at most nearly linear work. Work
// is counted, never timed.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/contract/about.hpp"
#include "core/contract/registry.hpp"
#include "core/families/build/cluster_builders.hpp"
#include "core/families/restructure/dynamic_tree.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/topology_edit.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/play.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::equal_boxes_test {
namespace {

using Corner = std::array<double, 3>;
using Triangle = std::array<Corner, 3>;

struct Shape {
  const char* name;
  /// Returns triangle i of n.
  Triangle (*triangle)(std::uint32_t i, std::uint32_t n);
};

double share(std::uint32_t i, std::uint32_t n) {
  return double(i + 1) / n;
}
const Shape shapes[] = {
    {"equal",
     [](std::uint32_t, std::uint32_t) -> Triangle {
       return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0.5}}};
     }},
    {"points",
     [](std::uint32_t, std::uint32_t) -> Triangle {
       return {{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}};
     }},
    {"nested",  // with a common corner; the largest last
     [](std::uint32_t i, std::uint32_t n) -> Triangle {
       const double s = share(i, n);
       return {{{0, 0, 0}, {s, 0, 0}, {0, s, s}}};
     }},
    {"nested, the largest first",
     [](std::uint32_t i, std::uint32_t n) -> Triangle {
       const double s = share(n - 1 - i, n);
       return {{{0, 0, 0}, {s, 0, 0}, {0, s, s}}};
     }},
    {"concentric",
     [](std::uint32_t i, std::uint32_t n) -> Triangle {
       const double s = share(i, n);
       return {{{-s, -s, -s}, {s, -s, s}, {0, s, 0}}};
     }},
    {"concentric, shuffled",
     [](std::uint32_t i, std::uint32_t n) -> Triangle {
       const double s = share(std::uint32_t(std::uint64_t(i) * 1237 % n), n);
       return {{{-s, -s, -s}, {s, -s, s}, {0, s, 0}}};
     }},
    {"collinear",
     [](std::uint32_t i, std::uint32_t n) -> Triangle {
       const double x = share(i, n), w = 1.5 / n;
       return {{{x, 0, 0}, {x + w, 0, 0}, {x + w / 2, 0, 0}}};
     }},
};

Box<double> box_of(const Triangle& triangle) {
  Box<double> box;
  for (const Corner& corner : triangle) box.extend(corner.data());
  return box;
}

/// The other body: one triangle that is far away, or one that meets all of the first body.
enum class Other : std::uint8_t { far_away, across };

Scene<float> with_other(Body<float> body, Other other) {
  Scene<float> scene;
  scene.bodies.push_back(std::move(body));
  const float at = other == Other::far_away ? 1000.0F : 0.0F;
  Body<float> one;
  one.primitives.add(std::vector<std::uint32_t>{0, 1, 2});
  one.plans = FlightPlans<float>(
      3, {0}, std::vector<float>{at - 2, at - 2, at - 2, at + 9, at + 8, at + 8, at + 8, at + 9, at + 8});
  scene.bodies.push_back(std::move(one));
  scene.pairs.push_back({0, 1});
  return scene;
}

/// n triangles of a shape that fly along; each with its own vertices, or all with those of the first one.
enum class Vertices : std::uint8_t { own, shared };

Body<float> flying(const Shape& shape, std::uint32_t n, Vertices vertices) {
  Body<float> body;
  std::vector<double> times;
  std::vector<float> positions;
  const std::uint32_t placed = vertices == Vertices::own ? n : 1;
  for (std::uint32_t k = 0; k < 4; ++k) {
    times.push_back(k);
    for (std::uint32_t i = 0; i < placed; ++i)
      for (const Corner& corner : shape.triangle(i, n))
        for (int axis = 0; axis < 3; ++axis) positions.push_back(float(corner[axis] + k * (1 + 0.5 * axis)));
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t first = vertices == Vertices::own ? 3 * i : 0;
    body.primitives.add(std::vector<std::uint32_t>{first, first + 1, first + 2});
  }
  body.plans = FlightPlans<float>(3 * placed, std::move(times), std::move(positions));
  return body;
}

/// A grid of about n triangles that is a point at every second keyframe.
Body<float> pulsing(std::uint32_t n, std::uint32_t point_at) {
  const auto side = std::uint32_t(std::lround(std::sqrt(n / 2.0)));
  return placed_grid<float>(side, 4, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) {
    const double scale = k % 2 == point_at ? 0.0 : 1.0;
    return scale * (axis == 0   ? i / double(side)
                    : axis == 1 ? j / double(side)
                                : 0.1 * std::sin(0.1 * (i + j)));
  });
}

struct Case {
  std::string name;
  std::function<Body<float>(std::uint32_t n)> body;
};
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const Shape& shape : shapes)
    all.push_back({shape.name, [&shape](std::uint32_t n) { return flying(shape, n, Vertices::own); }});
  all.push_back(
      {"one face listed many times", [](std::uint32_t n) { return flying(shapes[0], n, Vertices::shared); }});
  for (const std::uint32_t point_at : {0U, 1U})
    all.push_back({point_at == 0 ? "grows from a point" : "shrinks to a point and returns",
                   [point_at](std::uint32_t n) { return pulsing(n, point_at); }});
  return all;
}

/// Adds up all counts of work; excludes levels and maxima.
std::uint64_t steps(const Counters& counters) {
  std::uint64_t sum = 0;
  for (std::size_t c = 0; c < counters.values.size(); ++c)
    if (Counter(c) != Counter::bytes && Counter(c) != Counter::list_peak && Counter(c) != Counter::queue_peak)
      sum += counters.values[c];
  for (const Counters::Named& counter : counters.named) sum += counter.value;
  return sum;
}

std::uint64_t steps_of_clip(const StrategyEntry& entry, const std::map<std::string, std::string>& params,
                            const Scene<float>& scene) {
  Session<float> session(scene, {&entry, params, entry.info.topology.preferred});
  PhaseTimes times;
  PairBuffer pairs;
  session.reset(0);
  session.query(pairs, times);
  for (const double t : {0.5, 1.0, 1.5, 2.0, 2.5, 3.0}) {
    session.advance(t, times);
    session.query(pairs, times);
  }
  return steps(session.strategy().counters());
}

/// The growth of the work for four times as many boxes: n log n with a reserve; n sqrt n grows by 8, n^2 by
/// 16.
constexpr double most_growth = 6.5;
constexpr std::uint32_t few = 1000, many = 4 * few;

/// What a strategy's description says to be quadratic, and which cases these are.
struct Excuse {
  const char* id;
  std::vector<std::string> cases;
};
const std::vector<Excuse>& excuses() {
  static const std::vector<Excuse> list{
      // each lower end of a box passes each upper end
      {"kinetic_sweep", {"grows from a point", "shrinks to a point and returns"}},
      // no node owns a side, and a search for one reads them all
      {"kinetic_boxtree", {"equal", "points", "one face listed many times"}},
  };
  return list;
}
bool is_excused(const std::string& id, const std::string& input) {
  return std::any_of(excuses().begin(), excuses().end(), [&](const Excuse& excuse) {
    return excuse.id == id && std::count(excuse.cases.begin(), excuse.cases.end(), input) != 0;
  });
}

TEST(EqualBoxes, ExcusesAreDescribed) {
  for (const Excuse& excuse : excuses())
    EXPECT_NE(about(excuse.id).find("quadratic"), std::string_view::npos) << excuse.id;
}

TEST(EqualBoxes, EveryUpdateIsNearlyLinear) {
  struct Variant {
    const char* id;
    std::map<std::string, std::string> params;
  };
  std::vector<Variant> variants;
  for (const StrategyEntry& entry : registry())
    if (entry.factory<float>() != nullptr && entry.info.max_primitive_pairs == 0)
      variants.push_back({entry.info.id.c_str(), {}});
  variants.push_back({"ploc", {{"radius", "16"}}});
  std::size_t compared = 0, excused = 0;
  for (const Other other : {Other::far_away, Other::across})
    for (const Case& input : cases()) {
      const Scene<float> small = with_other(input.body(few), other),
                         large = with_other(input.body(many), other);
      for (const Variant& variant : variants) {
        const StrategyEntry& entry = find_strategy(variant.id);
        if (is_excused(entry.info.id, input.name)) {
          ++excused;
          continue;
        }
        const std::uint64_t less = steps_of_clip(entry, variant.params, small),
                            more = steps_of_clip(entry, variant.params, large);
        // Work that is left out completely takes no steps.
        EXPECT_LE(double(more), most_growth * double(less) + 1000)
            << variant.id << ", " << input.name << (other == Other::across ? ", met by a triangle" : "")
            << ": " << less << " steps with " << few << " triangles, " << more << " with " << many;
        ++compared;
      }
    }
  EXPECT_GT(compared, 500u);
  EXPECT_EQ(excused, 2 * (2 + 3));
}

/// Returns the sum over all inner nodes of the number of primitives below: the reads of a builder that splits
/// from the top.
std::uint64_t primitives_split(const Topology& topology) {
  std::vector<std::uint64_t> below(topology.size(), 0);
  std::uint64_t sum = 0;
  for (std::uint32_t node = topology.size(); node-- > 0;) {
    const TopologyNode content = topology.nodes[node];
    if (content.is_leaf()) {
      below[node] = content.count();
      continue;
    }
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      below[node] += below[c];
    sum += below[node];
  }
  return sum;
}

TEST(EqualBoxes, BuildersDivideFromTheTopInNearlyLinearTime) {
  for (const Shape& shape : shapes)
    for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
      for (const std::uint32_t width : {2U, 8U})
        for (const std::uint32_t leaf_size : {1U, 8U}) {
          constexpr std::uint32_t n = 4096;
          std::vector<Box<double>> boxes;
          for (std::uint32_t i = 0; i < n; ++i) boxes.push_back(box_of(shape.triangle(i, n)));
          const Topology topology =
              build_topology<double>(boxes, {.method = method, .width = width, .leaf_size = leaf_size});
          EXPECT_LE(primitives_split(topology), 2U * n * 12)
              << shape.name << ", " << name(method) << ", width " << width << ", leaf size " << leaf_size;
        }
}

TEST(EqualBoxes, ClusteringSearchesEachClusterAFewTimes) {
  for (const Shape& shape : shapes)
    for (const std::uint32_t radius : {8U, 16U}) {
      constexpr std::uint32_t n = 4096;
      Primitives primitives;
      std::vector<float> positions;
      for (std::uint32_t i = 0; i < n; ++i) {
        primitives.add(std::vector<std::uint32_t>{3 * i, 3 * i + 1, 3 * i + 2});
        for (const Corner& corner : shape.triangle(i, n))
          positions.insert(positions.end(), corner.begin(), corner.end());
      }
      positions.push_back(0);
      const PrimitiveList list(primitives);
      LocalClusterBuilder<float> builder(radius, 1);
      CurveOrder<float> order;
      BuiltTree<float> tree;
      tree.start(1, active_kernel_set());
      order.take(primitives, list, positions.data(), tree.kernels());
      builder.build(tree, order, list);
      EXPECT_LE(builder.searched(), 8U * n) << shape.name << ", radius " << radius;
      std::vector<Box<double>> boxes;
      EXPECT_LE(primitives_split(tree.topology(boxes)), 2U * n * 12) << shape.name << ", radius " << radius;
    }
}

TEST(EqualBoxes, InsertionsIntoADynamicTreeVisitLogarithmicallyManyNodes) {
  for (const Shape& shape : shapes) {
    constexpr std::uint32_t n = 4096;
    DynamicTree<double> tree;
    tree.clear(n);
    const auto box = [&](std::uint32_t i) { return box_of(shape.triangle(i, n)); };
    for (std::uint32_t i = 0; i < n; ++i) tree.insert(i, box(i));
    EXPECT_LE(tree.visited(), 8U * n * 12) << shape.name << ", insertions";
    for (std::uint32_t round = 0; round < 3; ++round)
      for (std::uint32_t i = 0; i < n; ++i) {
        tree.remove(i);
        tree.insert(i, box(round % 2 == 0 ? n - 1 - i : i));
      }
    EXPECT_LE(tree.visited(), 8U * n * 12 + 3 * 12U * n * 12) << shape.name << ", movements";
  }
}

TEST(EqualBoxes, EditsInsertIntoTreesThatStayShallow) {
  for (const Shape& shape : shapes)
    for (const std::uint32_t leaf_size : {1U, 8U}) {
      constexpr std::uint32_t n = 4096;
      std::vector<Box<double>> boxes{box_of(shape.triangle(0, n))};
      Topology topology =
          build_topology<double>(boxes, {.method = BuildMethod::median, .width = 2, .leaf_size = leaf_size});
      TopologyEditor editor(topology, n);
      TopologyEdit edit;
      std::uint64_t visited = 0;
      const auto follow = [&] {
        visited += edit.moved.size() + edit.fresh.size() + edit.vacated.size();
        std::vector<std::pair<std::uint32_t, Box<double>>> moved;
        for (const auto& move : edit.moved) moved.emplace_back(move.to, boxes[move.from]);
        boxes.resize(topology.size());
        for (const auto& [node, box] : moved) boxes[node] = box;
      };
      for (std::uint32_t p = 1; p < n; ++p) {
        const Box<double> box = box_of(shape.triangle(p, n));
        const std::uint32_t at = leaf_for(topology, box, [&](std::uint32_t node) {
          ++visited;
          return boxes[node];
        });
        const std::uint32_t leaf = editor.insert(topology, at, p, edit);
        follow();
        if (!edit.fresh.empty()) boxes[leaf] = box;
        for (std::uint32_t node = leaf;; node = topology.parents[node]) {
          boxes[node].extend(box);
          if (node == 0) break;
        }
        for (std::uint32_t top; (top = editor.unbalanced_above(topology, p)) != TopologyEditor::none;) {
          editor.rebalance(topology, top, edit, [&](std::uint32_t node) { return boxes[node]; });
          follow();
          for (std::size_t i = edit.fresh.size(); i-- > 0;) {
            const TopologyNode node = topology.nodes[edit.fresh[i]];
            if (node.is_leaf()) continue;
            boxes[edit.fresh[i]] = boxes[node.first()];
            boxes[edit.fresh[i]].extend(boxes[node.first() + 1]);
          }
        }
      }
      EXPECT_LE(visited, 12U * n * 12) << shape.name << ", leaf size " << leaf_size;
    }
}

}  // namespace
}  // namespace kbvh::test::equal_boxes_test
