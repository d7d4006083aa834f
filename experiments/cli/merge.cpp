#include "experiments/results/merge.hpp"

#include <memory>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* merge_examples = R"(Examples:
  kbvh merge laptop server --out both
  kbvh merge results/jobs/*/results.jsonl --out results
An input is a results folder, or a file of records; the folder --out may be one of them, or have results. Records are
only appended, word for word: a repeated merge adds nothing, and no input is changed. Of several records of
one configuration the newest counts.)";

int merge(const std::vector<std::string>& inputs, const std::string& out) {
  const MergeOutcome outcome = merge_results({inputs.begin(), inputs.end()}, out);
  for (const std::string& note : outcome.notes) say("note: " + note);
  print((std::filesystem::path(out) / "results.jsonl").string() + ": " + counted(outcome.records, "record") +
        ", " + std::to_string(outcome.added) + " added, " + std::to_string(outcome.repeated) +
        (outcome.repeated == 1 ? " was" : " were") + " there already; " +
        counted(outcome.machines.size(), "machine") + ", " + counted(outcome.commits.size(), "commit") +
        "\n");
  return success;
}

}  // namespace

void add_merge(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("merge", "add the results of several folders up in one");
  command->footer(merge_examples);
  auto inputs = std::make_shared<std::vector<std::string>>();
  auto out = std::make_shared<std::string>();
  add_texts(*command, "inputs", *inputs, "results folders, or files of records")->required();
  add_text(*command, "--out", *out, "folder to which results are added")->required();
  command->callback([&action, inputs, out] { action = [inputs, out] { return merge(*inputs, *out); }; });
}

}  // namespace kbvh::experiments
