#include <pybind11/stl.h>

#include "arrays.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/output.hpp"
#include "experiments/run/run_plan.hpp"
#include "experiments/study/strategy_record.hpp"

namespace kbvh::python {

namespace {

using namespace experiments;

Plan plan_of(const std::string& text, const std::string& place, const std::string& folder) {
  return read_plan(nlohmann::json::parse(text), place, folder);
}

/// Runs a plan; returns the printed tables and what became of the configurations.
py::dict run(const std::string& text, const std::string& place, const std::string& folder,
             const std::string& out) {
  static bool running = false;  // guarded by the interpreter's lock
  if (running) throw std::logic_error("another study is running in this process");
  const Plan plan = plan_of(text, place, folder);
  running = true;
  struct Done {
    ~Done() { running = false; }
  } done;
  StudyOutcome outcome;
  PrintedText printed;
  {
    const Unlocked unlocked;
    outcome = run_plan(plan, out);
  }
  py::dict result;
  result["tables"] = printed.text();
  result["measured"] = outcome.measured;
  result["skipped"] = outcome.skipped;
  result["refused"] = outcome.refused;
  result["unfinished"] = outcome.unfinished;
  return result;
}

/// Reads and expands a plan without running it, as JSON: for each study its scenes and its contestants.
std::string expanded(const std::string& text, const std::string& place, const std::string& folder) {
  const Plan plan = plan_of(text, place, folder);
  nlohmann::json studies = nlohmann::json::array();
  std::vector<std::string> notes;
  for (const Study& study : plan.studies) {
    nlohmann::json contestants = nlohmann::json::array(), scenes = nlohmann::json::array();
    for (const ContestantSpec& spec : expand(study.strategies, study.params, study.builder, notes))
      contestants.push_back(strategy_record(spec));
    for (const SceneSpec& spec : study.scenes)
      scenes.push_back({{"builtin", spec.builtin},
                        {"name", given_name(spec)},
                        {"triangles", spec.options.triangles},
                        {"keyframes", spec.options.keyframes},
                        {"seed", spec.options.seed},
                        {"order", experiments::word(spec.order)}});
    studies.push_back({{"study", study.name},
                       {"scenes", scenes},
                       {"contestants", contestants},
                       {"l", study.per_keyframe},
                       {"scalars", study.scalars},
                       {"repetitions", study.repetitions}});
  }
  return nlohmann::json{{"studies", studies}, {"notes", notes}}.dump();
}

}  // namespace

void bind_studies(py::module_& module) {
  using py::arg;
  module.def("run", &run, arg("plan"), arg("place"), arg("folder"), arg("out"));
  module.def("expand_plan", &expanded, arg("plan"), arg("place"), arg("folder"));
  module.def("machine", [] { return machine().dump(); });
  module.def("commit", &commit);
}

}  // namespace kbvh::python
