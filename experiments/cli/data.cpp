#include <algorithm>
#include <memory>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* data_examples = R"(Examples:
  kbvh data list                       the data sets of the field: licence, size, what of them is here
  kbvh data list unc-dynamic-scenes    one of them: addresses, converter, how to play it
  kbvh data fetch scalable-ccd-samples
  kbvh data verify scalable-ccd-samples --only cloth-ball
The data folder is $KBVH_DATA; files that were put there by hand count like fetched ones.
Exit codes: 0 all is as it should be, 1 files are missing or wrong, 2 wrong use, 3 a file cannot be fetched.)";

struct DataArguments {
  std::vector<std::string> words;
  std::string only;
};

int run_data(const DataArguments& arguments) {
  const std::vector<std::string> known{"list", "fetch", "verify"};
  if (const std::string& what = arguments.words.front();
      std::find(known.begin(), known.end(), what) == known.end())
    throw io::InputError(no_such("action", what, known));
  std::vector<std::string> words{python(), data_program().string(), data_folder().string()};
  words.insert(words.end(), arguments.words.begin(), arguments.words.end());
  if (!arguments.only.empty()) words.insert(words.end(), {"--only", arguments.only});
  return run_and_wait(words);
}

}  // namespace

void add_data(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("data", "list, fetch and verify the data sets of the field");
  command->footer(data_examples);
  auto a = std::make_shared<DataArguments>();
  add_texts(*command, "words", a->words, "list, fetch or verify, and names of data sets")->required();
  add_text(*command, "--only", a->only, "only files whose path contains this text");
  command->callback([&action, a] { action = [a] { return run_data(*a); }; });
}

}  // namespace kbvh::experiments
