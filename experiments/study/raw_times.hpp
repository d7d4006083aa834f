#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/judge/phase_times.hpp"

namespace kbvh::experiments {

/// Fewer repetitions have a range instead of an interval.
inline constexpr std::size_t fewest_of_an_interval = 5;

/// The frames that count.
enum class Part : std::uint8_t {
  clip,    ///< all
  steady,  ///< from the second knot of the overlaid plans on, without the beginning
};

/// How repetitions are combined to one time.
enum class By : std::uint8_t {
  frames,  ///< the sum over frames of each frame's median: a disturbance of one repetition does not count
  clips,   ///< the median of the clips' sums: for contestants whose work has no fixed frame
};

/// The times of one contestant in one table, as measured. Work per frame is the same in every repetition.
struct RawTimes {
  std::vector<std::vector<double>> totals, motions;  ///< [repetition][frame], ms
  std::vector<PhaseTimes> clip, steady;              ///< [repetition]: sums over frames, ms
  std::optional<std::size_t> steady_from;            ///< a frame; nothing: there are no steady times
  By by = By::frames;                                ///< how this contestant must be counted
  /// Identifies the rounds: repetitions of two contestants with equal texts were played next to each other.
  std::string session;

  std::size_t repetitions() const { return totals.size(); }
  std::size_t frames() const { return totals.empty() ? 0 : totals[0].size(); }
  bool has(Part part) const { return part == Part::clip || steady_from.has_value(); }
};

/// Repetitions, by index, any of them several times.
using Draw = std::vector<std::uint32_t>;

/// Returns all repetitions, each once.
Draw every_repetition(std::size_t repetitions);

/// Returns the time of a phase in ms per frame, over the drawn repetitions. Phases: motion, update,
/// traversal, triangle_tests, plan_changes, geometry_changes, changes (both), query (traversal and tests),
/// upkeep (update + changes), candidates (upkeep + traversal), total (candidates + triangle_tests); with
/// motion: upkeep_with_motion, total_with_motion. Total and motion are computed as `by` requires; phases of
/// the total are the medians of their sums, scaled to it. Returns 0 for steady times if there are none.
double time_of(const RawTimes& times, std::string_view phase, Part part, By by,
               std::span<const std::uint32_t> draw);
/// Does the same over all repetitions.
double time_of(const RawTimes& times, std::string_view phase, Part part = Part::clip);

/// Returns times of a phase over resampled repetitions, 200 of them; the same resamples on every machine.
std::vector<double> replicates(const RawTimes& times, std::string_view phase, Part part, By by);
/// Whether repetitions of two contestants belong to the same rounds, and are therefore drawn together.
enum class Rounds : std::uint8_t { same, others };
/// Returns the middle 95 % of the quotients of replicates. Replicates of different rounds are paired in
/// reversed order, which makes their draws independent.
std::pair<double, double> middle_of_quotients(const std::vector<double>& above,
                                              const std::vector<double>& below, Rounds rounds);

/// The uncertainty of a ratio: an interval of 95 % (percentile bootstrap over whole rounds) or, with fewer
/// than five repetitions, the range over single repetitions.
struct Within {
  double low, high;
  bool is_interval;
};

/// A time of one contestant over that of another.
struct RatioOfTimes {
  double middle = 0;
  std::optional<Within> within;  ///< nothing for a single repetition
};

/// Returns the ratio of the numerator's time to the denominator's. If one of them must be counted by clips,
/// both are. Repetitions of one session are drawn together, those of two sessions independently. The draws
/// are the same on every machine. Returns nothing if one of the times is 0.
struct TimeOf {
  const RawTimes& times;
  std::string_view phase;
};
std::optional<RatioOfTimes> ratio_of(const TimeOf& numerator, const TimeOf& denominator,
                                     Part part = Part::clip);

/// Above this the times of a contestant are disturbed: the work of its repetitions is the same.
inline constexpr double most_variation = 1.25;
/// Returns the upper quartile of the repetitions' clips, positions included, over the lower one; 1 with fewer
/// than five repetitions. It is large where something slowed down whole repetitions, also what no processor
/// waits for: a neighbour that shares caches or memory, a clock that changes.
double variation(const RawTimes& times);
/// Returns why times are disturbed, in words, or "": the recorded reasons, and a large variation.
std::string doubts(const RawTimes& times, std::string recorded);

/// Returns the first frame at which a contestant has paid for its preparation and its beginning: from there
/// on, the sum of its preparation (ms) and its frames so far never exceeds the other's. Nothing if there is
/// no such frame. Uses medians of frames.
std::optional<std::size_t> paid_from(const RawTimes& own, double own_preparation, const RawTimes& other,
                                     double other_preparation);

}  // namespace kbvh::experiments
