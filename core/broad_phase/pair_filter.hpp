#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/broad_phase/elements.hpp"
#include "core/broad_phase/vertex_rings.hpp"

namespace kbvh {

/// The groups that an element belongs to, and the groups that it may pair with, as bits. Two elements may be
/// a candidate if each has a group in the mask of the other.
struct GroupMask {
  std::uint32_t groups = 1, mask = ~std::uint32_t(0);
  bool admits(const GroupMask& other) const {
    return (groups & other.mask) != 0 && (mask & other.groups) != 0;
  }
  GroupMask& operator|=(const GroupMask& other) {
    groups |= other.groups;
    mask |= other.mask;
    return *this;
  }
  bool operator==(const GroupMask&) const = default;
};

/// A caller's filter: moves the pairs that stay to the front, in any order, and returns their number. It gets
/// many pairs at a time, each with overlapping boxes and without a common vertex.
using PairFunction = std::function<std::size_t(CandidateKind kind, std::span<Candidate> pairs)>;

/// The pairs of elements that may be candidates at all: groups and masks, rings, excluded pairs, and a
/// function of the caller. A pair has to pass all of them. Incident pairs are left out elsewhere.
class PairFilter {
 public:
  /// Ends all filters. Keeps memory.
  void clear();

  /// Set the groups of all elements of one kind; an empty list admits all pairs. Throws
  /// std::invalid_argument for another number of elements.
  void set_groups(const Elements& elements, Element element, std::span<const GroupMask> groups);
  /// Sets the groups of vertices; those of an edge or a face are the union of its vertices' groups, and its
  /// mask the union of their masks. Throws as `set_groups` does.
  void set_vertex_groups(const Elements& elements, std::span<const GroupMask> groups);
  /// Returns the groups of all elements of a kind; empty where all have the default.
  std::span<const GroupMask> groups(Element element) const { return groups_[std::size_t(element)]; }
  /// Returns whether groups can exclude pairs of a kind.
  bool has_groups(CandidateKind kind) const {
    return !groups(first_element(kind)).empty() || !groups(second_element(kind)).empty();
  }

  /// Excludes pairs of one kind, in any order, in place of those excluded before. Ids of two elements of one
  /// kind may be given in any order. Throws std::invalid_argument for an id that does not exist.
  void exclude(const Elements& elements, CandidateKind kind, std::span<const Candidate> pairs);

  /// Excludes pairs of elements that at most `rings` edges connect: VertexRings says which. 0 ends this.
  void exclude_rings(std::uint32_t rings) {
    rings_ = rings;
    rings_listed_ = false;
  }
  std::uint32_t rings() const { return rings_; }
  /// Notes that vertices are connected differently: the next `prepare` lists rings again.
  void connections_changed() { rings_listed_ = false; }
  /// Lists rings, if they are asked for and not listed; before the first `keep`. Throws as
  /// VertexRings::build does.
  void prepare(const Elements& elements);

  /// Takes further elements: with the default groups, or with the union of their vertices' groups if the
  /// groups of their kind were set by `set_vertex_groups`.
  void elements_inserted(const Elements& elements);

  /// Returns whether there is a function of the caller, which only the caller's thread may call. All other
  /// filters allow calls of `keep` by several threads.
  bool has_function() const { return bool(function_); }
  /// Sets the caller's function; an empty one ends it.
  void set_function(PairFunction function) { function_ = std::move(function); }

  /// Returns whether any filter looks at single pairs of a kind.
  bool looks_at(CandidateKind kind) const {
    return has_groups(kind) || rings_ > 0 || !excluded_[std::size_t(kind)].pairs.empty() || function_;
  }
  /// Moves the pairs that are admitted to the front and returns their number. Throws std::out_of_range if the
  /// caller's function returns more pairs than it got, and lets its exceptions pass.
  std::size_t keep(const Elements& elements, CandidateKind kind, std::span<Candidate> pairs) const;

  std::size_t bytes() const;

 private:
  struct Excluded {
    std::vector<std::uint32_t> first_pair;  ///< [first id + 1]
    std::vector<Candidate> pairs;           ///< ascending
  };
  std::array<std::vector<GroupMask>, element_kinds> groups_;
  /// [Element]: inserted edges, or faces, get the groups of their vertices, by `set_vertex_groups`
  std::array<bool, element_kinds> from_vertices_{};
  std::array<Excluded, 6> excluded_;
  std::uint32_t rings_ = 0;
  bool rings_listed_ = false;
  VertexRings connected_;
  PairFunction function_;
};

}  // namespace kbvh
