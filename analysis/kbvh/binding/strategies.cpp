// Registration of strategies that are written in Python.

#include <pybind11/stl.h>

#include <array>
#include <limits>
#include <map>

#include "open_registry.hpp"
#include "python_strategy.hpp"

namespace kbvh::python {

namespace {

struct Slot {
  std::string id;
  py::object factory;
};

/// Kept for the lifetime of the process: the interpreter may end before static objects do.
std::array<Slot, most_registered>& slots() {
  static auto& all = *new std::array<Slot, most_registered>;
  return all;
}

template <std::size_t slot, class S>
std::unique_ptr<Strategy<S>> make_in_slot(const SceneView<S>& scene, Playback<S>& playback,
                                          Topologies topologies, const Params& params) {
  return std::make_unique<PythonStrategy<S>>(slot, slots()[slot].id, scene, playback, std::move(topologies),
                                             params);
}
template <class S, std::size_t... slot>
StrategyEntry::Factory<S> factory_of(std::size_t wanted, std::index_sequence<slot...>) {
  constexpr StrategyEntry::Factory<S> all[] = {&make_in_slot<slot, S>...};
  return all[wanted];
}

template <class Enum>
Enum chosen(const std::string& word, const std::vector<std::pair<const char*, Enum>>& known,
            const std::string& what) {
  std::string words;
  for (const auto& [name, value] : known) {
    if (word == name) return value;
    words += (words.empty() ? "" : ", ") + std::string(name);
  }
  throw ConfigError(what + " is one of " + words + ", not '" + word + "'");
}

Parameter parameter_of(const py::dict& given) {
  Parameter out;
  out.name = given["name"].cast<std::string>();
  out.default_value = given["default"].cast<std::string>();
  out.meaning = given["meaning"].cast<std::string>();
  out.allowed = given["allowed"].cast<std::vector<std::string>>();
  out.least = given["least"].cast<double>();
  out.most = given["most"].cast<double>();
  out.numbers = given["whole"].cast<bool>() ? kbvh::Numbers::whole : kbvh::Numbers::any;
  return out;
}

/// Registers a strategy; `factory` is called as factory(scene, params, motion) and returns its object.
void register_strategy(const py::dict& given, const std::string& about, const py::object& factory) {
  if (unlocked_calls() > 0)
    throw std::logic_error("strategies cannot be registered while another thread plays one");
  Info info;
  info.id = given["id"].cast<std::string>();
  const std::string what = "strategy '" + info.id + "': its ";
  if (info.id.empty() ||
      info.id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") != std::string::npos)
    throw ConfigError("the id of a strategy is a word of a to z, 0 to 9 and _, not '" + info.id + "'");
  info.title = given["title"].cast<std::string>();
  info.family = "python";
  info.citation = given["citation"].cast<std::string>();
  info.tightness = chosen<Tightness>(
      given["tightness"].cast<std::string>(),
      {{"tight", Tightness::tight}, {"conservative", Tightness::conservative}, {"none", Tightness::none}},
      what + "tightness");
  info.guarantee = chosen<Guarantee>(given["guarantee"].cast<std::string>(),
                                     {{"exact", Guarantee::exact}, {"approximate", Guarantee::approximate}},
                                     what + "guarantee");
  info.foresight = chosen<Foresight>(given["foresight"].cast<std::string>(),
                                     {{"none", Foresight::none},
                                      {"step_bound", Foresight::step_bound},
                                      {"next_keyframe", Foresight::next_keyframe},
                                      {"whole_clip", Foresight::whole_clip}},
                                     what + "foresight");
  info.primitives.clear();
  for (const std::string& word : given["primitives"].cast<std::vector<std::string>>())
    info.primitives.push_back(chosen<PrimitiveKind>(word,
                                                    {{"polygons", PrimitiveKind::polygons},
                                                     {"points", PrimitiveKind::points},
                                                     {"control_nets", PrimitiveKind::control_nets}},
                                                    what + "primitives"));
  const py::object topology = given["topology"];
  info.topology.own = topology.is_none();
  if (!info.topology.own) {
    const auto words = topology.cast<std::map<std::string, std::string>>();
    const auto whole = [&](const char* key, std::uint32_t& number) {
      const auto found = words.find(key);
      if (found == words.end()) return;
      if (found->second.empty() || found->second.size() > 2 ||
          found->second.find_first_not_of("0123456789") != std::string::npos)
        throw ConfigError(what + key + " cannot be '" + found->second + "'");
      number = std::uint32_t(std::stoul(found->second));
    };
    for (const auto& [key, value] : words)
      if (key != "method" && key != "width" && key != "leaf_size")
        throw ConfigError(what + "topology has the keys method, width and leaf_size, not '" + key + "'");
    if (words.contains("method")) info.topology.preferred.method = build_method(words.at("method"));
    whole("width", info.topology.preferred.width);
    whole("leaf_size", info.topology.preferred.leaf_size);
    suitable_builder(info, {}, {}, {});
  }
  for (const py::handle parameter : given["parameters"])
    info.parameters.push_back(parameter_of(parameter.cast<py::dict>()));
  info.max_primitive_pairs = whole_number(given["max_primitive_pairs"], what + "max_primitive_pairs",
                                          std::numeric_limits<std::uint64_t>::max());
  for (const std::string& word : given["abilities"].cast<std::vector<std::string>>()) {
    bool Capabilities::*const ability =
        chosen<bool Capabilities::*>(word,
                                     {{"spans", &Capabilities::spans},
                                      {"self_pairs", &Capabilities::self_pairs},
                                      {"contacts", &Capabilities::contacts},
                                      {"plan_changes", &Capabilities::plan_changes}},
                                     what + "ability");
    info.can.*ability = true;
  }
  // Like make_entry for strategies in C++: without foresight of lines, no strategy expects them.
  info.can.curves = info.foresight <= Foresight::step_bound;
  info.has_float = info.has_double = true;
  const std::string id = info.id;
  const std::size_t slot = slot_for(id);
  using All = std::make_index_sequence<most_registered>;
  register_entry(slot,
                 {.info = std::move(info),
                  .make_float = factory_of<float>(slot, All{}),
                  .make_double = factory_of<double>(slot, All{})},
                 about);
  slots()[slot] = {id, factory};
}

}  // namespace

py::object make_object(std::size_t slot, const py::dict& scene, const py::dict& params,
                       const std::shared_ptr<MotionHandle>& motion) {
  return slots()[slot].factory(scene, params, motion);
}

std::string_view lasting(const std::string& text) {
  static auto& texts = *new std::set<std::string>;
  return *texts.insert(text).first;
}

void bind_strategies(py::module_& module) {
  using py::arg;
  using Handle = MotionHandle;
  const auto of = [](const py::handle& self, std::uint32_t body) -> const AnyMotion& {
    return object_of<Handle>(self).of(body);
  };
  py::class_<Handle, std::shared_ptr<Handle>>(module, "Motion")
      .def_property_readonly("time", [](py::handle self) { return object_of<Handle>(self).motion().time(); })
      .def(
          "positions", [of](py::handle self, Whole body) { return of(self, body).positions(body); },
          arg("body"))
      .def(
          "displacement_bound",
          [of](py::handle self, Whole body, Real t0, Real t1) {
            return of(self, body).displacement_bound(body, t0, t1);
          },
          arg("body"), arg("t0"), arg("t1"))
      .def(
          "lines_begin", [of](py::handle self, Whole body) { return of(self, body).lines_begin(body); },
          arg("body"))
      .def(
          "lines_end", [of](py::handle self, Whole body) { return of(self, body).lines_end(body); },
          arg("body"))
      .def(
          "positions_on_lines",
          [of](py::handle self, Whole body, Real t) { return of(self, body).positions_on_lines(body, t); },
          arg("body"), arg("t"))
      .def(
          "keyframe_times", [of](py::handle self, Whole body) { return of(self, body).keyframe_times(body); },
          arg("body"))
      .def(
          "keyframe", [of](py::handle self, Whole body, Whole k) { return of(self, body).keyframe(body, k); },
          arg("body"), arg("k"));
  module.def("register_strategy", &register_strategy, arg("description"), arg("about"), arg("factory"));
}

}  // namespace kbvh::python
