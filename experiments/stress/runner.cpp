#include "experiments/stress/runner.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>

#include "core/judge/verify.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/stress/isolate.hpp"
#include "experiments/stress/shrink.hpp"

namespace kbvh::experiments::stress {

using nlohmann::json;

const char* name(Outcome outcome) {
  switch (outcome) {
    case Outcome::held:
      return "held";
    case Outcome::broken:
      return "broken";
    case Outcome::threw:
      return "threw";
    case Outcome::crashed:
      return "crashed";
    case Outcome::hung:
      return "hung";
    case Outcome::unsuitable:
      return "unsuitable";
    case Outcome::refused:
      break;
  }
  return "refused";
}

bool CaseResult::failed() const {
  return outcome != Outcome::held && outcome != Outcome::unsuitable && outcome != Outcome::refused;
}

namespace {

/// Packs a result as text for the way from child to parent.
std::string packed(const CaseResult& r) {
  return json{int(r.outcome), r.what,       r.frames, r.pairs,     r.missed,  r.extra,
              r.events,       r.protrusion, r.extent, r.looseness, r.audited, r.seconds}
      .dump(-1, ' ', false, json::error_handler_t::replace);
}
double finite_or(const json& value, double otherwise) {
  return value.is_number() ? value.get<double>() : otherwise;
}
CaseResult unpacked(const std::string& text) {
  const json list = json::parse(text);
  CaseResult r;
  r.outcome = Outcome(list[0].get<int>());
  r.what = list[1].get<std::string>();
  std::uint64_t* counts[] = {&r.frames, &r.pairs, &r.missed, &r.extra, &r.events};
  for (std::size_t i = 0; i < std::size(counts); ++i) *counts[i] = list[2 + i].get<std::uint64_t>();
  // JSON has no infinity: an empty box counts as the largest protrusion.
  r.protrusion = finite_or(list[7], std::numeric_limits<double>::max());
  r.extent = finite_or(list[8], 0);
  r.looseness = finite_or(list[9], std::numeric_limits<double>::max());
  r.audited = list[10].get<bool>();
  r.seconds = finite_or(list[11], 0);
  return r;
}

template <class S>
double largest_coordinate(const Scene<S>& scene) {
  double largest = 0;
  for (const Body<S>& body : scene.bodies)
    for (std::size_t k = 0; k < body.plans.keyframe_count(); ++k)
      for (std::size_t i = 0; i < std::size_t(3) * body.plans.keyframed_count(); ++i)
        largest = std::max(largest, std::abs(double(body.plans.keyframe(k)[i])));
  return largest;
}

std::uint64_t events_of(const Counters& counters) {
  return counters[Counter::certificates_failed] + counters[Counter::overlap_events] +
         counters[Counter::parents_apart_events] + counters[Counter::leaves_apart_events];
}

template <class S>
CaseResult run_here(const Playable<S>& stress, Oracle<S>& oracle, const ContestantSpec& spec) {
  CaseResult result;
  const std::clock_t begin = std::clock();
  try {
    result.extent = largest_coordinate(stress.scene);
    Session<S> session(stress.scene, spec.contestant());
    const Verification seen =
        verify<S>(session, stress.frames, oracle, stress.script.empty() ? nullptr : &stress.script,
                  {.every_nth_frame = stress.compare_every});
    result.frames = seen.frames;
    result.pairs = seen.pairs;
    result.missed = seen.missed;
    result.extra = seen.extra;
    result.events = events_of(session.strategy().counters());
    result.protrusion = seen.audit.protrusion;
    result.looseness = seen.audit.looseness();
    result.audited = seen.audited;
    result.what = seen.first_violation;
    // Only approximate contestants may have errors; any other contestant may not, whatever it declares.
    if (result.what.empty() && spec.entry->info.guarantee != Guarantee::approximate && result.protrusion != 0)
      result.what = "protrusion " + number_text(result.protrusion);
    if (!result.what.empty()) result.outcome = Outcome::broken;
  } catch (const std::exception& problem) {
    result.outcome = Outcome::threw;
    result.what = problem.what();
  }
  result.seconds = double(std::clock() - begin) / CLOCKS_PER_SEC;
  return result;
}

template <class S>
std::vector<CaseResult> run_as(const StressScene& scene, const std::vector<ContestantSpec>& contestants,
                               const RunLimits& limits) {
  std::vector<CaseResult> results(contestants.size());
  Playable<S> stress;
  try {
    stress = playable<S>(scene);
  } catch (const Refused& refusal) {
    for (CaseResult& result : results) {
      result.outcome = Outcome::refused;
      result.what = refusal.what();
    }
    return results;
  }
  std::vector<std::size_t> jobs;
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    results[i].what = unsuitable(contestants[i].entry->info, stress.scene, stress.script, stress.frames);
    if (results[i].what.empty())
      jobs.push_back(i);
    else
      results[i].outcome = Outcome::unsuitable;
  }
  // Created by the child that first needs it, and kept for all contestants that this child plays.
  std::optional<Oracle<S>> oracle;
  const std::uint64_t script = stress.script.empty() ? 0 : hash(stress.script);
  const auto work = [&](std::size_t job) {
    if (!oracle) oracle.emplace(stress.scene, std::filesystem::path(), script);
    return packed(run_here(stress, *oracle, contestants[jobs[job]]));
  };
  const auto outcomes =
      run_in_children(jobs.size(), limits.seconds, work, limits.silent ? Stderr::silent : Stderr::shown);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    CaseResult& result = results[jobs[i]];
    switch (outcomes[i].end) {
      case JobOutcome::End::finished:
        result = unpacked(outcomes[i].said);
        break;
      case JobOutcome::End::crashed:
        result.outcome = Outcome::crashed;
        result.what = outcomes[i].said;
        break;
      case JobOutcome::End::hung:
        result.outcome = Outcome::hung;
        result.what = outcomes[i].said;
    }
  }
  return results;
}

}  // namespace

std::vector<CaseResult> run_scene(const StressScene& scene, const std::string& scalar,
                                  const std::vector<ContestantSpec>& contestants, const RunLimits& limits) {
  return scalar == "float" ? run_as<float>(scene, contestants, limits)
                           : run_as<double>(scene, contestants, limits);
}

void StressRow::add(const CaseResult& result) {
  StressRow one;
  if (result.outcome == Outcome::refused) {
    one.refused = 1;
  } else if (result.outcome == Outcome::unsuitable) {
    one.unsuitable = 1;
  } else {
    one.scenes = 1;
    one.broken = result.outcome == Outcome::broken;
    one.threw = result.outcome == Outcome::threw;
    one.crashes = result.outcome == Outcome::crashed;
    one.hangs = result.outcome == Outcome::hung;
    one.frames = result.frames;
    one.pairs = result.pairs;
    one.missed = result.missed;
    one.extra = result.extra;
    one.events = result.events;
    one.seconds = result.seconds;
    one.protrusion = result.protrusion;
    if (result.protrusion > 0 && result.extent > 0)
      one.relative_protrusion = result.protrusion / result.extent;
    if (result.audited) {
      one.audited = 1;
      // Empty boxes have an area of zero, and a looseness of minus one.
      one.log_looseness = std::log1p(std::max(result.looseness, -0.999999));
      one.looseness_worst = result.looseness;
    }
  }
  add(one);
}

void StressRow::add(const StressRow& other) {
  scenes += other.scenes;
  refused += other.refused;
  unsuitable += other.unsuitable;
  frames += other.frames;
  pairs += other.pairs;
  missed += other.missed;
  extra += other.extra;
  events += other.events;
  broken += other.broken;
  threw += other.threw;
  crashes += other.crashes;
  hangs += other.hangs;
  protrusion = std::max(protrusion, other.protrusion);
  relative_protrusion = std::max(relative_protrusion, other.relative_protrusion);
  log_looseness += other.log_looseness;
  looseness_worst = std::max(looseness_worst, other.looseness_worst);
  audited += other.audited;
  seconds += other.seconds;
}

std::string builder_text(const BuilderConfig& builder) {
  return std::string(name(builder.method)) + "/" + std::to_string(builder.width) + "/" +
         std::to_string(builder.leaf_size);
}

BuilderConfig builder_of(const std::string& text) {
  const auto parts = split(text, '/');
  const auto width = parts.size() == 3 ? parse_whole(parts[1]) : std::nullopt;
  const auto leaf_size = parts.size() == 3 ? parse_whole(parts[2]) : std::nullopt;
  if (!width || !leaf_size)
    throw io::InputError("builder: expected method/width/leaf size, got '" + text + "'");
  BuilderConfig builder;
  builder.method = build_method(parts[0]);
  builder.width = std::uint32_t(*width);
  builder.leaf_size = std::uint32_t(*leaf_size);
  return builder;
}

ContestantSpec varied(const ContestantSpec& spec, std::uint64_t seed) {
  const scenes::SeededNoise noise(seed);
  std::uint64_t next = 0;
  const auto below = [&](std::size_t n) { return std::size_t((noise.bits(next++) >> 11) % n); };
  ContestantSpec result = spec;
  const Info& info = spec.entry->info;
  for (const Parameter& parameter : info.parameters)
    if (!parameter.allowed.empty() && !spec.given.contains(parameter.name))
      result.given[parameter.name] = parameter.allowed[below(parameter.allowed.size())];
  if (!info.topology.own) {
    constexpr BuildMethod methods[] = {BuildMethod::median, BuildMethod::sah, BuildMethod::morton};
    result.builder.method = methods[below(std::size(methods))];
    result.builder.width = info.topology.widths[below(info.topology.widths.size())];
    result.builder.leaf_size = std::uint32_t(
        info.topology.min_leaf_size + below(info.topology.max_leaf_size - info.topology.min_leaf_size + 1));
  }
  result.params = Params(info.id, info.parameters, result.given).values();
  return result;
}

namespace {

Repro repro_for(const StressScene& scene, const ContestantSpec& spec, const std::string& scalar,
                const CaseResult& result) {
  Repro repro;
  repro.scene = scene;
  repro.strategy = spec.entry->info.id;
  repro.scalar = scalar;
  repro.params = spec.given;
  if (!spec.entry->info.topology.own) repro.builder = builder_text(spec.builder);
  repro.failure = std::string(name(result.outcome)) + ": " + result.what;
  return repro;
}

}  // namespace

StressReport run_stress(const StressOptions& options, const std::function<void(const std::string&)>& told,
                        const std::function<void(StressReport&)>& keep) {
  StressReport report;
  report.scenes = options.scenes;
  const std::size_t families = options.families.size(), contestants = options.contestants.size();
  for (const Family* family : options.families)
    for (const ContestantSpec& spec : options.contestants) {
      StressRow row;
      row.family = family->name;
      row.strategy = spec.label;
      row.strategy_family = spec.entry->info.family;
      row.approximate = spec.entry->info.guarantee == Guarantee::approximate;
      report.rows.push_back(std::move(row));
    }
  for (std::uint64_t i = 0; i < options.scenes; ++i) {
    const std::size_t f = std::size_t(i % families);
    const Family& family = *options.families[f];
    const std::uint64_t instance = i / families;
    FamilySetting setting;
    setting.seed = hash_of(family.name + " " + std::to_string(instance), options.seed);
    setting.many_keyframes = instance == 0 ? options.many_keyframes : options.many_keyframes / 50;
    std::vector<ContestantSpec> specs = options.contestants;
    // Approximate contestants are compared with each other, in the configuration that their labels state.
    if (options.vary && instance > 0)
      for (std::size_t c = 0; c < contestants; ++c)
        if (specs[c].entry->info.guarantee != Guarantee::approximate)
          specs[c] = varied(specs[c], hash_of(specs[c].label, setting.seed));
    for (const std::string& scalar : options.scalars)
      for (const std::uint32_t l : options.l) {
        told("scene " + std::to_string(i + 1) + " of " + std::to_string(options.scenes) + ": " + family.name +
             ", " + scalar + ", l = " + std::to_string(l));
        setting.l = l;
        setting.limits = scalar == "float" ? scalar_limits<float>() : scalar_limits<double>();
        const StressScene scene = make_scene(family, setting);
        const std::vector<CaseResult> results = run_scene(scene, scalar, specs, options.limits);
        for (std::size_t c = 0; c < contestants; ++c) {
          StressRow& row = report.rows[f * contestants + c];
          const bool first = row.failures() == 0;
          row.add(results[c]);
          if (!results[c].failed() || !first || report.failures.size() >= options.most_repros) continue;
          StressFailure failure;
          failure.seed = setting.seed;
          failure.l = l;
          failure.triangles_before = scene.triangles();
          failure.size_before = scene.size();
          failure.repro = repro_for(scene, specs[c], scalar, results[c]);
          report.failures.push_back(std::move(failure));
          // Shrinking can take long, and the run may be ended before.
          if (keep) keep(report);
          if (options.shrink) {
            CaseResult last = results[c];
            told("shrinking a failure of " + specs[c].label + " in " + family.name);
            RunLimits limits = options.limits;
            limits.silent = true;
            const auto fails = [&](const StressScene& candidate) {
              const CaseResult again = run_scene(candidate, scalar, {specs[c]}, limits)[0];
              if (again.outcome != results[c].outcome) return false;
              last = again;
              return true;
            };
            const StressScene small = shrink(scene, fails);
            report.failures.back().repro = repro_for(small, specs[c], scalar, last);
            if (keep) keep(report);
          }
        }
      }
    ++report.played;
    if (keep) keep(report);
  }
  return report;
}

}  // namespace kbvh::experiments::stress
