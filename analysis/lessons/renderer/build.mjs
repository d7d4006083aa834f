// Renders the course: node renderer/build.mjs --walker PROGRAM --kbvh PROGRAM --out FOLDER
// The folder gets one page per lesson, an index, the teacher's notes, the slides, and what these need.
import { build } from "esbuild";
import { mkdirSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { load } from "js-yaml";
import { checkers } from "../checkers/index.mjs";
import { figures as figureMakers } from "../figures/index.mjs";
import { rules, standalone } from "../figures/svg.mjs";
import { makeNumbers } from "../numbers/numbers.mjs";
import { states as preparedStates, exerciseStates } from "../states.mjs";
import { blocks, options, reasons } from "./blocks.mjs";
import { contents, page, sourceList } from "./pages.mjs";
import { escape, fill, parse, renderer } from "./text.mjs";

export const root = dirname(dirname(fileURLToPath(import.meta.url)));

/// Reads the lessons in order.
export function lessons() {
  return readdirSync(join(root, "text")).filter((name) => name.endsWith(".md")).sort().map((name) => ({
    name: name.replace(/\.md$/, ""), ...parse(readFileSync(join(root, "text", name), "utf8"), name) }));
}

export function sources() {
  return load(readFileSync(join(root, "sources.yaml"), "utf8"));
}

/// Cuts the teacher's notes out of a lesson's HTML.
function divide(html) {
  let teacher = "";
  const student = html.replace(/<!--teacher-->([\s\S]*?)<!--\/teacher-->/g, (_, notes) => ((teacher += notes), ""));
  return { student, teacher };
}

export function render({ numbers, data }) {
  const known = sources(), all = lessons(), pages = {}, used = new Set();
  const drawn = Object.fromEntries(Object.entries(figureMakers).map(([name, make]) => [name, make(data, numbers)]));
  const states = { ...preparedStates, ...exerciseStates() };
  const links = (current) => [["index.html", "Course", current === "index"],
    ...all.map(({ meta, name }) => [name + ".html", `<b>${meta.lesson}</b> <span>${escape(meta.short)}</span>`, current === name]),
    ["../index.html", "Lab", false], ["slides.html", "Pictures", current === "slides"],
    ...(current === "teacher" ? [["teacher.html", "Teacher", true]] : [])];
  const shown = [], notes = [];
  for (const { name, meta, text, file } of all) {
    const env = { order: [], headings: [], predictions: [], figures: [], exercises: [], answers: [] };
    const cited = new Set();
    const md = renderer({ sources: known, cited, blocks: blocks({ figures: drawn, states, checkers, numbers }) });
    const html = reasons(options(md.render(fill(text, numbers, file, used), env)), numbers);
    const { student, teacher } = divide(html);
    const at = all.findIndex((lesson) => lesson.name === name);
    const neighbour = (lesson, word) => lesson ? `<a class="${word}" href="${lesson.name}.html">${escape(lesson.meta.title)}</a>` : "<span></span>";
    const body = `<header><p class="number">Lesson ${meta.lesson} of ${all.length} · ${meta.minutes} minutes</p>
<h1>${escape(meta.title)}</h1><p class="lead">${escape(meta.lead)}</p></header>
${contents(env.headings)}<article>${student}</article>
${sourceList(env.order, known)}<nav class="neighbours">${neighbour(all[at - 1], "previous")}${neighbour(all[at + 1], "next")}</nav>`;
    pages[name + ".html"] = page({ title: `${meta.title} · kinetic hierarchies`, body, links: links(name) });
    shown.push({ name, meta, figures: env.figures, exercises: env.exercises, answers: env.answers });
    notes.push(`<section class="notes"><h2 id="${name}">Lesson ${meta.lesson}: <a href="${name}.html">${escape(meta.title)}</a></h2>\n${teacher}</section>`);
  }
  pages["teacher.html"] = page({ title: "Teacher's notes · kinetic hierarchies", kind: "teacher", links: links("teacher"),
    body: `<header><h1>Teacher's notes</h1><p class="lead">Timing, answers and stumbling blocks, lesson by lesson. Students do not need this page.</p></header>${notes.join("\n")}` });
  pages["slides.html"] = page({ title: "Pictures · kinetic hierarchies", kind: "slides", links: links("slides"),
    body: `<header><h1>Pictures</h1><p class="lead">Every picture of the course at the size of a slide. Each is a file of its own in the folder <code>pictures</code>; printed in landscape, this page gives one picture a sheet.</p></header>${shown
      .flatMap(({ meta, figures }) => figures.map((figure) => `<figure><p class="number">Lesson ${meta.lesson}</p>${drawn[figure]}<figcaption><a href="pictures/${figure}.svg">${figure}.svg</a></figcaption></figure>`)).join("\n")}` });
  const rows = shown.map(({ name, meta, exercises, answers }) => `<li data-lesson="${name}.html" data-tasks="${exercises.length + answers.length}"><a href="${name}.html"><b>${meta.lesson}. ${escape(meta.title)}</b></a>
<span class="minutes">${meta.minutes} min, ${exercises.length} exercises that the lab checks</span> <span class="progress"></span><p>${escape(meta.lead)}</p></li>`);
  pages["index.html"] = page({ title: "Kinetic bounding volume hierarchies: a course", kind: "index", links: links("index"),
    body: fill(readFileSync(join(root, "text/index.html"), "utf8"), { ...numbers,
      "course.minutes": { value: all.reduce((sum, { meta }) => sum + meta.minutes, 0) }, "course.lessons": { value: all.length } }, "index.html")
      .replace("<!--lessons-->", `<ol class="lessons">${rows.join("\n")}</ol>`) });
  return { pages, drawn, states, used, all };
}

/// KaTeX's style with its fonts inside, so that no browser asks for a file from another place.
function mathematicsStyle() {
  const folder = join(root, "node_modules/katex/dist");
  return readFileSync(join(folder, "katex.min.css"), "utf8").replace(
    /src:url\(fonts\/([\w-]+)\.woff2\)[^;}]*/g, (_, font) => /Main|Math|AMS|Size/.test(font)
      ? `src:url(data:font/woff2;base64,${readFileSync(join(folder, "fonts", font + ".woff2")).toString("base64")}) format("woff2")`
      : "src:local(serif)");
}

async function main() {
  const { values } = parseArgs({ options: { walker: { type: "string" }, kbvh: { type: "string" }, out: { type: "string" } } });
  if (!values.walker || !values.kbvh || !values.out) throw new Error("usage: build.mjs --walker PROGRAM --kbvh PROGRAM --out FOLDER");
  mkdirSync(join(values.out, "pictures"), { recursive: true });
  const made = makeNumbers({ walker: values.walker, kbvh: values.kbvh, cache: join(dirname(values.walker), "lesson_numbers.json") });
  const { pages, drawn } = render(made);
  for (const [name, html] of Object.entries(pages)) writeFileSync(join(values.out, name), html);
  for (const [name, svg] of Object.entries(drawn)) writeFileSync(join(values.out, "pictures", name + ".svg"), standalone(svg));
  writeFileSync(join(values.out, "katex.css"), mathematicsStyle());
  writeFileSync(join(values.out, "lessons.css"), readFileSync(join(root, "page/lessons.css"), "utf8") + rules + "\n");
  writeFileSync(join(values.out, "numbers.json"), JSON.stringify(made.numbers, null, 1));
  await build({ entryPoints: [join(root, "page/lessons.mjs")], bundle: true, minify: true, format: "iife", target: "es2020",
    outfile: join(values.out, "lessons.js"), logLevel: "warning" });
  console.log(`${Object.keys(pages).length} pages, ${Object.keys(drawn).length} pictures, ${Object.keys(made.numbers).length} numbers in ${values.out}`);
}

if (process.argv[1] === fileURLToPath(import.meta.url)) await main();
