#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/scene/motion_view.hpp"

namespace kbvh {

/// Lists the vertices of each body that moved since the last frame: as the caller says, or as the flight
/// plans show. The plans are asked about the past only, so this needs no foresight. Owned by a strategy that
/// uses such lists; no other strategy pays for them.
template <class S>
class MovedVertices : private SampledMotion<S> {
 public:
  /// Allocates all lists.
  explicit MovedVertices(const SampledMotion<S>& motion);

  /// Returns the vertices of a body whose positions may differ between the times `from`, that of the last
  /// frame, and `time()`, that of the motion: all other vertices are where they were. Returns nothing if this
  /// is not known (positions were handed in without a list) or if it is more than a quarter of the vertices.
  /// Vertices from plans come once each; a caller's list as it was given. Valid until the next call for the
  /// body. O(vertices) for each linear piece of the body's motion, O(1) for further frames on that piece.
  std::optional<std::span<const std::uint32_t>> since(std::uint32_t body, double from);

  /// Takes the caller's list for the next frame: the vertices of the body, in any order, that will differ
  /// from their positions at the last one. It counts instead of the plans, and replaces one given before;
  /// std::nullopt withdraws it. Nothing checks it: bounds made with a list that lacks a vertex are wrong.
  /// Throws std::invalid_argument for a body or a vertex out of range.
  void tell(std::uint32_t body, std::optional<std::span<const std::uint32_t>> vertices);
  /// Forgets callers' lists: they are for one frame.
  void end_frame();

  /// Forgets what is known of one body, whose plans changed.
  void forget(std::uint32_t body);
  /// Forgets everything, and makes room for inserted vertices: after a restart and a change of geometry.
  void start_over();

  /// Returns the number of vertices, including those added at run time.
  std::uint32_t vertex_count(std::uint32_t body) const { return this->playback_->plans(body).vertex_count(); }
  std::size_t bytes() const;

 private:
  struct Body {
    std::vector<std::uint32_t> vertices;
    bool told = false;      ///< `vertices` is the caller's list for the next frame
    bool too_many = false;  ///< there are more than `most`
    /// `vertices` are those that the plans move in this span of time.
    double begin = 0, end = -std::numeric_limits<double>::infinity();
  };
  static std::size_t most(std::size_t vertices) { return vertices / 4; }
  void list(Body& body, const FlightPlans<S>& plans, double from, double to);
  void add_moving(Body& body, const FlightPlans<S>& plans, double t);
  /// Adds a vertex; returns whether there is room for more.
  bool add(Body& body, std::uint32_t vertex, std::size_t room);

  std::vector<Body> bodies_;
  std::vector<std::uint64_t> seen_;  ///< a bit for each vertex of the largest body; 0 between calls
};

extern template class MovedVertices<float>;
extern template class MovedVertices<double>;

}  // namespace kbvh
