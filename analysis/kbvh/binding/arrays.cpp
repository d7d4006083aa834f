#include "arrays.hpp"

#include <cstddef>
#include <limits>

#include "core/facade/world.hpp"

namespace kbvh::python {

namespace {

struct Field {
  const char* name;
  py::object format;
  std::size_t offset;
};

py::dtype structured(const std::vector<Field>& fields, std::size_t size) {
  py::list names, formats, offsets;
  for (const Field& field : fields) {
    names.append(field.name);
    formats.append(field.format);
    offsets.append(field.offset);
  }
  return py::dtype(std::move(names), std::move(formats), std::move(offsets), py::ssize_t(size));
}

/// Keeps a type for the lifetime of the process: the interpreter may end before static objects do.
const py::dtype& kept(py::dtype type) {
  return *new py::dtype(std::move(type));
}

py::object u1() {
  return py::dtype("u1");
}
py::object u4() {
  return py::dtype("u4");
}
py::object f8() {
  return py::dtype("f8");
}
py::object truth() {
  return py::dtype("?");
}
py::object vector3() {
  return py::dtype::from_args(py::make_tuple("f8", py::make_tuple(3)));
}

std::string in_words(const py::object& given) {
  return py::str(py::type::of(given).attr("__name__"));
}

}  // namespace

Numbers::Numbers(const py::object& given, const std::string& what) {
  if (py::isinstance<py::array>(given)) {
    const auto array = py::reinterpret_borrow<py::array>(given);
    const bool in_order = (array.flags() & py::array::c_style) != 0;
    if (in_order && py::isinstance<py::array_t<float>>(array)) {
      array_ = array;
      single_ = true;
      return;
    }
    if (in_order && py::isinstance<py::array_t<double>>(array)) {
      array_ = array;
      return;
    }
  }
  const auto converted = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(given);
  if (!converted) {
    PyErr_Clear();
    throw std::invalid_argument(what + " is no array of numbers, but " + in_words(given));
  }
  array_ = converted;
}

void Numbers::check_points(const std::string& what) const {
  if (array_.ndim() > 1 && array_.shape(array_.ndim() - 1) != 3)
    throw std::invalid_argument(what + " has points of " + std::to_string(array_.shape(array_.ndim() - 1)) +
                                " coordinates, not 3");
}

std::vector<double> doubles_of(const py::object& given, const std::string& what) {
  const Numbers numbers(given, what);
  if (numbers.single()) return {numbers.floats().begin(), numbers.floats().end()};
  return {numbers.doubles().begin(), numbers.doubles().end()};
}

Ids::Ids(const py::object& given, const std::string& what) {
  py::array array;
  if (py::isinstance<py::array>(given)) {
    array = py::reinterpret_borrow<py::array>(given);
  } else {
    array = py::array::ensure(given);
    if (!array) {
      PyErr_Clear();
      throw std::invalid_argument(what + " are no ids, but " + in_words(given));
    }
  }
  if (py::isinstance<py::array_t<std::uint32_t>>(array) && (array.flags() & py::array::c_style) != 0) {
    keep_ = array;
    data_ = static_cast<const std::uint32_t*>(array.data());
    size_ = std::size_t(array.size());
    return;
  }
  const char kind = array.dtype().kind();
  if (array.size() > 0 && kind != 'i' && kind != 'u')
    throw std::invalid_argument(what + " are no whole numbers, but " + std::string(py::str(array.dtype())));
  const auto wide = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
  copy_.reserve(std::size_t(wide.size()));
  for (py::ssize_t i = 0; i < wide.size(); ++i) {
    const std::int64_t id = wide.data()[i];
    if (id < 0 || id > std::numeric_limits<std::uint32_t>::max())
      throw std::invalid_argument(what + ": " + std::to_string(id) + " cannot be an id");
    copy_.push_back(std::uint32_t(id));
  }
  data_ = copy_.data();
  size_ = copy_.size();
}

const py::dtype& pair_type() {
  static const py::dtype& type = kept(structured({{"body_a", u4(), offsetof(WorldPair, body_a)},
                                                  {"primitive_a", u4(), offsetof(WorldPair, primitive_a)},
                                                  {"body_b", u4(), offsetof(WorldPair, body_b)},
                                                  {"primitive_b", u4(), offsetof(WorldPair, primitive_b)}},
                                                 sizeof(WorldPair)));
  return type;
}
const py::dtype& span_type() {
  static const py::dtype& type =
      kept(structured({{"body_a", u4(), offsetof(WorldSpan, pair.body_a)},
                       {"primitive_a", u4(), offsetof(WorldSpan, pair.primitive_a)},
                       {"body_b", u4(), offsetof(WorldSpan, pair.body_b)},
                       {"primitive_b", u4(), offsetof(WorldSpan, pair.primitive_b)},
                       {"begin", f8(), offsetof(WorldSpan, begin)},
                       {"end", f8(), offsetof(WorldSpan, end)}},
                      sizeof(WorldSpan)));
  return type;
}
const py::dtype& contact_type() {
  static const py::dtype& type = kept(structured({{"kind", u1(), offsetof(WorldContact, kind)},
                                                  {"body_a", u4(), offsetof(WorldContact, body_a)},
                                                  {"feature_a", u4(), offsetof(WorldContact, feature_a)},
                                                  {"body_b", u4(), offsetof(WorldContact, body_b)},
                                                  {"feature_b", u4(), offsetof(WorldContact, feature_b)},
                                                  {"begin", f8(), offsetof(WorldContact, begin)},
                                                  {"end", f8(), offsetof(WorldContact, end)}},
                                                 sizeof(WorldContact)));
  return type;
}
const py::dtype& hit_type() {
  static const py::dtype& type = kept(structured({{"body", u4(), offsetof(WorldHit, body)},
                                                  {"primitive", u4(), offsetof(WorldHit, primitive)},
                                                  {"parameter", f8(), offsetof(WorldHit, parameter)}},
                                                 sizeof(WorldHit)));
  return type;
}
const py::dtype& node_type() {
  static const py::dtype& type = kept(structured({{"parent", u4(), offsetof(WorldNode, parent)},
                                                  {"first", u4(), offsetof(WorldNode, first)},
                                                  {"count", u4(), offsetof(WorldNode, count)},
                                                  {"leaf", truth(), offsetof(WorldNode, leaf)},
                                                  {"stale", truth(), offsetof(WorldNode, stale)},
                                                  {"lower", vector3(), offsetof(WorldNode, lower)},
                                                  {"upper", vector3(), offsetof(WorldNode, upper)},
                                                  {"event_node", u4(), offsetof(WorldNode, event_node)}},
                                                 sizeof(WorldNode)));
  return type;
}
const py::dtype& watch_type() {
  static const py::dtype& type = kept(structured({{"body", u4(), offsetof(WorldWatch, body)},
                                                  {"node", u4(), offsetof(WorldWatch, node)},
                                                  {"other_body", u4(), offsetof(WorldWatch, other_body)},
                                                  {"other_node", u4(), offsetof(WorldWatch, other_node)},
                                                  {"overlapping", truth(), offsetof(WorldWatch, overlapping)},
                                                  {"listed", truth(), offsetof(WorldWatch, listed)}},
                                                 sizeof(WorldWatch)));
  return type;
}
const py::dtype& event_type() {
  static const py::dtype& type = [&]() -> const py::dtype& {
    const py::dtype piece = structured({{"t0", f8(), offsetof(WorldPiece, t0)},
                                        {"t1", f8(), offsetof(WorldPiece, t1)},
                                        {"x0", f8(), offsetof(WorldPiece, x0)},
                                        {"x1", f8(), offsetof(WorldPiece, x1)},
                                        {"ray", truth(), offsetof(WorldPiece, ray)}},
                                       sizeof(WorldPiece));
    return kept(structured({{"kind", u1(), offsetof(WorldEvent, kind)},
                            {"body", u4(), offsetof(WorldEvent, body)},
                            {"node", u4(), offsetof(WorldEvent, node)},
                            {"side", u4(), offsetof(WorldEvent, side)},
                            {"winner", u4(), offsetof(WorldEvent, winner)},
                            {"loser", u4(), offsetof(WorldEvent, loser)},
                            {"other_body", u4(), offsetof(WorldEvent, other_body)},
                            {"other_node", u4(), offsetof(WorldEvent, other_node)},
                            {"time", f8(), offsetof(WorldEvent, time)},
                            {"error", f8(), offsetof(WorldEvent, error)},
                            {"exact", truth(), offsetof(WorldEvent, exact)},
                            {"winner_piece", piece, offsetof(WorldEvent, winner_piece)},
                            {"loser_piece", piece, offsetof(WorldEvent, loser_piece)}},
                           sizeof(WorldEvent)));
  }();
  return type;
}
const py::dtype& bound_change_type() {
  static const py::dtype& type =
      kept(structured({{"body", u4(), offsetof(WorldBoundChange, body)},
                       {"node", u4(), offsetof(WorldBoundChange, node)},
                       {"side", u4(), offsetof(WorldBoundChange, side)},
                       {"old_vertex", u4(), offsetof(WorldBoundChange, old_vertex)},
                       {"new_vertex", u4(), offsetof(WorldBoundChange, new_vertex)}},
                      sizeof(WorldBoundChange)));
  return type;
}

std::atomic<int>& unlocked_calls() {
  static std::atomic<int> calls{0};
  return calls;
}

}  // namespace kbvh::python
