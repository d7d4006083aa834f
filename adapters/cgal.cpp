// CGAL's box intersection (Zomorodian & Edelsbrunner 2000) as a contestant: no hierarchy is kept.
// Each frame sorts and divides the boxes of single primitives along a segment tree that exists only as the
// recursion, and scans short lists. CGAL's package for it may be used under the GPL 3 or a commercial
// licence: a program linked with this contestant is under one of the two, and kbvh's own MIT licence applies
// without it.
//
// - Boxes can be half-open or closed; kbvh's touching boxes overlap. CLOSED is passed explicitly.
// - Two boxes with the same id are never compared, and ids order boxes that begin at the same coordinate. Ids
//   of two sequences must therefore differ, or pairs are silently lost. Ids derived from the boxes' addresses
//   change when the algorithm moves boxes, so the ids here consist of body and primitive.
// - A call permutes both sequences. `box_self_intersection_d` copies its sequence at every call, which
//   allocates; the adapter keeps the memory of its copy, and makes the same inner call as CGAL.
// - `cutoff` is the length of lists that are scanned instead of divided. On mixing swarms of 16,000
//   triangles CGAL's default of 10 takes 4.5 times as long as 1000 (100: 2.4 times, 5000: 1.2 times).
// - The splits are random, by a generator that restarts at every split: equal input gives equal work.
//
// Range: everything admissible. CGAL compares coordinates and computes nothing with them.
//
// The update computes the boxes; the query is CGAL's. There is no hierarchy to audit, and no count of box
// tests.
#include <CGAL/box_intersection_d.h>
#include <CGAL/version.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/families/wide/body_by_body.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/scene/self_pairs.hpp"
#include "instructions.hpp"

namespace kbvh {
namespace {

template <class S>
struct CgalBox {
  S lower[3], upper[3];
  std::uint64_t id;  // body and primitive
};

/// The interface that CGAL requires of a box.
template <class S>
struct CgalTraits {
  using Box_parameter = const CgalBox<S>&;
  using NT = S;
  using ID = std::uint64_t;
  static S min_coord(Box_parameter box, int axis) { return box.lower[axis]; }
  static S max_coord(Box_parameter box, int axis) { return box.upper[axis]; }
  static ID id(Box_parameter box) { return box.id; }
  static int dimension() { return 3; }
};

template <class S>
class CgalBoxes final : public BodyByBody<S>, public AnswersSelfPairs {
  using BodyByBody<S>::near_bodies_;

 public:
  CgalBoxes(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies /*none*/,
            const Params& params)
      : BodyByBody<S>(scene, motion),
        cutoff_(std::ptrdiff_t(params.number("cutoff"))),
        bodies_(scene.body_count()) {}

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    std::uint64_t tests = 0;
    const auto box_of = [&](std::uint32_t body) { return bodies_[body].box; };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = this->scene_.pairs()[i];
      std::vector<CgalBox<S>>&first = bodies_[pair.first].boxes, &second = bodies_[pair.second].boxes;
      if (pair.first == pair.second) {
        copy_ = first;
        intersect(first, copy_, CGAL::Box_intersection_d::COMPLETE,
                  [&, primitives = &this->scene_.primitives(pair.first)](PrimitivePair found) {
                    if (keep_self_pair(primitives, LeavesOf::two, found.primitive_a, found.primitive_b))
                      out.push_back(found);
                  });
      } else {
        intersect(first, second, CGAL::Box_intersection_d::BIPARTITE,
                  [&](const PrimitivePair& found) { out.push_back(found); });
      }
    }
    this->count_.add(Counter::box_tests, tests);
    return {};
  }

  std::size_t bytes() const override {
    std::size_t total = near_bodies_.bytes() + copy_.capacity() * sizeof(CgalBox<S>);
    for (const Body& body : bodies_) total += sizeof(Body) + body.boxes.capacity() * sizeof(CgalBox<S>);
    return total;
  }

 private:
  struct Body {
    std::vector<CgalBox<S>> boxes;
    Box<double> box;
  };

  template <class Found>
  void intersect(std::vector<CgalBox<S>>& first, std::vector<CgalBox<S>>& second,
                 CGAL::Box_intersection_d::Setting setting, const Found& found) {
    CGAL::box_intersection_d(
        first.begin(), first.end(), second.begin(), second.end(),
        [&found](const CgalBox<S>& a, const CgalBox<S>& b) {
          found(PrimitivePair{std::uint32_t(a.id >> 32), std::uint32_t(a.id), std::uint32_t(b.id >> 32),
                              std::uint32_t(b.id)});
        },
        CgalTraits<S>(), cutoff_, CGAL::Box_intersection_d::CLOSED, setting);
  }

  void update(std::uint32_t index) override {
    Body& body = bodies_[index];
    const Primitives& primitives = this->scene_.primitives(index);
    const S* const positions = this->sampled_.positions(index);
    body.boxes.resize(primitives.count());
    LaneBox<S> all{};
    for (std::uint32_t p = 0; p < primitives.count(); ++p) {
      const LaneBox<S> lanes = LaneBox<S>::of(primitives[p], positions);
      const Box<S> box = lanes.box();
      CgalBox<S>& to = body.boxes[p];
      std::copy_n(box.lower, 3, to.lower);
      std::copy_n(box.upper, 3, to.upper);
      to.id = std::uint64_t(index) << 32 | p;
      if (p == 0)
        all = lanes;
      else
        all.extend(lanes);
    }
    body.box = primitives.count() == 0 ? Box<double>{} : to_double(all.box());
    this->count_.add(Counter::values_written, std::uint64_t(6) * primitives.count());
    this->count_.add(Counter::vertex_reads, primitives.vertices.size());
  }

  std::ptrdiff_t cutoff_;
  std::vector<Body> bodies_;
  std::vector<CgalBox<S>> copy_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(cgal) {
  using namespace kbvh;
  Info info;
  info.id = "cgal_box_intersection";
  info.title = "CGAL box intersection";
  info.family = "cgal";
  info.citation = "Zomorodian & Edelsbrunner 2000 (CGAL, GPL 3 or commercial licence)";
  info.version = "CGAL " CGAL_VERSION_STR;
  info.instructions = compiled_instructions();
  info.tightness = Tightness::none;
  info.guarantee = Guarantee::candidate_superset;
  info.positions = PositionUse::all;
  info.topology.own = true;
  info.parameters = {
      {"cutoff", "1000", {}, "length of lists that are scanned instead of divided", 1, 1e9, Numbers::whole}};
  return {make_entry<CgalBoxes>(std::move(info))};
}
