#include "experiments/scenes/walker.hpp"

#include <algorithm>
#include <cmath>

#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::cross;
using cloth::dot;
using cloth::length;
using cloth::Vec;

namespace {

enum BoneId : std::size_t { pelvis, abdomen, chest, head, thigh, shin, foot, upper_arm, forearm };
/// Returns the bone index; the right limbs' bones follow the left ones.
std::size_t limb(BoneId bone, std::size_t side) {
  return std::size_t(bone) + side * 5;
}
enum PartId : std::size_t { trunk, legs, feet = 3, arms = 5 };

/// Cones of the trunk blend where their distances differ by less than this.
constexpr double melting = 0.06;

using Matrix = std::array<Vec, 3>;
Vec times(const Matrix& m, const Vec& v) {
  return {dot(m[0], v), dot(m[1], v), dot(m[2], v)};
}
Matrix times(const Matrix& a, const Matrix& b) {
  const Matrix columns{Vec{b[0].x, b[1].x, b[2].x}, {b[0].y, b[1].y, b[2].y}, {b[0].z, b[1].z, b[2].z}};
  Matrix out;
  for (std::size_t row = 0; row < 3; ++row)
    out[row] = {dot(a[row], columns[0]), dot(a[row], columns[1]), dot(a[row], columns[2])};
  return out;
}
/// Returns the rotation about an axis of unit length (Rodrigues).
Matrix turn(const Vec& n, double degrees) {
  const double c = cosine_of_turns(degrees / 360), s = sine_of_turns(degrees / 360), d = 1 - c;
  return {Vec{c + n.x * n.x * d, n.x * n.y * d - n.z * s, n.x * n.z * d + n.y * s},
          {n.y * n.x * d + n.z * s, c + n.y * n.y * d, n.y * n.z * d - n.x * s},
          {n.z * n.x * d - n.y * s, n.z * n.y * d + n.x * s, c + n.z * n.z * d}};
}
Vec mirrored(Vec v, std::size_t side) {
  // GCC 12.2 fuses products with alternating sums and differences (vfmsubadd) where the hardware can, even
  // under -ffp-contract=off; the sign change must be hidden from it.
  const volatile double sign = side == 0 ? 1.0 : -1.0;
  v.y *= sign;
  return v;
}
constexpr Vec x_axis{1, 0, 0}, y_axis{0, 1, 0}, z_axis{0, 0, 1};

/// Returns the direction along the arm in the rest pose, and the axis about which its elbow bends.
Vec arm_direction(std::size_t side) {
  return mirrored({0, sine_of_turns(rest_arm_degrees / 360), -cosine_of_turns(rest_arm_degrees / 360)}, side);
}
Vec elbow_axis(std::size_t side) {
  return {0, cosine_of_turns(rest_arm_degrees / 360),
          (side == 0 ? 1.0 : -1.0) * sine_of_turns(rest_arm_degrees / 360)};
}

}  // namespace

FigureShape man() {
  return {};
}

FigureShape woman() {
  FigureShape f;
  f.hip = {0, 0.085, 0.87};
  f.knee = {0, 0.085, 0.47};
  f.ankle = {-0.02, 0.085, 0.08};
  f.toe = {0.13, 0.093, 0.033};
  f.shoulder = {0, 0.160, 1.335};
  f.upper_arm = 0.27;
  f.forearm = 0.31;
  f.pelvis = {0.90, 0.078, 0.103, -0.005};
  f.waist = {1.06, 0.045, 0.082, 0};
  f.chest = {1.21, 0.06, 0.096, 0};
  f.bust = {1.19, 0.065, 0.066, 0.058};
  f.shoulders = {1.345, 0.138, 0.044, 0};
  f.neck_radius = 0.045;
  f.head_radius = 0.088;
  f.head_z = 1.535;
  f.hip_radius = 0.086;
  f.knee_radius = 0.054;
  f.ankle_radius = 0.037;
  f.shoulder_radius = 0.043;
  f.elbow_radius = 0.035;
  f.hand_radius = 0.026;
  return f;
}

Walker::Walker(const FigureShape& shape, const Gait& gait) : shape_(shape), gait_(gait) {
  const FigureShape& f = shape_;
  bones_[pelvis].rest = {0, 0, f.pelvis.z};
  bones_[abdomen].rest = {0, 0, 0.5 * (f.pelvis.z + f.waist.z)};
  bones_[chest].rest = {0, 0, 0.5 * (f.waist.z + f.chest.z)};
  bones_[head].rest = {0, 0, f.shoulders.z + 0.06};
  for (std::size_t side = 0; side < 2; ++side) {
    bones_[limb(thigh, side)].rest = mirrored(f.hip, side);
    bones_[limb(shin, side)].rest = mirrored(f.knee, side);
    bones_[limb(foot, side)].rest = mirrored(f.ankle, side);
    bones_[limb(upper_arm, side)].rest = mirrored(f.shoulder, side);
    bones_[limb(forearm, side)].rest = mirrored(f.shoulder, side) + arm_direction(side) * f.upper_arm;
  }
  const auto bar = [&](std::size_t bone, const FigureShape::Bar& b) {
    add_cone(trunk, bone, {b.front, b.half, b.z}, b.radius, bone, {b.front, -b.half, b.z}, b.radius);
  };
  bar(pelvis, f.pelvis);
  bar(abdomen, f.waist);
  bar(chest, f.chest);
  bar(chest, f.bust);
  bar(chest, f.shoulders);
  const double skull = f.head_z - f.shoulders.z;
  add_cone(trunk, chest, {0, 0, f.shoulders.z}, f.neck_radius * 1.1, head,
           {0.01, 0, f.shoulders.z + 0.6 * skull}, f.neck_radius);
  add_cone(trunk, head, {0.025, 0, f.head_z - 0.02}, f.head_radius * 0.85, head, {0.005, 0, f.head_z + 0.035},
           f.head_radius);
  for (std::size_t side = 0; side < 2; ++side) {
    const auto at = [&](const Vec& v) { return mirrored(v, side); };
    add_cone(legs + side, limb(thigh, side), at(f.hip), f.hip_radius, limb(thigh, side), at(f.knee),
             f.knee_radius);
    add_cone(legs + side, limb(shin, side), at(f.knee), f.knee_radius, limb(shin, side), at(f.ankle),
             f.ankle_radius);
  }
  for (std::size_t side = 0; side < 2; ++side)
    add_cone(feet + side, limb(foot, side), mirrored(f.ankle, side), f.ankle_radius, limb(foot, side),
             mirrored(f.toe, side), 0.8 * f.ankle_radius);
  for (std::size_t side = 0; side < 2; ++side) {
    const Vec shoulder = mirrored(f.shoulder, side), along = arm_direction(side);
    const Vec elbow = shoulder + along * f.upper_arm;
    add_cone(arms + side, limb(upper_arm, side), shoulder, f.shoulder_radius, limb(upper_arm, side), elbow,
             f.elbow_radius);
    add_cone(arms + side, limb(forearm, side), elbow, f.elbow_radius, limb(forearm, side),
             elbow + along * f.forearm, f.hand_radius);
  }
  pose(0, 0);
  mark();
}

void Walker::add_cone(std::size_t part, std::size_t bone_a, const Vec& a, double ra, std::size_t bone_b,
                      const Vec& b, double rb) {
  Cone cone{};
  cone.part = part;
  cone.bone_a = bone_a;
  cone.bone_b = bone_b;
  cone.rest_a = a;
  cone.rest_b = b;
  cone.ra = ra;
  cone.rb = rb;
  cones_.push_back(cone);
}

void Walker::set_bone(std::size_t bone, std::size_t parent, const Matrix& turned) {
  bones_[bone].joint = carried(parent, bones_[bone].rest);
  bones_[bone].turn = times(bones_[parent].turn, turned);
}

Vec Walker::carried(std::size_t bone, const Vec& rest) const {
  return bones_[bone].joint + times(bones_[bone].turn, rest - bones_[bone].rest);
}

void Walker::pose(double t, double walking) {
  const double p = gait_.phase + gait_.cycles_per_second * t;
  const auto wave = [&](double turns) { return walking * cosine_of_turns(turns); };
  // The pelvis is lowest and the trunk leans most when both feet are down; it turns with the leg in front.
  bones_[pelvis].joint =
      bones_[pelvis].rest + Vec{0, 0.018 * wave(p - 0.3), -0.012 * walking - 0.018 * wave(2 * p)};
  bones_[pelvis].turn = times(turn(z_axis, -5 * wave(p)), turn(x_axis, 3 * wave(p - 0.2)));
  set_bone(abdomen, pelvis, times(turn(z_axis, 4 * wave(p)), turn(x_axis, -2 * wave(p - 0.2))));
  set_bone(chest, abdomen, times(turn(z_axis, 6 * wave(p)), turn(y_axis, 3 * walking + 1.5 * wave(2 * p))));
  set_bone(head, chest, turn(z_axis, -4 * wave(p)));
  for (std::size_t side = 0; side < 2; ++side) {
    const double q = p + 0.5 * double(side);  // heel strike at 0
    const double sign = side == 0 ? 1.0 : -1.0;
    // Mean curves of hip and knee over a cycle, by two harmonics.
    const double hip = 10 * walking + gait_.hip_swing * wave(q);
    const double knee = 24 * walking + 20 * wave(q - 0.75) + 14 * wave(2 * q - 1.4);
    const double ankle = 6 * wave(q - 0.35) - 6 * wave(2 * q - 0.1);
    set_bone(limb(thigh, side), pelvis, times(turn(y_axis, -hip), turn(x_axis, sign * 1.5 * walking)));
    set_bone(limb(shin, side), limb(thigh, side), turn(y_axis, knee));
    set_bone(limb(foot, side), limb(shin, side), turn(y_axis, ankle));
    const double hanging = 15;  // degrees from the vertical: clear of the hips
    const double swing = 3 * walking + gait_.arm_swing * wave(q + 0.5);
    const double lowered = -sign * walking * (rest_arm_degrees - hanging);
    set_bone(limb(upper_arm, side), chest, times(turn(y_axis, -swing), turn(x_axis, lowered)));
    const double bent = 22 * walking + 12 * wave(q + 0.45);
    set_bone(limb(forearm, side), limb(upper_arm, side), turn(elbow_axis(side), -bent));
  }
  place_cones();
}

void Walker::place_cones() {
  travel_ = 0;
  for (Cone& c : cones_) {
    c.a = carried(c.bone_a, c.rest_a);
    c.b = carried(c.bone_b, c.rest_b);
    c.centre = (c.a + c.b) * 0.5;
    c.size = length(c.b - c.a);
    c.along = (c.b - c.a) * (1.0 / c.size);
    c.sine = (c.ra - c.rb) / c.size;
    c.cosine = std::sqrt(1.0 - c.sine * c.sine);
    c.reach = 0.5 * c.size + std::max(c.ra, c.rb);
    travel_ = std::max({travel_, length(c.a - c.marked_a), length(c.b - c.marked_b)});
  }
}

void Walker::mark() {
  for (Cone& c : cones_) {
    c.marked_a = c.a;
    c.marked_b = c.b;
  }
  travel_ = 0;
}

Walker::Hit Walker::hit(const Cone& c, const Vec& p) {
  const Vec d = p - c.a;
  const double y = dot(d, c.along);
  const Vec outward = d - c.along * y;
  const double q = length(outward);
  // The nearest surface point lies where the normal through p meets the axis.
  const double foot = y - q * c.sine / c.cosine;
  const auto sphere = [&](const Vec& from, double radius, double share) -> Hit {
    const double r = length(from);
    if (!(r > 0.0)) return {-radius, z_axis, share};
    return {r - radius, from * (1.0 / r), share};
  };
  if (foot <= 0.0) return sphere(d, c.ra, 0);
  if (foot >= c.size) return sphere(p - c.b, c.rb, 1);
  const Vec radial = q > 0.0 ? outward * (1.0 / q) : Vec{};
  return {c.cosine * q + c.sine * y - c.ra, radial * c.cosine + c.along * c.sine, foot / c.size};
}

Walker::Contact Walker::nearest_of_part(const Vec& point, std::size_t part) const {
  Contact best{1e9, z_axis, {}};
  for (const Cone& c : cones_) {
    if (c.part != part) continue;
    const Vec d = point - c.centre;
    const double far = c.reach + std::max(best.distance, 0.0) + melting;
    if (best.distance < 1e9 && dot(d, d) > far * far) continue;
    const Hit h = hit(c, point);
    const Vec moved = (c.a - c.marked_a) * (1 - h.share) + (c.b - c.marked_b) * h.share;
    const double width = part == trunk ? melting : 0.01;
    const double overlap = std::max(0.0, 1.0 - std::fabs(h.distance - best.distance) / width);
    const double share = h.distance < best.distance ? 1 - 0.5 * overlap : 0.5 * overlap;
    best.normal = best.normal * (1 - share) + h.normal * share;
    best.moved = best.moved * (1 - share) + moved * share;
    best.distance = std::min(best.distance, h.distance) - 0.25 * width * overlap * overlap;
  }
  const double size = length(best.normal);
  best.normal = size > 0.0 ? best.normal * (1 / size) : z_axis;
  return best;
}

Walker::Contact Walker::nearest(const Vec& point, double reach) const {
  Contact best{reach, z_axis, {}};
  std::size_t part = bone_count;
  for (const Cone& c : cones_) {
    if (c.part == part) continue;  // that part was tested already
    const Vec d = point - c.centre;
    // A smooth minimum of seven lies below the least by at most about `melting`.
    const double far = c.reach + std::max(best.distance, 0.0) + melting;
    if (dot(d, d) > far * far) continue;
    part = c.part;
    const Contact found = nearest_of_part(point, part);
    if (found.distance < best.distance) best = found;
  }
  return best;
}

}  // namespace kbvh::scenes
