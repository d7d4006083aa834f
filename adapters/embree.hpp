#pragma once
// Owners of Embree's objects, and the adapter's queries of them.
#include <embree3/rtcore.h>

#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include "core/scene/rays.hpp"

namespace kbvh {

/// Restores the floating-point state: Embree flushes denormals and may leave that mode set.
class KeepFloatingPointState {
 public:
#if defined(__SSE__)
  KeepFloatingPointState() : state_(_mm_getcsr()) {}
  ~KeepFloatingPointState() {
    _mm_setcsr(state_);
  }

 private:
  unsigned state_;
#else
  KeepFloatingPointState() {}
  ~KeepFloatingPointState() {}
#endif
};

struct ReleaseDevice {
  using pointer = RTCDevice;
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  using pointer = RTCScene;
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
struct ReleaseGeometry {
  using pointer = RTCGeometry;
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};

using DevicePointer = std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseDevice>;
using ScenePointer = std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>;
using GeometryPointer = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, ReleaseGeometry>;

/// The properties that the library reports about itself.
struct EmbreeFacts {
  std::string version, instructions;
};

/// Asks a device with the default configuration for the version of the library and for the widest instruction
/// set that it uses here. An unknown version is empty.
inline EmbreeFacts embree_facts() {
  const KeepFloatingPointState keep;
  const DevicePointer device(rtcNewDevice("threads=0,set_affinity=0"));
  if (!device) return {};
  const auto ask = [&](RTCDeviceProperty property) { return rtcGetDeviceProperty(device.get(), property); };
  const auto number = [&](RTCDeviceProperty property) { return std::to_string(ask(property)); };
  return {"Embree " + number(RTC_DEVICE_PROPERTY_VERSION_MAJOR) + "." +
              number(RTC_DEVICE_PROPERTY_VERSION_MINOR) + "." + number(RTC_DEVICE_PROPERTY_VERSION_PATCH),
          ask(RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0  ? "avx512"
          : ask(RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0 ? "avx"
                                                                : "sse"};
}

/// How a scene stores its leaves.
enum class SceneLayout : std::uint8_t { compact, usual };

/// A scene of one geometry that is refitted at each commit.
struct RefitScene {
  ScenePointer scene;  // none for an empty body
  GeometryPointer geometry;

  RTCGeometry make(RTCDevice device, RTCGeometryType type, SceneLayout layout) {
    scene.reset(rtcNewScene(device));
    rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_LOW);
    rtcSetSceneFlags(scene.get(), layout == SceneLayout::compact
                                      ? RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_COMPACT
                                      : RTC_SCENE_FLAG_DYNAMIC);
    geometry.reset(rtcNewGeometry(device, type));
    rtcSetGeometryBuildQuality(geometry.get(), RTC_BUILD_QUALITY_REFIT);
    return geometry.get();
  }
  void build() {
    rtcCommitGeometry(geometry.get());
    rtcAttachGeometry(scene.get(), geometry.get());
    rtcCommitScene(scene.get());
  }
  void refit() {
    rtcCommitGeometry(geometry.get());
    rtcCommitScene(scene.get());
  }
};

/// The largest coordinate that is passed to Embree. Its FLT_LARGE is 1.844e18: it leaves out primitives whose
/// bounds reach that value, and asserts that rays do not.
inline constexpr double largest_coordinate = 1.8e18;

inline Box<float> bounds_of_scene(const RefitScene& scene) {
  if (!scene.scene) return {};
  RTCBounds bounds;
  rtcGetSceneBounds(scene.scene.get(), &bounds);
  return {{bounds.lower_x, bounds.lower_y, bounds.lower_z}, {bounds.upper_x, bounds.upper_y, bounds.upper_z}};
}
/// Returns a ray in Embree's form, with the geometry identifiers of a miss.
inline RTCRayHit ray_of(const Ray<float>& ray) {
  RTCRayHit made{};
  made.ray.org_x = ray.origin[0];
  made.ray.org_y = ray.origin[1];
  made.ray.org_z = ray.origin[2];
  made.ray.dir_x = ray.direction[0];
  made.ray.dir_y = ray.direction[1];
  made.ray.dir_z = ray.direction[2];
  made.ray.tnear = 0;
  made.ray.tfar = ray.length;
  made.ray.mask = ~0U;
  made.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  return made;
}

}  // namespace kbvh
