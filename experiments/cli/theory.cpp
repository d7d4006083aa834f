#include <filesystem>
#include <memory>
#include <optional>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/results/result_file.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/theory/theory.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* theory_examples = R"(Examples:
  kbvh theory
  kbvh theory --scenes waving_sheet --sizes 500,1000,2000,4000,8000,16000 --out results/theory
  kbvh theory --full --out results/theory
Checks the claims of Zachmann & Weller 2006 against counts and exact arithmetic, without a clock. DIR/theory.json has
the table with all numbers, DIR/figures the growth of the counts, DIR/theory.jsonl each measurement as soon as it is
made: an interrupted run continues from it. Exit codes: 0 done, with any verdicts; 2 wrong use, 3 other error.)";

struct TheoryArguments {
  std::string out;
  std::vector<std::string> scenes;
  std::vector<std::uint32_t> sizes;
  std::uint32_t keyframes = 0, exact_limit = 0, instants = 0;
  bool quick = false, full = false, no_figures = false;
};

int run(const TheoryArguments& arguments) {
  theory::TheoryOptions options = arguments.full ? theory::full_theory() : theory::quick_theory();
  for (const std::string& scene : arguments.scenes) find_builtin_scene(scene);
  if (!arguments.scenes.empty()) options.scenes = arguments.scenes;
  if (!arguments.sizes.empty()) options.sizes = arguments.sizes;
  if (arguments.keyframes > 0) options.keyframes = arguments.keyframes;
  if (arguments.exact_limit > 0) options.exact_limit = arguments.exact_limit;
  if (arguments.instants > 0) options.instants = arguments.instants;
  const std::filesystem::path folder = arguments.out;
  std::optional<ResultFile> file;
  if (!arguments.out.empty()) file.emplace(folder, "theory.json", theory::options_record(options));
  theory::MeasurementStore store(arguments.out.empty() ? std::filesystem::path() : folder / "theory.jsonl",
                                 program_identity());
  Progress progress;
  const theory::TheoryReport report =
      theory::run_theory(options, store, [&](const std::string& what) { progress.show(what); });
  progress.clear();
  print(theory::claims_table(report.claims));
  for (const std::string& note : report.notes) say(note);
  if (!file) return success;
  file->write(theory::to_json(report, options));
  say("all numbers are in " + file->path().string());
  if (arguments.no_figures) return success;
  const std::string script = (analysis_folder() / "theory_figures.py").string();
  const int code = run_and_wait({python(), script, arguments.out});
  if (code == 0) return success;
  say("the figures were not drawn: " + script + " ended with " + std::to_string(code));
  return internal_error;
}

}  // namespace

void add_theory(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("theory", "check the paper's claims by exact counts");
  command->footer(theory_examples);
  auto a = std::make_shared<TheoryArguments>();
  add_words(*command, "--scenes", a->scenes, "built-in scenes; `kbvh list` shows them");
  add_wholes(*command, "--sizes", a->sizes, {1, 1u << 24},
             "triangles of each scene; a fit needs six or more sizes (250 to 8000)");
  add_whole(*command, "--keyframes", a->keyframes, {2, 100000}, "keyframes of built-in scenes (30)");
  add_whole(*command, "--exact-limit", a->exact_limit, {1, 1u << 24},
            "largest size checked against exact envelopes (500)");
  add_whole(*command, "--instants", a->instants, {1, 1000000}, "times audited between keyframes (200)");
  add_text(*command, "--out", a->out, "folder for theory.json and figures (none: the table only)");
  command->add_flag("--no-figures", a->no_figures, "do not draw figures, which need Python and matplotlib");
  CLI::Option* quick = command->add_flag("--quick", a->quick, "the extent of CI: the default");
  command->add_flag("--full", a->full, "up to 580k triangles, exact up to 16k, whole sequences: hours")
      ->excludes(quick);
  command->callback([&action, a] { action = [a] { return run(*a); }; });
}

}  // namespace kbvh::experiments
