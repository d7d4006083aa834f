#include "experiments/results/results.hpp"

#include "tests/fuzz/input_file.hpp"

// Adds a record to a result file of arbitrary bytes: the new record is found again, and everything that was
// readable before still is.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using kbvh::experiments::ResultStore;
  static const kbvh::fuzz::InputFolder folder;
  folder.write("results.jsonl", data, size);
  std::size_t before = 0, unreadable = 0;
  {
    ResultStore store(folder.path());
    before = store.records();
    unreadable = store.unreadable_lines();
    store.append({{"key", "fuzz"}, {"value", 1}});
  }
  const ResultStore again(folder.path());
  const nlohmann::json* found = again.find("fuzz");
  if (found == nullptr || found->at("value") != 1) std::abort();
  if (again.records() != before + 1 || again.unreadable_lines() != unreadable) std::abort();
  return 0;
}
