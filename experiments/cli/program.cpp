#include "experiments/cli/program.hpp"

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/params.hpp"
#include "experiments/cli/commands.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/output.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/run/in_progress.hpp"

namespace kbvh::experiments {

namespace {

/// Makes one line of a message, without control characters. Cuts the middle of overlong values, lists or
/// paths, because both ends are informative; between words if one ends nearby.
std::string one_line(std::string text) {
  constexpr std::size_t longest = 290, tail = 90;
  for (char& c : text)
    if (const auto byte = static_cast<unsigned char>(c); byte < 32 || byte == 127) c = c == '\n' ? ' ' : '?';
  text.erase(text.find_last_not_of(' ') + 1);
  if (text.size() <= longest) return text;
  // Does not split a character of several bytes.
  const auto continues = [&](std::size_t at) { return (text[at] & 0xc0) == 0x80; };
  std::size_t head = longest - tail - 5, rest = text.size() - tail;
  while (head > 0 && continues(head)) --head;
  while (rest < text.size() && continues(rest)) ++rest;
  constexpr std::size_t nearby = 40;
  if (const std::size_t space = text.rfind(' ', head); space != text.npos && head - space < nearby)
    head = space;
  if (const std::size_t space = text.find(' ', rest - 1); space != text.npos && space + 1 - rest < nearby)
    rest = space + 1;
  return text.substr(0, head) + " ... " + text.substr(rest);
}

std::string version() {
  return "kbvh, commit " + commit() + (dirty() ? " with changes" : "");
}

/// Returns the options of a command as they are written.
std::vector<std::string> options_of(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

/// Composes the message about words that no option takes.
std::string unexpected(const CLI::App& program) {
  const auto called = program.get_subcommands();
  const CLI::App& command = called.empty() ? program : *called.front();
  const std::string name = called.empty() ? "kbvh" : "kbvh " + command.get_name();
  const std::vector<std::string> extras = program.remaining(true);
  for (const std::string& word : extras) {
    if (!word.starts_with("-")) continue;
    const std::string option = word.substr(0, word.find('='));
    const std::vector<std::string> known = options_of(command);
    if (std::find(known.begin(), known.end(), option) != known.end())
      return option + " belongs behind the command, as in " + name + " " + option;
    return name + " has no option " + io::printable(option) + suggestion(option, known) + " (try " + name +
           " --help)";
  }
  return name + " cannot use the word " + io::printable(extras.empty() ? "" : extras.front()) + " (try " +
         name + " --help)";
}

/// CLI11 uses the word after "--out=" as the missing value.
std::optional<std::string> option_without_value(int argc, const char* const* argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word.starts_with("--") && word.ends_with('=') && word.find('=') + 1 == word.size())
      return std::string(word.substr(0, word.size() - 1));
  }
  return {};
}

/// Returns the exit code, after a message if some output was not written.
int finished(int code) {
  const std::string why = output_failure();
  if (why.empty()) return code;
  say("standard output cannot be written: " + why);
  return code == success ? internal_error : code;
}

/// Reports the work during which a library called std::terminate, and ends the program. Embree calls it when
/// memory for one of its threads runs out.
[[noreturn]] void say_terminated() {
  std::string why = "terminated by a library, without an exception";
  if (const std::exception_ptr thrown = std::current_exception()) {
    try {
      std::rethrow_exception(thrown);
    } catch (const std::exception& problem) {
      why = "terminated by an exception: " + one_line(problem.what());
    } catch (...) {
      why = "terminated by an exception of an unknown type";
    }
  }
  InProgress::note_termination();
  const std::string& work = Progress::activity();
  say("internal error: " + why + (work.empty() ? "" : ", during " + work) +
      "; out of memory, perhaps (ulimit -v). What this scene has measured is lost, other results are kept");
  std::_Exit(internal_error);
}

int wrong(const std::string& what) {
  say(one_line(what));
  return finished(wrong_use);
}

}  // namespace

int run_program(int argc, const char* const* argv) {
  prepare_output();
  std::set_terminate(&say_terminated);
  Action action;
  CLI::App program("kbvh compares ways to keep bounding volume hierarchies valid while meshes deform.",
                   "kbvh");
  program.set_version_flag("--version", version());
  program.footer(
      "Example:\n  kbvh run --scene tablecloth --triangles 2000 --out results && kbvh report --out results\n"
      "Each command has its own --help.");
  program.require_subcommand(1);
  add_list(program, action);
  add_run(program, action);
  add_bench(program, action);
  add_report(program, action);
  add_explore(program, action);
  add_merge(program, action);
  add_scene(program, action);
  add_theory(program, action);
  add_stress(program, action);
  add_ccd(program, action);
  add_loop(program, action);
  add_lab(program, action);
  add_data(program, action);
  // CLI11 would only say that a command is missing.
  std::vector<std::string> commands;
  for (const CLI::App* command : program.get_subcommands({})) commands.push_back(command->get_name());
  if (argc > 1 && argv[1][0] != '-' && std::find(commands.begin(), commands.end(), argv[1]) == commands.end())
    return wrong("there is no command " + io::printable(argv[1]) + "; known are " + joined(commands) +
                 suggestion(argv[1], commands) + " (try --help)");
  if (argc < 2) return wrong("a command is missing; known are " + joined(commands) + " (try --help)");
  if (const auto option = option_without_value(argc, argv))
    return wrong(*option + ": is empty, but needs a value (try --help)");
  try {
    program.parse(argc, argv);
  } catch (const CLI::ExtrasError&) {
    return wrong(unexpected(program));
  } catch (const CLI::ParseError& problem) {
    // Without a command, CLI11 does not say that it knows no such option either.
    if (problem.get_exit_code() != 0 && program.get_subcommands().empty()) return wrong(unexpected(program));
    if (problem.get_exit_code() != 0) return wrong(std::string(problem.what()) + " (try --help)");
    // Help and version arrive here as well, and print themselves.
    std::ostringstream text;
    program.exit(problem, text, text);
    print(text.str());
    return finished(success);
  }
  try {
    return finished(action());
  } catch (const io::InputError& problem) {
    return wrong(problem.what());
  } catch (const ConfigError& problem) {
    return wrong(problem.what());
  } catch (const std::bad_alloc&) {
    say("out of memory: the request exceeds this machine's memory, or a limit (ulimit -v)");
    return internal_error;
  } catch (const std::exception& problem) {
    say(std::string("internal error: ") + one_line(problem.what()));
    return internal_error;
  }
}

}  // namespace kbvh::experiments
