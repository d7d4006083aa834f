#include "experiments/run/jobs.hpp"

#include <algorithm>
#include <cctype>
#include <set>

#include "experiments/common/machine.hpp"
#include "experiments/common/text.hpp"

namespace kbvh::experiments {

using nlohmann::json;

namespace {

/// Returns a short name of letters, digits and single hyphens.
std::string short_name(const std::string& text) {
  constexpr std::size_t longest = 40;
  std::string name;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 128 && std::isalnum(byte) != 0)
      name += char(std::tolower(byte));
    else if (!name.empty() && name.back() != '-')
      name += '-';
  }
  name.resize(std::min(name.size(), longest));
  while (name.ends_with('-')) name.pop_back();
  return name.empty() ? "scene" : name;
}

std::string name_of(const SceneSpec& spec) {
  if (const std::string given = given_name(spec); !given.empty()) return given;
  if (!spec.builtin.empty())
    return spec.builtin + "-" + std::to_string(spec.options.triangles) +
           (spec.order == VertexOrder::given ? "" : std::string("-") + word(spec.order));
  std::vector<std::string> names;
  for (const BodySpec& body : spec.bodies)
    names.push_back(body.name.empty() ? body.file.stem().string() : body.name);
  return joined(names, "-");
}

std::string id_of(const std::string& name, const json& content) {
  return short_name(name) + "-" +
         hexadecimal(hash_of(content.dump(-1, ' ', false, json::error_handler_t::replace)));
}

std::string scene_id(const SceneSpec& spec) {
  return id_of(name_of(spec), {spec.said, program_identity()});
}

/// Returns what is measured, as text that enters the id.
json content_of(const std::vector<ContestantSpec>& contestants) {
  json list = json::array();
  for (const ContestantSpec& one : contestants) {
    json entry{one.entry->info.id, one.params};
    if (!one.entry->info.topology.own)
      entry.push_back({int(one.builder.method), one.builder.width, one.builder.leaf_size});
    list.push_back(std::move(entry));
  }
  return list;
}

std::uint32_t threads_of(const std::vector<ContestantSpec>& contestants) {
  std::uint64_t most = 1;
  for (const ContestantSpec& one : contestants)
    if (const auto given = one.params.find("threads"); given != one.params.end())
      most = std::max(most, parse_whole(given->second).value_or(1));
  return std::uint32_t(most);
}

/// Returns the l at which a study plays a scene: 1 where l does not apply.
std::vector<std::uint32_t> steps_of(const Study& study, const SceneSpec& spec) {
  if (study.asks.continuous || has_own_frames(spec)) return {1};
  return study.per_keyframe;
}

}  // namespace

std::vector<Job> jobs_of(const Plan& plan, std::vector<std::string>& notes) {
  std::vector<Job> jobs;
  std::set<std::string> known;
  const auto note = [&notes](const std::string& text) {
    if (std::find(notes.begin(), notes.end(), text) == notes.end()) notes.push_back(text);
  };
  for (std::size_t s = 0; s < plan.studies.size(); ++s) {
    const Study& study = plan.studies[s];
    std::vector<std::string> left_out;
    const auto contestants = expand(study.strategies, study.params, study.builder, left_out);
    for (const std::string& text : left_out) note(text);
    for (std::size_t i = 0; i < study.scenes.size(); ++i) {
      const SceneSpec& spec = study.scenes[i];
      if (const std::string missing = spec.optional ? missing_file(spec) : ""; !missing.empty()) {
        note("the scene '" + spec.name + "' is skipped: there is no " + missing);
        continue;
      }
      for (const std::string& scalar : study.scalars)
        for (const std::uint32_t l : steps_of(study, spec)) {
          Job job;
          job.scene = scene_id(spec);
          job.scene_name = name_of(spec);
          job.study_at = s;
          job.scene_at = i;
          job.scalar = scalar;
          job.per_keyframe = l;
          job.configurations = contestants.size();
          job.threads = threads_of(contestants);
          job.id = id_of(name_of(spec) + "-" + scalar +
                             (study.asks.continuous ? "-contacts" : "-l" + std::to_string(l)) +
                             job_words(study.asks),
                         {job.scene, scalar, l, study.repetitions, study.interval_width, study.seconds,
                          study.shuffle ? json(*study.shuffle) : json(), study.frames_limit,
                          study.oracle_every, asked_of(study.asks), content_of(contestants)});
          if (known.insert(job.id).second) jobs.push_back(std::move(job));
        }
    }
  }
  return jobs;
}

Plan plan_of_job(const Plan& plan, const std::string& id) {
  std::vector<std::string> notes, known;
  for (const Job& job : jobs_of(plan, notes)) {
    if (job.id == id) {
      Study study = plan.studies[job.study_at];
      study.scenes = {study.scenes[job.scene_at]};
      study.scalars = {job.scalar};
      study.per_keyframe = {job.per_keyframe};
      return {plan.name, plan.description, {study}, {}};
    }
    known.push_back(job.id);
  }
  throw io::InputError(no_such("job", id, known, "`kbvh run --plan FILE --list-jobs` shows them") +
                       " (ids change with the plan and the program)");
}

json jobs_json(const Plan& plan, const std::vector<Job>& jobs) {
  json list = json::array(), scenes = json::array();
  std::set<std::string> known;
  for (const Job& job : jobs) {
    list.push_back({{"id", job.id},
                    {"scene", job.scene},
                    {"scene_name", job.scene_name},
                    {"study", plan.studies[job.study_at].name},
                    {"scalar", job.scalar},
                    {"l", job.per_keyframe},
                    {"configurations", job.configurations},
                    {"threads", job.threads}});
    if (known.insert(job.scene).second) scenes.push_back({{"id", job.scene}, {"name", job.scene_name}});
  }
  return {{"schema", "kbvh-jobs-1"}, {"plan", plan.name}, {"program", program_identity()},
          {"commit", commit()},      {"dirty", dirty()},  {"targets", plan.targets.size()},
          {"scenes", scenes},        {"jobs", list}};
}

}  // namespace kbvh::experiments
