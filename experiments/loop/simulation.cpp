#include "experiments/loop/simulation.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "core/base/hasher.hpp"
#include "experiments/common/machine.hpp"
#include "experiments/common/stopwatch.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/loop/frames.hpp"
#include "experiments/loop/penetration.hpp"
#include "experiments/loop/recording.hpp"

namespace kbvh::experiments::loop {

using nlohmann::json;

namespace {

/// What distinguishes a simulation from others; the number of steps does not.
json identity_of(const SimulationOptions& options) {
  json identity{{"scene", options.scene},
                {"triangles", options.triangles},
                {"seed", options.seed},
                {"detection", name(options.detection)},
                {"keep", options.keep},
                {"strategy", nullptr},
                {"lose_every", options.lose_every},
                {"record", options.record},
                {"frames_every", options.frames_every}};
  if (!options.strategy.id.empty()) {
    identity["detection"] = "strategy";
    identity["strategy"] = options.strategy.id;
    identity["params"] = options.strategy.params;
  }
  return identity;
}

/// Returns how many of the first faces belong to obstacles.
std::uint64_t leading_obstacle_faces(const SimulatedMesh& mesh) {
  for (Eigen::Index f = 0; f < mesh.faces.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      if (mesh.obstacle[mesh.faces(f, k)] == 0) return std::uint64_t(f);
  return std::uint64_t(mesh.faces.rows());
}

json header_record(const SimulationOptions& options, const Simulated& scene) {
  const Physics& physics = scene.physics;
  const SimulatedMesh& mesh = scene.mesh;
  std::uint64_t fixed = 0, driven = 0;
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v) {
    fixed += mesh.fixed[v];
    driven += mesh.is_driven(v) ? 1 : 0;
  }
  const Info* const strategy = options.strategy.id.empty() ? nullptr : &info_of(options.strategy.id);
  return {{"schema", "kbvh-loop-1"},
          {"options", identity_of(options)},
          {"baseline", strategy != nullptr && strategy->baseline},
          {"exact", strategy == nullptr || strategy->guarantee != Guarantee::approximate},
          {"title", scene_title(options.scene)},
          {"mesh",
           {{"vertices", mesh.vertex_count()},
            {"fixed_vertices", fixed},
            {"driven_vertices", driven},
            {"inner_vertices", mesh.inner.size()},
            {"edges", mesh.edges.rows()},
            {"faces", mesh.faces.rows()},
            {"obstacle_faces", leading_obstacle_faces(mesh)},
            {"springs", mesh.springs.size()},
            {"hinges", mesh.hinges.size()}}},
          {"physics",
           {{"time_step_s", physics.time_step},
            {"gravity_m_s2", {physics.gravity[0], physics.gravity[1], physics.gravity[2]}},
            {"thickness_m", physics.thickness},
            {"reach_m", physics.reach},
            {"repulsion_m_s2", physics.repulsion},
            {"friction", physics.friction},
            {"slip_speed_m_s", physics.slip_speed},
            {"tolerance_m", physics.tolerance},
            {"most_iterates", physics.most_iterations}}},
          {"commit", commit()},
          {"dirty", dirty()},
          {"machine", machine()},
          {"when", now_utc()}};
}

/// Returns the resident memory of this program in bytes; 0 where the system does not tell.
std::uint64_t resident_memory() {
  std::ifstream in("/proc/self/statm");
  std::uint64_t whole = 0, resident = 0;
  in >> whole >> resident;
  return in ? resident * std::uint64_t(::sysconf(_SC_PAGESIZE)) : 0;
}

/// Returns the largest resident memory of this program so far, in bytes.
std::uint64_t peak_memory() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return std::uint64_t(usage.ru_maxrss) * 1024;
}

/// The lines of a simulation's steps.
class StepLines {
 public:
  StepLines(std::filesystem::path file, std::uint64_t keep_bytes)
      : file_(std::move(file)), bytes_(keep_bytes) {
    std::error_code error;
    if (keep_bytes > 0) {
      if (std::filesystem::file_size(file_, error) < keep_bytes || error)
        io::fail(file_, "", "is shorter than when the simulation was saved");
      std::filesystem::resize_file(file_, keep_bytes, error);
      if (error) io::fail(file_, "", "cannot be cut: " + error.message());
    }
    out_.open(file_, std::ios::binary | std::ios::out | (keep_bytes > 0 ? std::ios::app : std::ios::trunc));
    if (!out_) io::fail(file_, "", "cannot be written");
  }
  void write(const json& record) {
    const std::string line = record.dump() + "\n";
    out_ << line << std::flush;
    if (!out_) io::fail(file_, "", "cannot be written");
    bytes_ += line.size();
  }
  std::uint64_t bytes() const { return bytes_; }

 private:
  std::filesystem::path file_;
  std::ofstream out_;
  std::uint64_t bytes_;
};

/// The files of one simulation; none without a folder.
class SimulationFiles {
 public:
  SimulationFiles(const SimulationOptions& options, const Simulated& scene, SavedState& saved)
      : options_(options), mesh_(scene.mesh), header_(header_record(options, scene)) {
    Hasher hasher;
    const std::string text = identity_of(options).dump() + commit();
    hasher.bytes(text.data(), text.size());
    saved.options = hasher.value();
    if (options.folder.empty()) return;
    std::error_code error;
    std::filesystem::create_directories(options.folder, error);
    if (error) io::fail(options.folder, "", "cannot be made: " + error.message());
    if (std::filesystem::exists(state_file())) {
      SavedState earlier = load_state(state_file());
      if (earlier.options != saved.options)
        io::fail(options.folder, "", "holds a simulation with other options, or of another commit");
      if (earlier.state.positions.rows() != scene.mesh.positions.rows())
        io::fail(state_file(), "", "has another number of vertices than the scene");
      saved = std::move(earlier);
    }
    const RecordingHeader header{ContactMesh(scene.mesh), scene.physics.radius(), scene.physics.thickness};
    const std::filesystem::path recording = options.folder / "loop.recording";
    if (options.record && saved.recording_bytes > 0)
      recording_ = std::make_unique<RecordingWriter>(recording, header, saved.recording_bytes);
    else if (options.record)
      recording_ = std::make_unique<RecordingWriter>(recording, header);
    lines_ = std::make_unique<StepLines>(options.folder / "loop.jsonl", saved.lines_bytes);
    if (lines_->bytes() == 0) lines_->write(header_);
  }

  IterateSink* sink() { return recording_.get(); }
  void begin_step(std::uint64_t step) {
    if (recording_) recording_->begin_step(std::uint32_t(step));
  }
  void write(const json& record) {
    if (lines_) lines_->write(record);
  }
  void save_frame_of(const State& state) {
    if (lines_ && options_.frames_every > 0 && state.step % options_.frames_every == 0)
      save_frame(options_.folder / "frames", mesh_, state.positions, state.step);
  }
  void save(SavedState& saved) {
    if (!lines_) return;
    saved.lines_bytes = lines_->bytes();
    saved.recording_bytes = recording_ ? recording_->flush() : 0;
    save_state(state_file(), saved);
  }

 private:
  std::filesystem::path state_file() const { return options_.folder / "loop.state"; }

  const SimulationOptions& options_;
  const SimulatedMesh& mesh_;
  json header_;
  std::unique_ptr<RecordingWriter> recording_;
  std::unique_ptr<StepLines> lines_;
};

json step_record(const StepReport& report, const State& state, double time_step) {
  json record{{"step", state.step},
              {"time_s", double(state.step) * time_step},
              {"ending", name(report.ending)},
              {"iterates", report.iterates},
              {"evaluations", report.evaluations},
              {"orders", report.orders},
              {"contacts", report.contacts},
              {"smallest_gap_m", report.smallest_gap},
              {"lag_m", report.lag},
              {"kinetic_j", report.kinetic},
              {"gravitational_j", report.gravitational},
              {"elastic_j", report.elastic},
              {"barrier_j", report.barrier},
              {"momentum_kg_m_s", {report.momentum[0], report.momentum[1], report.momentum[2]}},
              {"state", hexadecimal(hash_of_state(state))}};
  return record;
}

}  // namespace

std::uint64_t hash_of_state(const State& state) {
  Hasher hasher;
  hasher.mix(state.step);
  for (const Positions* list : {&state.positions, &state.velocities})
    hasher.bytes(list->data(), sizeof(double) * std::size_t(list->size()));
  return hasher.value();
}

SimulationResult simulate(const SimulationOptions& options, const std::function<void(const json&)>& done) {
  const auto start = std::chrono::steady_clock::now();
  const Simulated scene = make_scene(options.scene, options.triangles, options.seed);
  if (options.save_every == 0) throw std::invalid_argument("a state is saved every 0 steps");
  const ContactMesh contact_mesh(scene.mesh);
  if (!options.strategy.id.empty()) check_contact_strategy(options.strategy, contact_mesh);
  SimulationResult result;
  SavedState& saved = result;
  saved.state = first_state(scene.mesh);
  SimulationFiles files(options, scene, saved);
  result.first_step = saved.state.step;
  const double radius = scene.physics.radius();
  ContactFinder finder(
      contact_mesh, {options.detection, options.keep * radius, radius, options.lose_every, options.strategy},
      files.sink());
  ImplicitStep step(scene, finder);
  PenetrationCheck check(scene.mesh);
  files.save_frame_of(saved.state);
  for (bool ends = saved.state.step >= options.steps; !ends;) {
    files.begin_step(saved.state.step);
    const DetectionWork before = finder.work();
    const auto begin = std::chrono::steady_clock::now();
    StepReport report;
    try {
      report = step.advance(saved.state);
    } catch (const TooNear&) {
      result.too_near = true;
      files.save(saved);
      break;
    }
    const double seconds = seconds_since(begin);
    const DetectionWork& after = finder.work();
    const double detect = after.detect_seconds - before.detect_seconds,
                 impact = after.impact_seconds - before.impact_seconds, rest = seconds - detect - impact;
    const std::uint64_t penetrations = check.intersecting_pairs(saved.state.positions);
    if (penetrations > 0 && saved.penetrations == 0) saved.first_penetration = saved.state.step;
    saved.penetrations += penetrations;
    saved.stalled += report.ending == Ending::stalled ? 1 : 0;
    saved.unconverged += report.ending == Ending::iterations ? 1 : 0;
    result.detect_seconds += detect;
    result.impact_seconds += impact;
    result.rest_seconds += rest;
    json record = step_record(report, saved.state, scene.physics.time_step);
    record["penetrations"] = penetrations;
    record["questions"] = after.questions - before.questions;
    record["searches"] = after.searches - before.searches;
    record["candidates"] = after.candidates - before.candidates;
    record["detect_ms"] = 1e3 * detect;
    record["impact_ms"] = 1e3 * impact;
    record["rest_ms"] = 1e3 * rest;
    record["memory_bytes"] = finder.bytes() + step.bytes();
    record["resident_bytes"] = resident_memory();
    record["peak_resident_bytes"] = peak_memory();
    files.write(record);
    files.save_frame_of(saved.state);
    ends = saved.state.step >= options.steps ||
           (options.most_seconds > 0 && seconds_since(start) >= options.most_seconds);
    if (ends || saved.state.step % options.save_every == 0) files.save(saved);
    if (done) done(record);
  }
  return result;
}

}  // namespace kbvh::experiments::loop
