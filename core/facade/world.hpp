#pragma once
#include <compare>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace kbvh {

namespace detail {
struct WorldImplementation;
}

/// The scalar of a world's positions and boxes.
enum class Precision : std::uint8_t { float32, float64 };

/// The kind of a body's primitives.
enum class Shape : std::uint8_t { polygons, points, control_nets };

/// The connectivity of a body: primitive p has the vertices indices[offsets[p] .. offsets[p + 1]). Without
/// offsets the primitives are triangles: three indices each. A polygon of more than three corners is cut into
/// triangles once, when it is added (at its first keyframe, or the positions given then) or inserted; from
/// then on it is their union. The cut does not depend on the first corner.
struct Connectivity {
  std::span<const std::uint32_t> indices;
  std::span<const std::uint32_t> offsets{};
  Shape shape = Shape::polygons;
};

/// The curves of a body's vertices between keyframes. With the share s of a segment, from 0 to 1, a
/// coordinate is x0 (1 - s) + x1 s + s (1 - s) (bend + twist s), where x0 and x1 are its values at the
/// keyframes. Each list is [segment][vertex][3], or empty: all zero. Without twists vertices move on
/// parabolas.
struct WorldCurves {
  std::span<const double> bends{}, twists{};
};

/// Two primitives that intersect, as body and primitive ids. body_a < body_b, or body_a = body_b and
/// primitive_a < primitive_b.
struct WorldPair {
  std::uint32_t body_a, primitive_a, body_b, primitive_b;
  bool operator==(const WorldPair&) const = default;
};

/// Two primitives that may intersect between two times, both included, in seconds.
struct WorldSpan {
  WorldPair pair;
  double begin, end;
};

/// A vertex that meets a face, or two edges that meet, between two frames. Features are numbered by body:
/// vertices and faces as they were added, edges by their larger and then by their smaller vertex.
struct WorldContact {
  enum class Kind : std::uint8_t { vertex_face, edge_edge } kind;
  std::uint32_t body_a, feature_a, body_b, feature_b;
  double begin, end;  ///< seconds; enclose the time of impact
};

/// The points origin + s * direction with 0 <= s <= length. A zero direction makes the ray a point.
struct WorldRay {
  double origin[3] = {0, 0, 0}, direction[3] = {0, 0, 0};
  double length = std::numeric_limits<double>::infinity();
};

/// What is asked of a ray: the primitive that it meets first (of several, the smallest body and primitive),
/// or one of those that it meets.
enum class WorldRayQuery : std::uint8_t { closest, any };

/// The answer to a ray. Polygons are met, from both sides, edges and corners included; points and control
/// nets are not.
struct WorldHit {
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  std::uint32_t body = none, primitive = none;                 ///< none: a miss
  double parameter = std::numeric_limits<double>::infinity();  ///< s where the ray first meets the primitive
  bool operator==(const WorldHit&) const = default;
};

/// A closed ball: sought are the primitives at a distance of at most `radius` from `centre`.
struct WorldBall {
  double centre[3] = {0, 0, 0}, radius = 0;
};

/// A primitive within a ball, by the index of the ball in the call.
struct WorldBallHit {
  std::uint32_t ball, body, primitive;
  auto operator<=>(const WorldBallHit&) const = default;
};

/// A node of a body's hierarchy and its box. Parents have smaller numbers than their children; node 0 is the
/// root.
struct WorldNode {
  std::uint32_t parent;  ///< 0 for the root
  std::uint32_t first,
      count;  ///< of a leaf: number of its primitives in `WorldHierarchy::primitives`; else number of its
              ///< children
  bool leaf;
  bool stale;  ///< the box is not current, because no query read it
  double lower[3], upper[3];
  std::uint32_t
      event_node;  ///< the number by which events, realisers' changes and watched pairs name the node
};
struct WorldHierarchy {
  std::vector<WorldNode> nodes;
  std::vector<std::uint32_t> primitives;
};

/// A new plan of one vertex from the current time on: straight lines from its current position through
/// `positions` at `times`, then `velocity` for ever.
struct WorldPlan {
  std::uint32_t body = 0, vertex = 0;
  std::vector<double> times{};      ///< seconds, strictly increasing, later than the current time
  std::vector<double> positions{};  ///< [time][3]
  double velocity[3] = {0, 0, 0};   ///< units per second
};

/// Insertions and deletions of vertices and primitives at the current time. Inserted items get the next free
/// ids of their body in the given order; ids are never reused.
struct WorldEdit {
  struct Vertex {
    std::uint32_t body = 0;
    double position[3] = {0, 0, 0}, velocity[3] = {0, 0, 0};
  };
  struct Primitive {
    std::uint32_t body = 0;
    std::vector<std::uint32_t> vertices;
  };
  struct Id {
    std::uint32_t body = 0, id = 0;
  };
  std::vector<Vertex> vertices{};
  std::vector<Primitive> primitives{};
  std::vector<Id> removed_primitives{}, removed_vertices{};
};

/// One linear piece of a coordinate, exactly as it is stored: from x0 at t0 to x1 at t1, or, for a ray, from
/// x0 at t0 with velocity x1.
struct WorldPiece {
  double t0 = 0, t1 = 0, x0 = 0, x1 = 0;
  bool ray = false;
  bool operator==(const WorldPiece&) const = default;
};

/// A scheduled event of a kinetic strategy: a certificate and its failure time.
struct WorldEvent {
  enum class Kind : std::uint8_t { bound, boxes_meet, boxes_separate, review, window } kind = Kind::bound;
  std::uint32_t body = 0, node = 0;
  std::uint32_t side = 0;                        ///< event of a bound: 2 * axis + (0 lower, 1 upper)
  std::uint32_t winner = 0, loser = 0;           ///< event of a bound: vertex `loser` overtakes `winner`
  std::uint32_t other_body = 0, other_node = 0;  ///< event of two boxes: the second box
  double time = 0, error = 0;                    ///< seconds; the exact time is within `error` of `time`
  bool exact = false;                            ///< the exact time is the crossing of the two pieces
  WorldPiece winner_piece{}, loser_piece{};
  bool operator==(const WorldEvent&) const = default;
};

/// A side of a node's box whose realiser changed.
struct WorldBoundChange {
  std::uint32_t body, node, side, old_vertex, new_vertex;
  bool operator==(const WorldBoundChange&) const = default;
};

/// Describes the effects of one event.
struct WorldStep {
  WorldEvent event;
  std::vector<WorldBoundChange> touched;  ///< in the order of the changes
  std::vector<WorldEvent> rescheduled;    ///< certificates of bounds that the event created, if they fail
};

/// Two boxes that a separation list watches.
struct WorldWatch {
  std::uint32_t body, node, other_body, other_node;
  bool overlapping;
  bool listed;  ///< in the list: apart, or overlapping leaves; else an overlapping pair of inner nodes above
                ///< it
  auto operator<=>(const WorldWatch&) const = default;
};

/// Marks a missing vertex: the realiser of a side that a node inherits from its parent.
inline constexpr std::uint32_t world_no_vertex = 0xffffffff;

/// A parameter of a strategy; the admissible values are in words.
struct WorldParameter {
  std::string name, default_value, admissible, meaning;
  std::vector<std::string> allowed;  ///< the words that it takes; empty for numbers
  double least = 0, most = 0;        ///< of numbers, both included; `most` may be infinite
  bool whole = false;                ///< only whole numbers
};
/// What a strategy is and can do.
struct WorldStrategy {
  std::string id, title, family, citation, about;
  std::string foresight;  ///< the motion that it knows: none, step bound, next keyframe, whole clip
  bool tight = false, exact = false, events = false, plan_changes = false, geometry_changes = false,
       spans = false, self_pairs = false;
  bool has_float32 = false, has_float64 = false;
  std::vector<std::uint32_t> widths;  ///< of the nodes of the trees that it takes; empty if it builds its own
  std::vector<WorldParameter> parameters;
  bool baseline = false;                ///< a candidate for the best refit, the denominator of ratios
  std::string guarantee, tightness;     ///< exact, candidate_superset, approximate; tight, conservative, none
  std::vector<std::string> abilities;   ///< events, plan_changes, geometry_changes, spans, self_pairs, ...
  std::vector<std::string> primitives;  ///< polygons, points, control_nets
  std::string method;  ///< of its best tree, with width and leaf size; empty if it builds its own
  std::uint32_t width = 0, leaf_size = 0;
  std::uint64_t max_primitive_pairs = 0;  ///< of two bodies; 0: any number
  /// The largest magnitude of a coordinate that it takes; infinite: everything admissible.
  double max_coordinate = std::numeric_limits<double>::infinity();
};

/// A counter of a strategy since the last `reset`.
struct WorldCounter {
  std::string name;
  std::uint64_t value;
};

/// The positions of a body where they lie: [vertex][3] in the world's precision.
struct WorldPositions {
  Precision precision;
  std::uint32_t vertices;
  const void* data;
};

/// What an audit finds in one body's hierarchy, or in all. Nodes that no query read are stale: they are
/// counted and not examined.
struct WorldAudit {
  std::uint64_t nodes = 0, stale = 0;
  std::uint64_t invalid = 0;    ///< nodes whose bound does not contain a vertex below it
  std::uint64_t not_tight = 0;  ///< nodes whose bound is not as small as possible
  double protrusion = 0;        ///< largest distance of a vertex from a bound above it, in units of length
  double looseness = 0;         ///< summed surface area over that of tight bounds, minus one
  std::string first_fault{};    ///< of the tree or of a bound; or empty
};

/// The result of a run of one strategy that was compared with the truth in every frame; sums over frames.
struct WorldVerdict {
  bool holds = false;             ///< the declared guarantee and tightness held
  std::string first_violation{};  ///< frame, kind and value; or empty
  std::uint64_t frames = 0, pairs = 0, candidates = 0;
  std::uint64_t missed_candidates = 0;  ///< true pairs that were not candidates
  std::uint64_t missed = 0, extra = 0;  ///< confirmed pairs against the truth
  std::uint64_t repeated = 0, malformed = 0;
  bool audited = false;  ///< false for hierarchies that are not visible
  WorldAudit audit{};
};

/// A scene and one strategy that keeps its bounds valid, behind plain arrays. Bodies and their motion are
/// inputs; pairs, contacts, boxes, counters and events are outputs. The world owns its scene. Callers need no
/// template of the library.
///
/// Add the bodies first, then choose the strategy with `start`; then, for each frame, call `advance` and
/// query. Times are in seconds and never decrease except by `reset`. On error every function throws an
/// exception derived from std::exception whose text names the error, and changes nothing:
/// std::invalid_argument for wrong input, std::logic_error for calls in the wrong order and for abilities
/// that the strategy lacks.
///
/// Arrays of positions are [vertex][3]. Arrays of another precision than the world's are converted.
class World {
 public:
  explicit World(Precision precision = Precision::float32);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  // ---- The scene, before `start`

  /// Adds a body with known motion: `positions` is [keyframe][vertex][3] for keyframes at `times`, between
  /// which vertices move on straight lines, or on `curves`. A body with one keyframe rests. Strategies that
  /// foresee straight lines only refuse a body with curves, whose plans cannot change. Returns the body's id:
  /// 0, 1, ...
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> times, std::span<const float> positions,
                         const WorldCurves& curves = {});
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> times, std::span<const double> positions,
                         const WorldCurves& curves = {});
  /// Adds a body with unknown motion, whose positions are set frame by frame. `positions` holds its positions
  /// until then. Only strategies without foresight accept such a body.
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const float> positions);
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> positions);
  /// Adds a body over the vertices of another one, as the vertices, edges and faces of a mesh are: positions,
  /// motion and vertex ids are the same. Positions, plans and vertices change at run time for one of these
  /// bodies, and so for all. Primitives with a common vertex are no pair. Returns the new body's id.
  std::uint32_t add_body_over(std::uint32_t body, const std::string& name, const Connectivity& connectivity);
  /// Makes all pairs those of boxes, grown by radius / 2 on each side and rounded outward: two primitives at
  /// a distance of at most `radius` are always a pair, others whose grown boxes overlap are pairs, too. Only
  /// strategies that take control nets play such a world, which finds no contacts, answers neither rays nor
  /// balls, and changes neither plans nor vertices; primitives come and go. Each vertex v is two in
  /// `realisers` and in events: the corners 2 v (lower) and 2 v + 1 (upper) of its box; positions are those
  /// of the vertices. Throws std::invalid_argument for a radius that is negative or no admissible length.
  void set_radius(double radius);
  /// Requests pairs of these two bodies, or within one body if both are the same. Without any such call,
  /// pairs of all bodies are requested, but none within a body.
  void add_pair(std::uint32_t body_a, std::uint32_t body_b);

  /// Chooses the strategy by its id, with parameters as text, and starts at time t. The hierarchies are built
  /// with the strategy's best settings unless `topology` overrides them (keys method, width, leaf_size).
  void start(const std::string& strategy, const std::map<std::string, std::string>& params = {}, double t = 0,
             const std::map<std::string, std::string>& topology = {});

  // ---- Time

  /// Restarts at t, with the original plans and geometry of the scene.
  void reset(double t);
  /// Advances the scene and the strategy to time t.
  void advance(double t);
  double time() const;
  /// Sets the positions of a body with unknown motion, for the next `reset`, `advance` or `contacts`. An
  /// array of 3 * vertices + 1 numbers (the last one is ignored) in the world's precision is not copied: it
  /// must stay unchanged until the next positions are set, and, for `contacts`, until that call returns. An
  /// array of 3 * vertices numbers is copied.
  void set_positions(std::uint32_t body, std::span<const float> positions);
  void set_positions(std::uint32_t body, std::span<const double> positions);
  /// Does the same where only the vertices `moved` may differ from their positions at the last frame: a
  /// strategy that uses this (`dirty_refit`) leaves out the others. A list that lacks a vertex makes bounds
  /// wrong. Throws std::invalid_argument for a vertex out of range.
  void set_positions(std::uint32_t body, std::span<const float> positions,
                     std::span<const std::uint32_t> moved);
  void set_positions(std::uint32_t body, std::span<const double> positions,
                     std::span<const std::uint32_t> moved);
  /// Replaces the plans of vertices at the current time.
  void change_plans(const std::vector<WorldPlan>& plans);
  /// Inserts and deletes vertices and primitives at the current time.
  void change_geometry(const WorldEdit& edit);

  // ---- Questions

  /// Replaces `out` by the pairs of primitives that intersect at the current time, under the strategy's
  /// guarantee.
  void pairs(std::vector<WorldPair>& out);
  /// Replaces `begun` and `ended` by the pairs that began and that ceased to intersect since the last call,
  /// as contact events of a simulator. In the first call after `start` or `reset` all pairs begin. Added up,
  /// the changes equal `pairs`, which may be called in between. Throws std::invalid_argument if both lists
  /// are the same one.
  void changes(std::vector<WorldPair>& begun, std::vector<WorldPair>& ended);
  /// Advances to t and replaces `out` by the pairs of the elapsed time.
  void spans(double t, std::vector<WorldSpan>& out);
  /// Advances to t and replaces `out` by the contacts of the elapsed time, in which every vertex moves on a
  /// straight line. One call must not pass `next_knot`; no frame may be queried between two calls.
  void contacts(double t, std::vector<WorldContact>& out);
  /// Replaces `out` by the answers to rays at the current time, one for each, under the strategy's guarantee
  /// of rays. Rays are rounded to the world's precision.
  void hits(WorldRayQuery query, std::span<const WorldRay> rays, std::vector<WorldHit>& out);
  /// Replaces `out` by the primitives within balls at the current time, sorted. Squared distances are
  /// compared exactly with the squared radius; polygons and points are met, control nets are not. Balls are
  /// rounded to the world's precision.
  void within(std::span<const WorldBall> balls, std::vector<WorldBallHit>& out);
  /// Returns the next time at which the plan of any vertex bends; infinite if none does.
  double next_knot() const;
  /// Replaces `out` by the positions of a body at the current time.
  void positions(std::uint32_t body, std::vector<double>& out);
  /// Replaces `out` by the hierarchy of a body; returns false if the strategy's hierarchy is not visible.
  bool hierarchy(std::uint32_t body, WorldHierarchy& out) const;
  /// Replaces `out` by the positions of a body with known motion at t, correctly rounded, on its current
  /// plans; the world's time stays as it is. For times before the last change of a plan the answer is
  /// meaningless.
  void positions(std::uint32_t body, double t, std::vector<double>& out) const;
  /// Replaces `out` by the vertex that realises each side of each node of `hierarchy`, [node][6], side 2 *
  /// axis
  /// + (0 lower, 1 upper); `world_no_vertex` for an inherited side. The box of realisers contains the box
  /// that `hierarchy` shows, and is equal to it unless queries read tighter ones. Returns false unless the
  /// strategy has events on a hierarchy that is visible.
  bool realisers(std::uint32_t body, std::vector<std::uint32_t>& out) const;
  /// Replaces `out` by all pairs of boxes that a separation list watches, in ascending order; by nothing for
  /// a strategy without such a list.
  void watched_pairs(std::vector<WorldWatch>& out) const;
  /// Returns all counters since the last `reset`, without the work for `positions` and `hierarchy`; the
  /// strategy's own counters come last.
  std::vector<WorldCounter> counters() const;

  /// Returns the positions of a body at the current time without copying them. Valid until the next call that
  /// moves or changes the world.
  WorldPositions current_positions(std::uint32_t body);

  // ---- Judgement

  /// Returns the times of a clip with `per_keyframe` (l >= 1) frames per interval between the keyframes of
  /// all bodies, and the last keyframe. Possible before `start`.
  std::vector<double> frame_times(std::uint32_t per_keyframe) const;
  /// Replaces `out` by the pairs of primitives that intersect at the current time, sorted, found by testing
  /// every pair exactly. O(primitives^2).
  void true_pairs(std::vector<WorldPair>& out);
  /// Audits the hierarchy of a body at the current time, after a query; returns false if the strategy's
  /// hierarchy is not visible.
  bool audit(std::uint32_t body, WorldAudit& out);
  /// Plays the added bodies with a strategy from the first frame to the last, and compares its answers and
  /// bounds with the truth in each. This world keeps its own strategy and time. Throws std::invalid_argument
  /// for bodies with unknown motion and for times that decrease.
  WorldVerdict verify(const std::string& strategy, std::span<const double> frames,
                      const std::map<std::string, std::string>& params = {},
                      const std::map<std::string, std::string>& topology = {}) const;

  // ---- Single events, for event-driven strategies

  bool has_events() const;
  /// Returns the time of the earliest event; infinite if there is none.
  double next_event_time() const;
  /// Replaces `out` by all scheduled events, in order of time.
  void scheduled_events(std::vector<WorldEvent>& out) const;
  /// Performs the first event if it is due by time `until`, and describes it in `out`; returns false if none
  /// is due. Afterwards the world stands between frames: further steps may follow, then `advance` to `until`
  /// or later.
  bool step_event(double until, WorldStep& out);

  /// Returns the ids of all strategies.
  static std::vector<std::string> strategies();
  /// Describes all strategies, in the same order.
  static std::vector<WorldStrategy> strategy_descriptions();
  /// Returns the names of the counters that all strategies share, and what each counts.
  static std::vector<std::pair<std::string, std::string>> counter_meanings();

 private:
  /// Calls work(world of this precision).
  template <class Work>
  decltype(auto) in_scalar(const Work& work);
  template <class Work>
  decltype(auto) in_scalar(const Work& work) const;

  std::unique_ptr<detail::WorldImplementation> implementation_;
};

}  // namespace kbvh
