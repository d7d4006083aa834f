// kbvh::broad_phase for Python, through its C interface: arrays of numpy with any strides, read without a
// copy.
#include <pybind11/stl.h>

#include <memory>

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
    check(kbvh_broad_phase_build(handle_.get(), begin.view(), end ? end->view() : nullptr, e.data(),
                                 e.size() / 2, f.data(), f.size() / 3, radius));
  }
  void update(const py::array& v0, const std::optional<py::array>& v1) {
    const Positions begin(v0, type_, !v1 ? "V" : "V0");
    const std::optional<Positions> end = other(v1);
    check(kbvh_broad_phase_update(handle_.get(), begin.view(), end ? end->view() : nullptr));
  }
  void update_moved(const py::array& v, const py::object& moved) {
    const Positions positions(v, type_, "V");
    const Ids ids(moved, "the vertices that moved");
    check(
        kbvh_broad_phase_update_moved(handle_.get(), positions.view(), ids.span().data(), ids.span().size()));
  }
  void valid_for(Real displacement) { check(kbvh_broad_phase_valid_for(handle_.get(), displacement)); }
  py::array candidates(const std::string& kind) {
    const std::uint32_t* pairs = nullptr;
    std::size_t count = 0;
    check(kbvh_broad_phase_candidates(handle_.get(), kind_of(kind), &pairs, &count));
    return copied(pairs, count);
  }
  py::array within(const std::string& kind, Real distance) {
    const std::uint32_t* pairs = nullptr;
    std::size_t count = 0;
    check(kbvh_broad_phase_within(handle_.get(), kind_of(kind), distance, &pairs, &count));
    return copied(pairs, count);
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
  static py::array copied(const std::uint32_t* pairs, std::size_t count) {
    return numbers_of(std::vector<std::uint32_t>(pairs, pairs + 2 * count), {py::ssize_t(count), 2});
  }
  void check(int status) const {
    if (status != 0) throw std::invalid_argument(kbvh_broad_phase_error(handle_.get()));
  }

  py::dtype type_;
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
      .def_property_readonly("left", method(&PythonBroadPhase::left))
      .def_property_readonly("detections", method(&PythonBroadPhase::detections));
}

}  // namespace kbvh::python
