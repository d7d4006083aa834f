#include "experiments/scenes/reversal.hpp"

#include <system_error>

#include "core/judge/oracle.hpp"
#include "experiments/common/progress.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

std::vector<double> frames_of(const ReversalRule& rule) {
  std::vector<double> frames;
  for (std::uint32_t f = 0; f < rule.frames; ++f) frames.push_back(double(f) / rule.frames_per_second);
  return frames;
}

namespace {

/// The state of one body while its vertices reverse.
template <class S>
struct TurningBody {
  std::vector<S> outward;             ///< velocities [vertex][3]
  std::vector<std::uint8_t> inwards;  ///< whether the vertex has been reversed
  std::vector<std::uint8_t> touched;  ///< by a colliding primitive in this frame
};

template <class S>
TurningBody<S> turning(const FlightPlans<S>& plans) {
  TurningBody<S> body;
  const std::size_t size = std::size_t(3) * plans.vertex_count();
  body.outward.assign(size, S(0));
  body.inwards.assign(plans.vertex_count(), 0);
  body.touched.assign(plans.vertex_count(), 0);
  if (plans.keyframe_count() < 2) return body;
  const double seconds = plans.keyframe_times()[1] - plans.keyframe_times()[0];
  for (std::size_t i = 0; i < size; ++i)
    body.outward[i] = S((double(plans.keyframe(1)[i]) - double(plans.keyframe(0)[i])) / seconds);
  return body;
}

template <class S>
bool within(const S* position, const std::array<double, 3>& centre, double radius) {
  double square = 0;
  for (std::size_t d = 0; d < 3; ++d)
    square += (double(position[d]) - centre[d]) * (double(position[d]) - centre[d]);
  return square <= radius * radius;
}

}  // namespace

template <class S>
PlanScript<S> record_reversals(const Scene<S>& scene, const ReversalRule& rule,
                               const MakeProgress& progress) {
  if (rule.centres.size() != scene.bodies.size())
    throw std::invalid_argument(std::to_string(rule.centres.size()) + " centres for " +
                                std::to_string(scene.bodies.size()) + " bodies");
  std::vector<TurningBody<S>> bodies;
  for (const Body<S>& body : scene.bodies) bodies.push_back(turning(body.plans));
  Playback<S> playback(scene);
  PlanScript<S> script;
  const std::vector<double> frames = frames_of(rule);
  for (std::size_t f = 0; f + 1 < frames.size(); ++f) {
    if (progress && f % 10 == 0)
      progress("recording where " + scene.name + " collides", double(f) / double(frames.size()));
    playback.seek(frames[f]);
    const auto touch = [&](std::uint32_t body, std::uint32_t primitive) {
      for (const std::uint32_t v : scene.bodies[body].primitives[primitive]) bodies[body].touched[v] = 1;
    };
    for (const PrimitivePair& pair : sweep_pairs(scene, playback)) {
      touch(pair.body_a, pair.primitive_a);
      touch(pair.body_b, pair.primitive_b);
    }
    typename PlanScript<S>::Step step{frames[f], {}};
    for (std::uint32_t b = 0; b < bodies.size(); ++b) {
      TurningBody<S>& body = bodies[b];
      for (std::uint32_t v = 0; v < body.inwards.size(); ++v) {
        const bool touched = body.touched[v] != 0;
        body.touched[v] = 0;
        const bool turns = body.inwards[v] == 0
                               ? touched
                               : within(playback.position(b, v), rule.centres[b], rule.lowest_radius);
        if (!turns) continue;
        body.inwards[v] = body.inwards[v] == 0 ? 1 : 0;
        PlanChange<S> change;
        change.body = b;
        change.vertex = v;
        for (std::size_t d = 0; d < 3; ++d) {
          const S speed = body.outward[std::size_t(3) * v + d];
          change.velocity[d] = body.inwards[v] != 0 ? -speed : speed;
        }
        step.changes.push_back(std::move(change));
      }
    }
    if (step.changes.empty()) continue;
    playback.change_plans(frames[f], step.changes);
    script.steps.push_back(std::move(step));
  }
  return script;
}

namespace {

constexpr std::string_view magic = "KBVHSCR1";  // change it with the layout, the rule or the oracle's test

template <class S>
std::string bytes_of(const PlanScript<S>& script) {
  std::string out(magic);
  io::append_little_endian(out, hash(script));
  io::append_little_endian(out, std::uint64_t(script.steps.size()));
  for (const auto& step : script.steps) {
    io::append_little_endian(out, step.time);
    io::append_little_endian(out, std::uint64_t(step.changes.size()));
    for (const PlanChange<S>& change : step.changes) {
      io::append_little_endian(out, change.body);
      io::append_little_endian(out, change.vertex);
      for (const S speed : change.velocity) io::append_little_endian(out, speed);
    }
  }
  return out;
}

/// Throws io::InputError if the file was not written by bytes_of.
template <class S>
PlanScript<S> read_script(const std::filesystem::path& file) {
  const std::string bytes = io::read_file(file);
  std::size_t at = 0;
  const auto room = [&](std::uint64_t count, std::size_t size) {
    if (count > (bytes.size() - at) / size) io::fail(file, "", "is cut off");
  };
  const auto take = [&](auto& value) {
    room(1, sizeof value);
    value = io::load_little_endian<std::remove_reference_t<decltype(value)>>(bytes.data() + at);
    at += sizeof value;
  };
  room(1, magic.size());
  if (!bytes.starts_with(magic)) io::fail(file, "", "is not a recorded script of this version");
  at = magic.size();
  std::uint64_t expected = 0, steps = 0, changes = 0;
  take(expected);
  take(steps);
  PlanScript<S> script;
  for (std::uint64_t s = 0; s < steps; ++s) {
    typename PlanScript<S>::Step step{};
    take(step.time);
    take(changes);
    room(changes, 8 + 3 * sizeof(S));
    for (std::uint64_t c = 0; c < changes; ++c) {
      PlanChange<S> change;
      take(change.body);
      take(change.vertex);
      for (S& speed : change.velocity) take(speed);
      step.changes.push_back(std::move(change));
    }
    script.steps.push_back(std::move(step));
  }
  if (at != bytes.size() || hash(script) != expected) io::fail(file, "", "is damaged");
  return script;
}

template <class S>
std::filesystem::path file_of(const Scene<S>& scene, const ReversalRule& rule,
                              const std::filesystem::path& folder) {
  Hasher hasher;
  hasher.mix(hash(scene));
  for (const auto& centre : rule.centres) hasher.bytes(centre.data(), sizeof centre);
  for (const double value : {rule.lowest_radius, rule.frames_per_second, double(rule.frames)})
    hasher.bytes(&value, sizeof value);
  return folder / ("script-" + hexadecimal(hasher.value()) + ".bin");
}

}  // namespace

template <class S>
PlanScript<S> recorded_reversals(const Scene<S>& scene, const ReversalRule& rule,
                                 const std::filesystem::path& folder, const MakeProgress& progress) {
  if (folder.empty()) return record_reversals(scene, rule, progress);
  const std::filesystem::path file = file_of(scene, rule, folder);
  std::error_code error;
  if (std::filesystem::exists(file, error)) {
    try {
      return read_script<S>(file);
    } catch (const io::InputError& problem) {
      say(std::string("warning: ") + problem.what() + "; the script is recorded again");
    }
  }
  PlanScript<S> script = record_reversals(scene, rule, progress);
  try {
    io::write_file_atomically(file, bytes_of(script));
  } catch (const io::InputError& problem) {
    say(std::string("warning: the recorded script is not cached: ") + problem.what());
  }
  return script;
}

#define KBVH_INSTANTIATE(S)                                                                           \
  template PlanScript<S> record_reversals(const Scene<S>&, const ReversalRule&, const MakeProgress&); \
  template PlanScript<S> recorded_reversals(const Scene<S>&, const ReversalRule&,                     \
                                            const std::filesystem::path&, const MakeProgress&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh::experiments
