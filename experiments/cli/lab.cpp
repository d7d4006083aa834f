#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "experiments/cli/commands.hpp"
#include "experiments/cli/options.hpp"
#include "experiments/cli/program.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/output.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

namespace {

constexpr const char* lab_examples = R"(Examples:
  kbvh lab
  kbvh lab --study results --port 8080
shows the lab, which `experiments/lab` builds, to browsers on this machine, until Ctrl+C, and opens it in one if there is a
screen; with a study, its scenes are in the lab's menu. The lab also works without this server: open index.html or lab.html of its folder.)";

struct LabOptions {
  std::string folder, study;
  std::uint64_t port = 8017;
};

bool is_lab(const std::filesystem::path& folder) {
  std::error_code error;
  return std::filesystem::is_regular_file(folder / "index.html", error);
}

int serve(const LabOptions& options) {
  std::error_code error;
  if (!options.study.empty() &&
      !std::filesystem::is_directory(std::filesystem::path(options.study) / "scenes", error))
    throw io::InputError("--study: there is no folder scenes in " + io::printable(options.study) +
                         " (`kbvh run --out FOLDER` makes one)");
  const std::filesystem::path analysis = analysis_folder();
  std::filesystem::path folder = options.folder;
  if (!folder.empty() && !is_lab(folder))
    throw io::InputError("--folder: there is no built lab in " + io::printable(options.folder));
  if (folder.empty()) folder = analysis.parent_path() / "build" / "lab";
  if (!is_lab(folder))
    throw io::InputError("there is no built lab in " + folder.string() +
                         " (`experiments/lab` makes it; --folder names another)");
  std::vector<std::string> words{python(),
                                 (analysis / "lab" / "serve.py").string(),
                                 folder.string(),
                                 "--port",
                                 std::to_string(options.port),
                                 "--open"};
  if (!options.study.empty()) words.insert(words.end(), {"--study", options.study});
  // The server takes this process's place, and with it the signals that end it.
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execvp(arguments[0], arguments.data());
  throw io::InputError("cannot start " + words[0] + ": " + std::strerror(errno));
}

}  // namespace

void add_lab(CLI::App& program, Action& action) {
  CLI::App* command = program.add_subcommand("lab", "serve the lab in the browser, on this machine only");
  command->footer(lab_examples);
  auto o = std::make_shared<LabOptions>();
  add_text(*command, "--folder", o->folder, "the built lab (build/lab)");
  add_text(*command, "--study", o->study, "a folder of `kbvh run`, whose scenes the lab shows");
  add_whole(*command, "--port", o->port, {0, 65535}, "(8017; 0: a free one)");
  command->callback([&action, o] { action = [o] { return serve(*o); }; });
}

}  // namespace kbvh::experiments
