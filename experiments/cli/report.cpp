#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <system_error>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/io/animated_mesh.hpp"

extern char** environ;

namespace kbvh::experiments {

namespace {

constexpr const char* report_examples = R"(Example:
  kbvh report --out results
writes results/report.html and results/explorer.html, each self-contained, the report's figures and
results/claims.json, from results/results.jsonl and the files next to it: targets.json (bench), theory.json, stress.json, ccd.json. The commands that write those take the
same --out.)";

constexpr const char* explore_examples = R"(Example:
  kbvh merge laptop server --out both && kbvh explore --out both
writes both/explorer.html, a page of all results in both/results.jsonl: filters, performance profiles, ratios to any
contestant, two commits or machines side by side. It needs no network. `kbvh report` writes it, too, next to
the static report.)";

/// Runs a script of the analysis folder on a results folder.
int report(const std::string& script, const std::string& out, const std::string& title) {
  const std::filesystem::path results = std::filesystem::path(out) / "results.jsonl";
  std::error_code error;
  if (!std::filesystem::is_regular_file(results, error) &&
      !std::filesystem::is_regular_file(results.string() + ".xz", error))
    throw io::InputError("there is no " + results.string() + " (`kbvh run --out " + out + "` makes it)");
  std::vector<std::string> words{python(), (analysis_folder() / script).string(), out};
  if (!title.empty()) words.insert(words.end(), {"--title", title});
  const int code = run_and_wait(words);
  if (code == 0) return success;
  say("the page was not made: " + words[1] + " ended with " + std::to_string(code));
  return code == wrong_use ? wrong_use : internal_error;
}

/// Prints everything that can be read from a descriptor.
void pass_on(int descriptor) {
  char bytes[4096];
  for (;;) {
    const ssize_t n = ::read(descriptor, bytes, sizeof bytes);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;
    print({bytes, std::size_t(n)});
  }
}

}  // namespace

int run_and_wait(std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  // The program's output passes through here, so that a full disk is reported in one way.
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  if (error == 0) pass_on(ends[0]);
  ::close(ends[0]);
  if (error != 0) throw io::InputError("cannot start " + words[0] + ": " + std::strerror(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "waitpid");
  return WIFEXITED(status) ? WEXITSTATUS(status) : internal_error;
}

namespace {
void add_page(CLI::App& command, Action& action, const std::string& script) {
  auto out = std::make_shared<std::string>(), title = std::make_shared<std::string>();
  add_text(command, "--out", *out, "folder with results.jsonl")->required();
  add_text(command, "--title", *title, "title of the page");
  command.callback([&action, out, title, script] {
    action = [out, title, script] { return report(script, *out, *title); };
  });
}
}  // namespace

void add_report(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("report", "write tables and figures of a result folder");
  command->footer(report_examples);
  add_page(*command, action, "report.py");
}

void add_explore(CLI::App& program, Action& action) {
  CLI::App* command =
      program.add_subcommand("explore", "write the explorer of a result folder: a page with filters");
  command->footer(explore_examples);
  add_page(*command, action, "explore.py");
}

}  // namespace kbvh::experiments
