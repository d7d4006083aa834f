#pragma once
#include <span>

#include "core/scene/geometry_change.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/probes.hpp"

namespace kbvh {

template <class S>
class Strategy;

// The optional abilities of a strategy beyond pairs at a time. Each ability is a small interface. A strategy
// has the ability if and only if its class derives (publicly) from the interface; `make_entry` fills in
// `Info::can` accordingly. Callers use the functions of `Strategy`, which check times first; the functions
// below may rely on these checks.

/// Answers pairs for a span of time.
template <class S>
class AnswersSpans {
 public:
  virtual ~AnswersSpans() = default;

 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::spans`. The strategy stood at t0; `time()` is already t1.
  virtual void find_spans(double t0, double t1, SpanBuffer& out) = 0;
};

/// The two answers of a frame.
enum class Answer : std::uint8_t {
  candidates,  ///< of `Strategy::candidates_at`
  pairs,       ///< of `Strategy::pairs_at`
};

/// Reports changes of the answer directly, at a cost in proportion to the changes.
template <class S>
class AnswersChanges {
 public:
  virtual ~AnswersChanges() = default;

 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::changes_at`: appends the difference between the answer at t and that of the last
  /// call with the same `answer` since `reset_to`. A strategy that has no faster way for one of the answers
  /// always calls `compare_answers` for it.
  virtual void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) = 0;
};

/// Answers which primitives may touch between two times: the broad phase of continuous collision detection.
template <class S>
class AnswersSweeps {
 public:
  virtual ~AnswersSweeps() = default;

 protected:
  friend class Strategy<S>;
  /// Prepares for the motion that begins at t, the current time of the strategy and of the motion view.
  virtual void prepare_sweep(double /*t*/) {}
  /// Implements `Strategy::swept_pairs`. The strategy stood at t0; `time()` is already t1.
  virtual void find_swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) = 0;
};

/// Answers which primitives rays meet, and no other probes (a peer library).
template <class S>
class AnswersRays {
 public:
  virtual ~AnswersRays() = default;

 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::probe_at` for rays: sets hits[i] to the answer to rays[i]. The strategy stands at
  /// t. Lazy strategies refresh what the rays read, positions included.
  virtual void find_hits(double t, const RayProbes<S>& rays) = 0;
};

/// Answers probes of every kind. The value says what is asked; shared traversals answer it, and a strategy
/// passes it on.
template <class S>
class AnswersProbes : public AnswersRays<S> {
 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::probe_at`, under the same conditions as `find_hits`.
  virtual void answer_probes(double t, const Probes<S>& probes) = 0;

 private:
  void find_hits(double t, const RayProbes<S>& rays) final { answer_probes(t, rays); }
};

/// Follows flight plans that change at run time.
template <class S>
class TakesPlanChanges {
 public:
  virtual ~TakesPlanChanges() = default;

 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::flight_plans_changed`. The strategy stands at t.
  virtual void follow_plans(double t, std::span<const PlanChange<S>> changes) = 0;
};

/// Follows insertions and deletions of vertices and primitives at run time.
template <class S>
class TakesGeometryChanges {
 public:
  virtual ~TakesGeometryChanges() = default;

 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::geometry_changed`. The strategy stands at t.
  virtual void follow_geometry(double t, const GeometryChange<S>& change) = 0;
};

/// Also answers pairs within one body if the scene asks for them; primitives that share a vertex are not a
/// pair. The interface has no functions: these pairs are appended to the others.
class AnswersSelfPairs {
 protected:
  ~AnswersSelfPairs() = default;
};

}  // namespace kbvh
