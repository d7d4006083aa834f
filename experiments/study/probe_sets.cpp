#include "experiments/study/probe_sets.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "experiments/common/text.hpp"

namespace kbvh::experiments {

namespace {

constexpr std::size_t most_compared = 256;  ///< probes of a frame that are compared with brute force

using Vector = std::array<double, 3>;

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector unit(const Vector& a) {
  const double length = std::hypot(a[0], a[1], a[2]);
  return {a[0] / length, a[1] / length, a[2] / length};
}

/// Uniform in [0, 1), the same on every platform.
class Uniform {
 public:
  double operator()() { return double(random_()) / 4294967296.0; }

 private:
  std::mt19937 random_{1};
};

template <class S>
Ray<S> ray_from(const Vector& origin, const Vector& direction) {
  Ray<S> ray{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ray.origin[axis] = S(origin[axis]);
    ray.direction[axis] = S(direction[axis]);
  }
  ray.length = std::numeric_limits<S>::infinity();
  return ray;
}

template <class S>
Box<double> box_of(const Scene<S>& scene, const std::vector<double>& frames) {
  Playback<S> playback(scene);
  Box<double> box;
  for (const double t : {frames.front(), frames[frames.size() / 2], frames.back()}) {
    playback.seek(t);
    playback.evaluate_all();
    for (std::uint32_t body = 0; body < playback.body_count(); ++body)
      for (std::uint32_t v = 0; v < playback.plans(body).vertex_count(); ++v) {
        const S* const p = playback.positions(body) + std::size_t(3) * v;
        const double point[3] = {double(p[0]), double(p[1]), double(p[2])};
        box.extend(point);
      }
  }
  return box;
}

template <class S>
std::vector<Ray<S>> make_rays(const ProbeStudy& study, const Scene<S>& scene,
                              const std::vector<double>& frames) {
  const Box<double> box = box_of(scene, frames);
  std::vector<Ray<S>> rays;
  if (box.empty()) return rays;
  Vector centre, size;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    centre[axis] = (box.lower[axis] + box.upper[axis]) / 2;
    size[axis] = box.upper[axis] - box.lower[axis];
  }
  Uniform uniform;
  if (study.sought == ProbeStudy::Sought::incoherent_rays) {
    for (std::uint32_t i = 0; i < study.count; ++i) {
      Vector origin;
      for (std::size_t axis = 0; axis < 3; ++axis)
        origin[axis] = centre[axis] + (uniform() - 0.5) * size[axis];
      const double z = 2 * uniform() - 1, turn = 2 * std::numbers::pi * uniform(), r = std::sqrt(1 - z * z);
      rays.push_back(ray_from<S>(origin, {r * std::cos(turn), r * std::sin(turn), z}));
    }
    return rays;
  }
  // The camera stands to the side and above, at a distance of one and a half diagonals, and its pixels cover
  // the sphere around the box.
  const double radius = std::hypot(size[0], size[1], size[2]) / 2;
  const Vector back = unit({0.62, -0.71, 0.33});
  const Vector right = unit(cross({0, 0, 1}, back)), up = cross(back, right);
  const auto side = std::uint32_t(std::sqrt(double(study.count)));
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const double u = (x + 0.5) / side * 2 - 1, v = (y + 0.5) / side * 2 - 1;
      Vector origin, direction;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        origin[axis] = centre[axis] + 3 * radius * back[axis];
        direction[axis] = -3 * back[axis] + u * right[axis] + v * up[axis];
      }
      rays.push_back(ray_from<S>(origin, unit(direction)));
    }
  return rays;
}

template <class S>
std::vector<Ball<S>> make_balls(const ProbeStudy& study, const Scene<S>& scene,
                                const std::vector<double>& frames) {
  const Box<double> box = box_of(scene, frames);
  std::vector<Ball<S>> balls;
  if (box.empty()) return balls;
  double size[3];
  for (int axis = 0; axis < 3; ++axis) size[axis] = box.upper[axis] - box.lower[axis];
  Uniform uniform;
  for (std::uint32_t i = 0; i < study.count; ++i) {
    Ball<S>& ball = balls.emplace_back();
    for (int axis = 0; axis < 3; ++axis) ball.centre[axis] = S(box.lower[axis] + uniform() * size[axis]);
    ball.radius = S(study.radius * std::hypot(size[0], size[1], size[2]));
  }
  return balls;
}

/// The indices of the probes that are compared.
std::vector<std::size_t> some_of(std::size_t count) {
  std::vector<std::size_t> some;
  const std::size_t stride = (count + most_compared - 1) / most_compared;
  for (std::size_t i = stride / 2; i < count; i += stride) some.push_back(i);
  return some;
}

template <class S>
class RaySet final : public ProbeSet<S> {
 public:
  RaySet(RayQuery query, std::vector<Ray<S>> rays, std::size_t frames)
      : query_(query), rays_(std::move(rays)), hits_(rays_.size()), truth_(frames), remembered_(frames) {
    for (const std::size_t i : some_of(rays_.size())) {
      compared_.push_back(i);
      some_.push_back(rays_[i]);
    }
  }
  std::size_t size() const override { return rays_.size(); }
  Probes<S> probes() override { return RayProbes<S>{query_, rays_, hits_}; }
  ProbeCheck check(Session<S>& session, std::size_t frame) override {
    session.playback().evaluate_all();
    std::vector<RayHit>& truth = truth_[frame];
    if (truth.size() != some_.size()) {
      truth.resize(some_.size());
      brute_force_hits<S>(session.scene(), session.playback(), RayQuery::closest, some_,
                          std::span<RayHit>(truth));
    }
    return compare_hits<S>(session.scene(), session.playback(), query_, some_, answers(), truth);
  }
  void remember(std::size_t frame) override { remembered_[frame] = answers(); }
  void forget() override { remembered_.assign(remembered_.size(), {}); }
  std::string differs(std::size_t frame) const override {
    const std::vector<RayHit>& before = remembered_[frame];
    for (std::size_t c = 0; c < before.size(); ++c) {
      const RayHit& hit = hits_[compared_[c]];
      const bool same = query_ == RayQuery::any ? bool(hit) == bool(before[c]) : hit == before[c];
      if (!same) return "ray " + std::to_string(compared_[c]);
    }
    return {};
  }
  void mark_bodies(std::vector<bool>& seen) const override {
    for (const RayHit& hit : hits_)
      if (hit) seen[hit.body] = true;
  }

 protected:
  void clear_answers() override {}
  std::uint64_t hits() const override {
    return std::uint64_t(
        std::count_if(hits_.begin(), hits_.end(), [](const RayHit& hit) { return bool(hit); }));
  }

 private:
  std::vector<RayHit> answers() const {
    std::vector<RayHit> answers;
    for (const std::size_t i : compared_) answers.push_back(hits_[i]);
    return answers;
  }

  RayQuery query_;
  std::vector<Ray<S>> rays_, some_;
  std::vector<RayHit> hits_;
  std::vector<std::size_t> compared_;
  std::vector<std::vector<RayHit>> truth_, remembered_;  ///< [frame], of the compared rays; or empty
};

template <class S>
class BallSet final : public ProbeSet<S> {
 public:
  BallSet(std::vector<Ball<S>> balls, std::size_t frames)
      : balls_(std::move(balls)), place_(balls_.size(), none), truth_(frames), remembered_(frames) {
    for (const std::size_t i : some_of(balls_.size())) {
      place_[i] = std::uint32_t(some_.size());
      some_.push_back(balls_[i]);
    }
  }
  std::size_t size() const override { return balls_.size(); }
  Probes<S> probes() override { return BallProbes<S>{balls_, &found_}; }
  ProbeCheck check(Session<S>& session, std::size_t frame) override {
    session.playback().evaluate_all();
    std::optional<BallHits>& truth = truth_[frame];
    if (!truth) truth = brute_force_within<S>(session.scene(), session.playback(), some_);
    return compare_within(some_.size(), answers(), *truth);
  }
  void remember(std::size_t frame) override { remembered_[frame] = answers(); }
  void forget() override { remembered_.assign(remembered_.size(), {}); }
  std::string differs(std::size_t frame) const override {
    return !remembered_[frame] || answers() == *remembered_[frame] ? "" : "a point";
  }
  void mark_bodies(std::vector<bool>& seen) const override {
    for (const BallHit& hit : found_) seen[hit.body] = true;
  }

 protected:
  void clear_answers() override { found_.clear(); }
  std::uint64_t hits() const override { return found_.size(); }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// Returns the answers of the compared balls, numbered among these, sorted.
  BallHits answers() const {
    BallHits answers;
    for (const BallHit& hit : found_)
      if (place_[hit.ball] != none) answers.push_back({place_[hit.ball], hit.body, hit.primitive});
    std::sort(answers.begin(), answers.end());
    return answers;
  }

  std::vector<Ball<S>> balls_, some_;
  BallHits found_;
  std::vector<std::uint32_t> place_;                         ///< [ball] among those that are compared
  std::vector<std::optional<BallHits>> truth_, remembered_;  ///< [frame]
};

/// Reads a whole number of 1 to 2^24. `what` names the counted things.
std::uint32_t read_count(const std::string& word, const char* what) {
  constexpr std::uint64_t most = 1U << 24;
  std::uint64_t count = 0;
  for (const char digit : word) {
    if (digit < '0' || digit > '9' || count > most) count = most + 1;
    if (count <= most) count = 10 * count + std::uint64_t(digit - '0');
  }
  if (word.empty() || count == 0 || count > most)
    throw std::invalid_argument("expected 1 to " + std::to_string(most) + " " + what + ", got '" + word +
                                "'");
  return std::uint32_t(count);
}

bool of_rays(const ProbeStudy& study) {
  return study.sought != ProbeStudy::Sought::within;
}

}  // namespace

ProbeStudy ray_study(std::string_view text) {
  const std::vector<std::string> words = split(text, ':');
  ProbeStudy study;
  if (words[0] == "coherent")
    study.sought = ProbeStudy::Sought::coherent_rays;
  else if (words[0] == "incoherent")
    study.sought = ProbeStudy::Sought::incoherent_rays;
  else
    throw std::invalid_argument("expected coherent or incoherent, got '" + words[0] + "'");
  if (words.size() > 1) study.count = read_count(words[1], "rays");
  if (words.size() > 2) {
    if (words[2] != "closest" && words[2] != "any")
      throw std::invalid_argument("expected closest or any, got '" + words[2] + "'");
    study.query = words[2] == "any" ? RayQuery::any : RayQuery::closest;
  }
  if (words.size() > 3) throw std::invalid_argument("unexpected '" + words[3] + "'");
  return study;
}

ProbeStudy within_study(std::string_view text) {
  const std::vector<std::string> words = split(text, ':');
  if (words.size() != 2)
    throw std::invalid_argument("expected COUNT:RADIUS, as in 1000:0.01, got '" + std::string(text) + "'");
  ProbeStudy study{.sought = ProbeStudy::Sought::within, .count = read_count(words[0], "points")};
  const std::optional<double> radius = parse_number(words[1]);
  if (!radius || !(*radius >= 0 && *radius <= 1))
    throw std::invalid_argument("expected a radius of 0 to 1 diagonals of the scene's box, got '" + words[1] +
                                "'");
  study.radius = *radius;
  return study;
}

const char* key_of(const ProbeStudy& study) {
  return of_rays(study) ? "rays" : "within";
}

std::string text_of(const ProbeStudy& study) {
  if (!of_rays(study)) return std::to_string(study.count) + ":" + number_text(study.radius);
  return std::string(study.sought == ProbeStudy::Sought::coherent_rays ? "coherent:" : "incoherent:") +
         std::to_string(study.count) + (study.query == RayQuery::any ? ":any" : ":closest");
}

std::string suffix_of(const ProbeStudy& study) {
  if (!of_rays(study)) return " (within " + number_text(study.radius) + ")";
  return std::string(study.sought == ProbeStudy::Sought::coherent_rays ? " (coherent rays"
                                                                       : " (incoherent rays") +
         (study.query == RayQuery::any ? ", any)" : ")");
}

bool answers(const Info& contestant, const ProbeStudy& study) {
  return of_rays(study) ? contestant.can.rays : contestant.can.probes;
}

template <class S>
std::uint64_t ProbeSet<S>::ask(Session<S>& session, PhaseTimes& times) {
  clear_answers();
  session.probe(probes(), times);
  return hits();
}

template <class S>
std::unique_ptr<ProbeSet<S>> make_probes(const ProbeStudy& study, const Scene<S>& scene,
                                         const std::vector<double>& frames) {
  if (of_rays(study))
    return std::make_unique<RaySet<S>>(study.query, make_rays(study, scene, frames), frames.size());
  return std::make_unique<BallSet<S>>(make_balls(study, scene, frames), frames.size());
}

template class ProbeSet<float>;
template class ProbeSet<double>;
template std::unique_ptr<ProbeSet<float>> make_probes(const ProbeStudy&, const Scene<float>&,
                                                      const std::vector<double>&);
template std::unique_ptr<ProbeSet<double>> make_probes(const ProbeStudy&, const Scene<double>&,
                                                       const std::vector<double>&);

}  // namespace kbvh::experiments
