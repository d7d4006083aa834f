/**
 * Exact arithmetic on doubles for labels and tie checks: fractions of BigInts. A double is a fraction with a power of two
 * below, so the crossing of two stored lines is a fraction, too. Nothing here decides an answer of the engine.
 */

const bits = new DataView(new ArrayBuffer(8));

/** A fraction {n, d} with d > 0, in lowest terms. */
export function fraction(n, d = 1n) {
  if (d < 0n) { n = -n; d = -d; }
  const g = gcd(n < 0n ? -n : n, d);
  return g > 1n ? {n: n / g, d: d / g} : {n, d};
}

/** The fraction that equals a finite double. */
export function exact(x) {
  bits.setFloat64(0, x);
  const high = bits.getUint32(0);
  const exponent = (high >>> 20) & 0x7ff;
  let mantissa = (BigInt(high & 0xfffff) << 32n) | BigInt(bits.getUint32(4));
  let shift;
  if (exponent === 0) shift = -1074;
  else { mantissa |= 1n << 52n; shift = exponent - 1075; }
  if (high >>> 31) mantissa = -mantissa;
  return shift >= 0 ? fraction(mantissa << BigInt(shift)) : fraction(mantissa, 1n << BigInt(-shift));
}

export const add = (a, b) => fraction(a.n * b.d + b.n * a.d, a.d * b.d);
export const subtract = (a, b) => fraction(a.n * b.d - b.n * a.d, a.d * b.d);
export const multiply = (a, b) => fraction(a.n * b.n, a.d * b.d);
export const divide = (a, b) => fraction(a.n * b.d, a.d * b.n);
export const equal = (a, b) => a.n === b.n && a.d === b.d;
export const compare = (a, b) => { const l = a.n * b.d, r = b.n * a.d; return l < r ? -1 : l > r ? 1 : 0; };
export const isZero = (a) => a.n === 0n;

/** The nearest double, good enough for labels. */
export function toNumber({n, d}) {
  const size = (x) => (x < 0n ? -x : x).toString(2).length;
  const above = Math.max(0, size(n) - 1000), below = Math.max(0, size(d) - 1000);
  return Number(n >> BigInt(above)) / Number(d >> BigInt(below)) * 2 ** (above - below);
}

/**
 * Writes a fraction for people: an integer, a short fraction, or its decimals. `exactly` tells whether the text is the
 * number itself.
 */
export function spell(f) {
  if (f.d === 1n && f.n < 1000000n && f.n > -1000000n) return {text: f.n.toString(), exactly: true};
  if (f.d <= 999n && f.n < 100000n && f.n > -100000n) return {text: `${f.n}/${f.d}`, exactly: true};
  return {text: short(toNumber(f)), exactly: false};
}

/** A number in at most six digits, without trailing zeros. */
export function short(x, digits = 6) {
  if (!Number.isFinite(x)) return x > 0 ? 'never' : x < 0 ? 'always' : 'unknown';
  return String(Number(x.toPrecision(digits))).replace('-', '\u2212');
}

/**
 * A linear piece {t0, t1, x0, x1, ray?} as an exact line {p, v}: x(t) = p + v t. Null for a piece that is only a point.
 */
export function lineOf(piece) {
  const t0 = exact(piece.t0), x0 = exact(piece.x0);
  let v;
  if (piece.ray) v = exact(piece.x1);
  else {
    const span = subtract(exact(piece.t1), t0);
    if (isZero(span)) return null;
    v = divide(subtract(exact(piece.x1), x0), span);
  }
  return {p: subtract(x0, multiply(v, t0)), v};
}

/** The exact time at which two pieces cross: a fraction; null if they are parallel or one of them is unknown. */
export function crossingTime(a, b) {
  if (!a || !b) return null;
  const l = lineOf(a), m = lineOf(b);
  if (!l || !m) return null;
  const slope = subtract(l.v, m.v);
  return isZero(slope) ? null : divide(subtract(m.p, l.p), slope);
}

/** The exact time of an event of the engine, or null if it has none (reviews, windows). */
export function eventTime(event) {
  if (!event.exact || event.kind === 'review' || event.kind === 'window') return null;
  return crossingTime(event.winnerPiece, event.loserPiece);
}

function gcd(a, b) { while (b) [a, b] = [b, a % b]; return a; }
