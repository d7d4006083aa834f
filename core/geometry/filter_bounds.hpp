#pragma once

/// Error bounds of the filters. Separate from predicates.hpp, because the kernels include no standard header.
///
/// orient3d, with unit roundoff u (2^-53 in double, 2^-24 in float): a product of three differences takes
/// part in at most 8 roundings (3 differences, 2 products, 1 subtraction, 2 additions). The error is
/// therefore at most ((1 + u)^8 - 1) permanent < 8.01 u permanent, where the permanent is the sum of the
/// absolute values of all products in the determinant. The permanent is itself computed with a relative error
/// below 16 u; 10 u covers both.
///
/// Underflow in double adds at most 2^-1075 per product. In a 2x2 minor this is multiplied by a difference of
/// up to 2e100. Together the error is below 1e-221.
///
/// Underflow in float: coordinates go up to 1e30, and a single constant for all of them would be too coarse
/// at the sizes of real meshes. Errors of at most 2^-149 in a 2x2 minor are multiplied by a difference d, so
/// `minor3f` is added to the minor's magnitude before d multiplies it: relative3f minor3f > 2^-147, four
/// times the error. The last products and the multiplication by relative3f add at most 5 * 2^-150;
/// `absolute3f` covers them. Both constants are normal numbers, because denormals are slow. Float's triple
/// products may overflow. The bound is then infinite or NaN, and no value compares as greater: every infinite
/// or NaN step of the value occurs in the permanent, too, all of whose terms are positive, infinite or NaN.
///
/// A verdict of the float filter is also a verdict of the double filter of the same determinant: beyond 10 u
/// permanent with at most 8.01 u of error, 1.9 * 2^-24 of the permanent remain, and the double filter needs
/// less than 20 * 2^-53. Where underflow counts, 2^-127 remains, and the double filter needs 1e-220.
///
/// orient2d: at most 4 roundings, covered by 6 u; underflow adds at most 2 * 2^-1075 (a normal number stands
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
