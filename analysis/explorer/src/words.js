// Numbers for readers, as analysis/results/text.py formats them.

const THIN = "\u202f";

/** Formats with significant digits; only an exact 0 is "0". */
export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -4 || exponent >= 7) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    return `${mantissa}×10${[...String(Number(power))].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`;
  }
  const rounded = Number(value.toPrecision(digits));
  const decimals = Math.max(digits - 1 - Math.floor(Math.log10(Math.abs(rounded))), 0);
  const [whole, part] = rounded.toFixed(decimals).split(".");
  return whole.replace(/\B(?=(\d{3})+$)/g, THIN) + (part ? `.${part}` : "");
}

export const milliseconds = (value) => significant(value, 3);

/** Formats a ratio: two decimals around 1, three digits above, two below. */
export function factor(value) {
  if (value >= 0.1 && value < 1) return value.toFixed(2);
  return significant(value, value >= 1 ? 3 : 2);
}

export function count(value) {
  return value === null || value === undefined ? "–" : significant(value, 3);
}

export function bytes(value) {
  if (value === null || value === undefined) return "–";
  for (const [unit, scale] of [
    ["GB", 1e9],
    ["MB", 1e6],
    ["kB", 1e3],
  ])
    if (value >= scale) return `${significant(value / scale)}\u00a0${unit}`;
  return `${value}\u00a0B`;
}

export function percent(share, digits = 2) {
  return share === null || share === undefined ? "–" : `${significant(share * 100, digits)}${THIN}%`;
}

/** Begins a sentence. */
export function sentence(text) {
  return text[0].toUpperCase() + text.slice(1);
}

export function plural(number, noun) {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}

/** Writes the name of a scene for readers, without the size of one of its bodies: short of analysis/results/scene_names.py. */
export function sceneWords(name) {
  const words = /^[a-z]+(_[a-z]+)+(-\d+)*(?= \(|$)/.test(name) ? name.replaceAll("_", " ") : name;
  return words.replace(/(?<=\w) \d+(\.\d+)?[kM](?= |$)/, "");
}

/** Formats a tick of a logarithmic axis. */
export function tick(value) {
  if (value >= 1e6) return `${significant(value / 1e6, 3).replace(/\.0+$/, "")}M`;
  if (value >= 1e4) return `${Math.round(value / 1e3)}k`;
  return String(Number(value.toPrecision(3))).replace(/e([+-]\d+)/, (_, e) => `e${Number(e)}`);
}
