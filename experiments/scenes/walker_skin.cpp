#include <algorithm>
#include <cmath>

#include "experiments/scenes/shapes.hpp"
#include "experiments/scenes/walker.hpp"

namespace kbvh::scenes {

using cloth::cross;
using cloth::dot;
using cloth::length;
using cloth::Vec;

namespace {

constexpr double below_surface = 0.001;

double smooth_step(double x) {
  const double t = std::min(1.0, std::max(0.0, x));
  return t * t * (3 - 2 * t);
}

/// One closed mesh around a straight axis: rings of `segments` vertices around the axis, whose rays leave its
/// ends like the meridians of a capsule.
struct PartPlan {
  std::size_t part;
  Vec from, to, side;  // axis and one direction across it
  double around;       // typical circumference
  struct Joint {
    double at;  // along the axis, metres
    std::size_t bone;
  };
  std::vector<Joint> joints;  // bone from there on; the first at or before 0
  double length_with_caps() const { return length(to - from) + 0.25 * around; }
};

}  // namespace

/// Has access to the internals of a walker to make the parts of its skin.
class SkinPart {
 public:
  static std::vector<PartPlan> plans(const Walker& w, const FigureShape& f) {
    std::vector<PartPlan> plans;
    const double floor = f.pelvis.z - 0.03;
    plans.push_back({0, {0, 0, floor}, {0.01, 0, f.head_z + 0.03}, {1, 0, 0}, 0.9, {}});
    for (std::size_t bone = 0; bone < 4; ++bone)
      plans.back().joints.push_back({w.bones_[bone].rest.z - floor, bone});
    plans.back().joints[0].at = 0;
    for (std::size_t part = 1; part < 7; ++part) {
      std::vector<const Walker::Cone*> cones;
      for (const Walker::Cone& c : w.cones_)
        if (c.part == part) cones.push_back(&c);
      PartPlan plan{part, cones.front()->rest_a, cones.back()->rest_b, {1, 0, 0}, 0, {}};
      if (cones.size() == 1) plan.side = {0, 0, 1};
      plan.around = 6.28 * 0.5 * (cones.front()->ra + cones.back()->rb);
      double at = 0;
      for (const Walker::Cone* c : cones) {
        plan.joints.push_back({at, c->bone_a});
        at += length(c->rest_b - c->rest_a);
      }
      plans.push_back(plan);
    }
    return plans;
  }

  static Skin::Vertex vertex(const Walker& w, const PartPlan& plan, const Vec& origin, const Vec& ray,
                             double at, double bite) {
    Skin::Vertex v{};
    v.part = plan.part;
    double far = 0.5;
    // From outside inwards: every part is star-shaped with respect to its axis.
    for (int i = 0; i < 200; ++i) {
      const double d = w.nearest_of_part(origin + ray * far, plan.part).distance;
      far = std::max(0.0, far - 0.8 * d);
      if (std::fabs(d) < 1e-7) break;
    }
    v.rest = origin + ray * far;
    const double patch = sine_of_turns(v.rest.x * 6 + v.rest.z * 3 + 0.1) *
                         sine_of_turns(v.rest.y * 7 - 0.2) * sine_of_turns(v.rest.z * 6 + 0.3);
    v.offset = -below_surface + (bite + below_surface) * smooth_step(4 * patch - 1.0);
    v.bone_a = v.bone_b = plan.joints[0].bone;
    const double half = 0.05;  // of the length along which a joint bends
    for (std::size_t j = 1; j < plan.joints.size(); ++j) {
      if (at < plan.joints[j].at - half) break;
      v.bone_a = plan.joints[j - 1].bone;
      v.bone_b = plan.joints[j].bone;
      v.share = smooth_step((at - plan.joints[j].at + half) / (2 * half));
    }
    return v;
  }

  static void put_on(const Walker& w, const Skin::Vertex& v, Vec& x) {
    for (int i = 0; i < 4; ++i) {
      const Walker::Contact c = w.nearest_of_part(x, v.part);
      x += c.normal * (v.offset - c.distance);
    }
  }
};

namespace {

struct Counts {
  std::uint32_t segments, rings;
};

/// Returns rings and segments of every part for one length of edges.
std::vector<Counts> counts_at(const std::vector<PartPlan>& plans, double edge, std::uint64_t& triangles) {
  std::vector<Counts> counts;
  triangles = 0;
  for (const PartPlan& plan : plans) {
    const auto segments = std::max(4u, std::uint32_t(plan.around / edge + 0.5));
    const auto rings = std::max(3u, std::uint32_t(plan.length_with_caps() / edge + 0.5));
    counts.push_back({segments, rings});
    triangles += 2ull * segments * rings;
  }
  return counts;
}

}  // namespace

Skin::Skin(const Walker& walker, const FigureShape& shape, std::uint32_t triangles, double bite) {
  cloth::check_range("avatar", triangles, 1, 1 << 22, "the number of triangles");
  const std::vector<PartPlan> plans = SkinPart::plans(walker, shape);
  double area = 0;
  for (const PartPlan& plan : plans) area += plan.around * plan.length_with_caps();
  const double guess = std::sqrt(2 * area / double(triangles));
  // All lengths near the guess, from the nearest on.
  std::vector<Counts> counts;
  double least = 1e18;
  for (int i = 0; i < 800; ++i) {
    const double edge = guess * (1 + (i % 2 == 0 ? 1 : -1) * 0.0004 * double(i));
    std::uint64_t n = 0;
    std::vector<Counts> found = counts_at(plans, edge, n);
    const double off = std::fabs(double(n) - double(triangles));
    if (off < least) {
      least = off;
      counts = std::move(found);
    }
  }
  std::vector<std::uint32_t>& corners = mesh_.primitive_vertices;
  for (std::size_t i = 0; i < plans.size(); ++i) {
    const PartPlan& plan = plans[i];
    const auto [segments, rings] = counts[i];
    const auto first = std::uint32_t(vertices_.size());
    const Vec axis = plan.to - plan.from;
    const double size = length(axis), cap = 0.125 * plan.around;
    const Vec u = axis * (1 / size);
    Vec across = plan.side - u * dot(plan.side, u);
    across = across * (1 / length(across));
    const Vec third = cross(u, across);
    const auto add = [&](double way, double turns) {
      // `way` runs over one cap, the axis, and the other cap; rays bend towards the axis in the caps.
      const double along = std::min(size, std::max(0.0, way - cap));
      double lean = 0;  // turns
      if (way < cap) lean = -0.25 * (1 - way / cap);
      if (way > cap + size) lean = 0.25 * (way - cap - size) / cap;
      const Vec radial = across * cosine_of_turns(turns) + third * sine_of_turns(turns);
      const Vec ray = radial * cosine_of_turns(lean) + u * sine_of_turns(lean);
      vertices_.push_back(SkinPart::vertex(walker, plan, plan.from + u * along, ray, along, bite));
    };
    const double whole = size + 2 * cap;
    for (std::uint32_t r = 0; r < rings; ++r)
      for (std::uint32_t s = 0; s < segments; ++s)
        add(whole * double(r + 1) / double(rings + 1), double(s) / double(segments));
    add(0, 0);
    add(whole, 0);
    const std::uint32_t bottom = first + rings * segments, top = bottom + 1;
    for (std::uint32_t s = 0; s < segments; ++s) {
      const std::uint32_t next = (s + 1) % segments;
      corners.insert(corners.end(), {bottom, first + next, first + s});
      for (std::uint32_t r = 0; r + 1 < rings; ++r) {
        const std::uint32_t low = first + r * segments, high = low + segments;
        corners.insert(corners.end(), {low + s, low + next, high + next});
        corners.insert(corners.end(), {low + s, high + next, high + s});
      }
      const std::uint32_t last = first + (rings - 1) * segments;
      corners.insert(corners.end(), {top, last + s, last + next});
    }
  }
  const std::size_t count = corners.size() / 3;
  mesh_.name = "avatar-" + std::to_string(count);
  mesh_.vertex_count = std::uint32_t(vertices_.size());
  for (std::size_t t = 1; t <= count; ++t) mesh_.primitive_offsets.push_back(std::uint32_t(3 * t));
}

void Skin::positions(const Walker& walker, std::vector<Vec>& out) const {
  out.resize(vertices_.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Vertex& v = vertices_[i];
    out[i] = walker.carried(v.bone_a, v.rest) * (1 - v.share) + walker.carried(v.bone_b, v.rest) * v.share;
    SkinPart::put_on(walker, v, out[i]);
  }
}

}  // namespace kbvh::scenes
