#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/broad_phase/earliest_impact.hpp"
#include "core/broad_phase/element_tree.hpp"
#include "core/broad_phase/elements.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

struct BroadPhaseSettings {
  /// The most elements in a leaf of the trees: 5 to 16. 8 and 16 fill the vector units.
  std::uint32_t leaf_size = 16;
  /// A tree is built again where its nodes' surface has grown beyond this factor since it was built.
  double most_growth = 2;
  /// The instruction set; nothing: the widest that this processor supports. All compute the same bits.
  std::optional<KernelSet> kernels{};
};

/// The broad phase of a simulation: pairs of vertices, edges and faces of a mesh whose boxes overlap. One
/// object holds one mesh; several bodies are one mesh whose parts have no common vertices.
///
/// Boxes of elements grow by radius / 2 on each side, rounded outward, and are closed: two elements at a
/// distance of at most `radius` are always a candidate. A swept box encloses the straight motions of its
/// vertices between two times. Incident elements (with a common vertex) are no candidates. Answers are the
/// same set on every machine and list each pair once, in an order that depends on the tree.
///
/// S is float or double. Coordinates are numbers of at most admissible_magnitude<S>; positions are n x 3 in
/// the caller's memory, any strides (matrices and maps of Eigen convert), and are read during the call only.
/// Every call that takes positions throws std::invalid_argument, and changes nothing, for another number of
/// rows or columns and for an inadmissible coordinate, which it names. Once warm, nothing allocates except
/// lists that become longer than ever before. One thread at a time.
template <class S>
class BroadPhase {
 public:
  /// Throws std::invalid_argument for a leaf size or a growth out of range.
  explicit BroadPhase(const BroadPhaseSettings& settings = {});
  ~BroadPhase();
  BroadPhase(const BroadPhase&) = delete;
  BroadPhase& operator=(const BroadPhase&) = delete;

  /// Takes a mesh: positions V (n x 3), edges E (m x 2), faces F (k x 3), and the largest distance between
  /// elements that `within` will be asked for, rounded up to S. Indices are checked and copied; a bound of
  /// `valid_for` ends. Throws as `make_elements` does, and std::invalid_argument for a radius that is
  /// negative or no number.
  template <IndexMatrix Edges, IndexMatrix Faces>
  void build(const MatrixView<S>& v, const Edges& e, const Faces& f, double radius = 0) {
    start(v, v, make_elements(v.rows, view_of(e), view_of(f)), radius, Motion::none);
  }
  /// Takes a mesh whose vertices move from V0 to V1.
  template <IndexMatrix Edges, IndexMatrix Faces>
  void build(const MatrixView<S>& v0, const MatrixView<S>& v1, const Edges& e, const Faces& f,
             double radius = 0) {
    start(v0, v1, make_elements(v0.rows, view_of(e), view_of(f)), radius, Motion::straight);
  }

  /// Takes other positions of the same mesh. O(n), and a refit at the next search.
  void update(const MatrixView<S>& v);
  /// Takes another motion of the same mesh.
  void update(const MatrixView<S>& v0, const MatrixView<S>& v1);
  /// Takes the positions of the vertices `moved` from the rows of V; all other rows must be unchanged since
  /// the last update, and are not read. Costs in proportion to the elements that moved. Throws
  /// std::invalid_argument for a vertex out of range, and std::logic_error after a swept update.
  void update(const MatrixView<S>& v, std::span<const std::uint32_t> moved);

  /// Makes the trees of earlier searches current now; otherwise the next search does this.
  void refresh();

  /// Finds candidates of one kind, into the caller's list, which is replaced. See `valid_for` for what stays.
  void detect(CandidateKind kind, CandidateBuffer& out);
  void detect_vertex_vertex_candidates(CandidateBuffer& out) { detect(CandidateKind::vertex_vertex, out); }
  void detect_edge_vertex_candidates(CandidateBuffer& out) { detect(CandidateKind::edge_vertex, out); }
  void detect_edge_edge_candidates(CandidateBuffer& out) { detect(CandidateKind::edge_edge, out); }
  void detect_face_vertex_candidates(CandidateBuffer& out) { detect(CandidateKind::face_vertex, out); }
  void detect_edge_face_candidates(CandidateBuffer& out) { detect(CandidateKind::edge_face, out); }
  void detect_face_face_candidates(CandidateBuffer& out) { detect(CandidateKind::face_face, out); }
  /// Returns the same from memory of this object, without a copy; valid until the next build or update.
  /// Searches only if the kept list is not valid any more.
  std::span<const Candidate> candidates(CandidateKind kind);

  /// Finds the pairs of elements whose distance is at most `distance`, exactly: the answer is that of real
  /// arithmetic on the given numbers. For a motion, at its end. Edges and faces are closed; degenerate ones
  /// are what their corners span. Throws std::invalid_argument unless 0 <= distance <= radius.
  void within(CandidateKind kind, double distance, CandidateBuffer& out);

  /// Finds the first contact of a vertex and a face, or of two edges, during the motion from V0 to V1: exact
  /// verdicts in real arithmetic on the given numbers, no epsilon (core/continuous/impact.hpp). Contact at
  /// t = 0 counts. Throws std::logic_error unless the last positions were a motion.
  EarliestImpact earliest_impact(EarliestImpactStats* stats = nullptr);

  /// From now on candidates hold for all positions in which no coordinate of a vertex differs by more than
  /// `displacement` from its value at the last detection: updates within that bound cost a comparison and
  /// leave all candidates as they are. An update beyond it starts the bound again from the new positions,
  /// and the next question detects again. Candidates are then pairs that can become candidates within the
  /// bound; `within` is exact at the present positions all the same. 0 ends this. Throws
  /// std::invalid_argument for a displacement that is negative or no number.
  void valid_for(double displacement);
  /// The same with a bound for each vertex.
  void valid_for(std::span<const S> displacements);
  /// Returns by how much every coordinate of every vertex may still change before candidates are detected
  /// again, up to rounding; 0 where no bound was asked for.
  S left() const { return left_; }

  /// Returns how many searches all kinds together have made since `build`.
  std::uint64_t detections() const { return detections_; }
  /// Returns how often positions left the bound of `valid_for`, or came without one.
  std::uint64_t references() const { return references_; }
  /// Returns the number of box tests of the last search.
  std::uint64_t last_box_tests() const { return last_box_tests_; }
  /// Builds the trees again at the next search.
  void forget_trees();

  bool built() const { return elements_.has_value(); }
  /// Returns the mesh. Throws std::logic_error before `build`, as do all functions but it.
  const Elements& elements() const;
  S radius() const { return radius_; }
  const typename ElementTree<S>::Work& work(Element element) const {
    return trees_[std::size_t(element)].work();
  }
  /// Returns the memory in bytes.
  std::size_t bytes() const;

 private:
  enum class Motion : std::uint8_t { none, straight };
  void start(const MatrixView<S>& v0, const MatrixView<S>& v1, Elements elements, double radius,
             Motion motion);
  void take(const MatrixView<S>& v0, const MatrixView<S>& v1, Motion motion);
  VertexBoxesJob<S> vertex_job(const MatrixView<S>& v0, const MatrixView<S>& v1);
  VertexBoxesJob<S> packed_job();
  bool bounded() const { return displacement_ > 0 || !displacements_.empty(); }
  /// Makes boxes, grown by the displacement too, from the packed positions.
  void refer_to_present();
  void forget_found() { found_valid_.fill(false); }
  ElementTree<S>& current_tree(Element element);
  void search(CandidateKind kind, CandidateBuffer& out);
  void take_leaf_pairs(CandidateKind kind, const ElementLeaves<S>& a, const ElementLeaves<S>& b,
                       std::size_t count, CandidateBuffer& out);
  const CandidateBuffer& kept(CandidateKind kind);

  BroadPhaseSettings settings_;
  KernelSet kernels_;
  std::optional<Elements> elements_;
  S radius_ = 0, half_radius_ = 0;
  Motion motion_ = Motion::none;
  UnfilledArray<S> points_, end_points_;  // [vertex][4]
  UnfilledArray<S> boxes_;                // [vertex][8], of which the trees are made
  std::array<ElementTree<S>, element_kinds> trees_;
  // valid_for
  S displacement_ = 0, left_ = 0;
  std::vector<S> displacements_, grown_each_;  // [vertex]
  // Answers that are kept, by kind.
  std::array<CandidateBuffer, 6> found_;
  std::array<bool, 6> found_valid_{};
  // For temporary use by searches.
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  std::uint64_t detections_ = 0, references_ = 0, last_box_tests_ = 0;
};

extern template class BroadPhase<float>;
extern template class BroadPhase<double>;

}  // namespace kbvh
