#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/unfilled_array.hpp"
#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/pair_filter.hpp"

namespace kbvh {

namespace detail {
template <class S>
struct StrategySearch;
}

/// The candidates of a simulation, like those of BroadPhase, found by a strategy of the registry: to compare
/// strategies in a simulator, and simulators' meshes in the study. Positions are not known in advance, so the
/// strategy must need no foresight. It must accept control nets and, for candidates of elements of one kind,
/// answer pairs within a body.
///
/// Vertices, edges and faces are bodies over one vertex set, whose vertices are the two corners of each
/// vertex's box: it encloses the vertex, or its motion, grown by radius / 2 and rounded outward as in
/// BroadPhase. Candidates of an exact strategy are therefore the same set as those of BroadPhase, in another
/// order. Filters sift what the strategy found: they do not shorten its search.
///
/// S is float or double. Positions, indices and errors are as in BroadPhase. Strategies may allocate at any
/// call.
template <class S>
class StrategyBroadPhase {
 public:
  /// Takes the strategy's id, its parameters as text, and overrides of its tree (keys method, width,
  /// leaf_size). Throws ConfigError for an unknown id, and std::invalid_argument for an unknown key; whether
  /// the strategy suits and its parameters are valid is checked by the first search of a kind.
  explicit StrategyBroadPhase(const std::string& strategy, std::map<std::string, std::string> params = {},
                              const std::map<std::string, std::string>& topology = {});
  ~StrategyBroadPhase();
  StrategyBroadPhase(const StrategyBroadPhase&) = delete;
  StrategyBroadPhase& operator=(const StrategyBroadPhase&) = delete;

  /// Takes a mesh: positions V (n x 3), edges E (m x 2), faces F (k x 3), and the radius.
  template <IndexMatrix Edges, IndexMatrix Faces>
  void build(const MatrixView<S>& v, const Edges& e, const Faces& f, double radius = 0) {
    start(v, v, make_elements(v.rows, view_of(e), view_of(f)), radius);
  }
  /// Takes a mesh whose vertices move from V0 to V1.
  template <IndexMatrix Edges, IndexMatrix Faces>
  void build(const MatrixView<S>& v0, const MatrixView<S>& v1, const Edges& e, const Faces& f,
             double radius = 0) {
    start(v0, v1, make_elements(v0.rows, view_of(e), view_of(f)), radius);
  }
  /// Takes new positions of the same mesh, or a new motion. O(n). Throws std::logic_error before `build`.
  void update(const MatrixView<S>& v) { take(v, v); }
  void update(const MatrixView<S>& v0, const MatrixView<S>& v1) { take(v0, v1); }

  /// Finds candidates of one kind, into the caller's list, which is replaced: each pair once, under the
  /// strategy's guarantee. The first search of a kind builds its trees. Throws ConfigError, with a reason,
  /// if the strategy does not suit, and std::logic_error before `build`.
  void detect(CandidateKind kind, CandidateBuffer& out);

  /// Filter candidates as the functions of BroadPhase with these names do, until the next `build`. Throw
  /// what those throw, and std::logic_error before `build`. The next search throws what too many rings, or
  /// the function, throw there.
  void set_groups(Element element, std::span<const GroupMask> groups);
  void set_vertex_groups(std::span<const GroupMask> groups);
  void exclude(CandidateKind kind, std::span<const Candidate> pairs);
  void exclude_rings(std::uint32_t rings);
  void keep_only(PairFunction function);
  /// Ends all filters. Before `build` there are none, and nothing is thrown.
  void clear_filters();

  const std::string& strategy() const { return strategy_; }
  /// Returns the memory of boxes, elements, filters, the strategy's structures and its lists, in bytes.
  std::size_t bytes() const;

 private:
  void start(const MatrixView<S>& v0, const MatrixView<S>& v1, Elements elements, double radius);
  void take(const MatrixView<S>& v0, const MatrixView<S>& v1);
  void write_boxes(const MatrixView<S>& v0, const MatrixView<S>& v1);
  /// Returns the elements. Throws std::logic_error before `build`.
  const Elements& built() const;

  std::string strategy_;
  std::map<std::string, std::string> params_, topology_;
  bool built_ = false;
  Elements elements_;  ///< over vertices
  Elements nets_;      ///< over corners: vertex v has the corners 2 v and 2 v + 1
  PairFilter filter_;
  std::uint32_t vertices_ = 0;
  S half_radius_ = 0;
  double time_ = 0;         ///< number of updates since `build`
  std::vector<S> corners_;  ///< [corner][3], and one for reads of four; read when searches are called
  UnfilledArray<S> boxes_, begin_points_, end_points_;  ///< [vertex][8], [vertex][4] and [vertex][4]
  std::array<std::unique_ptr<detail::StrategySearch<S>>, candidate_kinds.size()> searches_;
};

extern template class StrategyBroadPhase<float>;
extern template class StrategyBroadPhase<double>;

}  // namespace kbvh
