#pragma once
#include <cmath>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/stress/families.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments::stress {

/// The outcome of one contestant on one scene.
enum class Outcome : std::uint8_t {
  held,        ///< guarantee, tightness and boxes held; an approximate contestant: it finished
  broken,      ///< a declared guarantee was violated, or a box does not contain its vertices
  threw,       ///< an exception outside the contract
  crashed,     ///< the process ended
  hung,        ///< had to be stopped
  unsuitable,  ///< does not take part: no such scalar, no support for changes of plans, scene too large
  refused,     ///< the scene is inadmissible, by contract
};
const char* name(Outcome outcome);

/// The result of one contestant on one scene in one scalar.
struct CaseResult {
  Outcome outcome = Outcome::held;
  std::string what;  ///< a failure, a refusal or the reason for not taking part, in one sentence
  std::uint64_t frames = 0, pairs = 0, missed = 0, extra = 0;
  std::uint64_t events = 0;  ///< certificates that failed, and events of separation lists
  double protrusion = 0;     ///< largest protrusion from a box, in units of the scene
  double extent = 0;         ///< largest coordinate of the scene, for comparison
  double looseness = 0;      ///< of all audited frames
  bool audited = false;
  double seconds = 0;  ///< processor time; 0 if it did not finish

  /// Returns whether the outcome is a failure; held, unsuitable and refused are not.
  bool failed() const;
};

struct RunLimits {
  double seconds = 100;  ///< processor time of one contestant on one scene; more is a hang
  bool silent = false;   ///< drop the output of child processes on standard error
};

/// Plays one scene to all contestants, each in a process that may crash or hang; `scalar` is "float" or
/// "double".
std::vector<CaseResult> run_scene(const StressScene& scene, const std::string& scalar,
                                  const std::vector<ContestantSpec>& contestants, const RunLimits& limits);

/// One row of the table: one contestant on the scenes of one family.
struct StressRow {
  std::string family, strategy, strategy_family;  ///< the strategy's label, and its own family
  bool approximate = false;
  std::uint64_t scenes = 0;  ///< played to the end or failed: scenes of the family in a scalar, with one l
  std::uint64_t refused = 0, unsuitable = 0;
  std::uint64_t frames = 0, pairs = 0, missed = 0, extra = 0, events = 0;
  std::uint64_t broken = 0, threw = 0, crashes = 0, hangs = 0;
  double protrusion = 0;           ///< largest, in units of the scene
  double relative_protrusion = 0;  ///< largest, over the scene's largest coordinate
  double log_looseness = 0;        ///< sum over audited scenes of log(1 + looseness)
  double looseness_worst = 0;
  std::uint64_t audited = 0;
  double seconds = 0;  ///< processor time

  void add(const CaseResult& result);
  /// Adds the counts of another row; names stay.
  void add(const StressRow& other);
  std::uint64_t failures() const { return broken + threw + crashes + hangs; }
  /// Returns the geometric mean over scenes of the corresponding factor; the scales differ too much for an
  /// arithmetic mean.
  double looseness() const { return audited > 0 ? std::expm1(log_looseness / double(audited)) : 0; }
};

/// A failure, shrunk or not.
struct StressFailure {
  Repro repro;
  std::uint64_t seed = 0;
  std::uint32_t l = 0;
  std::string file;  ///< path of the repro file, or empty
  std::size_t triangles_before = 0, size_before = 0;
};

struct StressOptions {
  std::vector<const Family*> families;
  std::vector<ContestantSpec> contestants;
  std::uint64_t scenes = 100;  ///< from the families in turn
  std::uint64_t seed = 1;
  std::vector<std::string> scalars{"float", "double"};
  std::vector<std::uint32_t> l{1, 7, 100};
  bool vary = true;  ///< draw builder and parameters for all but the first scene of a family
  bool shrink = true;
  std::size_t most_repros = 20;  ///< failures of one family and strategy beyond the first are only counted
  std::uint32_t many_keyframes = 100000;  ///< of the first such scene; the others have a fiftieth
  RunLimits limits{};
};

struct StressReport {
  std::vector<StressRow> rows;  ///< by family, then by strategy
  std::vector<StressFailure> failures;
  std::uint64_t scenes = 0, played = 0;  ///< requested, and played so far
};

/// Runs the suite. `told` receives progress messages. `keep`, if given, receives the current report after
/// every scene, at every failure before it is shrunk, and after shrinking. Same options, same scenes.
StressReport run_stress(const StressOptions& options, const std::function<void(const std::string&)>& told,
                        const std::function<void(StressReport&)>& keep = {});

/// Returns the contestant in another valid configuration, drawn at random from the seed: builder, and every
/// parameter with a choice of words.
ContestantSpec varied(const ContestantSpec& spec, std::uint64_t seed);

/// Converts to "median/2/1", and back; throws io::InputError.
std::string builder_text(const BuilderConfig& builder);
BuilderConfig builder_of(const std::string& text);

/// Formats the table that the program prints, and the content of stress.json (RESULTS.md).
std::string stress_table(const StressReport& report);
nlohmann::json to_json(const StressReport& report, const StressOptions& options);
/// Makes the member "options" of stress.json: everything that affects the played scenes.
nlohmann::json options_record(const StressOptions& options);

}  // namespace kbvh::experiments::stress
