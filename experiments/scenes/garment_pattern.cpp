#include "experiments/scenes/garment_pattern.hpp"

#include <algorithm>
#include <cmath>

#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::cross;
using cloth::dot;
using cloth::length;
using cloth::Vec;

GarmentShape garment_shape(GarmentKind kind) {
  GarmentShape g;
  if (kind == GarmentKind::shirt) {
    g.levels = {{0.84, 0.222, 0.150, 0},
                {0.95, 0.220, 0.150, 0},
                {1.10, 0.205, 0.140, 0},
                {1.28, 0.225, 0.150, 0.01}};
    g.shoulder_y = 0.205;
    g.shoulder_z = 1.485;
    g.armhole_depth = 0.078;
    g.neck_y = 0.078;
    g.neck_z = 1.505;
    g.neck_front = 0.085;
    g.neck_back = 0.075;
    g.neck_dip_front = 0.05;
    g.neck_dip_back = 0.01;
    g.sleeve = 0.50;
    g.cuff_radius = 0.050;
    return g;
  }
  g.levels = {{0.46, 0.50, 0.47, 0},     {0.90, 0.235, 0.20, 0},      {0.98, 0.185, 0.15, 0},
              {1.06, 0.148, 0.108, 0.0}, {1.14, 0.160, 0.130, 0.018}, {1.22, 0.172, 0.138, 0.022}};
  g.shoulder_y = 0.150;
  g.shoulder_z = 1.398;
  g.armhole_depth = 0.065;
  g.neck_y = 0.085;
  g.neck_z = 1.408;
  g.neck_front = 0.09;
  g.neck_back = 0.075;
  g.neck_dip_front = 0.10;
  g.neck_dip_back = 0.05;
  g.doubled_below = 0.88;
  return g;
}

namespace {

constexpr double shoulder_share = 0.24;  // of the front's columns, under each shoulder seam

constexpr double pi = 3.14159265358979323846;

/// Returns the circumference of an ellipse (Ramanujan's first approximation).
double around(double a, double b) {
  return pi * (3 * (a + b) - std::sqrt((3 * a + b) * (a + 3 * b)));
}

/// Returns the path length up the side of the trunk from the hem to each level: the mean of the slants at the
/// side and in front.
std::vector<double> ways(const GarmentShape& g) {
  std::vector<double> way{0};
  for (std::size_t i = 1; i < g.levels.size(); ++i) {
    const auto &a = g.levels[i - 1], &b = g.levels[i];
    const double dz = b.z - a.z, dw = b.width - a.width, dd = b.depth - a.depth;
    way.push_back(way.back() + 0.5 * (std::sqrt(dz * dz + dw * dw) + std::sqrt(dz * dz + dd * dd)));
  }
  return way;
}

GarmentShape::Level level_at(const GarmentShape& g, const std::vector<double>& way, double s) {
  std::size_t i = 1;
  while (i + 1 < way.size() && way[i] < s) ++i;
  const double t = (s - way[i - 1]) / (way[i] - way[i - 1]);
  const auto &a = g.levels[i - 1], &b = g.levels[i];
  const auto mix = [t](double from, double to) { return from + t * (to - from); };
  return {mix(a.z, b.z), mix(a.width, b.width), mix(a.depth, b.depth), mix(a.front, b.front)};
}

double armhole_height(const GarmentShape& g) {
  return g.shoulder_z - g.levels.back().z;
}

double doubled_way(const GarmentShape& g, const std::vector<double>& way) {
  double s = 0;
  while (g.doubled_below > 0 && s < way.back() && level_at(g, way, s).z < g.doubled_below) s += 0.001;
  return s;
}

GarmentCounts counts_at(const GarmentShape& g, double edge, std::int64_t more_rows) {
  const auto squares = [edge](double size, std::uint32_t least) {
    return std::max(least, std::uint32_t(size / edge + 0.5));
  };
  const std::vector<double> way = ways(g);
  const auto& top = g.levels.back();
  GarmentCounts c;
  c.columns = squares(0.5 * around(top.width, top.depth), 4);
  c.shoulder = std::max(1u, std::uint32_t(shoulder_share * c.columns + 0.5));
  const double doubled = doubled_way(g, way);
  c.doubled = doubled > 0 ? squares(doubled, 2) : 0;
  c.rows = std::uint32_t(std::max<std::int64_t>(2, squares(way.back() - doubled, 2) + more_rows)) + c.doubled;
  c.armhole = squares(1.1 * armhole_height(g), 2);
  c.sleeve = g.sleeve > 0 ? squares(g.sleeve, 2) : 0;
  return c;
}

class Sewing {
 public:
  Sewing(const GarmentShape& shape, const GarmentCounts& counts, const Walker& walker, double margin)
      : g_(shape), c_(counts), walker_(walker), margin_(margin), way_(ways(shape)) {
    p_.counts = counts;
    p_.pieces.resize(6);
  }

  GarmentPattern sewn() {
    lay_trunk();
    lay_upper(0);
    lay_upper(1);
    for (std::uint32_t side = 0; side < 2; ++side) lay_sleeve(side);
    for (int i = 0; i < 8; ++i)
      for (Vec& x : p_.rest) {
        const Walker::Contact near = walker_.nearest(x, margin_);
        if (near.distance < margin_) x += near.normal * (margin_ - near.distance);
      }
    for (Vec& x : p_.rest) x = {rounded_to_float(x.x), rounded_to_float(x.y), rounded_to_float(x.z)};
    link();
    return std::move(p_);
  }

 private:
  using Piece = GarmentPattern::Piece;
  std::uint32_t add(const Vec& x) {
    p_.rest.push_back(x);
    return std::uint32_t(p_.rest.size() - 1);
  }
  static Vec on_ellipse(const GarmentShape::Level& l, double turns) {
    return {l.front + l.depth * sine_of_turns(turns), l.width * cosine_of_turns(turns), l.z};
  }

  /// Returns the position of a column across the front or back, from 0 to 1. Columns under the shoulders have
  /// a fixed share of the width for any number of columns, so that patterns of all counts have the same cut.
  double across(double column) const {
    const double m = c_.shoulder, n = c_.columns;
    if (column <= m) return shoulder_share * column / m;
    if (column >= n - m) return 1 - shoulder_share * (n - column) / m;
    return shoulder_share + (1 - 2 * shoulder_share) * (column - m) / (n - 2 * m);
  }
  /// Returns turns around the trunk, from the left over the front.
  double turns(double column) const {
    const double n = c_.columns;
    return column < n ? 0.5 * across(column) : 0.5 + 0.5 * across(column - n);
  }

  void lay_trunk() {
    const std::uint32_t round = 2 * c_.columns;
    const double doubled = c_.doubled > 0 ? doubled_way(g_, way_) : 0;
    Piece& skirt = p_.pieces[0];
    skirt.closed = true;
    if (c_.doubled > 0) {
      skirt.rows = c_.doubled;
      skirt.columns = 2 * round;
      for (std::uint32_t j = 0; j <= skirt.rows; ++j)
        for (std::uint32_t i = 0; i < skirt.columns; ++i)
          skirt.ids.push_back(add(on_ellipse(level_at(g_, way_, doubled * double(j) / double(skirt.rows)),
                                             turns(0.5 * double(i)))));
    }
    Piece& trunk = p_.pieces[1];
    trunk.closed = true;
    trunk.rows = c_.rows - c_.doubled;
    trunk.columns = round;
    for (std::uint32_t j = 0; j <= trunk.rows; ++j)
      for (std::uint32_t i = 0; i < round; ++i) {
        if (j == 0 && c_.doubled > 0) {
          trunk.ids.push_back(skirt.at(skirt.rows, 2 * i));
          continue;
        }
        const double s = doubled + (way_.back() - doubled) * double(j) / double(trunk.rows);
        trunk.ids.push_back(add(on_ellipse(level_at(g_, way_, s), turns(double(i)))));
      }
    for (const std::uint32_t mark : {0u, c_.shoulder, c_.columns - c_.shoulder}) trunk.marks.push_back(mark);
    for (std::size_t i = 0; i < 3; ++i) trunk.marks.push_back(trunk.marks[i] + c_.columns);
    trunk.marks.push_back(round);
    for (const std::uint32_t mark : trunk.marks) skirt.marks.push_back(2 * mark);
  }

  /// Returns points on the seams around the front (0) or back (1) panel, u and v from 0 to 1.
  Vec armhole_edge(std::uint32_t back, double y_sign, double v) const {
    const double lower_y = g_.levels.back().width, lower_z = g_.levels.back().z;
    const double c = 0.5 * (1 - cosine_of_turns(0.5 * v));
    const double x = (back ? -1.0 : 1.0) * g_.armhole_depth * sine_of_turns(0.5 * v);
    return {x + g_.levels.back().front * (1 - v), y_sign * (lower_y + (g_.shoulder_y - lower_y) * c),
            lower_z + (g_.shoulder_z - lower_z) * c};
  }
  Vec top_edge(std::uint32_t back, double column) const {
    // Columns count from the wearer's left in front, and from the right at the back.
    const double m = c_.shoulder, n = c_.columns;
    const double left = back ? -1.0 : 1.0;
    if (column <= m || column >= n - m) {
      const double t = column <= m ? column / m : (n - column) / m;
      const double y = g_.shoulder_y + (g_.neck_y - g_.shoulder_y) * t;
      return {0, (column <= m ? left : -left) * y, g_.shoulder_z + (g_.neck_z - g_.shoulder_z) * t};
    }
    const double half = 0.5 * (column - m) / (n - 2 * m);
    const double fore = back ? -g_.neck_back : g_.neck_front;
    const double dip = back ? g_.neck_dip_back : g_.neck_dip_front;
    return {fore * sine_of_turns(half), left * g_.neck_y * cosine_of_turns(half),
            g_.neck_z - dip * sine_of_turns(half)};
  }

  void lay_upper(std::uint32_t back) {
    const Piece& trunk = p_.pieces[1];
    Piece& panel = p_.pieces[2 + back];
    panel.rows = c_.armhole;
    panel.columns = c_.columns;
    for (const std::uint32_t mark : {0u, c_.shoulder, c_.columns - c_.shoulder, c_.columns})
      panel.marks.push_back(mark);
    const double left = back ? -1.0 : 1.0;
    const auto bottom = [&](double u) { return on_ellipse(g_.levels.back(), 0.5 * (u + back)); };
    for (std::uint32_t j = 0; j <= panel.rows; ++j)
      for (std::uint32_t i = 0; i <= panel.columns; ++i) {
        if (j == 0) {
          panel.ids.push_back(trunk.at(trunk.rows, (i + back * c_.columns) % trunk.columns));
          continue;
        }
        if (j == panel.rows && back == 1 && (i <= c_.shoulder || i + c_.shoulder >= c_.columns)) {
          panel.ids.push_back(p_.pieces[2].at(panel.rows, panel.columns - i));  // the shoulder seam
          continue;
        }
        // Coons patch through its four edges.
        const double u = across(double(i)), v = double(j) / double(panel.rows);
        const Vec l = armhole_edge(back, left, v), r = armhole_edge(back, -left, v);
        const Vec b = bottom(u), t = top_edge(back, double(i));
        const Vec corners = (bottom(0) * (1 - u) + bottom(1) * u) * (1 - v) +
                            (top_edge(back, 0) * (1 - u) + top_edge(back, double(c_.columns)) * u) * v;
        panel.ids.push_back(add(l * (1 - u) + r * u + b * (1 - v) + t * v - corners));
      }
  }

  void lay_sleeve(std::uint32_t side) {
    if (c_.sleeve == 0) return;
    Piece& sleeve = p_.pieces[4 + side];
    sleeve.closed = true;
    sleeve.rows = c_.sleeve;
    sleeve.columns = 2 * c_.armhole;
    sleeve.marks = {0, c_.armhole, 2 * c_.armhole};
    // Around the armhole from the armpit: forwards on the left, backwards on the right, so that the outside
    // of the cloth is on the same side of every piece.
    const std::uint32_t first_panel = side;
    const auto rim = [&](std::uint32_t k) {
      const std::uint32_t row = k <= c_.armhole ? k : 2 * c_.armhole - k;
      const std::uint32_t panel = k <= c_.armhole ? first_panel : 1 - first_panel;
      return p_.pieces[2 + panel].at(row, k <= c_.armhole ? 0 : c_.columns);
    };
    const double sign = side == 0 ? 1.0 : -1.0;
    const double s = sine_of_turns(rest_arm_degrees / 360), c = cosine_of_turns(rest_arm_degrees / 360);
    const Vec along{0, sign * s, -c};
    const Vec shoulder = walker_.carried(side == 0 ? 7 : 12, {0, sign * g_.shoulder_y, g_.shoulder_z - 0.07});
    const double radius = 0.5 * (g_.armhole_depth + 0.5 * armhole_height(g_));
    for (std::uint32_t j = 0; j <= sleeve.rows; ++j)
      for (std::uint32_t k = 0; k < sleeve.columns; ++k) {
        if (j == 0) {
          sleeve.ids.push_back(rim(k));
          continue;
        }
        const double t = double(j) / double(sleeve.rows);
        // From the armhole's own shape to a tube around the arm.
        const double ring = t < 0.3 ? t / 0.3 : 1.0;
        const double blend = ring * ring * (3 - 2 * ring);
        const double angle = double(k) / double(sleeve.columns);  // turns
        const double size = radius + (g_.cuff_radius - radius) * t;
        const Vec outward{0, sign * c, s};
        const Vec tube = shoulder + along * (g_.sleeve * t + 0.02) -
                         outward * (size * cosine_of_turns(angle)) +
                         Vec{sign * size * sine_of_turns(angle), 0, 0};
        const Vec rim_moved = p_.rest[rim(k)] + along * (g_.sleeve * t + 0.02 * t);
        sleeve.ids.push_back(add(rim_moved * (1 - blend) + tube * blend));
      }
  }

  void link() {
    const std::size_t n = p_.rest.size();
    p_.places.assign(n, {GarmentPattern::none, 0, 0});
    p_.neighbours.assign(
        n, {GarmentPattern::none, GarmentPattern::none, GarmentPattern::none, GarmentPattern::none});
    for (std::uint32_t piece = 0; piece < p_.pieces.size(); ++piece) link(piece);
    finish(p_.threads);
    finish(p_.diagonals);
    double sum = 0;
    for (const auto& t : p_.threads) sum += t.rest;
    p_.spacing = sum / double(p_.threads.size());
    for (std::uint32_t v = 0; v < n; ++v)
      for (std::size_t side = 0; side < 4; side += 2) {
        const std::uint32_t a = p_.neighbours[v][side], c = p_.neighbours[v][side + 1];
        if (a != GarmentPattern::none && c != GarmentPattern::none)
          p_.bends.push_back({a, v, c, 0.5 * (distance(a, v) + distance(v, c))});
      }
    by_colours(p_.bends, [](const auto& b) { return std::array{b.a, b.b, b.c}; });
    for (std::uint32_t v = 0; v < n; ++v)
      for (std::uint32_t& other : p_.neighbours[v])
        if (other == GarmentPattern::none) other = v;
  }

  double distance(std::uint32_t a, std::uint32_t b) const { return length(p_.rest[b] - p_.rest[a]); }
  void thread(std::vector<GarmentPattern::Distance>& list, std::uint32_t a, std::uint32_t b) {
    list.push_back({std::min(a, b), std::max(a, b), distance(a, b)});
  }
  void neighbour(std::uint32_t a, std::uint32_t b, std::size_t towards) {
    auto& slot = p_.neighbours[a][towards];
    if (slot == GarmentPattern::none) slot = b;
    auto& back = p_.neighbours[b][towards - 1];
    if (back == GarmentPattern::none) back = a;
  }

  void link(std::uint32_t which) {
    const Piece& piece = p_.pieces[which];
    if (piece.rows == 0) return;
    const std::uint32_t stride = piece.stride();
    const bool gathers = which == 1 && c_.doubled > 0;  // the lowest row has twice as many columns below it
    for (std::uint32_t j = 0; j <= piece.rows; ++j)
      for (std::uint32_t i = 0; i < stride; ++i) {
        const std::uint32_t v = piece.at(j, i);
        if (p_.places[v].piece == GarmentPattern::none) p_.places[v] = {which, j, i};
        if (i < piece.columns && !(gathers && j == 0)) {
          thread(p_.threads, v, piece.at(j, (i + 1) % stride));
          neighbour(v, piece.at(j, (i + 1) % stride), 1);
        }
        if (j < piece.rows) {
          thread(p_.threads, v, piece.at(j + 1, i));
          neighbour(v, piece.at(j + 1, i), 3);
        }
      }
    for (std::uint32_t j = 0; j < piece.rows; ++j)
      for (std::uint32_t i = 0; i < piece.columns; ++i) {
        const std::uint32_t next = (i + 1) % stride;
        const std::uint32_t a = piece.at(j, i), b = piece.at(j, next), c = piece.at(j + 1, i),
                            d = piece.at(j + 1, next);
        if (gathers && j == 0) {
          const Piece& skirt = p_.pieces[0];
          const std::uint32_t middle = skirt.at(skirt.rows, 2 * i + 1);
          thread(p_.diagonals, middle, c);
          thread(p_.diagonals, middle, d);
          triangle(a, c, middle);
          triangle(c, d, middle);
          triangle(middle, d, b);
          continue;
        }
        thread(p_.diagonals, a, d);
        thread(p_.diagonals, b, c);
        if ((i + j) % 2 == 0) {
          triangle(a, c, d);
          triangle(a, d, b);
        } else {
          triangle(a, c, b);
          triangle(b, c, d);
        }
      }
  }
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    p_.triangles.insert(p_.triangles.end(), {a, b, c});
  }

  /// Removes duplicates: threads along seams are found twice.
  static void finish(std::vector<GarmentPattern::Distance>& list) {
    std::stable_sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end(),
                           [](const auto& x, const auto& y) { return x.a == y.a && x.b == y.b; }),
               list.end());
    by_colours(list, [](const auto& d) { return std::array{d.a, d.b}; });
  }

  /// Sorts constraints into groups of independent ones, so that no sweep drags the cloth towards one side.
  template <class Constraint, class Vertices>
  static void by_colours(std::vector<Constraint>& list, Vertices vertices) {
    std::uint32_t most = 0;
    for (const Constraint& c : list)
      for (const std::uint32_t v : vertices(c)) most = std::max(most, v + 1);
    std::vector<std::uint32_t> used(most, 0);
    std::array<std::vector<Constraint>, 32> groups;
    for (const Constraint& c : list) {
      std::uint32_t taken = 0;
      for (const std::uint32_t v : vertices(c)) taken |= used[v];
      const std::uint32_t colour = std::min(31u, std::uint32_t(std::countr_one(taken)));
      for (const std::uint32_t v : vertices(c)) used[v] |= 1u << colour;
      groups[colour].push_back(c);
    }
    list.clear();
    for (const auto& group : groups) list.insert(list.end(), group.begin(), group.end());
  }

  const GarmentShape& g_;
  const GarmentCounts& c_;
  const Walker& walker_;
  double margin_;
  std::vector<double> way_;
  GarmentPattern p_;
};

}  // namespace

std::uint64_t GarmentCounts::triangles() const {
  const std::uint64_t round = 2ull * columns;
  std::uint64_t count = 2 * round * (rows - doubled + armhole) + 8ull * armhole * sleeve;
  if (doubled > 0) count += 4 * round * doubled + round;  // and the gathering row has three to a column
  return count;
}

GarmentCounts garment_counts(const GarmentShape& shape, std::uint32_t triangles) {
  const auto& top = shape.levels.back();
  const double area = around(top.width, top.depth) * (ways(shape).back() + armhole_height(shape)) +
                      2 * shape.sleeve * 2.2 * armhole_height(shape);
  double edge = std::sqrt(2 * area / double(std::max(1u, triangles)));
  // Corrects the estimate by its result, then tries all lengths around it.
  for (int i = 0; i < 4; ++i)
    edge = edge * std::sqrt(double(counts_at(shape, edge, 0).triangles()) / double(std::max(1u, triangles)));
  GarmentCounts best;
  double least = 1e18;
  for (int i = 0; i < 600; ++i)
    for (const std::int64_t rows : {0, 1, -1, 2, -2}) {
      const double near = edge * (1 + (i % 2 == 0 ? 1 : -1) * 0.0002 * double(i));
      const GarmentCounts c = counts_at(shape, near, rows);
      const double off = std::fabs(double(c.triangles()) - double(triangles));
      if (off < least) {
        least = off;
        best = c;
      }
    }
  return best;
}

GarmentPattern sew(const GarmentShape& shape, const GarmentCounts& counts, const Walker& walker,
                   double margin) {
  return Sewing(shape, counts, walker, margin).sewn();
}

}  // namespace kbvh::scenes
