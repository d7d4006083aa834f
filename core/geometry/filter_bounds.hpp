#pragma once

/// Error bounds of the filters. Kept apart from predicates.hpp for the kernels, which include no standard
/// header.
///
/// orient3d, with unit roundoff u (2^-53 in double, 2^-24 in float): a product of three differences takes
/// part in at most 8 roundings (3 differences, 2 products, 1 subtraction, 2 additions), so the error is at
/// most
/// ((1 + u)^8 - 1) permanent < 8.01 u permanent, where the permanent is the sum of the absolute values of all
/// products in the determinant. It is itself computed with a relative error below 16 u; 10 u covers both.
///
/// Underflow, in double: it adds at most 2^-1075 per product; a 2x2 minor's is multiplied by a difference of
/// up to 2e100: together below 1e-221.
///
/// Underflow, in float: coordinates go up to 1e30, and one constant for all of them would be felt at the
/// sizes of real meshes. Errors of at most 2^-149 in a 2x2 minor are multiplied by a difference d, so
/// `minor3f` is added to the minor's magnitude before d multiplies it: relative3f minor3f > 2^-147, four
/// times as much. The last products and that with relative3f add at most 5 * 2^-150: `absolute3f` covers
/// them. Both are normal numbers: denormals are slow. Float's triple products may overflow; then the bound is
/// infinite or NaN, and nothing compares as greater (every infinite or NaN step of the value makes the same
/// step of the permanent, all of whose terms are positive, infinite or NaN).
///
/// What the float filter decides, the double filter of the same determinant would decide, too: beyond 10 u
/// permanent with at most 8.01 u of error, 1.9 * 2^-24 of the permanent are left, and the other needs less
/// than 20 * 2^-53; where underflow counts, 2^-127 is left, and it needs 1e-220.
///
/// orient2d: 4 roundings at most, 6 u covers them; underflow adds at most 2 * 2^-1075 (a normal number stands
/// for it).
namespace kbvh::filter {
inline constexpr double relative3d = 10.0 * 0x1p-53;
inline constexpr double absolute3d = 1e-220;
inline constexpr double relative2d = 6.0 * 0x1p-53;
inline constexpr double absolute2d = 1e-300;

inline constexpr float relative3f = 10.0F * 0x1p-24F;
inline constexpr float minor3f = 0x1p-126F;
inline constexpr float absolute3f = 0x1p-126F;
}  // namespace kbvh::filter
