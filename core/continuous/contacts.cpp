#include "core/continuous/contacts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>

namespace kbvh {

namespace {
auto key(const Contact& c) {
  return std::tuple(c.kind, c.body_a, c.feature_a, c.body_b, c.feature_b, c.begin, c.end);
}
}  // namespace

bool operator<(const Contact& a, const Contact& b) {
  return key(a) < key(b);
}
bool operator==(const Contact& a, const Contact& b) {
  return key(a) == key(b);
}

Features::Features(const Primitives& primitives) {
  if (primitives.kind != PrimitiveKind::polygons)
    throw std::invalid_argument("contacts are of triangles, not of points or control nets");
  struct Use {
    std::uint32_t larger, smaller, face;
    std::uint8_t side;
    auto operator<=>(const Use&) const = default;
  };
  std::vector<Use> uses;
  std::vector<std::uint8_t> seen;
  faces_.resize(primitives.count());
  for (std::uint32_t p = 0; p < primitives.count(); ++p) {
    const auto corners = primitives[p];
    if (corners.size() != 3)
      throw std::invalid_argument("contacts are of triangles, primitive " + std::to_string(p) + " has " +
                                  std::to_string(corners.size()) + " vertices");
    Face& face = faces_[p];
    std::copy(corners.begin(), corners.end(), face.vertices);
    if (!primitives.alive(p)) continue;
    for (std::uint8_t i = 0; i < 3; ++i) {
      const std::uint32_t v = corners[i], w = corners[(i + 1) % 3];
      if (v >= seen.size()) seen.resize(v + 1, 0);
      if (seen[v] == 0) face.owned_vertices |= std::uint8_t(1U << i);
      seen[v] = 1;
      uses.push_back({std::max(v, w), std::min(v, w), p, i});
    }
  }
  std::sort(uses.begin(), uses.end());
  for (std::size_t i = 0; i < uses.size(); ++i) {
    const Use& use = uses[i];
    if (i == 0 || uses[i - 1].larger != use.larger || uses[i - 1].smaller != use.smaller) {
      edges_.push_back({{use.smaller, use.larger}});
      faces_[use.face].owned_edges |= std::uint8_t(1U << use.side);
    }
    faces_[use.face].edges[use.side] = std::uint32_t(edges_.size() - 1);
  }
}

template <class S>
ContactFinder<S>::ContactFinder(const Scene<S>& scene)
    : scene_(&scene), features_(scene.bodies.size()), before_(scene.bodies.size()) {
  for (auto& positions : positions_) positions.resize(scene.bodies.size());
  std::vector<bool> wanted(scene.bodies.size());
  for (const BodyPair& pair : scene.pairs) wanted[pair.first] = wanted[pair.second] = true;
  for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
    if (!wanted[body]) continue;
    try {
      features_[body] = Features(scene.bodies[body].primitives);
    } catch (const std::invalid_argument& problem) {
      throw std::invalid_argument("body '" + scene.bodies[body].name + "': " + problem.what());
    }
  }
}

template <class S>
void ContactFinder<S>::start(const Playback<S>& playback) {
  begin_ = playback.time();
  for (std::uint32_t body = 0; body < before_.size(); ++body) {
    const S* positions = playback.positions(body);
    const std::size_t size = std::size_t(3) * scene_->bodies[body].plans.vertex_count();
    before_[body].assign(positions, positions + size + 1);
    positions_[0][body].assign(positions, positions + size);
  }
}

template <class S>
void ContactFinder<S>::finish(const Playback<S>& playback) {
  end_ = playback.time();
  for (std::uint32_t body = 0; body < before_.size(); ++body) {
    const S* positions = playback.positions(body);
    positions_[1][body].assign(positions, positions + positions_[0][body].size());
  }
}

template <class S>
void ContactFinder<S>::find(const Playback<S>& playback, std::span<const PrimitivePair> pairs,
                            ContactBuffer& out) {
  finish(playback);
  const auto take = [&](const Contact& contact, const MovingPoints& points) {
    ImpactBatch& batch = batches_[std::size_t(contact.kind)];
    batch.add(points);
    taken_[taken_count_++] = contact;
    if (batch.full()) decide_batches(out);
  };
  for (const PrimitivePair& pair : pairs) faces(pair, take);
  decide_batches(out);
}

template <class S>
void ContactFinder<S>::decide_batches(ContactBuffer& out) {
  for (ImpactBatch& batch : batches_) batch.decide(&stats_);
  std::size_t read[2] = {0, 0};
  for (std::size_t i = 0; i < taken_count_; ++i) {
    const auto kind = std::size_t(taken_[i].kind);
    report(taken_[i], batches_[kind].impact(read[kind]++), out);
  }
  for (ImpactBatch& batch : batches_) batch.clear();
  taken_count_ = 0;
}

template <class S>
template <class Take>
void ContactFinder<S>::faces(const PrimitivePair& pair, const Take& take) {
  const Features::Face& a = features_[pair.body_a].faces()[pair.primitive_a];
  const Features::Face& b = features_[pair.body_b].faces()[pair.primitive_b];
  for (std::uint32_t i = 0; i < 3; ++i) {
    if ((a.owned_vertices >> i & 1U) != 0)
      vertex_face(pair.body_a, a.vertices[i], pair.body_b, pair.primitive_b, take);
    if ((b.owned_vertices >> i & 1U) != 0)
      vertex_face(pair.body_b, b.vertices[i], pair.body_a, pair.primitive_a, take);
    if ((a.owned_edges >> i & 1U) == 0) continue;
    for (std::uint32_t j = 0; j < 3; ++j)
      if ((b.owned_edges >> j & 1U) != 0) edge_edge(pair.body_a, a.edges[i], pair.body_b, b.edges[j], take);
  }
}

template <class S>
template <class Take>
void ContactFinder<S>::vertex_face(std::uint32_t body_a, std::uint32_t vertex, std::uint32_t body_b,
                                   std::uint32_t face, const Take& take) {
  const std::uint32_t(&corners)[3] = features_[body_b].faces()[face].vertices;
  if (scene_->same_vertices(body_a, body_b) &&
      (vertex == corners[0] || vertex == corners[1] || vertex == corners[2]))
    return;
  MovingPoints points;
  for (int end = 0; end < 2; ++end) {
    const double** p = end == 0 ? points.begin : points.end;
    p[0] = positions_[end][body_a].data() + std::size_t(3) * vertex;
    for (int i = 0; i < 3; ++i) p[i + 1] = positions_[end][body_b].data() + std::size_t(3) * corners[i];
  }
  take(Contact{Contact::Kind::vertex_face, body_a, vertex, body_b, face, 0, 0}, points);
}

template <class S>
template <class Take>
void ContactFinder<S>::edge_edge(std::uint32_t body_a, std::uint32_t edge_a, std::uint32_t body_b,
                                 std::uint32_t edge_b, const Take& take) {
  if (body_a == body_b && edge_a > edge_b) std::swap(edge_a, edge_b);
  const auto& a = features_[body_a].edges()[edge_a].vertices;
  const auto& b = features_[body_b].edges()[edge_b].vertices;
  if (scene_->same_vertices(body_a, body_b) && (a[0] == b[0] || a[0] == b[1] || a[1] == b[0] || a[1] == b[1]))
    return;
  MovingPoints points;
  for (int end = 0; end < 2; ++end) {
    const double** p = end == 0 ? points.begin : points.end;
    for (int i = 0; i < 2; ++i) {
      p[i] = positions_[end][body_a].data() + std::size_t(3) * a[i];
      p[i + 2] = positions_[end][body_b].data() + std::size_t(3) * b[i];
    }
  }
  take(Contact{Contact::Kind::edge_edge, body_a, edge_a, body_b, edge_b, 0, 0}, points);
}

template <class S>
void ContactFinder<S>::report(Contact contact, const Impact& impact, ContactBuffer& out) {
  if (!impact.touches) return;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  // The length, the product and the sum are rounded; three steps outwards cover these errors. Ends are exact.
  const auto at = [&](double fraction, double outwards) {
    if (fraction == 0) return begin_;
    if (fraction == 1) return end_;
    const double length = std::nextafter(end_ - begin_, outwards);
    const double t = std::nextafter(begin_ + std::nextafter(length * fraction, outwards), outwards);
    return std::clamp(t, begin_, end_);
  };
  contact.begin = at(impact.begin, -infinity);
  contact.end = at(impact.end, infinity);
  out.push_back(contact);
}

template <class S>
void ContactFinder<S>::find_all(const Playback<S>& playback, ContactBuffer& out) {
  finish(playback);
  const auto take = each_alone(out);
  for (const BodyPair& pair : scene_->pairs) {
    const auto all_vertices = [&](std::uint32_t body_a, std::uint32_t body_b) {
      std::vector<bool> used(scene_->bodies[body_a].plans.vertex_count());
      for (const Features::Face& face : features_[body_a].faces())
        for (int i = 0; i < 3; ++i)
          if ((face.owned_vertices >> i & 1) != 0) used[face.vertices[i]] = true;
      for (std::uint32_t v = 0; v < used.size(); ++v)
        for (std::uint32_t face = 0; used[v] && face < features_[body_b].faces().size(); ++face)
          if (scene_->bodies[body_b].primitives.alive(face)) vertex_face(body_a, v, body_b, face, take);
    };
    all_vertices(pair.first, pair.second);
    if (pair.first != pair.second) all_vertices(pair.second, pair.first);
    const std::size_t edges_a = features_[pair.first].edges().size();
    const std::size_t edges_b = features_[pair.second].edges().size();
    for (std::uint32_t i = 0; i < edges_a; ++i)
      for (std::uint32_t j = pair.first == pair.second ? i + 1 : 0; j < edges_b; ++j)
        edge_edge(pair.first, i, pair.second, j, take);
  }
}

template <class S>
void ContactFinder<S>::find_by_sweep(const Playback<S>& playback, ContactBuffer& out) {
  finish(playback);
  const auto take = each_alone(out);
  struct Item {
    Box<double> box;
    std::uint32_t primitive;
    bool second;
  };
  for (const BodyPair& pair : scene_->pairs) {
    std::vector<Item> items;
    const bool within = pair.first == pair.second;
    for (const bool second : {false, true}) {
      const std::uint32_t body = second ? pair.second : pair.first;
      if (second && within) continue;
      const std::vector<Features::Face>& all = features_[body].faces();
      for (std::uint32_t p = 0; p < all.size(); ++p) {
        if (!scene_->bodies[body].primitives.alive(p)) continue;
        Box<double> box;
        for (const auto& positions : positions_)
          for (const std::uint32_t v : all[p].vertices)
            box.extend(positions[body].data() + std::size_t(3) * v);
        items.push_back({box, p, second});
      }
    }
    std::sort(items.begin(), items.end(),
              [](const Item& x, const Item& y) { return x.box.lower[0] < y.box.lower[0]; });
    for (std::size_t i = 0; i < items.size(); ++i)
      for (std::size_t j = i + 1; j < items.size() && items[j].box.lower[0] <= items[i].box.upper[0]; ++j) {
        const bool turned = items[i].second;
        if ((!within && items[j].second == turned) || !overlap(items[i].box, items[j].box)) continue;
        const Item &a = items[turned ? j : i], &b = items[turned ? i : j];
        faces({pair.first, a.primitive, pair.second, b.primitive}, take);
      }
  }
}

template class ContactFinder<float>;
template class ContactFinder<double>;

}  // namespace kbvh
