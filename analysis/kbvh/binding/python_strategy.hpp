#pragma once
#include <algorithm>
#include <limits>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "core/contract/registry.hpp"

namespace kbvh::python {

/// The motion of a scene as a strategy in Python sees it. Arrays are copies: a strategy may keep them.
class AnyMotion {
 public:
  virtual ~AnyMotion() = default;
  virtual double time() const = 0;
  virtual std::uint32_t body_count() const = 0;
  virtual py::array positions(std::uint32_t body) const = 0;
  virtual double displacement_bound(std::uint32_t body, double t0, double t1) const = 0;
  virtual double lines_begin(std::uint32_t body) const = 0;
  virtual double lines_end(std::uint32_t body) const = 0;
  virtual py::array positions_on_lines(std::uint32_t body, double t) const = 0;
  virtual py::array keyframe_times(std::uint32_t body) const = 0;
  virtual py::array keyframe(std::uint32_t body, std::size_t k) const = 0;
};

/// What Python holds of a motion. A strategy in Python may outlive its world, and the motion with it.
class MotionHandle {
 public:
  explicit MotionHandle(const AnyMotion& motion) : motion_(&motion) {}
  void end() { motion_ = nullptr; }
  const AnyMotion& motion() const {
    if (motion_ == nullptr) throw std::logic_error("the world of this motion is gone");
    return *motion_;
  }
  const AnyMotion& of(std::uint32_t body) const {
    if (body >= motion().body_count())
      throw std::invalid_argument("there is no body " + std::to_string(body) + " among " +
                                  std::to_string(motion().body_count()));
    return motion();
  }

 private:
  const AnyMotion* motion_;
};

/// Makes the object of a registered strategy: calls the factory of its slot with the scene, the parameters
/// and the motion.
py::object make_object(std::size_t slot, const py::dict& scene, const py::dict& params,
                       const std::shared_ptr<MotionHandle>& motion);

/// Returns a text that outlives every table of counters.
std::string_view lasting(const std::string& text);

template <class S>
class MotionOf final : public AnyMotion {
 public:
  MotionOf(const SceneView<S>& scene, Playback<S>& playback) : scene_(scene), motion_(playback) {}
  double time() const override { return motion_.SampledMotion<S>::time(); }
  std::uint32_t body_count() const override { return scene_.body_count(); }
  py::array positions(std::uint32_t body) const override {
    return copy(scene_.vertex_count(body), motion_.positions(body));
  }
  double displacement_bound(std::uint32_t body, double t0, double t1) const override {
    return motion_.displacement_bound(body, t0, t1);
  }
  double lines_begin(std::uint32_t body) const override { return motion_.lines_begin(body); }
  double lines_end(std::uint32_t body) const override { return motion_.lines_end(body); }
  py::array positions_on_lines(std::uint32_t body, double t) const override {
    std::vector<S> room;
    return copy(scene_.vertex_count(body), motion_.positions_on_lines(body, t, room));
  }
  py::array keyframe_times(std::uint32_t body) const override {
    const auto times = motion_.plans(body).keyframe_times();
    return py::array_t<double>(py::ssize_t(times.size()), times.data());
  }
  py::array keyframe(std::uint32_t body, std::size_t k) const override {
    const FlightPlans<S>& plans = motion_.plans(body);
    if (k >= plans.keyframe_count())
      throw std::invalid_argument("body " + std::to_string(body) + " has " +
                                  std::to_string(plans.keyframe_count()) +
                                  " keyframes; there is no keyframe " + std::to_string(k));
    return copy(plans.keyframed_count(), plans.keyframe(k));
  }
  static py::array copy(std::uint32_t vertices, const S* numbers) {
    return py::array_t<S>({py::ssize_t(vertices), py::ssize_t(3)}, numbers);
  }

 private:
  SceneView<S> scene_;
  ClipMotion<S> motion_;
};

/// A strategy whose methods are written in Python. The registration declares its abilities; the methods of
/// the others are never called.
template <class S>
class PythonStrategy final : public CountedStrategy<S>,
                             public AnswersSelfPairs,
                             public AnswersSpans<S>,
                             public AnswersSweeps<S>,
                             public TakesPlanChanges<S> {
 public:
  PythonStrategy(std::size_t slot, std::string id, const SceneView<S>& scene, Playback<S>& playback,
                 Topologies topologies, const Params& params)
      : CountedStrategy<S>(scene, SampledMotion<S>(playback)),
        id_(std::move(id)),
        topologies_(std::move(topologies)),
        motion_(scene, playback) {
    const py::gil_scoped_acquire locked;
    handle_ = std::make_shared<MotionHandle>(motion_);
    py::dict values;
    for (const auto& [key, value] : params.values()) values[py::str(key)] = value;
    guarded([&] { object_ = make_object(slot, described(), values, handle_); });
  }
  ~PythonStrategy() override {
    const py::gil_scoped_acquire locked;
    handle_->end();
    object_ = {};
  }

  void reset_to(double /*t*/) override { call("reset"); }
  void advance_to(double /*t*/) override { call("advance"); }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*budget*/) override {
    const py::gil_scoped_acquire locked;
    append(call("candidates"), "candidates", out);
    return {};
  }

  void find_spans(double t0, double t1, SpanBuffer& out) override {
    const py::gil_scoped_acquire locked;
    const py::object answer = call("spans", t0, t1);
    if (!py::isinstance<py::tuple>(answer) || py::len(answer) != 2)
      throw std::invalid_argument("'" + id_ + "', spans: returned no tuple (pairs, times)");
    PairBuffer pairs;
    append(answer[py::int_(0)], "spans", pairs);
    const std::vector<double> times = doubles_of(answer[py::int_(1)], "'" + id_ + "', spans: its times");
    if (times.size() != 2 * pairs.size())
      throw std::invalid_argument("'" + id_ + "', spans: " + std::to_string(times.size()) + " times for " +
                                  std::to_string(pairs.size()) + " pairs");
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (!(times[2 * i] >= t0 && times[2 * i] <= times[2 * i + 1] && times[2 * i + 1] <= t1))
        throw std::invalid_argument("'" + id_ + "', spans: span " + std::to_string(i) + " is from " +
                                    number_text(times[2 * i]) + " to " + number_text(times[2 * i + 1]));
      out.push_back({pairs[i], times[2 * i], times[2 * i + 1]});
    }
  }

  void find_swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) override {
    const py::gil_scoped_acquire locked;
    py::list arrays;
    for (std::uint32_t body = 0; body < before.size(); ++body)
      arrays.append(MotionOf<S>::copy(this->scene_.vertex_count(body), before[body]));
    append(call("swept_candidates", t0, t1, arrays), "swept_candidates", out);
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    const py::gil_scoped_acquire locked;
    py::array_t<std::uint32_t> changed({py::ssize_t(changes.size()), py::ssize_t(2)});
    for (std::size_t i = 0; i < changes.size(); ++i) {
      changed.mutable_at(py::ssize_t(i), 0) = changes[i].body;
      changed.mutable_at(py::ssize_t(i), 1) = changes[i].vertex;
    }
    call("plans_changed", changed);
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    if (topologies_.empty()) return {};
    const py::gil_scoped_acquire locked;
    const py::object answer = call("bounds", body);
    if (answer.is_none()) return {};
    const std::string what = "'" + id_ + "', bounds of body " + std::to_string(body);
    const std::vector<double> numbers = doubles_of(answer, what);
    AuditView view;
    view.topology = topologies_[body];
    if (numbers.size() != std::size_t(6) * view.topology.size())
      throw std::invalid_argument(what + ": " + std::to_string(numbers.size()) + " numbers for " +
                                  std::to_string(view.topology.size()) + " nodes, not 6 each");
    view.boxes.resize(view.topology.size());
    for (std::size_t node = 0; node < view.boxes.size(); ++node)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        view.boxes[node].lower[axis] = numbers[6 * node + axis];
        view.boxes[node].upper[axis] = numbers[6 * node + 3 + axis];
      }
    return view;
  }

  std::size_t bytes() const override {
    const py::gil_scoped_acquire locked;
    return whole_number(call("bytes"), "'" + id_ + "', bytes: the memory",
                        std::numeric_limits<std::size_t>::max());
  }

 private:
  void add_counts(Counters& table) const override {
    const py::gil_scoped_acquire locked;
    const py::object counts = call("counters");
    if (!py::isinstance<py::dict>(counts))
      throw py::type_error("'" + id_ + "', counters: returned no dictionary, but " +
                           std::string(py::str(py::type::of(counts).attr("__name__"))));
    for (const std::pair<py::handle, py::handle> entry : py::reinterpret_borrow<py::dict>(counts)) {
      if (!py::isinstance<py::str>(entry.first))
        throw py::type_error("'" + id_ + "', counters: the name of a counter is a text, not " +
                             std::string(py::str(entry.first)));
      const std::string counter = py::str(entry.first);
      const std::uint64_t amount = whole_number(entry.second, "'" + id_ + "', counters: '" + counter + "'",
                                                std::numeric_limits<std::uint64_t>::max());
      std::size_t known = 0;
      while (known < table.values.size() && counter != name(Counter(known))) ++known;
      if (known < table.values.size())
        table[Counter(known)] += amount;
      else
        table.add(lasting(counter), amount);
    }
  }

  /// Runs Python code; an interruption by the user goes through every handler of faulty strategies.
  template <class Work>
  static auto guarded(const Work& work) -> decltype(work()) {
    try {
      return work();
    } catch (py::error_already_set& error) {
      if (error.matches(PyExc_KeyboardInterrupt)) throw Interrupted{};
      throw;
    }
  }
  template <class... Arguments>
  py::object call(const char* method, const Arguments&... arguments) const {
    const py::gil_scoped_acquire locked;
    return guarded([&] { return py::object(object_.attr(method)(arguments...)); });
  }

  /// Appends an answer: [pair][4] ids, or a structured array of pairs. Refuses ids that no body has, because
  /// the exact tests that follow would read them; puts each pair into canonical order.
  void append(const py::object& answer, const char* method, PairBuffer& out) const {
    const std::string what = "'" + id_ + "', " + method;
    py::object plain = answer;
    if (py::isinstance<py::array>(answer) && !answer.attr("dtype").attr("names").is_none()) {
      const py::object type = answer.attr("dtype");
      if (!type.equal(pair_type()))
        throw std::invalid_argument(what + ": its pairs have the type " + std::string(py::str(type)));
      plain = answer.attr("view")("u4");
    } else {
      const py::array array = py::array::ensure(answer);
      if (!array) PyErr_Clear();
      if (!array || (array.size() > 0 && (array.ndim() != 2 || array.shape(1) != 4)))
        throw std::invalid_argument(what + ": its pairs are no array [pair][4]");
      plain = array;
    }
    const Ids ids(plain, what + ": its pairs");
    const std::span<const std::uint32_t> numbers = ids.span();
    for (std::size_t i = 0; i + 3 < numbers.size(); i += 4) {
      PrimitivePair pair{numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]};
      check(pair.body_a, pair.primitive_a, what);
      check(pair.body_b, pair.primitive_b, what);
      if (pair.body_a > pair.body_b || (pair.body_a == pair.body_b && pair.primitive_a > pair.primitive_b))
        pair = {pair.body_b, pair.primitive_b, pair.body_a, pair.primitive_a};
      out.push_back(pair);
    }
  }
  void check(std::uint32_t body, std::uint32_t primitive, const std::string& what) const {
    if (body >= this->scene_.body_count())
      throw std::invalid_argument(what + ": there is no body " + std::to_string(body) + " among " +
                                  std::to_string(this->scene_.body_count()));
    if (const std::uint32_t count = this->scene_.primitives(body).count(); primitive >= count)
      throw std::invalid_argument(what + ": body " + std::to_string(body) + " has " + std::to_string(count) +
                                  " primitives; there is no primitive " + std::to_string(primitive));
  }

  /// Describes the scene: bodies (offsets, indices, vertex count, whether it moves), body pairs, trees.
  py::dict described() const {
    py::list bodies, pairs, trees;
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) {
      const Primitives& primitives = this->scene_.primitives(body);
      py::dict one;
      one["offsets"] = ids(primitives.offsets);
      one["indices"] = ids(primitives.vertices);
      one["vertices"] = this->scene_.vertex_count(body);
      one["moving"] = this->scene_.moving(body);
      one["shape"] = name(primitives.kind);
      bodies.append(one);
    }
    for (const BodyPair& pair : this->scene_.pairs()) pairs.append(py::make_tuple(pair.first, pair.second));
    for (const Topology& topology : topologies_) {
      std::vector<std::uint32_t> first, count;
      py::array_t<bool> leaf{py::ssize_t(topology.size())};
      for (std::uint32_t node = 0; node < topology.size(); ++node) {
        first.push_back(topology.nodes[node].first());
        count.push_back(topology.nodes[node].count());
        leaf.mutable_at(py::ssize_t(node)) = topology.nodes[node].is_leaf();
      }
      py::dict one;
      one["first"] = ids(first);
      one["count"] = ids(count);
      one["leaf"] = leaf;
      one["parents"] = ids(topology.parents);
      one["primitives"] = ids(topology.primitives);
      trees.append(one);
    }
    py::dict out;
    out["bodies"] = bodies;
    out["pairs"] = pairs;
    out["trees"] = trees;
    out["precision"] = sizeof(S) == 4 ? "float32" : "float64";
    return out;
  }
  static py::array ids(const std::vector<std::uint32_t>& numbers) {
    return py::array_t<std::uint32_t>(py::ssize_t(numbers.size()), numbers.data());
  }

  std::string id_;
  Topologies topologies_;  ///< empty if the strategy builds its own hierarchy
  MotionOf<S> motion_;
  std::shared_ptr<MotionHandle> handle_;
  py::object object_;
};

}  // namespace kbvh::python
