#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace kbvh::experiments::loop {

/// Vertices row by row, in metres or metres per second.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using EdgeList = Eigen::Matrix<std::uint32_t, Eigen::Dynamic, 2, Eigen::RowMajor>;
using FaceList = Eigen::Matrix<std::uint32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// A spring between two vertices: energy stiffness / 2 (distance - length)^2.
struct Spring {
  std::uint32_t a, b;
  double length;     ///< at rest, m
  double stiffness;  ///< N/m
};

/// Resistance of two triangles with a common edge against bending out of their plane: energy stiffness / 2
/// |sum of weights[i] x[vertices[i]]|^2, quadratic in positions (Bergou et al. 2006, "A Quadratic Bending
/// Model for Inextensible Surfaces"). The first two vertices are those of the edge.
struct Hinge {
  std::uint32_t vertices[4];
  double weights[4];
  double stiffness;  ///< N/m
};

/// A joint of a script: what hangs on it turns about an axis and is carried along. At time 0 everything is at
/// rest, in the pose of the mesh; it is in full motion within half a second.
struct Joint {
  std::int32_t parent = -1;         ///< an earlier joint, which carries this one; -1: none
  Eigen::Vector3d pivot{0, 0, 0};   ///< m, at time 0
  Eigen::Vector3d axis{0, 0, 1};    ///< of length 1
  double turn = 0;                  ///< rad/s, all the time
  double bend = 0, swing = 0;       ///< rad: the angle is bend + swing sin(2 pi time / period + phase)
  double phase = 0;                 ///< rad
  Eigen::Vector3d travel{0, 0, 0};  ///< m: there and back once a period
  double period = 1;                ///< s
};

/// What is simulated: one mesh whose parts have no common vertices, its material, and its state at the start.
struct SimulatedMesh {
  Positions positions, velocities;
  EdgeList edges;  ///< all edges of the faces, once each
  FaceList faces;
  std::vector<double> mass;         ///< [vertex], kg
  std::vector<std::uint8_t> fixed;  ///< [vertex], 1 for vertices that never move
  std::vector<std::int32_t> joint;  ///< [vertex], the joint that a driven vertex follows; -1: none
  std::vector<std::uint8_t>
      obstacle;                      ///< [vertex]: 1: elements of such vertices alone do not touch each other
  std::vector<std::uint32_t> inner;  ///< vertices of no face, ascending: they touch nothing
  std::vector<Spring> springs;
  std::vector<Hinge> hinges;
  std::vector<Joint> joints;

  std::uint32_t vertex_count() const { return std::uint32_t(positions.rows()); }
  bool is_driven(std::uint32_t vertex) const { return joint[vertex] >= 0; }
  /// Returns whether forces alone decide where a vertex goes.
  bool is_free(std::uint32_t vertex) const { return fixed[vertex] == 0 && !is_driven(vertex); }
};

/// The constants of a simulation.
struct Physics {
  double time_step = 0.01;               ///< s
  Eigen::Vector3d gravity{0, 0, -9.81};  ///< m/s^2
  double thickness = 1e-3;               ///< m: surfaces never come as near as this
  double reach = 2e-3;                   ///< m: surfaces repel each other nearer than thickness + reach
  double repulsion = 1000;               ///< m/s^2: scales the barrier, with the mean mass of a vertex
  double friction = 0.3;                 ///< coefficient; 0: none
  double slip_speed = 0.01;              ///< m/s: slower than that, friction is less than its limit
  double tolerance = 2e-5;               ///< m: a step ends when no coordinate changes by more
  std::uint32_t most_iterations = 120;   ///< of Newton's method in a step

  double radius() const { return thickness + reach; }
};

/// A scene of the simulator.
struct Simulated {
  SimulatedMesh mesh;
  Physics physics;
};

/// Returns the names of the scenes: sphere, cloths, sheets, stack, walker, knot.
const std::vector<std::string>& scene_names();
/// Returns what a scene shows, in a sentence. Throws std::invalid_argument for an unknown name.
std::string scene_title(const std::string& name);
/// Makes a scene whose moving bodies have about `triangles` triangles together, at least 8. Equal requests
/// give equal bits in one build. Throws std::invalid_argument for an unknown name.
///   sphere: a square cloth falls onto a sphere at rest
///   cloths: a cloth falls onto a cloth that is held at its corners
///   sheets: sheets fall, turned at random, onto a floor and onto each other
///   stack:  soft boxes fall onto a floor and onto each other
///   walker: three skirts, one over the other, on a figure that walks in a circle
///   knot:   a rope with an overhand knot is pulled at its ends and let go, again and again; its
///   cross-section
///           has at least 5 corners, which takes about 600 triangles
Simulated make_scene(const std::string& name, std::uint64_t triangles, std::uint64_t seed);

/// Composes meshes from parts.
class MeshBuilder {
 public:
  /// The vertices of one body, and where the body's grid lies.
  struct Sheet {
    std::uint32_t side;             ///< vertices a side
    Eigen::Vector3d corner;         ///< of vertex 0
    Eigen::Vector3d along, across;  ///< the two sides
  };
  struct Material {
    double area_density = 0.2;  ///< kg/m^2
    double stretch = 500;       ///< N/m, of a spring
    double bending = 2e-5;      ///< N m
  };
  /// The grid of a surface of columns x rows vertices.
  struct Grid {
    std::uint32_t columns, rows;
    bool closed;  ///< the last column is joined to the first one: a tube
  };
  /// A rope of rings, each with its centre.
  struct Rope {
    std::span<const Eigen::Vector3d> line;  ///< the centres of its rings, at equal distances; at least 4
    std::uint32_t sides = 8;                ///< corners of a ring, at least 3
    double radius = 0.01;                   ///< m
    double density = 300;                   ///< kg/m^3
    double modulus = 1e5;                   ///< N/m^2
  };
  /// A body that never moves.
  void add_obstacle(std::span<const Eigen::Vector3d> vertices,
                    std::span<const Eigen::Vector3<std::uint32_t>> faces);
  /// A body that follows a joint. Its parts do not touch each other.
  void add_driven_obstacle(std::span<const Eigen::Vector3d> vertices,
                           std::span<const Eigen::Vector3<std::uint32_t>> faces, std::int32_t joint);
  /// A square cloth of side x side vertices, cut into triangles. Returns its first vertex.
  std::uint32_t add_cloth(const Sheet& sheet, const Material& material);
  /// A cloth over a grid whose vertex (x, y) is at points[y * columns + x]. Returns its first vertex.
  std::uint32_t add_cloth(const Grid& grid, std::span<const Eigen::Vector3d> points,
                          const Material& material);
  /// A soft rope with closed ends: springs within each ring and between neighbours. Returns its first vertex;
  /// ring i has the vertices (sides + 1) i to (sides + 1) i + sides; the last one is its centre.
  std::uint32_t add_rope(const Rope& rope);
  /// A soft box of cells^3 cells: springs along edges and diagonals of the cells. Returns its first vertex.
  std::uint32_t add_soft_box(const Eigen::Vector3d& low, double side, std::uint32_t cells, double density,
                             double stiffness);
  void fix(std::uint32_t vertex) { fixed_[vertex] = obstacle_[vertex] = 1; }
  /// Adds a joint and returns its number.
  std::int32_t add_joint(const Joint& joint);
  /// Lets a vertex follow a joint: a particle of 10 kg that keeps to the script as long as no force acts on
  /// it. Contact can hold it back a little (StepReport::lag).
  void drive(std::uint32_t vertex, std::int32_t joint);
  void move(std::uint32_t vertex, const Eigen::Vector3d& by) { vertices_[vertex] += by; }
  /// Returns the mesh, with its edges, inner vertices, and no velocity.
  SimulatedMesh finish() const;

 private:
  std::uint32_t add_vertex(const Eigen::Vector3d& at);
  void add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c) { faces_.push_back({a, b, c}); }
  void add_spring(std::uint32_t a, std::uint32_t b, double stiffness);
  void add_hinges(std::size_t first_face, double bending);

  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Eigen::Vector3<std::uint32_t>> faces_;
  std::vector<double> mass_;
  std::vector<std::uint8_t> fixed_, obstacle_;
  std::vector<std::int32_t> joint_;
  std::vector<Joint> joints_;
  std::vector<Spring> springs_;
  std::vector<Hinge> hinges_;
};

}  // namespace kbvh::experiments::loop
