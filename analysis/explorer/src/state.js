// The state of the page and the link that holds it. Only what differs from the defaults is in the link.

/** Filters: lists of values of a facet; an empty list lets everything pass. */
export const FACETS = ["plan", "scene", "size", "l", "scalar", "machine", "commit", "strategy"];

const DEFAULTS = {
  ...Object.fromEntries(FACETS.map((name) => [name, []])),
  view: "answer",
  know: "none", // of the future: or "next", "clip"
  frames: "", // a keyframe: a class of l
  large: "any", // or a class of sizes
  asks: "", // what is asked of a cell
  of: "", // a scene of the answer
  lines: "six", // of a figure, or "all": the others pale
  contestants: "usual", // or "all"
  per: "best", // each strategy with its fastest setting, or "each" setting
  measure: "with_motion",
  against: "baseline",
  cells: "own", // of a profile: each one's "own", "all" of them, or the "common" ones
  cell: "",
  a: "",
  b: "",
  sort: "",
  claims: "number", // the order of the paper's claims, or "worst", "best": by verdict
  point: "",
};

/** Returns the state of a page without a link. */
export function initial() {
  return structuredClone(DEFAULTS);
}

/** Returns the link's fragment, without "#". */
export function encode(state) {
  const words = [];
  for (const [name, usual] of Object.entries(DEFAULTS)) {
    const value = state[name];
    if (Array.isArray(usual) ? value.length > 0 : value !== usual)
      words.push(
        `${name}=${[value]
          .flat()
          .map((one) => encodeURIComponent(one))
          .join(",")}`,
      );
  }
  return words.join("&");
}

/** Returns the state of a link's fragment. Words that it does not know are skipped: a link may be older than the page. */
export function decode(fragment) {
  const state = initial();
  for (const word of fragment.replace(/^#/, "").split("&")) {
    const at = word.indexOf("=");
    const name = word.slice(0, at);
    if (at < 0 || !(name in DEFAULTS)) continue;
    const values = word
      .slice(at + 1)
      .split(",")
      .filter(Boolean)
      .map(plain);
    if (Array.isArray(DEFAULTS[name])) state[name] = [...new Set(values)];
    else if (values.length) state[name] = values[0];
  }
  return state;
}

function plain(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text; // a link that was cut
  }
}
