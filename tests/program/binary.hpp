#pragma once
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "temporary_folder.hpp"

// The kbvh binary for tests, run like from a shell.

namespace kbvh::experiments {

using nlohmann::json;

/// One folder for all runs of a test, with the cache inside.
class Binary : public testing::Test {
 protected:
  struct Outcome {
    int code;
    std::string out, err;
  };
  Outcome kbvh(const std::string& arguments, const std::string& environment = "",
               const std::string& program = KBVH_PROGRAM) {
    return shell(environment + " '" + program + "' " + arguments);
  }
  /// Runs a shell command in the folder.
  Outcome shell(const std::string& line) {
    const auto out = folder_ / "stdout", err = folder_ / "stderr";
    const std::string command = "cd '" + folder_.path().string() + "' && export KBVH_CACHE='" +
                                (folder_ / "cache").string() + "' && { " + line + "\n} >'" + out.string() +
                                "' 2>'" + err.string() + "'";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_of_file(out), text_of_file(err)};
  }
  std::vector<json> records(const std::string& file = "out/results.jsonl") {
    std::vector<json> list;
    std::ifstream in(folder_ / file);
    for (std::string line; std::getline(in, line);) list.push_back(json::parse(line));
    return list;
  }
  TemporaryFolder folder_;
};

/// Small enough for every contestant: 100 triangles, few frames.
inline const std::string tiny = "--scene waving_sheet --triangles 100 --keyframes 3 --l 2 --repetitions 2 ";

}  // namespace kbvh::experiments
