#pragma once
// Other ways to swept candidates, for the bench of the broad phase: a sort and sweep, the swept pairs of a
// strategy, and strategies of peer libraries on boxes that enclose a motion.
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/families/sweep/sorted_boxes.hpp"
#include "core/judge/session.hpp"
#include "experiments/study/contestants.hpp"
#include "frame_mesh.hpp"

namespace kbvh::experiments::micro {

/// Sort and sweep on the axis of the largest extent, by the SIMD kernels of the family `sweep`.
class SortAndSweep {
 public:
  explicit SortAndSweep(const FramePair& frames)
      : elements_(make_elements(
            frames.positions[0].size() / 3,
            MatrixView<std::uint32_t>::by_rows(frames.edges[0].data(), frames.edges.size(), 2),
            MatrixView<std::uint32_t>::by_rows(frames.faces[0].data(), frames.faces.size(), 3))) {}

  std::size_t find(const Mesh<double>& mesh, CandidateBuffer (&out)[2]) {
    const std::size_t values = mesh.v[0].size();
    positions_.resize(2 * values + 1);
    std::copy_n(mesh.v[0].data(), values, positions_.data());
    std::copy_n(mesh.v[1].data(), values, positions_.data() + values);
    for (std::size_t kind = 0; kind < element_kinds; ++kind) sort(kind);
    run(2, 0, CandidateKind::face_vertex, out[0]);
    run(1, 1, CandidateKind::edge_edge, out[1]);
    return out[0].size() + out[1].size();
  }

 private:
  void sort(std::size_t kind) {
    const Primitives& list = elements_.lists[kind];
    if (twice_[kind].count() == 0) {
      for (std::uint32_t p = 0; p < list.count(); ++p) {
        std::vector<std::uint32_t> corners(list[p].begin(), list[p].end());
        for (const std::uint32_t v : list[p]) corners.push_back(v + elements_.vertex_count());
        twice_[kind].add(corners);
      }
      sorted_[kind].start(PrimitiveList(twice_[kind]), active_kernel_set());
    }
    const PrimitiveList all(twice_[kind]);
    order_.take(twice_[kind], all, positions_.data(), active_kernel_set());
    sorted_[kind].update(order_.boxes(), axis());
  }
  std::uint32_t axis() const {
    std::uint32_t widest = 0;
    double extent[3];
    for (std::size_t k = 0; k < 3; ++k) {
      double low = positions_[k], high = low;
      for (std::size_t i = k; i + 1 < positions_.size(); i += 3) {
        low = std::min(low, positions_[i]);
        high = std::max(high, positions_[i]);
      }
      extent[k] = high - low;
      if (extent[k] > extent[widest]) widest = std::uint32_t(k);
    }
    return widest;
  }
  void run(std::size_t a, std::size_t b, CandidateKind kind, CandidateBuffer& out) {
    out.clear();
    chunk_.resize(4096);
    SweepJob<double> job{};
    job.a = sorted_[a].side(0);
    job.b = sorted_[b].side(a == b ? 0 : 1);
    job.axis = axis();
    job.block = SweepJob<double>::no_block;
    job.out = chunk_.data();
    job.out_room = chunk_.size();
    const auto kernel = a == b ? sweep_kernels<double>(active_kernel_set()).one
                               : sweep_kernels<double>(active_kernel_set()).two;
    while (job.next < job.a.count) {
      kernel(job);
      for (std::size_t i = 0; i < job.found; ++i) {
        Candidate pair{chunk_[i].primitive_a, chunk_[i].primitive_b};
        if (a == b && pair.first > pair.second) std::swap(pair.first, pair.second);
        if (!elements_.incident(kind, pair)) out.push_back(pair);
      }
      job.found = 0;
    }
  }

  Elements elements_;
  Primitives twice_[element_kinds];
  SortedBoxes<double> sorted_[element_kinds];
  CurveOrder<double> order_;
  std::vector<double> positions_;
  std::vector<FoundPair> chunk_;
};

/// The elements of a frame pair as bodies of one scene: vertices, faces and edges.
template <class S>
class ElementScene {
 public:
  /// How a scene knows the motion between the frames.
  enum class Motion : std::uint8_t {
    keyframes,  ///< two keyframes: for strategies with swept pairs
    boxes,      ///< each primitive has its vertices at both frames: its box encloses the motion
  };
  ElementScene(const FramePair& frames, Motion motion) : frames_(frames) {
    std::vector<std::array<std::uint32_t, 1>> vertices;
    for (std::uint32_t v = 0; v < frames.positions[0].size() / 3; ++v) vertices.push_back({v});
    for (const auto& positions : frames.positions)
      positions_.insert(positions_.end(), positions.begin(), positions.end());
    add("vertices", vertices, motion);
    add("faces", frames.faces, motion);
    add("edges", frames.edges, motion);
    positions_.push_back(0);  // readers may load four scalars
  }
  Scene<S>& scene() { return scene_; }
  /// The positions of all vertices at both frames, and one scalar.
  const S* positions() const { return positions_.data(); }

  /// Returns the number of pairs whose elements have no common vertex.
  std::size_t count(const PairBuffer& pairs) const {
    std::size_t apart = 0;
    for (const PrimitivePair& pair : pairs) {
      if (pair.body_a == 2) {
        const auto &a = frames_.edges[pair.primitive_a], &b = frames_.edges[pair.primitive_b];
        apart += a[0] != b[0] && a[0] != b[1] && a[1] != b[0] && a[1] != b[1] ? 1 : 0;
      } else {
        const auto& face = frames_.faces[pair.primitive_b];
        apart +=
            face[0] != pair.primitive_a && face[1] != pair.primitive_a && face[2] != pair.primitive_a ? 1 : 0;
      }
    }
    return apart;
  }

 private:
  template <class Lists>
  void add(const char* name, const Lists& lists, Motion motion) {
    const auto vertices = std::uint32_t(frames_.positions[0].size() / 3);
    Body<S> body;
    body.name = name;
    body.primitives.kind = PrimitiveKind::control_nets;
    std::vector<std::uint32_t> primitive;
    for (const auto& list : lists) {
      primitive.assign(list.begin(), list.end());
      if (motion == Motion::boxes)
        for (const std::uint32_t v : list) primitive.push_back(vertices + v);
      body.primitives.add(primitive);
    }
    body.plans = motion == Motion::boxes ? FlightPlans<S>::handed_in(2 * vertices, positions_)
                                         : FlightPlans<S>(vertices, {0.0, 1.0}, positions_);
    scene_.bodies.push_back(std::move(body));
  }

  const FramePair& frames_;
  std::vector<S> positions_;  ///< [frame][vertex][3]
  Scene<S> scene_;
};

/// A strategy's swept pairs between two frames, on trees that stay.
class StrategySweep {
 public:
  StrategySweep(const FramePair& frames, const char* strategy)
      : elements_(frames, ElementScene<double>::Motion::keyframes) {
    elements_.scene().pairs = {{0, 1}, {2, 2}};
    const StrategyEntry& entry = strategy_named(strategy);
    session_.emplace(elements_.scene(), kbvh::Contestant{&entry, {}, entry.info.topology.preferred});
  }
  std::size_t find() {
    session_->reset(0);
    Playback<double>& playback = session_->playback();
    before_.clear();
    for (std::uint32_t body = 0; body < playback.body_count(); ++body) {
      const double* const positions = playback.positions(body);
      copies_[body].assign(positions, positions + std::size_t(3) * playback.plans(body).vertex_count() + 1);
      before_.push_back(copies_[body].data());
    }
    session_->strategy().start_sweep(0);
    playback.seek(1);
    playback.evaluate_all();
    pairs_.clear();
    session_->strategy().swept_pairs(0, 1, before_, pairs_);
    return elements_.count(pairs_);
  }

 private:
  ElementScene<double> elements_;
  std::optional<Session<double>> session_;
  std::vector<double> copies_[3];
  std::vector<const double*> before_;
  PairBuffer pairs_;
};

/// A strategy of another library on boxes that enclose the motion: each frame updates and queries its trees.
template <class S>
class PeerBoxes {
 public:
  /// Pairs of `pairs`: {0, 1} are vertices and faces, {2, 2} edges.
  PeerBoxes(const FramePair& frames, const StrategyEntry& entry, std::vector<BodyPair> pairs)
      : elements_(frames, ElementScene<S>::Motion::boxes) {
    elements_.scene().pairs = std::move(pairs);
    session_.emplace(elements_.scene(), kbvh::Contestant{&entry, {}, entry.info.topology.preferred},
                     Use::timed);
    for (std::uint32_t body = 0; body < 3; ++body) session_->hand_in(body, elements_.positions());
    session_->reset(0);
  }
  /// Updates the trees.
  void advance() {
    PhaseTimes ignored;
    for (std::uint32_t body = 0; body < 3; ++body) session_->hand_in(body, elements_.positions());
    session_->advance(++time_, ignored);
  }
  std::size_t find() {
    pairs_.clear();
    session_->strategy().candidates_at(time_, pairs_, Budget{});
    return elements_.count(pairs_);
  }

 private:
  ElementScene<S> elements_;
  std::optional<Session<S>> session_;
  double time_ = 0;
  PairBuffer pairs_;
};

}  // namespace kbvh::experiments::micro
