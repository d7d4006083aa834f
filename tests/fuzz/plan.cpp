#include "experiments/study/plan.hpp"

#include "tests/fuzz/input_file.hpp"

// A plan file is read, and its contestants are expanded; no scene is loaded.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kbvh;
  static const fuzz::InputFolder folder;
  try {
    const experiments::Plan plan = experiments::load_plan(folder.write("plan.json", data, size));
    std::vector<std::string> notes;
    for (const experiments::Study& study : plan.studies)
      experiments::expand(study.strategies, study.params, study.builder, notes);
  } catch (const io::InputError&) {
  } catch (const ConfigError&) {
  }
  return 0;
}
