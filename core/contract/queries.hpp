#pragma once
#include <span>

#include "core/scene/geometry_change.hpp"
#include "core/scene/pairs.hpp"

namespace kbvh {

template <class S>
class Strategy;

// What a strategy can do besides answering pairs at a time: each ability is a small interface, and a strategy
// has the ability if and only if its class derives (publicly) from the interface. `make_entry` fills in
// `Info::can` from the class. Callers use the functions of `Strategy`, which check times first; so the
// functions below may rely on what their comments say.

/// Answers pairs for a span of time.
template <class S>
class AnswersSpans {
 public:
  virtual ~AnswersSpans() = default;

 protected:
  friend class Strategy<S>;
  /// Does what `Strategy::spans` promises. The strategy stood at t0, and `time()` is t1 already.
  virtual void find_spans(double t0, double t1, SpanBuffer& out) = 0;
};

/// Answers which primitives may touch between two times: the broad phase of continuous collision detection.
template <class S>
class AnswersSweeps {
 public:
  virtual ~AnswersSweeps() = default;

 protected:
  friend class Strategy<S>;
  /// Prepares for the motion that begins at t, where the strategy and the motion view stand.
  virtual void prepare_sweep(double /*t*/) {}
  /// Does what `Strategy::swept_pairs` promises. The strategy stood at t0, and `time()` is t1 already.
  virtual void find_swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) = 0;
};

/// Follows flight plans that change while the strategy runs.
template <class S>
class TakesPlanChanges {
 public:
  virtual ~TakesPlanChanges() = default;

 protected:
  friend class Strategy<S>;
  /// Does what `Strategy::flight_plans_changed` promises. The strategy stands at t.
  virtual void follow_plans(double t, std::span<const PlanChange<S>> changes) = 0;
};

/// Follows vertices and primitives that are inserted and deleted while the strategy runs.
template <class S>
class TakesGeometryChanges {
 public:
  virtual ~TakesGeometryChanges() = default;

 protected:
  friend class Strategy<S>;
  /// Does what `Strategy::geometry_changed` promises. The strategy stands at t.
  virtual void follow_geometry(double t, const GeometryChange<S>& change) = 0;
};

/// Answers pairs within one body, too, where the scene asks for them: primitives that share a vertex are no
/// pair. There is no function to implement: such pairs come with all others.
class AnswersSelfPairs {
 protected:
  ~AnswersSelfPairs() = default;
};

}  // namespace kbvh
