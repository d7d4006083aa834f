#pragma once
#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/broad_phase/changes.hpp"
#include "core/broad_phase/earliest_impact.hpp"
#include "core/broad_phase/element_search.hpp"
#include "core/broad_phase/element_tree.hpp"
#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/pair_filter.hpp"
#include "core/broad_phase/self_intersections.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

struct BroadPhaseSettings {
  /// The most elements in a leaf of the trees: 5 to 16. 8 and 16 fill the vector units.
  std::uint32_t leaf_size = 16;
  /// A tree is built again when the surface of its nodes has grown by more than this factor.
  double most_growth = 2;
  /// Threads that share searches and tests of self intersections. Answers and their order do not depend on
  /// it. At most most_threads() (core/parallel/workers.hpp).
  std::uint32_t threads = 1;
  /// The instruction set; nothing: the widest that this processor supports. All compute the same bits.
  std::optional<KernelSet> kernels{};
};

/// The ids of the first inserted vertex, edge and face; the other inserted ones follow.
struct InsertedElements {
  std::uint32_t vertex, edge, face;
};

/// The broad phase of a simulation: pairs of vertices, edges and faces of a mesh whose boxes overlap. One
/// object holds one mesh; several bodies are one mesh whose parts have no common vertices.
///
/// Boxes of elements grow by radius / 2 on each side, rounded outward, and are closed: two elements at a
/// distance of at most `radius` are always a candidate. A swept box encloses the straight motions of its
/// vertices between two times. Incident elements (with a common vertex) are no candidates, nor are pairs that
/// a filter excludes. Answers are the same set on every machine and list each pair once, in an order that
/// depends on the tree.
///
/// S is float or double. Coordinates are numbers of at most admissible_magnitude<S>; positions are n x 3 in
/// the caller's memory, any strides (matrices and maps of Eigen convert), and are read during the call only.
/// Every call that takes positions throws std::invalid_argument, and changes nothing, for another number of
/// rows or columns and for an inadmissible coordinate, which it names. Once warm, nothing allocates except
/// lists that become longer than ever before. One caller's thread at a time; filters of a caller are called
/// on it.
template <class S>
class BroadPhase {
 public:
  /// Throws std::invalid_argument for a leaf size, a growth or a number of threads out of range, and for an
  /// instruction set that this processor lacks.
  explicit BroadPhase(const BroadPhaseSettings& settings = {});
  ~BroadPhase();
  BroadPhase(const BroadPhase&) = delete;
  BroadPhase& operator=(const BroadPhase&) = delete;

  /// Takes a mesh: positions V (n x 3), edges E (m x 2), faces F (k x 3), and the largest distance between
  /// elements that `within` will be asked for, rounded up to S. Indices are checked and copied; filters and a
  /// bound of `valid_for` end, and changes start over. Throws as `make_elements` does, and
  /// std::invalid_argument for a radius that is negative or no number.
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

  /// Takes new positions of the same mesh. O(n), and a refit at the next search.
  void update(const MatrixView<S>& v);
  /// Takes a new motion of the same mesh.
  void update(const MatrixView<S>& v0, const MatrixView<S>& v1);
  /// Takes the positions of the vertices `moved` from the rows of V; all other rows must be unchanged since
  /// the last update, and are not read. Costs in proportion to the elements that moved. Throws
  /// std::invalid_argument for a vertex out of range, and std::logic_error after a swept update.
  void update(const MatrixView<S>& v, std::span<const std::uint32_t> moved);

  /// Adds vertices at the positions `v` (k x 3; they rest in a motion) and edges and faces between vertices,
  /// the added ones included. From then on, positions have rows for the added vertices, too. Ids follow the
  /// largest of their kind, that of a removed element included; all other ids are unchanged. A tree whose
  /// elements become more is built again by the next search. Added elements have the default groups, except
  /// edges and faces if `set_vertex_groups` was the last to set the groups of their kind: these get the union
  /// of their vertices' groups. If `valid_for` was given a bound for each vertex, added vertices have the
  /// smallest of these. Throws as `build` does.
  template <IndexMatrix Edges, IndexMatrix Faces>
  InsertedElements insert(const MatrixView<S>& v, const Edges& e, const Faces& f) {
    const std::size_t vertices = elements().vertex_count() + v.rows;
    return add(v, element_list(vertices, view_of(e), Element::edge),
               element_list(vertices, view_of(f), Element::face));
  }
  /// Removes elements: they are no candidates any more, and their ids are never used again before the next
  /// `build`. A removed vertex keeps its row in V, and edges and faces that name it stay. The cost is in
  /// proportion to the removed elements and the kept candidates; trees shrink, and one that has lost half of
  /// its elements is built again. Throws std::invalid_argument for an id that does not exist, was removed, or
  /// is named twice.
  void remove(Element element, std::span<const std::uint32_t> ids);

  /// Set groups and masks of all elements of one kind, in place of those set before; an empty list sets the
  /// default, which admits every pair. Two elements are a candidate only if each has a group in the mask of
  /// the other; searches skip subtrees without such elements. Throw std::invalid_argument for another number
  /// of elements than there are ids.
  void set_groups(Element element, std::span<const GroupMask> groups);
  /// Sets them for vertices. Edges and faces get the union of their vertices' groups, and of their masks:
  /// they pair where a vertex of one may pair with a vertex of the other.
  void set_vertex_groups(std::span<const GroupMask> groups);
  /// Excludes pairs of one kind, in place of those excluded before. Throws std::invalid_argument for an id
  /// that does not exist.
  void exclude(CandidateKind kind, std::span<const Candidate> pairs);
  /// Excludes pairs of elements, of all kinds, that at most `rings` edges connect: a path of at most so many
  /// edges leads from a vertex of one element to a vertex of the other. Edges are those of E and the sides of
  /// faces; removed ones do not count. 0: incident elements only, which never are candidates. The next search
  /// lists the vertices within so many edges of each vertex (about 1 + 3 k + 3 k^2 for k rings of a
  /// triangulation), and does so again after elements were inserted or removed; it throws std::length_error
  /// for 2^32 of them or more.
  void exclude_rings(std::uint32_t rings);
  /// Lets a function choose among the pairs that no other filter excludes, many at a time: see PairFunction.
  /// It has to give the same answer whenever it is asked about a pair. Exceptions that it throws end the
  /// search and pass to the caller. An empty function removes this filter.
  void keep_only(PairFunction function);
  /// The same with keep(kind, pair), which says whether a pair stays.
  template <class Keep>
  requires std::predicate<Keep, CandidateKind, const Candidate&>
  void keep_if(Keep keep) {
    keep_only([keep = std::move(keep)](CandidateKind kind, std::span<Candidate> pairs) mutable {
      std::size_t kept = 0;
      for (const Candidate& pair : pairs)
        if (keep(kind, pair)) pairs[kept++] = pair;
      return kept;
    });
  }
  /// Ends all filters.
  void clear_filters();

  /// Sets the number of threads (BroadPhaseSettings::threads). Throws std::invalid_argument for 0, and for
  /// more than there are.
  void use_threads(std::uint32_t threads) {
    Workers workers(threads);
    face_tests_.resize(threads);
    workers_ = std::move(workers);
  }

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
  /// Returns the same from memory of this object, without a copy; valid until the mesh, its positions, the
  /// bound or a filter changes. Searches only if the kept list is not valid any more.
  std::span<const Candidate> candidates(CandidateKind kind);

  /// Finds the pairs of elements whose distance is at most `distance`, exactly: the answer is that of real
  /// arithmetic on the given numbers. For a motion, at its end. Edges and faces are closed; degenerate ones
  /// are what their corners span. Throws std::invalid_argument unless 0 <= distance <= radius.
  void within(CandidateKind kind, double distance, CandidateBuffer& out);

  /// Returns which candidates of a kind began and which ended since the last call for this kind; at the first
  /// one since `build`, all begin. Both lists are ascending and valid until the next call for this kind.
  /// O(elements + candidates log(candidates of one element)).
  CandidateChanges changes(CandidateKind kind);
  /// Returns the same of the pairs within a distance, which may be another one at each call. These changes
  /// and those of candidates do not affect each other. Throws as `within` does.
  CandidateChanges changes_within(CandidateKind kind, double distance);

  /// Finds all self intersections of the faces: the pairs of faces, without a common vertex, that have a
  /// common point, exactly as within(face_face, 0) finds them. Of a motion, at its end. Candidates are not
  /// kept, and answers are in another order. With `cones`, the search leaves out patches that are proved not
  /// to touch themselves (PatchCertificate): a smooth mesh has few others. After a build of the faces' tree,
  /// the first call with cones lists contours, which takes about as long as the build.
  void self_intersections(CandidateBuffer& out, SelfCulling culling = SelfCulling::cones,
                          SelfIntersectionStats* stats = nullptr);

  /// Finds the first time during the motion from V0 to V1 at which the distance of a vertex and a face, or of
  /// two edges, is at most the separation; 0: the first contact. Verdicts are exact, in real arithmetic on
  /// the given numbers, no epsilon (core/continuous/impact.hpp; core/broad_phase/approach.hpp), and the time
  /// is enclosed. A distance that is reached at a single instant counts, and so does t = 0. Incident elements
  /// do not count, nor do pairs that a filter excludes. Throws std::logic_error unless the last positions
  /// were a motion, and std::invalid_argument unless 0 <= separation <= radius. With `cones`, contacts are
  /// not looked for within patches that are proved not to touch themselves during the whole motion; with a
  /// separation, cones change nothing.
  EarliestImpact earliest_impact(double separation = 0, EarliestImpactStats* stats = nullptr,
                                 SelfCulling culling = SelfCulling::cones);

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

  /// Returns the number of searches since `build`, of all kinds together.
  std::uint64_t detections() const { return detections_; }
  /// Returns how many updates left the bound of `valid_for`, or came while there was none.
  std::uint64_t references() const { return references_; }
  /// Returns the number of box tests of the last search.
  std::uint64_t last_box_tests() const { return last_box_tests_; }
  /// Builds the trees again at the next search.
  void forget_trees();

  bool built() const { return elements_.has_value(); }
  /// Returns the mesh. Throws std::logic_error before `build`, as do all functions that ask about a mesh or
  /// change it.
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
  void forget_found(Element element);
  InsertedElements add(const MatrixView<S>& v, const Primitives& edges, const Primitives& faces);
  void add_vertices(const MatrixView<S>& v);
  void groups_changed();
  /// Notes that vertices are connected differently: with rings, pairs of all kinds may begin or end.
  void connections_changed();
  /// Returns the members of the patches that do not touch themselves during the motion.
  const PatchMembers& certified_patches();
  ElementTree<S>& current_tree(Element element);
  /// Returns a search of current trees from their roots; without starts if their boxes do not meet.
  ElementSearchJob<S> search_job(CandidateKind kind);
  void search(CandidateKind kind, CandidateBuffer& out);
  /// Searches on all threads, or on the caller's alone if a function of the caller or the size of the mesh
  /// asks for that. Returns the number of box tests.
  template <class Sift>
  std::uint64_t run_search(const ElementSearchJob<S>& job, CandidateBuffer& out, const Sift& sift) {
    const bool alone = filter_.has_function() || job.usual < 4 * few_elements;
    return alone ? search_.run_alone(job, out, sift) : search_.run(workers_, job, out, sift);
  }
  static constexpr std::size_t few_elements = 4096;
  const CandidateBuffer& kept(CandidateKind kind);
  /// Returns the present positions, [vertex][4]: of a motion, its end.
  const S* present_points() const {
    return motion_ == Motion::straight ? end_points_.data() : points_.data();
  }

  BroadPhaseSettings settings_;
  KernelSet kernels_;
  std::optional<Elements> elements_;
  S radius_ = 0, half_radius_ = 0;
  Motion motion_ = Motion::none;
  UnfilledArray<S> points_, end_points_;  // [vertex][4]
  UnfilledArray<S> boxes_;                // [vertex][8]; the trees are made of these
  std::array<ElementTree<S>, element_kinds> trees_;
  // valid_for
  S displacement_ = 0, left_ = 0;
  std::vector<S> displacements_, grown_each_;  // [vertex]
  // Answers that are kept, by kind.
  std::array<CandidateBuffer, 6> found_;
  std::array<bool, 6> found_valid_{};
  PairFilter filter_;
  std::array<ChangeTracker, 6> candidate_changes_, near_changes_;
  CandidateBuffer near_;
  Workers workers_;
  ElementSearch<S> search_;
  PatchCulling<S> patches_;
  PatchMembers patch_members_;
  std::vector<FaceTests<S>> face_tests_;  // [runner]
  std::uint64_t detections_ = 0, references_ = 0, last_box_tests_ = 0;
};

extern template class BroadPhase<float>;
extern template class BroadPhase<double>;

}  // namespace kbvh
