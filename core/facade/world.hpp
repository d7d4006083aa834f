#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace kbvh {

namespace detail {
class WorldImplementation;
}

/// In which numbers a world keeps positions and boxes.
enum class Precision : std::uint8_t { float32, float64 };

/// What the primitives of a body are.
enum class Shape : std::uint8_t { polygons, points, control_nets };

/// The connectivity of a body: primitive p has the vertices indices[offsets[p] .. offsets[p + 1]). Without
/// offsets primitives are triangles: three indices each.
struct Connectivity {
  std::span<const std::uint32_t> indices;
  std::span<const std::uint32_t> offsets{};
  Shape shape = Shape::polygons;
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

/// A node of a body's hierarchy and its box. Nodes are numbered with parents first; node 0 is the root.
struct WorldNode {
  std::uint32_t parent;  ///< of the root: 0
  std::uint32_t first,
      count;  ///< of a leaf: its primitives in `WorldHierarchy::primitives`; else its children
  bool leaf;
  bool stale;  ///< the box is not that of the present, because no query read it
  double lower[3], upper[3];
};
struct WorldHierarchy {
  std::vector<WorldNode> nodes;
  std::vector<std::uint32_t> primitives;
};

/// A new plan of one vertex from the present time on: straight lines from its present position through
/// `positions` at `times`, then `velocity` for ever.
struct WorldPlan {
  std::uint32_t body = 0, vertex = 0;
  std::vector<double> times{};      ///< seconds, strictly increasing, later than the present
  std::vector<double> positions{};  ///< [time][3]
  double velocity[3] = {0, 0, 0};   ///< units per second
};

/// Vertices and primitives that come and go at the present time. What is inserted gets the next free ids of
/// its body in the order given; ids are never used again.
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

/// One linear piece of a coordinate, exactly as it is stored: from x0 at t0 to x1 at t1, or, of a ray, from
/// x0 at t0 on with velocity x1.
struct WorldPiece {
  double t0 = 0, t1 = 0, x0 = 0, x1 = 0;
  bool ray = false;
  bool operator==(const WorldPiece&) const = default;
};

/// An event of a kinetic strategy that is scheduled: a certificate and when it fails.
struct WorldEvent {
  enum class Kind : std::uint8_t { bound, boxes_meet, boxes_separate, review, window } kind = Kind::bound;
  std::uint32_t body = 0, node = 0;
  std::uint32_t side = 0;                        ///< of a bound: 2 * axis + (0 lower, 1 upper)
  std::uint32_t winner = 0, loser = 0;           ///< of a bound: vertex `loser` overtakes `winner`
  std::uint32_t other_body = 0, other_node = 0;  ///< of two boxes: the second one
  double time = 0, error = 0;                    ///< seconds; the exact time is within `error` of `time`
  bool exact = false;                            ///< the exact time is where the two pieces meet
  WorldPiece winner_piece{}, loser_piece{};
  bool operator==(const WorldEvent&) const = default;
};

/// A side of a node's box that another vertex realises from now on.
struct WorldBoundChange {
  std::uint32_t body, node, side, old_vertex, new_vertex;
  bool operator==(const WorldBoundChange&) const = default;
};

/// What one event did.
struct WorldStep {
  WorldEvent event;
  std::vector<WorldBoundChange> touched;  ///< in the order of the changes
  std::vector<WorldEvent> rescheduled;    ///< certificates of bounds that were made anew, as far as they fail
};

/// A counter of a strategy since the last `reset`.
struct WorldCounter {
  std::string name;
  std::uint64_t value;
};

/// A whole scene with one strategy that keeps bounds valid while it moves, behind plain arrays: bodies and
/// their motion go in, pairs, contacts, boxes, counters and events come out. Owns its scene; no template of
/// the library is needed to use it.
///
/// First bodies are added, then `start` chooses the strategy; then, for each frame, `advance` and a question.
/// Times are in seconds and never decrease but by `reset`. Every function throws an exception derived from
/// std::exception whose text says what is wrong, with nothing changed: std::invalid_argument for wrong input,
/// std::logic_error for calls in the wrong order and for what the strategy cannot do.
///
/// Arrays of positions are [vertex][3]. Those of another precision than the world's are converted.
class World {
 public:
  explicit World(Precision precision = Precision::float32);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  // ---- The scene, before `start`

  /// Adds a body whose motion is known: `positions` is [keyframe][vertex][3] for keyframes at `times`,
  /// between which vertices move on straight lines. One keyframe is a body at rest. Returns its id: 0, 1, ...
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> times, std::span<const float> positions);
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> times, std::span<const double> positions);
  /// Adds a body of whose motion nothing is known: its positions are set frame by frame. `positions` are
  /// those until then. Only strategies without foresight take it.
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const float> positions);
  std::uint32_t add_body(const std::string& name, const Connectivity& connectivity,
                         std::span<const double> positions);
  /// Asks for pairs of these two bodies, or within one body if both are the same. Without any such call,
  /// pairs of all bodies are asked for, and none within a body.
  void add_pair(std::uint32_t body_a, std::uint32_t body_b);

  /// Chooses the strategy by its id, with parameters as text, and starts at time t. Hierarchies are built as
  /// suits the strategy best, unless `topology` says otherwise (keys method, width, leaf_size).
  void start(const std::string& strategy, const std::map<std::string, std::string>& params = {}, double t = 0,
             const std::map<std::string, std::string>& topology = {});

  // ---- Time

  /// Starts over at t, with the scene's own plans and geometry again.
  void reset(double t);
  /// Brings everything to time t.
  void advance(double t);
  double time() const;
  /// Sets the positions of a body that were not known before, for the next `reset`, `advance` or `contacts`.
  /// An array of 3 * vertices + 1 numbers (the last one means nothing) in the world's precision is not
  /// copied: it has to stay as it is until the next positions are set, and, for `contacts`, until that call
  /// returns. An array of 3 * vertices numbers is copied.
  void set_positions(std::uint32_t body, std::span<const float> positions);
  void set_positions(std::uint32_t body, std::span<const double> positions);
  /// Replaces the plans of vertices at the present time.
  void change_plans(const std::vector<WorldPlan>& plans);
  /// Inserts and deletes vertices and primitives at the present time.
  void change_geometry(const WorldEdit& edit);

  // ---- Questions

  /// Replaces `out` by the pairs of primitives that intersect now, as the strategy promises.
  void pairs(std::vector<WorldPair>& out);
  /// Moves to t and replaces `out` by the pairs of the time until then.
  void spans(double t, std::vector<WorldSpan>& out);
  /// Moves to t and replaces `out` by the contacts on the way; every vertex moves on a straight line. No
  /// further than `next_knot` at a time, and without frames between two calls.
  void contacts(double t, std::vector<WorldContact>& out);
  /// The next time at which the plan of any vertex bends; infinite if none does.
  double next_knot() const;
  /// Replaces `out` by the positions of a body at the present time.
  void positions(std::uint32_t body, std::vector<double>& out);
  /// Replaces `out` by the hierarchy of a body; false if the strategy's cannot be seen.
  bool hierarchy(std::uint32_t body, WorldHierarchy& out) const;
  /// All counters since the last `reset`, those of the strategy's own last.
  std::vector<WorldCounter> counters() const;

  // ---- Events, one by one, of strategies that have them

  bool has_events() const;
  /// The time of the event that comes first; infinite if there is none.
  double next_event_time() const;
  /// Replaces `out` by all scheduled events, first event first.
  void scheduled_events(std::vector<WorldEvent>& out) const;
  /// Performs the first event if it is due by time `until`, and describes it in `out`; false if none is. Then
  /// the world stands between frames: steps may follow, then `advance` to `until` or later.
  bool step_event(double until, WorldStep& out);

  /// The ids of all strategies.
  static std::vector<std::string> strategies();

 private:
  std::unique_ptr<detail::WorldImplementation> implementation_;
};

}  // namespace kbvh
