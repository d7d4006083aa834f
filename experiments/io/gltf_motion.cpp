#include "experiments/io/gltf_motion.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "experiments/io/bytes.hpp"

namespace kbvh::io::gltf {
namespace {

double length_of(const double* q) {
  return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

void normalize(double* q) {
  const double length = length_of(q);
  for (int i = 0; i < 4; ++i) q[i] /= length;
}

/// Interpolates two unit quaternions along the shorter arc (glTF 2.0, appendix C).
void slerp(const double* a, const double* b, double u, double* out) {
  double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const double sign = cosine < 0 ? -1 : 1;
  cosine *= sign;
  double left = 1 - u, right = u;
  if (cosine <
      1 - 1e-12) {  // when closer, the quotient of sines loses its digits, and the chord equals the arc
    const double angle = std::acos(cosine), sine = std::sin(angle);
    left = std::sin((1 - u) * angle) / sine;
    right = std::sin(u * angle) / sine;
  }
  for (int i = 0; i < 4; ++i) out[i] = left * a[i] + sign * right * b[i];
}

Affine local_of(const Node& node) {
  if (node.matrix) return affine_of(node.matrix->data());
  std::array<double, 4> q = node.rotation;
  normalize(q.data());
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const std::array<double, 9> r{1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                                2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                                2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
  Affine out;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) out.m[4 * i + j] = r[3 * i + j] * node.scale[j];
    out.m[4 * i + 3] = node.translation[i];
  }
  return out;
}

std::size_t target_count(const Document& document, const Node& node) {
  if (!node.mesh) return 0;
  const Mesh& mesh = document.meshes[*node.mesh];
  return mesh.primitives.empty() ? 0 : mesh.primitives[0].targets.size();
}

}  // namespace

Affine operator*(const Affine& a, const Affine& b) {
  Affine out;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 4; ++c) {
      out.m[4 * r + c] = a.m[4 * r] * b.m[c] + a.m[4 * r + 1] * b.m[4 + c] + a.m[4 * r + 2] * b.m[8 + c] +
                         (c == 3 ? a.m[4 * r + 3] : 0);
    }
  }
  return out;
}

Affine affine_of(const double* columns) {
  Affine out;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 4; ++c) out.m[4 * r + c] = columns[4 * c + r];
  }
  return out;
}

Track::Track(const Document& document, const Channel& channel, std::size_t width)
    : interpolation_(channel.interpolation), path_(channel.path), width_(width) {
  const bool of_weights = path_ == Path::weights;
  times_ = read_numbers(document, channel.input, 1);
  values_ = read_numbers(document, channel.output, of_weights ? 1 : static_cast<std::uint32_t>(width));
  const std::size_t per_key = width * (interpolation_ == Interpolation::cubic_spline ? 3 : 1);
  if (times_.empty()) fail(document.file, channel.place, "has no keyframes");
  if (values_.size() != times_.size() * per_key) {
    fail(document.file, channel.place,
         std::to_string(values_.size()) + " output numbers for " + std::to_string(times_.size()) +
             " keys of " + std::to_string(per_key));
  }
  const auto key_at = [&](std::size_t k) {
    return values_.begin() + static_cast<std::ptrdiff_t>(k * per_key);
  };
  std::size_t kept = 0;
  for (std::size_t k = 0; k < times_.size(); ++k) {
    if (kept > 0 && times_[k] <= times_[kept - 1]) {
      const std::string place = place_in(channel.input, k);
      if (times_[k] < times_[kept - 1]) {
        fail(document.file, place,
             "time " + text_of(times_[k]) + " s is before the previous key's " + text_of(times_[kept - 1]) +
                 " s");
      }
      if (!std::equal(key_at(k), key_at(k + 1), key_at(kept - 1))) {
        fail(document.file, place,
             "has the same time " + text_of(times_[k]) + " s as the previous key, but another value");
      }
      ++merged_;
      continue;
    }
    times_[kept] = times_[k];
    if (kept != k) std::copy(key_at(k), key_at(k + 1), key_at(kept));
    ++kept;
  }
  times_.resize(kept);
  values_.resize(kept * per_key);
  if (path_ != Path::rotation) return;
  for (std::size_t k = 0; k < kept; ++k) {
    double* q = values_.data() + k * per_key + (interpolation_ == Interpolation::cubic_spline ? width : 0);
    if (!(length_of(q) > 0)) fail(document.file, place_in(channel.output, k), "a rotation of length 0");
    if (interpolation_ == Interpolation::linear) normalize(q);
  }
}

const double* Track::value(std::size_t key) const {
  return interpolation_ == Interpolation::cubic_spline ? &values_[(3 * key + 1) * width_]
                                                       : &values_[key * width_];
}

std::vector<double> Track::jumps() const {
  std::vector<double> jumps;
  if (interpolation_ != Interpolation::step) return jumps;
  for (std::size_t k = 1; k < times_.size(); ++k)
    if (!std::equal(value(k), value(k) + width_, value(k - 1))) jumps.push_back(times_[k]);
  return jumps;
}

void Track::evaluate(double time, double* out) const {
  const auto after = std::upper_bound(times_.begin(), times_.end(), time);
  const std::size_t key = after == times_.begin() ? 0 : static_cast<std::size_t>(after - times_.begin()) - 1;
  // At a key exactly its value, for any interpolation.
  if (time <= times_[key] || key + 1 == times_.size() || interpolation_ == Interpolation::step) {
    std::copy(value(key), value(key) + width_, out);
  } else {
    interpolate(key, time, out);
  }
  if (path_ == Path::rotation) normalize(out);
}

void Track::interpolate(std::size_t key, double time, double* out) const {
  const double span = times_[key + 1] - times_[key], u = (time - times_[key]) / span;
  const double *a = value(key), *b = value(key + 1);
  if (interpolation_ == Interpolation::linear) {
    if (path_ == Path::rotation) return slerp(a, b, u, out);
    for (std::size_t i = 0; i < width_; ++i) out[i] = (1 - u) * a[i] + u * b[i];
    return;
  }
  const double u2 = u * u, u3 = u2 * u;
  const double *leaving = a + width_, *arriving = b - width_;
  for (std::size_t i = 0; i < width_; ++i) {
    out[i] = (2 * u3 - 3 * u2 + 1) * a[i] + span * (u3 - 2 * u2 + u) * leaving[i] + (3 * u2 - 2 * u3) * b[i] +
             span * (u3 - u2) * arriving[i];
  }
}

Pose::Pose(const Document& document, const Animation* animation)
    : document_(&document), nodes_(document.nodes), globals_(document.nodes.size()) {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const std::string place = "nodes[" + std::to_string(i) + "]";
    if (!(length_of(node.rotation.data()) > 0)) fail(document.file, place + ".rotation", "has length 0");
    const std::size_t targets = target_count(document, node);
    std::vector<double> weights = node.weights;
    if (weights.empty() && node.mesh) weights = document.meshes[*node.mesh].weights;
    if (weights.empty()) weights.assign(targets, 0.0);
    if (node.mesh && weights.size() != targets) {
      fail(document.file, place,
           std::to_string(weights.size()) + " morph weights for " + std::to_string(targets) + " targets");
    }
    weights_.push_back(std::move(weights));
  }
  if (animation == nullptr) return;
  std::set<std::pair<std::uint32_t, Path>> seen;
  std::set<double> times, jumps;
  for (const Channel& channel : animation->channels) {
    if (!seen.insert({channel.node, channel.path}).second) {
      fail(document.file, channel.place,
           "animates a property of nodes[" + std::to_string(channel.node) + "] twice");
    }
    const Node& node = nodes_[channel.node];
    if (channel.path != Path::weights && node.matrix) {
      fail(document.file, channel.place,
           "animates nodes[" + std::to_string(channel.node) + "], which has a matrix");
    }
    const std::size_t width = channel.path == Path::weights    ? target_count(document, node)
                              : channel.path == Path::rotation ? 4
                                                               : 3;
    if (width == 0) {
      fail(document.file, channel.place,
           "animates weights of nodes[" + std::to_string(channel.node) + "], which has no morph targets");
    }
    tracks_.push_back({channel.path, channel.node, Track(document, channel, width)});
    times.insert(tracks_.back().track.times().begin(), tracks_.back().track.times().end());
    const std::vector<double> own = tracks_.back().track.jumps();
    jumps.insert(own.begin(), own.end());
  }
  times_.assign(times.begin(), times.end());
  jumps_.assign(jumps.begin(), jumps.end());
}

bool Pose::morphs(std::size_t node) const {
  return std::any_of(tracks_.begin(), tracks_.end(),
                     [&](const Bound& bound) { return bound.path == Path::weights && bound.node == node; });
}

std::size_t Pose::merged_keyframes() const {
  std::size_t sum = 0;
  for (const Bound& bound : tracks_) sum += bound.track.merged();
  return sum;
}

void Pose::evaluate(double time) {
  for (const Bound& bound : tracks_) {
    Node& node = nodes_[bound.node];
    double* out = bound.path == Path::translation ? node.translation.data()
                  : bound.path == Path::rotation  ? node.rotation.data()
                  : bound.path == Path::scale     ? node.scale.data()
                                                  : weights_[bound.node].data();
    bound.track.evaluate(time, out);
  }
  for (std::uint32_t i : document_->order) {
    const Affine local = local_of(nodes_[i]);
    globals_[i] = document_->parent[i] ? globals_[*document_->parent[i]] * local : local;
  }
}

}  // namespace kbvh::io::gltf
