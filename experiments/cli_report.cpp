#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <system_error>

#include "experiments/cli.hpp"
#include "experiments/environment.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/program.hpp"
#include "experiments/progress.hpp"

extern char** environ;

namespace kbvh::experiments {

namespace {

constexpr const char* examples = R"(Example:
  kbvh report --out results
writes results/report.html, self-contained, its figures and results/claims.json, from results/results.jsonl and what lies
beside it: targets.json (bench), theory.json, stress.json, ccd.json. Commands that make those take the same --out.)";

int report(const std::string& out, const std::string& title) {
  const std::filesystem::path results = std::filesystem::path(out) / "results.jsonl";
  std::error_code error;
  if (!std::filesystem::is_regular_file(results, error))
    throw io::InputError("there is no " + results.string() + " (`kbvh run --out " + out + "` makes it)");
  std::vector<std::string> words{python(), (analysis_folder() / "report.py").string(), out};
  if (!title.empty()) words.insert(words.end(), {"--title", title});
  const int code = run_and_wait(words);
  if (code == 0) return success;
  say("the report was not made: " + words[1] + " ended with " + std::to_string(code));
  return code == wrong_use ? wrong_use : internal_error;
}

}  // namespace

int run_and_wait(std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  if (const int error = ::posix_spawnp(&child, arguments[0], nullptr, nullptr, arguments.data(), environ))
    throw io::InputError("cannot start " + words[0] + ": " + std::strerror(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "waitpid");
  return WIFEXITED(status) ? WEXITSTATUS(status) : internal_error;
}

void add_report(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("report", "tables and figures of a result folder");
  command->footer(examples);
  auto out = std::make_shared<std::string>(), title = std::make_shared<std::string>();
  command->add_option("--out", *out, "folder with results.jsonl")->required();
  command->add_option("--title", *title, "of the report");
  command->callback([&action, out, title] { action = [out, title] { return report(*out, *title); }; });
}

}  // namespace kbvh::experiments
