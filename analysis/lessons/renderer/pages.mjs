// The frame around a page: head, navigation, footer.
import { escape } from "./text.mjs";

const licence = `Text and pictures: <a href="https://creativecommons.org/licenses/by/4.0/" rel="license">CC BY 4.0</a>,
the kbvh authors. Programs: MIT licence.`;

/// A whole page. `links` are [address, label, current?].
export function page({ title, body, links, kind = "lesson" }) {
  const nav = links.map(([to, label, current]) =>
    `<a href="${to}"${current ? ' aria-current="page"' : ""}>${label}</a>`).join("\n");
  return `<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<link rel="icon" href="data:,">
<title>${escape(title)}</title>
<link rel="stylesheet" href="katex.css">
<link rel="stylesheet" href="lessons.css">
</head>
<body class="${kind}">
<a class="skip" href="#text">Skip to the text</a>
<nav class="course" aria-label="Lessons">
${nav}
</nav>
<main id="text">
${body}
</main>
<footer><p>${licence}</p></footer>
<script src="lessons.js"></script>
</body>
</html>
`;
}

/// The list of sources that a page cites, in the order of their first citation.
export function sourceList(order, sources) {
  if (order.length === 0) return "";
  const items = order.map((id) => {
    const { text, url } = sources[id];
    return `<li id="source-${id}">${text}${url ? ` <a href="${escape(url)}">${escape(url)}</a>` : ""}</li>`;
  });
  return `<section class="sources"><h2 id="sources">Sources</h2>\n<ol>\n${items.join("\n")}\n</ol></section>\n`;
}

/// A lesson's table of contents.
export function contents(headings) {
  return `<nav class="contents" aria-label="This lesson"><ol>${headings
    .map(({ id, text }) => `<li><a href="#${id}">${escape(text)}</a></li>`).join("")}</ol></nav>\n`;
}
