#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "core/contract/strategy.hpp"

namespace kbvh {

/// Takes lists of the vertices that moved since the last frame: an optional input, by which a strategy leaves
/// out the others. A strategy takes them if it derives publicly from this interface. Where flight plans are
/// known, it finds the vertices itself (core/scene/moved_vertices.hpp); lists are for callers who hand in
/// positions, or who know better.
template <class S>
class TakesMovedVertices {
 public:
  virtual ~TakesMovedVertices() = default;

 protected:
  template <class T>
  friend bool tell_moved(Strategy<T>& strategy, std::uint32_t body,
                         std::optional<std::span<const std::uint32_t>> vertices);
  /// Implements `tell_moved`. The list is valid during the call.
  virtual void take_moved(std::uint32_t body, std::optional<std::span<const std::uint32_t>> vertices) = 0;
};

/// Tells a strategy which vertices of a body will differ, at the next `advance`, from their positions at the
/// last frame: the listed ones at most. The list is for that frame and replaces one given before;
/// std::nullopt withdraws it. A list that lacks a vertex makes bounds wrong, which audits show and nothing
/// prevents. Does nothing for strategies that take no lists; returns whether this one does. Throws
/// std::invalid_argument for a body or a vertex out of range.
template <class S>
bool tell_moved(Strategy<S>& strategy, std::uint32_t body,
                std::optional<std::span<const std::uint32_t>> vertices) {
  auto* const taker = dynamic_cast<TakesMovedVertices<S>*>(&strategy);
  if (taker == nullptr) return false;
  taker->take_moved(body, vertices);
  return true;
}

}  // namespace kbvh
