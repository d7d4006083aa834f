// From a lesson's Markdown to HTML: front matter, numbers, mathematics, citations and blocks.
import { load } from "js-yaml";
import katex from "katex";
import MarkdownIt from "markdown-it";
import container from "markdown-it-container";

/// Splits a file into its front matter and its text. Throws if there is no front matter.
export function parse(source, file) {
  const match = /^---\n([\s\S]*?)\n---\n/.exec(source);
  if (!match) throw new Error(`${file}: expected front matter between two lines of ---`);
  return { meta: load(match[1]), text: nested(source.slice(match[0].length), file), file };
}

/// Writes blocks inside of blocks with fewer colons than the outer ones, as the parser wants it. Throws if a block
/// is not closed.
function nested(text, file) {
  const open = [];
  let code = false;
  const lines = text.split("\n").map((line, i) => {
    if (line.startsWith("```")) code = !code;
    if (code || !line.startsWith(":::")) return line;
    if (line.trim() === ":::" && open.length === 0) throw new Error(`${file}: line ${i + 1} closes a block that is not open`);
    if (line.trim() === ":::") {
      open.pop();
      return ":".repeat(7 - open.length);
    }
    open.push(line);
    return ":".repeat(8 - open.length) + line.slice(3);
  });
  if (open.length > 0) throw new Error(`${file}: the block '${open.at(-1)}' is not closed`);
  return lines.join("\n");
}

export function escape(text) {
  return String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
}

const words = ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve",
  "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen", "twenty"];

/// Formats a number of the course: `word` spells it out, a digit gives the decimals, `%` makes a percentage.
export function format(value, how = "") {
  if (typeof value === "string") return value;
  if (how === "word" || how === "Word") {
    const word = words[value] ?? value.toLocaleString("en");
    return how === "Word" ? word[0].toUpperCase() + word.slice(1) : word;
  }
  if (how === "%") return (100 * value).toLocaleString("en", { maximumFractionDigits: 1 }) + "\u00a0%";
  const digits = how === "" ? 3 : Number(how);
  return value.toLocaleString("en", { minimumFractionDigits: how === "" ? 0 : digits, maximumFractionDigits: digits });
}

/// Fills {{ key }} and {{ key | how }} from `numbers`. Records each used key in `used`. Throws on a missing key.
export function fill(text, numbers, file, used = new Set()) {
  return text.replace(/\{\{\s*([\w.]+)\s*(?:\|\s*([\w%]+)\s*)?\}\}/g, (all, key, how) => {
    if (!(key in numbers)) throw new Error(`${file}: no number '${key}'; numbers.mjs makes them`);
    used.add(key);
    return format(numbers[key].value, how);
  });
}

function mathematics(md) {
  const render = (tex, displayMode) => katex.renderToString(tex, { displayMode, throwOnError: true, strict: "error" });
  md.inline.ruler.after("escape", "math", (state, silent) => {
    if (state.src[state.pos] !== "$") return false;
    const end = state.src.indexOf("$", state.pos + 1);
    if (end < 0 || end === state.pos + 1) return false;
    if (!silent) state.push("math", "", 0).content = state.src.slice(state.pos + 1, end);
    state.pos = end + 1;
    return true;
  });
  md.block.ruler.before("fence", "math_block", (state, start, end, silent) => {
    const line = (n) => state.src.slice(state.bMarks[n] + state.tShift[n], state.eMarks[n]);
    if (line(start).trim() !== "$$") return false;
    let last = start + 1;
    while (last < end && line(last).trim() !== "$$") ++last;
    if (last >= end) return false;
    if (silent) return true;
    const token = state.push("math_block", "", 0);
    token.content = Array.from({ length: last - start - 1 }, (_, i) => line(start + 1 + i)).join("\n");
    state.line = last + 1;
    return true;
  }, { alt: ["paragraph", "list"] });
  md.renderer.rules.math = (tokens, i) => render(tokens[i].content, false);
  md.renderer.rules.math_block = (tokens, i) => `<div class="math">${render(tokens[i].content, true)}</div>\n`;
}

function citations(md, sources, cited) {
  md.inline.ruler.before("link", "cite", (state, silent) => {
    const match = /^\[@([\w-]+)(?:,\s*([^\]]+))?\]/.exec(state.src.slice(state.pos));
    if (!match) return false;
    if (!(match[1] in sources)) throw new Error(`no source '${match[1]}' in sources.yaml`);
    if (!silent) {
      cited.add(match[1]);
      state.push("cite", "", 0).meta = { id: match[1], place: match[2] };
    }
    state.pos += match[0].length;
    return true;
  });
  md.renderer.rules.cite = (tokens, i, _, env) => {
    const { id, place } = tokens[i].meta;
    const number = env.order.indexOf(id) < 0 ? env.order.push(id) : env.order.indexOf(id) + 1;
    return `<a class="cite" href="#source-${id}" title="${escape(sources[id].short)}">[${number}${place ? ", " + escape(place) : ""}]</a>`;
  };
}

/// Makes the renderer. `blocks` maps the name of a block to (rest of its line, opening?, env) => HTML.
export function renderer({ sources, cited, blocks }) {
  const md = new MarkdownIt({ html: true, typographer: false, linkify: false });
  mathematics(md);
  citations(md, sources, cited);
  for (const [name, render] of Object.entries(blocks))
    md.use(container, name, {
      validate: (line) => line.trim().split(/\s+/)[0] === name,
      render: (tokens, i, _, env) =>
        render(tokens[i].info.trim().slice(name.length).trim(), tokens[i].nesting === 1, env, tokens, i),
    });
  const slug = (text) => text.toLowerCase().replace(/<[^>]*>|[^\w\s-]/g, "").trim().replace(/\s+/g, "-");
  md.renderer.rules.heading_open = (tokens, i, options, env, self) => {
    tokens[i].attrSet("id", slug(tokens[i + 1].content));
    if (tokens[i].tag === "h2") env.headings.push({ id: slug(tokens[i + 1].content), text: tokens[i + 1].content.replace(/[*`]/g, "") });
    return self.renderToken(tokens, i, options);
  };
  md.renderer.rules.table_open = () => '<div class="table"><table>\n';
  md.renderer.rules.table_close = () => "</table></div>\n";
  return md;
}
