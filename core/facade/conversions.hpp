#pragma once
// Internal to the façade: between its plain structures and those of the library.
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/facade/world.hpp"
#include "core/judge/session.hpp"

namespace kbvh::facade {

template <class S>
std::vector<S> converted(std::span<const float> numbers) {
  return {numbers.begin(), numbers.end()};
}
template <class S>
std::vector<S> converted(std::span<const double> numbers) {
  std::vector<S> out;
  out.reserve(numbers.size());
  for (const double number : numbers) out.push_back(S(number));
  return out;
}

inline Primitives primitives_of(const Connectivity& connectivity) {
  Primitives primitives;
  primitives.kind = connectivity.shape == Shape::points         ? PrimitiveKind::points
                    : connectivity.shape == Shape::control_nets ? PrimitiveKind::control_nets
                                                                : PrimitiveKind::polygons;
  const auto indices = connectivity.indices;
  if (connectivity.offsets.empty()) {
    if (indices.size() % 3 != 0)
      throw std::invalid_argument(std::to_string(indices.size()) +
                                  " indices do not make triangles; other primitives need offsets");
    for (std::size_t i = 0; i < indices.size(); i += 3) primitives.add(indices.subspan(i, 3));
    return primitives;
  }
  const auto offsets = connectivity.offsets;
  if (offsets.front() != 0 || offsets.back() != indices.size())
    throw std::invalid_argument("offsets run from 0 to the number of indices, " +
                                std::to_string(indices.size()) + ", not from " +
                                std::to_string(offsets.front()) + " to " + std::to_string(offsets.back()));
  for (std::size_t p = 0; p + 1 < offsets.size(); ++p) {
    if (offsets[p] > offsets[p + 1] || offsets[p + 1] > indices.size())
      throw std::invalid_argument("primitive " + std::to_string(p) + " has indices " +
                                  std::to_string(offsets[p]) + " to " + std::to_string(offsets[p + 1]) +
                                  " of " + std::to_string(indices.size()));
    primitives.add(indices.subspan(offsets[p], offsets[p + 1] - offsets[p]));
  }
  return primitives;
}

template <class S>
WorldPiece plain(const Piece<S>& piece) {
  return {piece.t0, piece.t1, double(piece.x0), double(piece.x1), piece.kind == PieceKind::ray};
}
template <class S>
WorldEvent plain(const ScheduledEvent<S>& event) {
  WorldEvent out;
  out.kind = WorldEvent::Kind(event.kind);
  out.body = event.body;
  out.node = event.node;
  out.side = event.side;
  out.winner = event.winner;
  out.loser = event.loser;
  out.other_body = event.other_body;
  out.other_node = event.other_node;
  out.time = event.time.time;
  out.error = event.time.error;
  out.exact = event.has_crossing;
  if (!out.exact) return out;
  out.winner_piece = plain(event.crossing.winner);
  out.loser_piece = plain(event.crossing.loser);
  return out;
}
static_assert(int(WorldEvent::Kind::window) == int(EventKind::window) &&
              int(WorldEvent::Kind::boxes_separate) == int(EventKind::boxes_separate));

inline WorldPair plain(const PrimitivePair& pair) {
  return {pair.body_a, pair.primitive_a, pair.body_b, pair.primitive_b};
}
inline void replace(std::vector<WorldPair>& out, const PairBuffer& pairs) {
  out.clear();
  for (const PrimitivePair& pair : pairs) out.push_back(plain(pair));
}

/// Rounds a ray to the world's precision.
template <class S>
Ray<S> typed(const WorldRay& ray) {
  Ray<S> made{};
  for (int axis = 0; axis < 3; ++axis) {
    made.origin[axis] = S(ray.origin[axis]);
    made.direction[axis] = S(ray.direction[axis]);
  }
  made.length = S(ray.length);
  return made;
}
static_assert(WorldHit::none == RayHit::none && int(WorldRayQuery::any) == int(RayQuery::any));

inline std::optional<std::uint32_t> number_of(const std::map<std::string, std::string>& words,
                                              const std::string& key) {
  const auto found = words.find(key);
  if (found == words.end()) return {};
  try {
    std::size_t read = 0;
    const unsigned long number = std::stoul(found->second, &read);
    if (read == found->second.size() && number <= 64) return std::uint32_t(number);
  } catch (const std::exception&) {
  }
  throw std::invalid_argument("the topology's " + key + " cannot be '" + found->second + "'");
}

}  // namespace kbvh::facade
