#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

/// The shared parts of the cloth solvers (tablecloth, garments). All results are deterministic to the last
/// bit on every machine with IEEE doubles and -ffp-contract=off.
namespace kbvh::scenes {

/// Receives the finished fraction (0 to 1) after every keyframe; may be empty.
using Progress = std::function<void(double)>;

namespace cloth {

inline constexpr double gravity = 9.81;  ///< m/s^2, along -z

struct Vec {
  double x = 0, y = 0, z = 0;
  Vec operator+(const Vec& o) const { return {x + o.x, y + o.y, z + o.z}; }
  Vec operator-(const Vec& o) const { return {x - o.x, y - o.y, z - o.z}; }
  Vec operator*(double s) const { return {x * s, y * s, z * s}; }
  Vec& operator+=(const Vec& o) { return *this = *this + o; }
  Vec& operator-=(const Vec& o) { return *this = *this - o; }
};
inline double dot(const Vec& a, const Vec& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(const Vec& a) {
  return std::sqrt(dot(a, a));
}

/// Performs one XPBD step of the distance between two vertices of equal mass; softness = mass / (stiffness
/// dt^2).
inline void solve_distance(Vec& a, Vec& b, double rest, double softness) {
  const Vec d = b - a;
  const double now = length(d);
  if (!(now > 0.0)) return;
  const Vec move = d * ((now - rest) / (now * (2.0 + softness)));
  a += move;
  b -= move;
}

/// Performs one XPBD step of quadratic bending at b between its neighbours a and c along a thread; share = 1
/// / (6 + softness), softness = mass spacing^2 / (rigidity dt^2).
inline void solve_bend(Vec& a, Vec& b, Vec& c, double share) {
  const Vec bend = (a + c - b * 2.0) * share;
  a -= bend;
  b += bend * 2.0;
  c -= bend;
}

/// Returns the speed along the unit normal that a step of quadratic drag removes. Implicit, so that drag can
/// stop but never reverse the motion.
inline double dragged_speed(double across, double air_drag, double dt) {
  const double kept = 1.0 / (1.0 + dt * air_drag * std::fabs(across));
  return (1.0 - kept) * across;
}

/// Applies Coulomb friction after a vertex was pushed out of a solid along n by `push`: removes the part of
/// its displacement `slide`, relative to the solid, that friction holds.
inline void resist_sliding(Vec& x, Vec slide, const Vec& n, double push, double friction) {
  slide -= n * dot(slide, n);
  const double amount = length(slide);
  if (amount > 0.0) x -= slide * std::min(1.0, friction * push / amount);
}

/// Contact between layers of a cloth: vertices keep a distance from all vertices that are not their
/// neighbours in the cloth. This keeps layers apart nearly everywhere but is no guarantee: edges may still
/// cut.
class LayerContacts {
 public:
  /// `distance` is the distance to keep, in metres; 0: no contact.
  explicit LayerContacts(double distance) : distance_(distance) {}

  /// Pushes vertices apart that are too near, with friction on their displacement since `previous`. `held(p,
  /// q)`, p < q, returns whether two vertices are neighbours in the cloth. O(vertices), plus a sort into
  /// cells when one has moved by more than a quarter of the distance.
  template <class Held>
  void solve(std::vector<Vec>& x, const std::vector<Vec>& previous, double friction, Held held) {
    if (!(distance_ > 0.0)) return;
    if (stale(x)) {
      sort_into_cells(x);
      list(x, held);
    }
    push_apart(x, previous, friction);
  }

 private:
  bool stale(const std::vector<Vec>& x) const;
  void sort_into_cells(const std::vector<Vec>& x);
  void push_apart(std::vector<Vec>& x, const std::vector<Vec>& previous, double friction) const;

  std::uint32_t cell(std::int64_t i, std::int64_t j, std::int64_t k) const {
    const std::uint64_t h =
        std::uint64_t(i) * 73856093u ^ std::uint64_t(j) * 19349663u ^ std::uint64_t(k) * 83492791u;
    return std::uint32_t(h) & (cells_ - 1);
  }
  double reach() const { return 1.5 * distance_; }
  std::int64_t lattice(double x) const { return std::int64_t(std::floor(x * (1.0 / reach()))); }

  template <class Held>
  void list(const std::vector<Vec>& x, Held held) {
    pairs_.clear();
    for (std::size_t p = 0; p < x.size(); ++p) {
      const std::int64_t ci = lattice(x[p].x), cj = lattice(x[p].y), ck = lattice(x[p].z);
      std::uint32_t visited[27];
      std::uint32_t* visited_end = visited;
      for (std::int64_t k = ck - 1; k <= ck + 1; ++k)
        for (std::int64_t j = cj - 1; j <= cj + 1; ++j)
          for (std::int64_t i = ci - 1; i <= ci + 1; ++i) {
            const std::uint32_t h = cell(i, j, k);
            // Two of the 27 may share a hash: a pair must not be listed twice.
            bool seen = false;
            for (const std::uint32_t* v = visited; v != visited_end && !seen; ++v) seen = *v == h;
            if (seen) continue;
            *visited_end++ = h;
            for (std::uint32_t n = cell_start_[h]; n < cell_start_[h + 1]; ++n) {
              const std::uint32_t q = sorted_[n];
              if (q <= p) continue;
              const Vec d = x[q] - x[p];
              if (!(dot(d, d) < reach() * reach()) || held(std::uint32_t(p), q)) continue;
              pairs_.emplace_back(std::uint32_t(p), q);
            }
          }
    }
    listed_at_ = x;
  }

  double distance_;
  // Candidates: pairs that were within the reach when they were listed.
  std::vector<Vec> listed_at_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
  std::uint32_t cells_ = 0;
  std::vector<std::uint32_t> cell_start_, cell_of_, sorted_, next_;
};

/// Hashes a config's values for cache keys. Doubles count by their bits: two configs share a key only if they
/// are equal.
class ConfigHash {
 public:
  void add(std::uint64_t value) {
    for (int byte = 0; byte < 8; ++byte) hash_ = (hash_ ^ (value >> (8 * byte) & 0xff)) * 0x100000001b3u;
  }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  /// Returns 16 hexadecimal digits.
  std::string digits() const;

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

/// Throws io::InputError "scene: what is ..., must be from ... to ..." unless lowest <= value <= highest.
void check_range(const char* scene, double value, double lowest, double highest, const char* what);

/// Returns the number of solver steps per keyframe: the config's, or one by the distance of threads.
template <class Config>
std::uint32_t steps_per_keyframe(const Config& c, double spacing) {
  if (c.substeps_per_keyframe > 0) return c.substeps_per_keyframe;
  // One iteration per step leaves threads as stiff as mass / step^2: under the weight of half a metre of
  // cloth they stretch by about 5 (step / spacing)^2.
  const double steps = 1.0 / (c.keyframes_per_second * 0.025 * spacing);
  return std::uint32_t(std::max(4.0, std::floor(steps) + 1.0));
}

/// Checks the parameters that all cloths have in common, by these names in their config: density, stiffness,
/// drag, viscosity, friction and distance of layers. `check(value, lowest, highest, what)` is a `check_range`
/// for the scene.
template <class Config, class Check>
void check_cloth(const Config& c, const Check& check) {
  check(c.area_density, 1e-3, 1e3, "the area density");
  check(c.stretch_stiffness, 1e-3, 1e12, "the stretch stiffness");
  check(c.shear_stiffness, 1e-3, 1e12, "the shear stiffness");
  check(c.bending_rigidity, 0.0, 1e6, "the bending rigidity");
  check(c.air_drag, 0.0, 1e6, "the air drag");
  check(c.viscosity, 0.0, 1e3, "the viscosity");
  check(c.friction, 0.0, 1e3, "the friction");
  check(c.layer_distance, 0.0, 0.95, "the layer distance");
}

}  // namespace cloth
}  // namespace kbvh::scenes
