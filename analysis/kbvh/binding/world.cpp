#include "core/facade/world.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>

#include "arrays.hpp"

namespace kbvh::python {

namespace {

using Words = std::map<std::string, std::string>;

Shape shape_of(const std::string& word) {
  if (word == "polygons") return Shape::polygons;
  if (word == "points") return Shape::points;
  if (word == "control_nets") return Shape::control_nets;
  throw std::invalid_argument("a shape is polygons, points or control_nets, not '" + word + "'");
}

Precision precision_of(const std::string& word) {
  if (word == "float32") return Precision::float32;
  if (word == "float64") return Precision::float64;
  throw std::invalid_argument("a precision is float32 or float64, not '" + word + "'");
}

py::dict plain(const WorldAudit& audit) {
  py::dict out;
  out["nodes"] = audit.nodes;
  out["stale"] = audit.stale;
  out["invalid"] = audit.invalid;
  out["not_tight"] = audit.not_tight;
  out["protrusion"] = audit.protrusion;
  out["looseness"] = audit.looseness;
  out["first_fault"] = audit.first_fault;
  return out;
}

py::dict plain(const WorldVerdict& verdict) {
  py::dict out;
  out["holds"] = verdict.holds;
  out["first_violation"] = verdict.first_violation;
  out["frames"] = verdict.frames;
  out["pairs"] = verdict.pairs;
  out["candidates"] = verdict.candidates;
  out["missed_candidates"] = verdict.missed_candidates;
  out["missed"] = verdict.missed;
  out["extra"] = verdict.extra;
  out["repeated"] = verdict.repeated;
  out["malformed"] = verdict.malformed;
  out["audit"] = verdict.audited ? py::object(plain(verdict.audit)) : py::object(py::none());
  return out;
}

/// The primitives of a body of a caller, whose arrays are kept for the call that adds the body.
class GivenPrimitives {
 public:
  GivenPrimitives(const std::string& what, const py::object& indices, const py::object& offsets,
                  const std::string& shape)
      : vertices_(indices, what + ", its indices"), shape_(shape_of(shape)) {
    if (offsets.is_none()) return;
    offsets_.emplace(offsets, what + ", its offsets");
    if (offsets_->span().empty())
      throw std::invalid_argument(what + ": offsets begin with 0, but there are none");
  }
  Connectivity connectivity() const {
    return {vertices_.span(), offsets_ ? offsets_->span() : std::span<const std::uint32_t>(), shape_};
  }

 private:
  Ids vertices_;
  std::optional<Ids> offsets_;
  Shape shape_;
};

/// The façade for Python: keeps alive the arrays whose memory the world reads, and lets other threads run
/// while it works.
class PythonWorld {
 public:
  explicit PythonWorld(const std::string& precision)
      : precision_(precision), world_(precision_of(precision)) {}

  std::uint32_t add_body(const std::string& name, const py::object& indices, const py::object& offsets,
                         const std::string& shape, const py::object& times, const py::object& positions,
                         const py::object& bends, const py::object& twists) {
    check_idle();
    const std::string what = "body '" + name + "'";
    const GivenPrimitives primitives(what, indices, offsets, shape);
    const Numbers numbers(positions, what + ", its positions");
    numbers.check_points(what + ", its positions");
    const Connectivity connectivity = primitives.connectivity();
    std::vector<double> of_bends, of_twists;
    if (!bends.is_none()) of_bends = doubles_of(bends, what + ", its bends");
    if (!twists.is_none()) of_twists = doubles_of(twists, what + ", its twists");
    if (times.is_none() && !(of_bends.empty() && of_twists.empty()))
      throw std::invalid_argument(what + " has curves, but no keyframes");
    const auto add = [&](auto span) {
      if (times.is_none()) return world_.add_body(name, connectivity, span);
      const std::vector<double> keyframes = doubles_of(times, what + ", its times");
      return world_.add_body(name, connectivity, std::span<const double>(keyframes), span,
                             {of_bends, of_twists});
    };
    const std::uint32_t body = numbers.single() ? add(numbers.floats()) : add(numbers.doubles());
    given_.emplace_back();
    return body;
  }
  std::uint32_t add_body_over(Whole over, const std::string& name, const py::object& indices,
                              const py::object& offsets, const std::string& shape) {
    check_idle();
    const GivenPrimitives primitives("body '" + name + "'", indices, offsets, shape);
    const std::uint32_t body = world_.add_body_over(over, name, primitives.connectivity());
    given_.emplace_back();
    return body;
  }
  void add_pair(Whole a, Whole b) {
    check_idle();
    world_.add_pair(a, b);
  }
  void set_radius(Real radius) {
    check_idle();
    world_.set_radius(radius);
    has_radius_ = true;
  }

  void start(const std::string& strategy, const Words& params, Real t, const Words& topology) {
    alone([&] { world_.start(strategy, params, t, topology); });
  }
  void reset(Real t) {
    move([&] { world_.reset(t); });
  }
  void advance(Real t) {
    move([&] { world_.advance(t); });
  }
  double time() const { return world_.time(); }
  /// `rays` is [ray][7]: origin, direction, length.
  py::array hits(const py::object& rays, bool any) {
    const std::vector<double> numbers = doubles_of(rays, "rays");
    if (numbers.size() % 7 != 0)
      throw std::invalid_argument(std::to_string(numbers.size()) + " numbers are no rays of 7 each");
    std::vector<WorldRay> asked(numbers.size() / 7);
    for (std::size_t i = 0; i < asked.size(); ++i) {
      std::copy_n(&numbers[7 * i], 3, asked[i].origin);
      std::copy_n(&numbers[7 * i + 3], 3, asked[i].direction);
      asked[i].length = numbers[7 * i + 6];
    }
    std::vector<WorldHit> out;
    alone([&] { world_.hits(any ? WorldRayQuery::any : WorldRayQuery::closest, asked, out); });
    return records_of(std::move(out), hit_type());
  }
  /// `balls` is [ball][4]: centre, radius.
  py::array within(const py::object& balls) {
    const std::vector<double> numbers = doubles_of(balls, "balls");
    if (numbers.size() % 4 != 0)
      throw std::invalid_argument(std::to_string(numbers.size()) + " numbers are no balls of 4 each");
    std::vector<WorldBall> asked(numbers.size() / 4);
    for (std::size_t i = 0; i < asked.size(); ++i) {
      std::copy_n(&numbers[4 * i], 3, asked[i].centre);
      asked[i].radius = numbers[4 * i + 3];
    }
    std::vector<WorldBallHit> out;
    alone([&] { world_.within(asked, out); });
    return records_of(std::move(out), ball_hit_type());
  }
  double next_knot() const { return world_.next_knot(); }

  /// Returns whether the array is used where it lies: one of 3n + 1 numbers in the world's precision.
  bool set_positions(Whole body, const py::object& positions, const py::object& moved) {
    // A world on its way to another time would keep other arrays alive than it reads.
    check_idle();
    const std::string what = "the positions of body " + std::to_string(body);
    const Numbers numbers(positions, what);
    if (numbers.array().ndim() > 1) numbers.check_points(what);
    std::optional<Ids> ids;
    if (!moved.is_none()) ids.emplace(moved, "the vertices that moved");
    const bool in_place = set(body, numbers, ids ? &*ids : nullptr) && numbers.array().is(positions);
    given_[body].pending.push_back(numbers.array());
    return in_place;
  }

  void change_plans(Whole body, const py::object& vertices, const py::object& velocities,
                    const py::object& times, const py::object& positions) {
    const Ids ids(vertices, "the vertices of new plans");
    const std::size_t count = ids.span().size();
    const std::vector<double> velocity = points_of(velocities, "the velocities of new plans");
    std::vector<double> knots, points;
    if (!times.is_none()) knots = doubles_of(times, "the times of new plans");
    if (!positions.is_none()) points = points_of(positions, "the positions of new plans");
    if (velocity.size() != 3 * count)
      throw std::invalid_argument(std::to_string(velocity.size()) + " numbers are no velocities of " +
                                  std::to_string(count) + " vertices");
    if (points.size() != 3 * count * knots.size())
      throw std::invalid_argument(std::to_string(points.size()) + " numbers are no positions of " +
                                  std::to_string(count) + " vertices at " + std::to_string(knots.size()) +
                                  " times");
    std::vector<WorldPlan> plans(count);
    for (std::size_t i = 0; i < count; ++i) {
      plans[i].body = body;
      plans[i].vertex = ids.span()[i];
      plans[i].times = knots;
      plans[i].positions.assign(points.begin() + std::ptrdiff_t(3 * knots.size() * i),
                                points.begin() + std::ptrdiff_t(3 * knots.size() * (i + 1)));
      for (std::size_t axis = 0; axis < 3; ++axis) plans[i].velocity[axis] = velocity[3 * i + axis];
    }
    alone([&] { world_.change_plans(plans); });
  }

  /// Each dictionary is by body: (positions, velocities); lists of vertices; ids; ids.
  void change_geometry(const py::dict& vertices, const py::dict& primitives,
                       const py::dict& removed_primitives, const py::dict& removed_vertices) {
    WorldEdit edit;
    const auto body_of = [](const py::handle& key) {
      return std::uint32_t(whole_number(key, "a body", std::numeric_limits<std::uint32_t>::max()));
    };
    for (const auto& [key, value] : vertices) {
      const std::uint32_t body = body_of(key);
      if ((!py::isinstance<py::tuple>(value) && !py::isinstance<py::list>(value)) || py::len(value) != 2)
        throw py::type_error("new vertices of body " + std::to_string(body) +
                             " are a tuple (positions, velocities), not " +
                             std::string(py::str(py::type::handle_of(value).attr("__name__"))));
      const auto pair = py::reinterpret_borrow<py::sequence>(value);
      const std::vector<double> positions = points_of(pair[0], "the positions of new vertices");
      const std::vector<double> velocities = points_of(pair[1], "the velocities of new vertices");
      if (positions.size() != velocities.size())
        throw std::invalid_argument(std::to_string(positions.size() / 3) + " positions and " +
                                    std::to_string(velocities.size() / 3) + " velocities of new vertices");
      for (std::size_t i = 0; i < positions.size(); i += 3)
        edit.vertices.push_back({body,
                                 {positions[i], positions[i + 1], positions[i + 2]},
                                 {velocities[i], velocities[i + 1], velocities[i + 2]}});
    }
    for (const auto& [key, value] : primitives)
      for (const py::handle list : value) {
        const Ids ids(py::reinterpret_borrow<py::object>(list), "the vertices of a new primitive");
        if (ids.axes() != 1)
          throw std::invalid_argument("a new primitive is a list of vertices, [primitive][corner], not " +
                                      std::string(py::str(list)));
        edit.primitives.push_back({body_of(key), {ids.span().begin(), ids.span().end()}});
      }
    const auto collect = [&](const py::dict& from, std::vector<WorldEdit::Id>& to, const char* what) {
      for (const auto& [key, value] : from) {
        const Ids ids(py::reinterpret_borrow<py::object>(value), what);
        for (const std::uint32_t id : ids.span()) to.push_back({body_of(key), id});
      }
    };
    collect(removed_primitives, edit.removed_primitives, "removed primitives");
    collect(removed_vertices, edit.removed_vertices, "removed vertices");
    alone([&] { world_.change_geometry(edit); });
  }

  py::array pairs() {
    std::vector<WorldPair> out;
    alone([&] { world_.pairs(out); });
    return records_of(std::move(out), pair_type());
  }
  py::array true_pairs() {
    std::vector<WorldPair> out;
    alone([&] { world_.true_pairs(out); });
    return records_of(std::move(out), pair_type());
  }
  py::tuple changes() {
    std::vector<WorldPair> begun, ended;
    alone([&] { world_.changes(begun, ended); });
    return py::make_tuple(records_of(std::move(begun), pair_type()),
                          records_of(std::move(ended), pair_type()));
  }
  py::array spans(Real t) {
    std::vector<WorldSpan> out;
    move([&] { world_.spans(t, out); });
    return records_of(std::move(out), span_type());
  }
  py::array contacts(Real t) {
    for (std::size_t body = 0; body < given_.size(); ++body)
      if (const Given& given = given_[body]; !given.pending.empty() && !given.current.empty() &&
                                             given.pending.back().data() == given.current.back().data())
        throw std::invalid_argument("contacts need the positions at both ends: body " + std::to_string(body) +
                                    " got the same array twice");
    std::vector<WorldContact> out;
    move([&] { world_.contacts(t, out); });
    return records_of(std::move(out), contact_type());
  }

  py::array positions(Whole body) {
    const WorldPositions found = alone([&] { return world_.current_positions(body); });
    const std::vector<py::ssize_t> shape{py::ssize_t(found.vertices), 3};
    py::array out(found.precision == Precision::float32 ? py::dtype::of<float>() : py::dtype::of<double>(),
                  shape);
    if (found.vertices > 0) std::memcpy(out.mutable_data(), found.data, std::size_t(out.nbytes()));
    return out;
  }
  std::uintptr_t positions_address(Whole body) {
    return reinterpret_cast<std::uintptr_t>(alone([&] { return world_.current_positions(body); }).data);
  }
  py::object hierarchy(Whole body) {
    WorldHierarchy out;
    if (!alone([&] { return world_.hierarchy(body, out); })) return py::none();
    const auto primitives = py::ssize_t(out.primitives.size());
    return py::make_tuple(records_of(std::move(out.nodes), node_type()),
                          numbers_of(std::move(out.primitives), {primitives}));
  }
  py::object realisers(Whole body) {
    std::vector<std::uint32_t> out;
    if (!alone([&] { return world_.realisers(body, out); })) return py::none();
    const auto nodes = py::ssize_t(out.size() / 6);
    return numbers_of(std::move(out), {nodes, 6});
  }
  py::array watched_pairs() {
    std::vector<WorldWatch> out;
    alone([&] { world_.watched_pairs(out); });
    return records_of(std::move(out), watch_type());
  }
  py::object audit(Whole body) {
    WorldAudit out;
    if (!alone([&] { return world_.audit(body, out); })) return py::none();
    return plain(out);
  }
  py::dict counters() const {
    py::dict out;
    for (const WorldCounter& counter : world_.counters()) out[py::str(counter.name)] = counter.value;
    return out;
  }

  std::vector<double> frame_times(Whole per_keyframe) const { return world_.frame_times(per_keyframe); }
  py::dict verify(const std::string& strategy, const py::object& frames, const Words& params,
                  const Words& topology) {
    const std::vector<double> times = doubles_of(frames, "frames");
    return plain(alone([&] { return world_.verify(strategy, times, params, topology); }));
  }

  bool has_events() const { return world_.has_events(); }
  double next_event_time() const { return world_.next_event_time(); }
  py::array scheduled_events() {
    std::vector<WorldEvent> out;
    alone([&] { world_.scheduled_events(out); });
    return records_of(std::move(out), event_type());
  }
  py::object step_event(Real until) {
    WorldStep out;
    if (!alone([&] { return world_.step_event(until, out); })) return py::none();
    std::vector<WorldEvent> event{out.event};
    return py::make_tuple(records_of(std::move(event), event_type()),
                          records_of(std::move(out.touched), bound_change_type()),
                          records_of(std::move(out.rescheduled), event_type()));
  }

  const std::string& precision() const { return precision_; }

 private:
  /// The arrays of a body that the world may read: since the last move, and for the next one.
  struct Given {
    std::vector<py::array> current, pending;
  };

  /// Returns whether the world reads these numbers where they lie.
  bool set(std::uint32_t body, const Numbers& numbers, const Ids* moved) {
    const auto hand_in = [&](const auto& positions) {
      if (moved != nullptr)
        world_.set_positions(body, positions, moved->span());
      else
        world_.set_positions(body, positions);
    };
    if (numbers.single())
      hand_in(numbers.floats());
    else
      hand_in(numbers.doubles());
    return !has_radius_ && numbers.size() % 3 == 1 && numbers.single() == (precision_ == "float32");
  }

  void check_idle() const {
    if (busy_)
      throw std::logic_error("this world is at work, in another thread or in a strategy that asks it");
  }
  template <class Work>
  auto alone(Work&& work) -> decltype(work()) {
    check_idle();
    busy_ = true;
    struct Done {
      bool& busy;
      ~Done() { busy = false; }
    } done{busy_};
    Unlocked unlocked;
    return work();
  }
  /// Works on the way to another time: afterwards the pending positions are the current ones.
  template <class Work>
  void move(Work&& work) {
    alone(work);
    for (Given& given : given_)
      if (!given.pending.empty()) {
        given.current = {given.pending.back()};
        given.pending.clear();
      }
  }

  std::string precision_;
  World world_;
  std::vector<Given> given_;
  bool has_radius_ = false;
  bool busy_ = false;  ///< guarded by the interpreter's lock
};

py::list listed() {
  py::list out;
  for (const WorldStrategy& strategy : World::strategy_descriptions()) {
    py::list parameters;
    for (const WorldParameter& parameter : strategy.parameters) {
      py::dict one;
      one["name"] = parameter.name;
      one["default"] = parameter.default_value;
      one["meaning"] = parameter.meaning;
      one["admissible"] = parameter.admissible;
      one["allowed"] = py::tuple(py::cast(parameter.allowed));
      one["least"] = parameter.least;
      one["most"] = parameter.most;
      one["whole"] = parameter.whole;
      parameters.append(one);
    }
    py::list precisions;
    if (strategy.has_float32) precisions.append("float32");
    if (strategy.has_float64) precisions.append("float64");
    std::string foresight = strategy.foresight;
    std::replace(foresight.begin(), foresight.end(), ' ', '_');
    py::dict one;
    one["id"] = strategy.id;
    one["title"] = strategy.title;
    one["family"] = strategy.family;
    one["citation"] = strategy.citation;
    one["about"] = strategy.about;
    one["baseline"] = strategy.baseline;
    one["guarantee"] = strategy.guarantee;
    one["tightness"] = strategy.tightness;
    one["foresight"] = foresight;
    one["precisions"] = py::tuple(precisions);
    one["primitives"] = py::tuple(py::cast(strategy.primitives));
    one["abilities"] = py::tuple(py::cast(strategy.abilities));
    one["method"] = strategy.method;
    one["width"] = strategy.width;
    one["leaf_size"] = strategy.leaf_size;
    one["max_primitive_pairs"] = strategy.max_primitive_pairs;
    one["max_coordinate"] = strategy.max_coordinate;
    one["parameters"] = parameters;
    out.append(one);
  }
  return out;
}

}  // namespace

void bind_world(py::module_& module) {
  using py::arg;
  py::class_<PythonWorld>(module, "World")
      .def(py::init<const std::string&>(), arg("precision"))
      .def_property_readonly("precision", method(&PythonWorld::precision))
      .def_property_readonly("time", method(&PythonWorld::time))
      .def("add_body", method(&PythonWorld::add_body), arg("name"), arg("indices"), arg("offsets"),
           arg("shape"), arg("times"), arg("positions"), arg("bends"), arg("twists"))
      .def("add_body_over", method(&PythonWorld::add_body_over), arg("body"), arg("name"), arg("indices"),
           arg("offsets"), arg("shape"))
      .def("set_radius", method(&PythonWorld::set_radius), arg("radius"))
      .def("add_pair", method(&PythonWorld::add_pair), arg("body_a"), arg("body_b"))
      .def("start", method(&PythonWorld::start), arg("strategy"), arg("params"), arg("t"), arg("topology"))
      .def("reset", method(&PythonWorld::reset), arg("t"))
      .def("advance", method(&PythonWorld::advance), arg("t"))
      .def("next_knot", method(&PythonWorld::next_knot))
      .def("set_positions", method(&PythonWorld::set_positions), arg("body"), arg("positions"), arg("moved"))
      .def("change_plans", method(&PythonWorld::change_plans), arg("body"), arg("vertices"),
           arg("velocities"), arg("times"), arg("positions"))
      .def("change_geometry", method(&PythonWorld::change_geometry), arg("vertices"), arg("primitives"),
           arg("removed_primitives"), arg("removed_vertices"))
      .def("pairs", method(&PythonWorld::pairs))
      .def("true_pairs", method(&PythonWorld::true_pairs))
      .def("changes", method(&PythonWorld::changes))
      .def("spans", method(&PythonWorld::spans), arg("t"))
      .def("contacts", method(&PythonWorld::contacts), arg("t"))
      .def("hits", method(&PythonWorld::hits), arg("rays"), arg("any"))
      .def("within", method(&PythonWorld::within), arg("balls"))
      .def("positions", method(&PythonWorld::positions), arg("body"))
      .def("positions_address", method(&PythonWorld::positions_address), arg("body"))
      .def("hierarchy", method(&PythonWorld::hierarchy), arg("body"))
      .def("realisers", method(&PythonWorld::realisers), arg("body"))
      .def("watched_pairs", method(&PythonWorld::watched_pairs))
      .def("audit", method(&PythonWorld::audit), arg("body"))
      .def("counters", method(&PythonWorld::counters))
      .def("frame_times", method(&PythonWorld::frame_times), arg("per_keyframe"))
      .def("verify", method(&PythonWorld::verify), arg("strategy"), arg("frames"), arg("params"),
           arg("topology"))
      .def("has_events", method(&PythonWorld::has_events))
      .def("next_event_time", method(&PythonWorld::next_event_time))
      .def("scheduled_events", method(&PythonWorld::scheduled_events))
      .def("step_event", method(&PythonWorld::step_event), arg("until"));
  module.def("list_strategies", &listed);
  module.def("counter_meanings", [] {
    py::dict out;
    for (const auto& [name, meaning] : World::counter_meanings()) out[py::str(name)] = meaning;
    return out;
  });
  module.attr("pair_type") = pair_type();
  module.attr("span_type") = span_type();
  module.attr("contact_type") = contact_type();
  module.attr("hit_type") = hit_type();
  module.attr("node_type") = node_type();
  module.attr("watch_type") = watch_type();
  module.attr("event_type") = event_type();
  module.attr("bound_change_type") = bound_change_type();
}

}  // namespace kbvh::python
