#include "experiments/run/time_left.hpp"

#include <algorithm>

#include "experiments/common/steps_left.hpp"

namespace kbvh::experiments {

namespace {

/// Returns the work of each table of a scene, in order.
std::vector<double> tables_of(const Study& study, const SceneSpec& spec, std::size_t contestants) {
  constexpr double usual_triangles = 16000, usual_keyframes = 60;  // of files, before they are read
  const bool built_in = !spec.builtin.empty();
  const double triangles = built_in ? double(spec.options.triangles) : usual_triangles;
  const double keyframes = built_in ? double(spec.options.keyframes) : usual_keyframes;
  std::vector<std::uint32_t> per_keyframe = study.per_keyframe;
  if (study.asks.continuous || has_own_frames(spec)) per_keyframe = {1};
  std::vector<double> tables;
  for (std::size_t scalar = 0; scalar < study.scalars.size(); ++scalar)
    for (const std::uint32_t l : per_keyframe) {
      double frames = (keyframes - 1) * l + 1;
      if (study.frames_limit > 0) frames = std::min(frames, double(study.frames_limit));
      tables.push_back(triangles * frames * double(contestants) *
                       double(verification_steps + study.repetitions));
    }
  return tables;
}

}  // namespace

TimeLeft::TimeLeft(const Plan& plan, const std::vector<std::size_t>& contestants, std::function<double()> now)
    : now_(std::move(now)) {
  for (std::size_t i = 0; i < plan.studies.size(); ++i)
    for (const SceneSpec& spec : plan.studies[i].scenes)
      scenes_.push_back(tables_of(plan.studies[i], spec, contestants[i]));
  for (const std::vector<double>& tables : scenes_)
    for (const double work : tables) ahead_ += work;
}

void TimeLeft::begin_scene() {
  if (scene_ > 0)
    while (table_ < scenes_[scene_ - 1].size()) begin_table(0);
  end_table();
  ++scene_;
  table_ = 0;
}

void TimeLeft::begin_table(std::size_t steps) {
  end_table();
  ++table_;
  steps_ = steps;
  made_ = 0;
  began_ = now_();
}

void TimeLeft::end_table() {
  if (scene_ == 0 || table_ == 0 || table_ > scenes_[scene_ - 1].size()) return;
  double& work = scenes_[scene_ - 1][table_ - 1];
  ahead_ -= work;
  if (made_ > 0) {
    worked_ += part_done();
    took_ += now_() - began_;
  }
  steps_ = made_ = 0;
  work = 0;
}

void TimeLeft::made(std::size_t steps) {
  made_ = std::min(steps_, made_ + steps);
}

double TimeLeft::part_done() const {
  if (steps_ == 0 || table_ > scenes_[scene_ - 1].size()) return 0;
  return scenes_[scene_ - 1][table_ - 1] * double(made_) / double(steps_);
}

double TimeLeft::seconds() const {
  constexpr double least = 3;  // seconds of work, before which an estimate is a guess
  const double part = part_done();
  const double took = took_ + (made_ > 0 ? now_() - began_ : 0);
  if (!(worked_ + part > 0) || took < least) return -1;
  return (ahead_ - part) * took / (worked_ + part);
}

std::string TimeLeft::said() const {
  return time_left_in_words(seconds());
}

}  // namespace kbvh::experiments
