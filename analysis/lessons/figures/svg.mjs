// Pictures as SVG texts of 960 x 540 units, the shape of a slide. Colours are classes: the page's style and the style of
// a picture on its own (`standalone`) give them light and dark values.

export const width = 960, height = 540;

const round = (x) => (typeof x === "number" ? Math.round(100 * x) / 100 : x);
const attributes = (object) => Object.entries(object).filter(([, value]) => value !== undefined)
  .map(([key, value]) => ` ${key}="${String(round(value)).replaceAll("&", "&amp;").replaceAll('"', "&quot;").replaceAll("<", "&lt;")}"`).join("");
const plain = (text) => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;");

export const tag = (name, object, content = "") => `<${name}${attributes(object)}>${content}</${name}>`;
export const line = (x1, y1, x2, y2, css = "ink") => tag("line", { x1, y1, x2, y2, class: css });
export const rect = (x, y, w, h, css, rx) => tag("rect", { x, y, width: w, height: h, class: css, rx });
export const circle = (cx, cy, r, css) => tag("circle", { cx, cy, r, class: css });
export const text = (x, y, content, css = "", anchor = "start") => tag("text", { x, y, class: css || undefined, "text-anchor": anchor === "start" ? undefined : anchor }, plain(content));
export const polyline = (points, css) => tag("polyline", { points: points.map(([x, y]) => round(x) + "," + round(y)).join(" "), class: css });
export const polygon = (points, css) => tag("polygon", { points: points.map(([x, y]) => round(x) + "," + round(y)).join(" "), class: css });
export const arrow = (x1, y1, x2, y2, css = "ink") => {
  const d = Math.hypot(x2 - x1, y2 - y1) || 1, [u, v] = [(x2 - x1) / d, (y2 - y1) / d];
  return line(x1, y1, x2 - 8 * u, y2 - 8 * v, css) + polygon([[x2, y2], [x2 - 14 * u + 6 * v, y2 - 14 * v - 6 * u], [x2 - 14 * u - 6 * v, y2 - 14 * v + 6 * u]], css + " solid");
};

/// A whole picture. `title` says in words what the picture shows.
export function picture(title, ...parts) {
  return `<svg class="picture" viewBox="0 0 ${width} ${height}" role="img" xmlns="http://www.w3.org/2000/svg"><title>${plain(title)}</title>${parts.flat(Infinity).join("")}</svg>`;
}

export const rules = `
.picture text{font:20px system-ui,sans-serif;fill:var(--ink)}
.picture .small{font-size:16px}.picture .big{font-size:26px;font-weight:600}.picture .bold{font-weight:700}
.picture .quiet{fill:var(--quiet)}
.picture line,.picture polyline,.picture polygon,.picture path{fill:none;stroke:var(--ink);stroke-width:2}
.picture rect,.picture circle{fill:none;stroke:var(--ink);stroke-width:2}
.picture .grid{stroke:var(--grid);stroke-width:1}.picture .axis{stroke:var(--quiet);stroke-width:1.5}
.picture .thick{stroke-width:5}.picture .thin{stroke-width:1.2}.picture .dash{stroke-dasharray:7 6}
.picture .a{stroke:var(--a)}.picture .b{stroke:var(--b)}.picture .c{stroke:var(--c)}.picture .d{stroke:var(--d)}.picture .soft{stroke:var(--soft)}
.picture text.a{stroke:none;fill:var(--a)}.picture text.b{stroke:none;fill:var(--b)}.picture text.c{stroke:none;fill:var(--c)}.picture text.d{stroke:none;fill:var(--d)}
.picture .solid{fill:var(--ink)}.picture .a.solid{fill:var(--a)}.picture .b.solid{fill:var(--b)}.picture .c.solid{fill:var(--c)}.picture .d.solid{fill:var(--d)}.picture .soft.solid{fill:var(--soft)}
.picture .bare{stroke:none}.picture .paper{fill:var(--paper)}.picture .wash{fill:var(--grid);stroke:none}
.picture .fa{fill:var(--fa)}.picture .fb{fill:var(--fb)}.picture .fc{fill:var(--fc)}.picture .fd{fill:var(--fd)}`;

/// Colours of the pictures, distinguishable for the colour-blind: blue, orange, green, purple.
export const light = "--ink:#1c1f24;--quiet:#5b6370;--grid:#e3e6ea;--soft:#a7afba;--paper:#ffffff;--a:#0063a8;--b:#c24a00;--c:#00795a;--d:#8a3a8f;--fa:#0063a822;--fb:#c24a0022;--fc:#00795a22;--fd:#8a3a8f22";
export const dark = "--ink:#e8eaed;--quiet:#a2abb8;--grid:#31363d;--soft:#6b7480;--paper:#16191d;--a:#6cb8f5;--b:#ff9d5c;--c:#4fd1a5;--d:#d99be0;--fa:#6cb8f530;--fb:#ff9d5c30;--fc:#4fd1a530;--fd:#d99be030";

/// The picture as a file of its own.
export function standalone(svg) {
  return svg.replace(/(<svg[^>]*>)/, `$1<style>svg{${light};background:var(--paper)}@media (prefers-color-scheme:dark){svg{${dark}}}${rules}</style>`);
}
