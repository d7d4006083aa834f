#pragma once
#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/continuous/impact.hpp"

namespace kbvh::experiments {

/// One query of continuous collision detection, with its answer if it is known.
struct ImpactQuery {
  Contact::Kind kind = Contact::Kind::vertex_face;
  double points[2][4][3] = {};  ///< [t = 0, t = 1][point]
  std::optional<bool> truth;

  MovingPoints moving() const {
    return {{points[0][0], points[0][1], points[0][2], points[0][3]},
            {points[1][0], points[1][1], points[1][2], points[1][3]}};
  }
};

/// Queries that belong together: those of one file, or of one kind between two frames.
struct ImpactQueries {
  std::string name;
  std::vector<ImpactQuery> queries;
};

/// Reads a file of queries in the format of Wang et al. 2021 (NYU CCD benchmark): 8 rows each, 4 points at t
/// = 0 and 4 at t = 1, of x, y, z as numerator,denominator and, optionally, 0 or 1 for the verdict. The name
/// of the file or of its folder gives the kind: "vf", "vertex-face", "ee", "edge-edge". Throws io::InputError
/// with the line, also for a number that is not exactly a double: no number is rounded.
ImpactQueries read_impact_queries(const std::filesystem::path& file);

/// Two consecutive frames of a mesh, with the pairs of features that are known to touch between them (ground
/// truth of the same benchmark): frames/*.ply, boxes/*vf.json and *ee.json with pairs of ids, mma_bool/* with
/// their verdicts. Ids: vertices, then edges, then faces; edges are the unique undirected ones, sorted by
/// larger and then by smaller vertex.
struct FramePair {
  std::string name;
  std::vector<double> positions[2];  ///< [vertex][3]
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::array<std::uint32_t, 2>> edges;
  struct Listed {
    Contact::Kind kind;
    std::uint32_t first, second;  ///< vertex and face, or two edges: their own numbers
    bool touches;
  };
  std::vector<Listed> listed;

  /// Returns the vertices of a vertex and a face, or of two edges.
  std::array<std::uint32_t, 4> corners(Contact::Kind kind, std::uint32_t first, std::uint32_t second) const {
    std::array<std::uint32_t, 4> all{first};
    if (kind == Contact::Kind::vertex_face) {
      std::copy_n(faces[second].begin(), 3, all.begin() + 1);
    } else {
      std::copy_n(edges[first].begin(), 2, all.begin());
      std::copy_n(edges[second].begin(), 2, all.begin() + 2);
    }
    return all;
  }
  ImpactQuery query(const Listed& pair) const;
};
/// Reads a frame pair. Throws io::InputError.
FramePair read_frame_pair(const std::filesystem::path& folder);
/// Returns whether the folder has the layout of a frame pair.
bool is_frame_pair(const std::filesystem::path& folder);

/// Returns all queries below a path: a file, a frame pair, or a folder of either. Sorted by name. Throws
/// io::InputError if there are none.
std::vector<ImpactQueries> find_impact_queries(const std::filesystem::path& path);

/// A peer's own continuous test of two features.
struct ImpactPeer {
  std::string id;
  bool (*touches)(Contact::Kind, const MovingPoints&);
};
/// Returns the peers with such a test that are built in.
std::vector<ImpactPeer> impact_peers();

}  // namespace kbvh::experiments
