// The module kbvh._core: the façade, scenes, studies and strategies in Python, for the package kbvh.

#include "arrays.hpp"
#include "core/base/params.hpp"
#include "experiments/io/animated_mesh.hpp"

PYBIND11_MODULE(_core, module) {
  namespace py = pybind11;
  using namespace kbvh::python;
  module.doc() = "The compiled part of kbvh; use the package kbvh.";
  static py::exception<void> base(module, "KbvhError", PyExc_ValueError);
  base.attr("__doc__") =
      "Wrong input: a configuration, a file, a plan. The text names the value and its place.";
  py::register_exception<kbvh::ConfigError>(module, "ConfigError", base.ptr()).attr("__doc__") =
      "A strategy, parameter or topology that does not exist or does not fit.";
  py::register_exception<kbvh::io::InputError>(module, "InputError", base.ptr()).attr("__doc__") =
      "A file, a scene or a plan that cannot be read.";
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const kbvh::Interrupted&) {
      // The handler of the signal, if it has not been called: else it would be, once more, later.
      if (PyErr_CheckSignals() == 0) PyErr_SetNone(PyExc_KeyboardInterrupt);
    }
  });
  bind_world(module);
  bind_scenes(module);
  bind_studies(module);
  bind_strategies(module);
  bind_broad_phase(module);
}
