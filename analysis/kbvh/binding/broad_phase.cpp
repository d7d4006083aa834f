// kbvh::broad_phase for Python, through its C interface: arrays of numpy with any strides, read without a
// copy.
#include <pybind11/stl.h>

#include <exception>
#include <memory>
#include <utility>

#include "arrays.hpp"
#include "core/broad_phase/broad_phase_c.h"
#include "core/broad_phase/elements.hpp"

namespace kbvh::python {

namespace {

/// Positions of a caller: an array (n, 3) of the handle's scalar, as it lies.
class Positions {
 public:
  Positions(const py::array& array, const py::dtype& type, const std::string& what) : array_(array) {
    const py::ssize_t size = type.itemsize();
    if (array.ndim() != 2 || array.shape(1) != 3 || !array.dtype().equal(type) ||
        array.strides(0) % size != 0 || array.strides(1) % size != 0)
      throw std::invalid_argument(what + " is an array of " + std::string(py::str(py::handle(type))) +
                                  " of the shape (n, 3)");
    view_ = {array.data(), std::size_t(array.shape(0)), array.strides(0) / size, array.strides(1) / size};
  }
  const kbvh_positions* view() const { return &view_; }

 private:
  py::array array_;
  kbvh_positions view_{};
};

/// Rows of ids, (m, 2) or (k, 3), as 32-bit numbers row by row.
std::vector<std::int32_t> rows_of(const py::object& given, std::size_t width, const std::string& what) {
  const Ids ids(given, what);
  if (!ids.span().empty() && (ids.axes() != 2 || std::size_t(py::array(given).shape(1)) != width))
    throw std::invalid_argument(what + " has to have the shape (n, " + std::to_string(width) + ")");
  std::vector<std::int32_t> rows;
  rows.reserve(ids.span().size());
  for (const std::uint32_t id : ids.span()) {
    if (id > 0x7fffffffU) throw std::invalid_argument(what + ": " + std::to_string(id) + " is no vertex");
    rows.push_back(std::int32_t(id));
  }
  return rows;
}

/// A filter of a caller: a function of a kind and pairs (n, 2) that returns n truth values. Its first
/// exception is kept, and the search fails.
class PairChoice {
 public:
  explicit PairChoice(py::object choose) : choose_(std::move(choose)) {}
  static std::size_t keep(void* self, kbvh_candidate_kind kind, std::uint32_t* pairs, std::size_t count) {
    return static_cast<PairChoice*>(self)->ask(kind, pairs, count);
  }
  /// Whether the function is at work.
  bool asks() const { return asks_; }
  /// Raises the exception of the last search, if there was one.
  void raise() {
    if (const std::exception_ptr error = std::exchange(error_, nullptr)) std::rethrow_exception(error);
  }

 private:
  struct Asking {
    explicit Asking(bool& flag) : asks(flag) { asks = true; }
    ~Asking() { asks = false; }
    Asking(const Asking&) = delete;
    Asking& operator=(const Asking&) = delete;
    bool& asks;
  };
  std::size_t ask(kbvh_candidate_kind kind, std::uint32_t* pairs, std::size_t count) {
    const Asking asking(asks_);
    try {
      const py::array shown =
          numbers_of(std::vector<std::uint32_t>(pairs, pairs + 2 * count), {py::ssize_t(count), 2});
      const auto stay = py::cast<py::array>(choose_(name(CandidateKind(int(kind))), shown));
      if (stay.ndim() != 1 || std::size_t(stay.shape(0)) != count || stay.dtype().kind() != 'b')
        throw std::invalid_argument("a filter of pairs returns an array of " + std::to_string(count) +
                                    " truth values for " + std::to_string(count) + " pairs");
      const auto chosen = py::array_t<bool, py::array::c_style | py::array::forcecast>(stay);
      std::size_t kept = 0;
      for (std::size_t i = 0; i < count; ++i) {
        if (!chosen.data()[i]) continue;
        pairs[2 * kept] = pairs[2 * i];
        pairs[2 * kept + 1] = pairs[2 * i + 1];
        ++kept;
      }
      return kept;
    } catch (...) {
      error_ = std::current_exception();
      return ~std::size_t(0);
    }
  }

  py::object choose_;
  std::exception_ptr error_;
  bool asks_ = false;
};

class PythonBroadPhase {
 public:
  explicit PythonBroadPhase(const std::string& precision)
      : type_(precision == "float32" ? py::dtype::of<float>() : py::dtype::of<double>()),
        handle_(kbvh_broad_phase_new(precision == "float32" ? KBVH_FLOAT : KBVH_DOUBLE),
                &kbvh_broad_phase_free) {
    if (precision != "float32" && precision != "float64")
      throw std::invalid_argument("a precision is float32 or float64, not '" + precision + "'");
    if (!handle_) throw std::bad_alloc();
  }

  void build(const py::array& v0, const std::optional<py::array>& v1, const py::object& edges,
             const py::object& faces, Real radius) {
    const Positions begin(v0, type_, !v1 ? "V" : "V0");
    const std::optional<Positions> end = other(v1);
    const std::vector<std::int32_t> e = rows_of(edges, 2, "E"), f = rows_of(faces, 3, "F");
    check(kbvh_broad_phase_build(handle(), begin.view(), end ? end->view() : nullptr, e.data(), e.size() / 2,
                                 f.data(), f.size() / 3, radius));
    choice_.reset();
  }
  void update(const py::array& v0, const std::optional<py::array>& v1) {
    const Positions begin(v0, type_, !v1 ? "V" : "V0");
    const std::optional<Positions> end = other(v1);
    check(kbvh_broad_phase_update(handle(), begin.view(), end ? end->view() : nullptr));
  }
  void update_moved(const py::array& v, const py::object& moved) {
    const Positions positions(v, type_, "V");
    const Ids ids(moved, "the vertices that moved");
    check(kbvh_broad_phase_update_moved(handle(), positions.view(), ids.span().data(), ids.span().size()));
  }
  void valid_for(Real displacement) { check(kbvh_broad_phase_valid_for(handle(), displacement)); }
  py::array candidates(const std::string& kind) {
    const std::uint32_t* pairs = nullptr;
    std::size_t count = 0;
    check(kbvh_broad_phase_candidates(handle(), kind_of(kind), &pairs, &count));
    return copied(pairs, count);
  }
  py::array within(const std::string& kind, Real distance) {
    const std::uint32_t* pairs = nullptr;
    std::size_t count = 0;
    check(kbvh_broad_phase_within(handle(), kind_of(kind), distance, &pairs, &count));
    return copied(pairs, count);
  }
  py::tuple insert(const std::optional<py::array>& v, const py::object& edges, const py::object& faces) {
    std::optional<Positions> positions;
    if (v) positions.emplace(*v, type_, "V");
    const std::vector<std::int32_t> e = rows_of(edges, 2, "E"), f = rows_of(faces, 3, "F");
    std::uint32_t first[3] = {};
    check(kbvh_broad_phase_insert(handle(), positions ? positions->view() : nullptr, e.data(), e.size() / 2,
                                  f.data(), f.size() / 3, first));
    return py::make_tuple(first[0], first[1], first[2]);
  }
  void remove(const std::string& element, const py::object& ids) {
    const Ids removed(ids, "the elements to remove");
    check(
        kbvh_broad_phase_remove(handle(), element_of(element), removed.span().data(), removed.span().size()));
  }
  void set_groups(const std::string& element, const py::object& groups, const py::object& masks) {
    const std::vector<kbvh_group_mask> list = groups_of(groups, masks);
    check(kbvh_broad_phase_set_groups(handle(), element_of(element), list.data(), list.size()));
  }
  void set_vertex_groups(const py::object& groups, const py::object& masks) {
    const std::vector<kbvh_group_mask> list = groups_of(groups, masks);
    check(kbvh_broad_phase_set_vertex_groups(handle(), list.data(), list.size()));
  }
  void exclude(const std::string& kind, const py::object& pairs) {
    const Ids ids(pairs, "the excluded pairs");
    if (!ids.span().empty() && (ids.axes() != 2 || py::array(pairs).shape(1) != 2))
      throw std::invalid_argument("the excluded pairs have to have the shape (n, 2)");
    check(kbvh_broad_phase_exclude(handle(), kind_of(kind), ids.span().data(), ids.span().size() / 2));
  }
  void use_threads(std::uint32_t threads) { check(kbvh_broad_phase_use_threads(handle(), threads)); }
  void exclude_rings(std::uint32_t rings) { check(kbvh_broad_phase_exclude_rings(handle(), rings)); }
  py::array self_intersections() {
    const std::uint32_t* pairs = nullptr;
    std::size_t count = 0;
    check(kbvh_broad_phase_self_intersections(handle(), &pairs, &count));
    return copied(pairs, count);
  }
  void keep_only(const py::object& choose) {
    auto choice = choose.is_none() ? nullptr : std::make_unique<PairChoice>(choose);
    check(kbvh_broad_phase_keep_only(handle(), choice ? &PairChoice::keep : nullptr, choice.get()));
    choice_ = std::move(choice);
  }
  void clear_filters() {
    check(kbvh_broad_phase_clear_filters(handle()));
    choice_.reset();
  }
  py::tuple changes(const std::string& kind, const std::optional<double>& distance) {
    const std::uint32_t *begun = nullptr, *ended = nullptr;
    std::size_t begun_count = 0, ended_count = 0;
    check(distance ? kbvh_broad_phase_changes_within(handle(), kind_of(kind), *distance, &begun, &begun_count,
                                                     &ended, &ended_count)
                   : kbvh_broad_phase_changes(handle(), kind_of(kind), &begun, &begun_count, &ended,
                                              &ended_count));
    return py::make_tuple(copied(begun, begun_count), copied(ended, ended_count));
  }
  py::object earliest_impact(Real separation) {
    kbvh_impact impact{};
    check(kbvh_broad_phase_earliest_impact(handle(), separation, &impact));
    if (impact.touches == 0) return py::none();
    return py::make_tuple(impact.begin, impact.end, name(CandidateKind(int(impact.kind))), impact.pair[0],
                          impact.pair[1]);
  }
  double left() const { return kbvh_broad_phase_left(handle_.get()); }
  std::uint64_t detections() const { return kbvh_broad_phase_detections(handle_.get()); }

 private:
  std::optional<Positions> other(const std::optional<py::array>& v1) const {
    if (!v1) return {};
    return Positions(*v1, type_, "V1");
  }
  static kbvh_candidate_kind kind_of(const std::string& name) {
    return kbvh_candidate_kind(int(candidate_kind(name)));
  }
  static kbvh_element element_of(const std::string& name) {
    for (const auto& [word, element] :
         {std::pair("vertex", KBVH_VERTEX), std::pair("edge", KBVH_EDGE), std::pair("face", KBVH_FACE)})
      if (name == word) return element;
    throw std::invalid_argument("an element is a vertex, an edge or a face, not '" + name + "'");
  }
  static std::vector<kbvh_group_mask> groups_of(const py::object& groups, const py::object& masks) {
    const Ids of(groups, "groups"), with(masks, "masks");
    if (of.span().size() != with.span().size())
      throw std::invalid_argument("there are " + std::to_string(of.span().size()) + " groups and " +
                                  std::to_string(with.span().size()) + " masks");
    std::vector<kbvh_group_mask> list;
    for (std::size_t i = 0; i < of.span().size(); ++i) list.push_back({of.span()[i], with.span()[i]});
    return list;
  }
  static py::array copied(const std::uint32_t* pairs, std::size_t count) {
    return numbers_of(std::vector<std::uint32_t>(pairs, pairs + 2 * count), {py::ssize_t(count), 2});
  }
  /// Returns the handle for a call. A filter must not use the object that asks it: the search goes on
  /// afterwards, and the filter itself might be gone.
  kbvh_broad_phase* handle() const {
    if (choice_ && choice_->asks())
      throw std::logic_error(
          "a filter of pairs, or another thread, uses the broad phase that asks the filter");
    return handle_.get();
  }
  void check(int status) const {
    if (status != 0 && choice_) choice_->raise();
    if (status != 0) throw std::invalid_argument(kbvh_broad_phase_error(handle_.get()));
  }

  py::dtype type_;
  std::unique_ptr<PairChoice> choice_;  // the handle has a pointer to it
  std::unique_ptr<kbvh_broad_phase, decltype(&kbvh_broad_phase_free)> handle_;
};

}  // namespace

void bind_broad_phase(py::module_& module) {
  using py::arg;
  py::class_<PythonBroadPhase>(module, "BroadPhase")
      .def(py::init<const std::string&>(), arg("precision"))
      .def("build", method(&PythonBroadPhase::build), arg("v0"), arg("v1"), arg("edges"), arg("faces"),
           arg("radius"))
      .def("update", method(&PythonBroadPhase::update), arg("v0"), arg("v1"))
      .def("update_moved", method(&PythonBroadPhase::update_moved), arg("v"), arg("moved"))
      .def("valid_for", method(&PythonBroadPhase::valid_for), arg("displacement"))
      .def("candidates", method(&PythonBroadPhase::candidates), arg("kind"))
      .def("within", method(&PythonBroadPhase::within), arg("kind"), arg("distance"))
      .def("insert", method(&PythonBroadPhase::insert), arg("v"), arg("edges"), arg("faces"))
      .def("remove", method(&PythonBroadPhase::remove), arg("element"), arg("ids"))
      .def("set_groups", method(&PythonBroadPhase::set_groups), arg("element"), arg("groups"), arg("masks"))
      .def("set_vertex_groups", method(&PythonBroadPhase::set_vertex_groups), arg("groups"), arg("masks"))
      .def("exclude", method(&PythonBroadPhase::exclude), arg("kind"), arg("pairs"))
      .def("use_threads", method(&PythonBroadPhase::use_threads), arg("threads"))
      .def("exclude_rings", method(&PythonBroadPhase::exclude_rings), arg("rings"))
      .def("self_intersections", method(&PythonBroadPhase::self_intersections))
      .def("keep_only", method(&PythonBroadPhase::keep_only), arg("choose"))
      .def("clear_filters", method(&PythonBroadPhase::clear_filters))
      .def("changes", method(&PythonBroadPhase::changes), arg("kind"), arg("distance"))
      .def("earliest_impact", method(&PythonBroadPhase::earliest_impact), arg("separation"))
      .def_property_readonly("left", method(&PythonBroadPhase::left))
      .def_property_readonly("detections", method(&PythonBroadPhase::detections));
}

}  // namespace kbvh::python
