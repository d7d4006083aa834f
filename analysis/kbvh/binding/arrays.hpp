#pragma once
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/base/interruption.hpp"

namespace kbvh::python {

namespace py = pybind11;

/// Hands a vector's memory to numpy, without a copy.
template <class T>
py::array array_of(std::vector<T>&& numbers, const py::dtype& type, std::vector<py::ssize_t> shape) {
  auto owned = std::make_unique<std::vector<T>>(std::move(numbers));
  const void* const data = owned->data();
  py::capsule owner(owned.get(), [](void* memory) { delete static_cast<std::vector<T>*>(memory); });
  owned.release();
  return py::array(type, std::move(shape), data, owner);
}
template <class T>
py::array records_of(std::vector<T>&& records, const py::dtype& type) {
  const auto size = py::ssize_t(records.size());
  return array_of(std::move(records), type, {size});
}
template <class T>
py::array numbers_of(std::vector<T>&& numbers, std::vector<py::ssize_t> shape) {
  return array_of(std::move(numbers), py::dtype::of<T>(), std::move(shape));
}

/// A whole number of a caller from 0 to 2^32 - 1: of a body, of a keyframe. Others raise TypeError or
/// ValueError.
struct Whole {
  std::uint32_t value = 0;
  operator std::uint32_t() const { return value; }
};

/// A real number of a caller: of seconds, of units of length. Others raise TypeError.
struct Real {
  double value = 0;
  operator double() const { return value; }
};

/// Returns a whole number from 0 to `most`. Throws a TypeError or ValueError of Python that begins with
/// `what`.
std::uint64_t whole_number(const py::handle& given, const std::string& what, std::uint64_t most);

/// Numbers of a caller: an array of float32 or float64 in C order as it lies, other whole or real numbers as
/// a copy in float64. `what` begins the message about values that are no such numbers.
class Numbers {
 public:
  Numbers(const py::object& given, const std::string& what);
  bool single() const { return single_; }
  std::size_t size() const { return std::size_t(array_.size()); }
  const void* data() const { return array_.data(); }
  const py::array& array() const { return array_; }
  std::span<const float> floats() const { return {static_cast<const float*>(data()), size()}; }
  std::span<const double> doubles() const { return {static_cast<const double*>(data()), size()}; }
  /// Throws std::invalid_argument unless the last axis has 3 entries, or the array is flat.
  void check_points(const std::string& what) const;

 private:
  py::array array_;
  bool single_ = false;
};

/// Numbers as float64.
std::vector<double> doubles_of(const py::object& given, const std::string& what);
/// Points as float64: [point][3], or a flat list of coordinates.
std::vector<double> points_of(const py::object& given, const std::string& what);

/// Ids of a caller: an array of uint32 in C order as it lies, other whole numbers as a checked copy.
class Ids {
 public:
  Ids(const py::object& given, const std::string& what);
  std::span<const std::uint32_t> span() const { return {data_, size_}; }
  /// The number of axes: 0 for a number, 1 for a list.
  int axes() const { return axes_; }

 private:
  int axes_ = 1;
  py::object keep_;
  std::vector<std::uint32_t> copy_;
  const std::uint32_t* data_ = nullptr;
  std::size_t size_ = 0;
};

/// The structured types of the arrays that answers are returned in.
const py::dtype& pair_type();
const py::dtype& span_type();
const py::dtype& contact_type();
const py::dtype& hit_type();
const py::dtype& ball_hit_type();
const py::dtype& node_type();
const py::dtype& watch_type();
const py::dtype& event_type();
const py::dtype& bound_change_type();

/// The number of calls that run without the interpreter's lock. The registry must not change meanwhile.
std::atomic<int>& unlocked_calls();

/// While it lives in the main thread of Python, an interruption by the user (SIGINT) ends the work of this
/// thread by Interrupted, at its next frame; the former handler is called as well. Made while the lock is
/// held.
class EndsOnInterrupt {
 public:
  EndsOnInterrupt();
  ~EndsOnInterrupt();
  EndsOnInterrupt(const EndsOnInterrupt&) = delete;
  EndsOnInterrupt& operator=(const EndsOnInterrupt&) = delete;

 private:
  std::optional<Interruptible> interruptible_;
};

/// Releases the interpreter's lock for its lifetime.
class Unlocked {
  struct Counted {
    Counted() { ++unlocked_calls(); }
    ~Counted() { --unlocked_calls(); }
  } counted_;  // counted while the lock is held
  EndsOnInterrupt ends_on_interrupt_;
  py::gil_scoped_release released_;
};

/// Returns the object of an instance. Throws a TypeError where there is none: __new__ alone makes an instance
/// without an object.
template <class T>
T& object_of(const py::handle& self) {
  if (!py::isinstance<T>(self)) throw py::type_error("the call is on an object of another class");
  if (!reinterpret_cast<py::detail::instance*>(self.ptr())->get_value_and_holder().holder_constructed())
    throw py::type_error(std::string(py::str(py::type::of(self).attr("__name__"))) +
                         ".__init__ was not called, so there is nothing to ask");
  return *py::cast<T*>(self);
}

/// Makes a member function a method of Python that checks its object.
template <class T, class R, class... A>
auto method(R (T::*function)(A...)) {
  return [function](py::handle self, A... arguments) -> R {
    return (object_of<T>(self).*function)(std::forward<A>(arguments)...);
  };
}
template <class T, class R, class... A>
auto method(R (T::*function)(A...) const) {
  return [function](py::handle self, A... arguments) -> R {
    return (object_of<T>(self).*function)(std::forward<A>(arguments)...);
  };
}

// The parts of the module.
void bind_broad_phase(py::module_& module);
void bind_world(py::module_& module);
void bind_scenes(py::module_& module);
void bind_studies(py::module_& module);
void bind_strategies(py::module_& module);

}  // namespace kbvh::python

namespace pybind11::detail {

template <>
struct type_caster<kbvh::python::Whole> {
  PYBIND11_TYPE_CASTER(kbvh::python::Whole, const_name("int"));
  bool load(handle source, bool /*convert*/) {
    value.value = std::uint32_t(kbvh::python::whole_number(source, "an argument", 0xffffffffU));
    return true;
  }
};

template <>
struct type_caster<kbvh::python::Real> {
  PYBIND11_TYPE_CASTER(kbvh::python::Real, const_name("float"));
  bool load(handle source, bool /*convert*/) {
    value.value = PyUnicode_Check(source.ptr()) ? -1.0 : PyFloat_AsDouble(source.ptr());
    if (!PyUnicode_Check(source.ptr()) && (value.value != -1.0 || PyErr_Occurred() == nullptr)) return true;
    PyErr_Clear();
    throw type_error("an argument is a real number, not " +
                     std::string(pybind11::str(type::handle_of(source).attr("__name__"))));
  }
};

}  // namespace pybind11::detail
