#include "experiments/study/ray_measurement.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <random>

#include "experiments/common/text.hpp"

namespace kbvh::experiments {

namespace {

constexpr std::size_t most_compared = 256;  ///< rays of a frame that are compared with brute force

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

}  // namespace

RayStudy ray_study(std::string_view text) {
  const std::vector<std::string> words = split(text, ':');
  RayStudy study;
  if (words[0] == "coherent")
    study.pattern = RayStudy::Pattern::coherent;
  else if (words[0] == "incoherent")
    study.pattern = RayStudy::Pattern::incoherent;
  else
    throw std::invalid_argument("expected coherent or incoherent, got '" + words[0] + "'");
  if (words.size() > 1) {
    constexpr std::uint64_t most = 1U << 24;
    std::uint64_t count = 0;
    for (const char digit : words[1]) {
      if (digit < '0' || digit > '9' || count > most) count = most + 1;
      if (count <= most) count = 10 * count + std::uint64_t(digit - '0');
    }
    if (words[1].empty() || count == 0 || count > most)
      throw std::invalid_argument("expected 1 to " + std::to_string(most) + " rays, got '" + words[1] + "'");
    study.count = std::uint32_t(count);
  }
  if (words.size() > 2) {
    if (words[2] != "closest" && words[2] != "any")
      throw std::invalid_argument("expected closest or any, got '" + words[2] + "'");
    study.query = words[2] == "any" ? RayQuery::any : RayQuery::closest;
  }
  if (words.size() > 3) throw std::invalid_argument("unexpected '" + words[3] + "'");
  return study;
}

std::string text_of(const RayStudy& study) {
  return std::string(study.pattern == RayStudy::Pattern::coherent ? "coherent:" : "incoherent:") +
         std::to_string(study.count) + (study.query == RayQuery::any ? ":any" : ":closest");
}

std::string suffix_of(const RayStudy& study) {
  return std::string(study.pattern == RayStudy::Pattern::coherent ? " (coherent rays" : " (incoherent rays") +
         (study.query == RayQuery::any ? ", any)" : ")");
}

template <class S>
std::vector<Ray<S>> make_rays(const RayStudy& study, const Scene<S>& scene,
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
  if (study.pattern == RayStudy::Pattern::incoherent) {
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
template std::vector<Ray<float>> make_rays(const RayStudy&, const Scene<float>&, const std::vector<double>&);
template std::vector<Ray<double>> make_rays(const RayStudy&, const Scene<double>&,
                                            const std::vector<double>&);

template <class S>
RayMeasurement<S>::RayMeasurement(const Scene<S>& scene, std::vector<double> frames, const RayStudy& study,
                                  const PlanScript<S>* script)
    : scene_(&scene),
      frames_(std::move(frames)),
      study_(study),
      script_(script),
      rays_(make_rays(study, scene, frames_)),
      truth_(frames_.size()),
      hits_(rays_.size()),
      steady_from_(steady_frame(scene, std::span<const double>(frames_), script != nullptr)) {
  const std::size_t stride = (rays_.size() + most_compared - 1) / most_compared;
  for (std::size_t i = stride / 2; i < rays_.size(); i += stride) compared_.push_back(i);
}

template <class S>
std::uint64_t RayMeasurement<S>::ask(Session<S>& session, PhaseTimes& times) {
  session.hits(study_.query, rays_, std::span<RayHit>(hits_), times);
  return std::uint64_t(
      std::count_if(hits_.begin(), hits_.end(), [](const RayHit& hit) { return bool(hit); }));
}

template <class S>
void RayMeasurement<S>::verify(RayEntrant<S>& entrant, std::uint64_t oracle_every, Answers& answers) {
  Measured& measured = entrant.measured;
  Session<S> session(*scene_, measured.spec->contestant());
  std::vector<Ray<S>> rays;
  for (const std::size_t i : compared_) rays.push_back(rays_[i]);
  answers.resize(frames_.size());
  play_frames<S>(session, frames_, script_, [&](PhaseTimes& times, std::size_t f) {
    const std::uint64_t found = ask(session, times);
    entrant.hits += found;
    std::vector<bool> seen(session.scene().bodies.size(), false);
    for (const RayHit& hit : hits_)
      if (hit) seen[hit.body] = true;
    for (std::size_t body = 0; body < seen.size(); ++body)
      if (!seen[body] && session.scene().bodies[body].primitives.kind == PrimitiveKind::polygons)
        ++entrant.hidden_bodies;
    if (f % oracle_every != 0 && f + 1 != frames_.size()) return found;
    for (const std::size_t i : compared_) answers[f].push_back(hits_[i]);
    session.playback().evaluate_all();
    std::vector<RayHit>& truth = truth_[f];
    if (truth.size() != rays.size()) {
      truth.resize(rays.size());
      brute_force_hits<S>(session.scene(), session.playback(), RayQuery::closest, rays,
                          std::span<RayHit>(truth));
    }
    entrant.check.add(
        compare_hits<S>(session.scene(), session.playback(), study_.query, rays, answers[f], truth));
    ++measured.verification.frames;
    return found;
  });
  const RayCheck& check = entrant.check;
  measured.verification.pairs = check.hits;
  measured.verification.candidates = check.hits;
  measured.verification.missed = check.missed;
  measured.verification.extra = check.extra + check.misplaced;
  if (session.info().rays_guarantee == Guarantee::exact)
    measured.verification.first_violation = check.first_violation;
}

template <class S>
void RayMeasurement<S>::replay(Measured& measured, const Answers& answers) {
  Session<S> session(*scene_, measured.spec->contestant());
  const bool exact = session.info().rays_guarantee == Guarantee::exact;
  const auto same = [&](const RayHit& a, const RayHit& b) {
    return study_.query == RayQuery::any ? bool(a) == bool(b) : a == b;
  };
  const auto asked = [&](PhaseTimes& times, std::size_t f) {
    const std::uint64_t found = ask(session, times);
    for (std::size_t c = 0; exact && c < answers[f].size(); ++c)
      if (!same(hits_[compared_[c]], answers[f][c]))
        throw BrokenPromise("t = " + std::to_string(frames_[f]) + ": in the replay of the timed calls, ray " +
                            std::to_string(compared_[c]) + " has another answer than in the verification");
    return found;
  };
  measured.answers = play_frames<S>(session, frames_, script_, asked).answers;
  measured.counters = session.strategy().counters();
}

template <class S>
void RayMeasurement<S>::add(const ContestantSpec& spec, std::uint64_t oracle_every) {
  RayEntrant<S> entrant;
  Measured& measured = entrant.measured;
  measured.spec = &spec;
  measured.sampled_every = oracle_every;
  measured.steady_from = steady_from_;
  entrant.attempt([&] {
    Answers answers;
    verify(entrant, oracle_every, answers);
    if (!measured.verification.holds()) {
      measured.refused = measured.verification.first_violation;
      return;
    }
    replay(measured, answers);
    const auto begin = std::chrono::steady_clock::now();
    entrant.session = std::make_unique<Session<S>>(*scene_, spec.contestant(), Use::timed);
    measured.build_seconds = seconds_since(begin);
  });
  this->entrants_.push_back(std::move(entrant));
}

template <class S>
void RayMeasurement<S>::play(std::size_t i) {
  RayEntrant<S>& entrant = this->entrants_[i];
  entrant.attempt([&] {
    Session<S>& session = *entrant.session;
    const auto asked = [&](PhaseTimes& times, std::size_t) { return ask(session, times); };
    const WarmUp warm_up;
    play_frames<S>(session, frames_, script_, asked, &warm_up);
    entrant.keep(play_frames<S>(session, frames_, script_, asked));
  });
}

template <class S>
nlohmann::json RayMeasurement<S>::extras(std::size_t i) const {
  const RayEntrant<S>& entrant = this->entrants_[i];
  return {{"rays",
           {{"per_frame", rays_.size()},
            {"hits", entrant.hits},
            {"compared", entrant.check.rays},
            {"missed", entrant.check.missed},
            {"extra", entrant.check.extra},
            {"misplaced", entrant.check.misplaced},
            {"hidden_bodies", entrant.hidden_bodies}}}};
}

template <class S>
std::string RayMeasurement<S>::beyond_range(const Info& contestant) const {
  return out_of_range(contestant, std::span<const Ray<S>>(rays_));
}

template class RayMeasurement<float>;
template class RayMeasurement<double>;

}  // namespace kbvh::experiments
