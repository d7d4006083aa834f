#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/continuous/impact.hpp"
#include "core/continuous/impact_batch.hpp"
#include "core/scene/playback.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

using ContactBuffer = std::vector<Contact>;

/// Orders and compares contacts by kind, features and time, for sets of contacts.
bool operator<(const Contact& a, const Contact& b);
bool operator==(const Contact& a, const Contact& b);

/// Vertices, edges and faces of a body of triangles, for contacts. Faces are its primitives, vertices are
/// those of the faces. Edges are unique and undirected, numbered by their larger and then by their smaller
/// vertex.
///
/// Every vertex and every edge belongs to the first face that contains it, so that a pair of features is
/// found with exactly one pair of faces (representative triangles: Curtis, Tamstorf & Manocha 2008).
class Features {
 public:
  struct Edge {
    std::uint32_t vertices[2];  ///< smaller, larger
  };
  struct Face {
    std::uint32_t vertices[3];
    std::uint32_t edges[3];                            ///< from corner i to the next
    std::uint8_t owned_vertices = 0, owned_edges = 0;  ///< bit i: corner i, edge i
  };

  Features() = default;
  /// Throws std::invalid_argument unless all primitives are triangles.
  explicit Features(const Primitives& primitives);

  const std::vector<Edge>& edges() const { return edges_; }
  const std::vector<Face>& faces() const { return faces_; }

 private:
  std::vector<Edge> edges_;
  std::vector<Face> faces_;  ///< by primitive; removed primitives own no feature
};

/// The narrow phase of continuous collision detection between two frames: every vertex moves on a straight
/// line from its position at the first frame (`start`) to its position at the second (`find`). Positions are
/// truth B: at keyframes the stored ones. Reuses its buffers.
template <class S>
class ContactFinder {
 public:
  /// Throws std::invalid_argument that names the body, unless all bodies in pairs consist of triangles.
  explicit ContactFinder(const Scene<S>& scene);

  /// Starts the motion at the playback's time, with its positions, all of which must be current.
  void start(const Playback<S>& playback);
  /// Ends the motion at the playback's time, with its positions. Appends the contacts of the features of
  /// pairs of faces, each once if each pair is listed once; features that share a vertex have no contact.
  /// Times of impact are enclosed to within `impact_width` of the motion's length, rounded outwards. Features
  /// are tested in batches.
  void find(const Playback<S>& playback, std::span<const PrimitivePair> pairs, ContactBuffer& out);
  /// Appends the contacts of every vertex with every face, and of every edge with every edge, for the scene's
  /// pairs of bodies, one by one: the oracle. O(n^2).
  void find_all(const Playback<S>& playback, ContactBuffer& out);
  /// Appends the same contacts as `find_all`, by sort-and-sweep of the faces' swept boxes: for larger scenes.
  void find_by_sweep(const Playback<S>& playback, ContactBuffer& out);

  /// Returns the positions of a body at the start of the motion, [vertex][3]; one scalar past the end may be
  /// read.
  const S* before(std::uint32_t body) const { return before_[body].data(); }
  const ImpactStats& stats() const { return stats_; }

 private:
  void finish(const Playback<S>& playback);
  // These call take(contact, points) for two features, or for all of two faces; the contact has no time yet.
  template <class Take>
  void vertex_face(std::uint32_t body_a, std::uint32_t vertex, std::uint32_t body_b, std::uint32_t face,
                   const Take& take);
  template <class Take>
  void edge_edge(std::uint32_t body_a, std::uint32_t edge_a, std::uint32_t body_b, std::uint32_t edge_b,
                 const Take& take);
  template <class Take>
  void faces(const PrimitivePair& pair, const Take& take);
  /// Returns a function that tests features at once, to be taken.
  auto each_alone(ContactBuffer& out) {
    return [this, &out](const Contact& contact, const MovingPoints& points) {
      report(contact, find_impact(contact.kind, points, &stats_), out);
    };
  }
  /// Decides the batches, and reports their contacts in the order in which the features were taken.
  void decide_batches(ContactBuffer& out);
  void report(Contact contact, const Impact& impact, ContactBuffer& out);

  const Scene<S>* scene_;
  std::vector<Features> features_;
  std::vector<std::vector<S>> before_;             ///< [body]
  std::vector<std::vector<double>> positions_[2];  ///< [end][body][vertex][3]
  double begin_ = 0, end_ = 0;
  ImpactStats stats_;
  ImpactBatch batches_[2]{ImpactBatch(Contact::Kind::vertex_face),
                          ImpactBatch(Contact::Kind::edge_edge)};  ///< [kind]
  std::array<Contact, 2 * ImpactBatch::room> taken_{};             ///< of both batches, without times
  std::size_t taken_count_ = 0;
};

extern template class ContactFinder<float>;
extern template class ContactFinder<double>;

}  // namespace kbvh
