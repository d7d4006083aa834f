#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "experiments/theory/claim.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

/// The extent of the measurements.
struct TheoryOptions {
  std::vector<std::string> scenes{"tablecloth", "waving_sheet", "expanding_sphere", "turning_box",
                                  "random_soups"};
  std::vector<std::uint32_t> sizes{250, 500, 1000, 2000, 4000, 8000};  ///< triangles
  std::uint32_t keyframes = 30;
  std::uint32_t exact_limit = 500;  ///< largest size checked against exact envelopes; one clip per scene
  std::uint32_t simulation_limit = 8000;  ///< largest size of simulated scenes: O(triangles^1.5)
  std::uint32_t boxtree_limit = 4000;     ///< largest size played through BoxTrees
  std::uint32_t separation_size = 250;    ///< triangles of clips played through separation lists
  std::uint32_t list_limit = 4000;        ///< largest size with separation lists
  std::uint32_t list_audits = 20;         ///< traversals compared with each list
  std::uint32_t instants = 200;           ///< audited between keyframes
  std::vector<std::string> sequences{"robot-Dance", "MorphStressTest"};
  std::uint32_t sequence_keyframes = 8;  ///< of the data folder's sequences; 0: all
};

/// Returns options for CI, under a minute.
TheoryOptions quick_theory();
/// Returns options for manual runs: counts up to 580k triangles, exact envelopes up to 16k and whole
/// sequences. Hours.
TheoryOptions full_theory();

/// The results.
struct TheoryReport {
  std::vector<Claim> claims;  ///< T1 to T16, C1 to C4
  std::vector<CountRun> counts;
  std::vector<GrowthFit> fits;
  std::vector<FrameRun> frames;
  std::vector<std::string> notes;  ///< skipped parts, one sentence each
};

/// Receives progress messages; may be empty.
using TheoryProgress = std::function<void(const std::string&)>;

/// Keeps measurements as they are made, so that an interrupted run continues. A folder belongs to one version
/// of the program; records of other versions are ignored.
class MeasurementStore {
 public:
  /// Reads `file`, if it exists, and appends to it. An empty path keeps nothing. Throws io::InputError if it
  /// cannot be written.
  MeasurementStore(std::filesystem::path file, std::string program);

  /// Returns the kept measurement of that name, or makes it now.
  template <class Measurement, class Make>
  Measurement get(const std::string& key, Make&& make) {
    if (const nlohmann::json* kept = find(key)) return kept->get<Measurement>();
    Measurement measurement = make();
    keep(key, measurement);
    return measurement;
  }

 private:
  const nlohmann::json* find(const std::string& key) const;
  void keep(const std::string& key, const nlohmann::json& value);
  std::filesystem::path file_;
  std::string program_;
  nlohmann::json kept_ = nlohmann::json::object();
};

/// Measures and judges. Throws io::InputError on scenes that do not exist.
TheoryReport run_theory(const TheoryOptions& options, MeasurementStore& store,
                        const TheoryProgress& progress = {});

/// Makes the content of theory.json, see RESULTS.md.
nlohmann::json to_json(const TheoryReport& report, const TheoryOptions& options);
/// Makes its member "options": everything that affects the counts.
nlohmann::json options_record(const TheoryOptions& options);

}  // namespace kbvh::theory
