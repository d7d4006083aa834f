#pragma once
// Times of rivals by turns, their ratios, and comparisons with targets, for programs that measure by
// themselves.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/base/median.hpp"
#include "core/kernels/kernel_set.hpp"
#include "experiments/common/environment.hpp"
#include "experiments/common/machine.hpp"

namespace kbvh::experiments::micro {

/// The processor's time of this program, which has one thread: other programs disturb it least.
inline double milliseconds() {
  return 1e3 * double(std::clock()) / CLOCKS_PER_SEC;
}

/// Work that is timed by turns with its rivals.
struct Contestant {
  std::string name;
  std::function<std::size_t()> work;  ///< returns the number of pairs
  std::vector<double> ms{};
  std::size_t pairs = 0;
};

/// Ratios of a run next to what is at least asked for and aimed at, and the file that receives them.
class RatioTargets {
 public:
  /// Adds a ratio; `at_least` 0: nothing is asked for. `facts` are further fields of the row.
  void add(const std::string& what, double ratio, double at_least, double aim,
           nlohmann::json facts = nlohmann::json::object()) {
    facts.update({{"what", what},
                  {"ratio", ratio},
                  {"at_least", at_least},
                  {"aim", aim},
                  {"verdict", at_least == 0       ? "reported"
                              : ratio >= aim      ? "met, and the aim"
                              : ratio >= at_least ? "met"
                                                  : "missed"}});  // also where there is no ratio
    rows_.push_back(std::move(facts));
  }
  void print() const {
    std::printf("Targets\n");
    for (const nlohmann::json& row : rows_)
      std::printf("  %-78s %7.2f x  (%g, aim %g): %s\n", row["what"].get<std::string>().c_str(),
                  row["ratio"].get<double>(), row["at_least"].get<double>(), row["aim"].get<double>(),
                  row["verdict"].get<std::string>().c_str());
  }
  /// Writes them with what was compared, when, where and by which program. Throws std::runtime_error.
  void write(const std::filesystem::path& file, const char* program, int repetitions,
             const nlohmann::json& comparisons, nlohmann::json facts = nlohmann::json::object()) const {
    facts.update({{"program", program},
                  {"time", now_utc()},
                  {"commit", commit()},
                  {"dirty", dirty()},
                  {"machine", machine()},
                  {"kernels", name(active_kernel_set())},
                  {"repetitions", repetitions},
                  {"clock", "processor time, median of repetitions by turns, one thread"},
                  {"comparisons", comparisons},
                  {"targets", rows_}});
    std::ofstream out(file);
    out << facts.dump(2) << '\n';
    if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
  }

 private:
  nlohmann::json rows_ = nlohmann::json::array();
};

/// What was compared in this run, for the file and for targets.
class Table {
 public:
  /// Plays all contestants once without a clock, then by turns, and prints medians and how many times as long
  /// as the first each one takes.
  void compare(const std::string& title, std::vector<Contestant> contestants, int repetitions) {
    for (int r = -1; r < repetitions; ++r)
      for (Contestant& contestant : contestants) {
        const double begin = milliseconds();
        contestant.pairs = contestant.work();
        const double took = milliseconds() - begin;
        if (r >= 0) contestant.ms.push_back(took);
      }
    std::printf("%s\n", title.c_str());
    nlohmann::json rows = nlohmann::json::array();
    double first = 0;
    for (Contestant& contestant : contestants) {
      const double median = median_of_times(contestant.ms);
      if (first == 0) first = median;
      medians_[contestant.name] = median;
      std::printf("  %-56s %10.3f ms  %7.2f x  %zu pairs\n", contestant.name.c_str(), median, median / first,
                  contestant.pairs);
      rows.push_back({{"name", contestant.name},
                      {"median_ms", median},
                      {"ms", contestant.ms},
                      {"over_first", median / first},
                      {"pairs", contestant.pairs}});
    }
    comparisons_.push_back({{"title", title}, {"contestants", rows}});
  }

  /// Compares how many times as long as `ours` the rival takes with what is at least asked for, and with the
  /// aim; 0: none is. Does nothing if one of them was not measured.
  void target(const char* what, const std::string& ours, const std::string& rival, double at_least,
              double aim) {
    if (!medians_.contains(ours) || !medians_.contains(rival)) return;
    targets_.add(what, medians_.at(rival) / medians_.at(ours), at_least, aim,
                 {{"ours", ours}, {"rival", rival}});
  }
  void print_targets() const { targets_.print(); }
  void write(const std::filesystem::path& file, const std::string& frames, int repetitions) const {
    targets_.write(file, "kbvh_broad_phase_bench", repetitions, comparisons_, {{"frames", frames}});
  }

 private:
  std::map<std::string, double> medians_;
  nlohmann::json comparisons_ = nlohmann::json::array();
  RatioTargets targets_;
};

}  // namespace kbvh::experiments::micro
