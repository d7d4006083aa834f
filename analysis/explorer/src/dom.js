// Elements of the page.

/** Makes an element: attributes (functions are listeners), then children. */
export function make(name, attributes = {}, ...children) {
  const element = name.startsWith("svg:")
    ? document.createElementNS("http://www.w3.org/2000/svg", name.slice(4))
    : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (typeof value === "function") element.addEventListener(key, value);
    else if (key === "text") element.textContent = value;
    else element.setAttribute(key, value === true ? "" : value);
  }
  element.append(
    ...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false),
  );
  return element;
}

/** Makes the marker of a contestant, as analysis/figures/colours.py draws it. */
export function symbol(contestant) {
  const { corners, filled } = contestant.look;
  const paint = {
    fill: filled ? paintOf(contestant) : "var(--page)",
    stroke: paintOf(contestant),
    "stroke-width": 1.6,
  };
  const shape = corners.length
    ? make("svg:polygon", { points: corners.map((c) => c.join(",")).join(" "), ...paint })
    : make("svg:circle", { r: 4.2, ...paint });
  return make(
    "svg:svg",
    { class: "symbol", viewBox: "-6.5 -6.5 13 13", width: 13, height: 13, "aria-hidden": "true" },
    shape,
  );
}

/** Returns the colour of a contestant, in the page's scheme. */
export function paintOf(contestant) {
  return contestant.paint ?? `var(--contestant-${contestant.index})`;
}

/** Returns the declarations of all contestants' colours, in one scheme. */
export function paints(contestants, scheme) {
  return contestants.map((one) => `--contestant-${one.index}:${one.look[scheme]}`).join(";");
}

/** Makes a labelled choice among options: {value: label}, or groups of them. */
export function choice(label, options, chosen, change) {
  const option = ([value, text]) => make("option", { value, selected: value === chosen, text });
  const select = make(
    "select",
    { change: (event) => change(event.target.value) },
    Object.entries(options).map(([value, text]) =>
      typeof text === "string"
        ? option([value, text])
        : make("optgroup", { label: value }, Object.entries(text).map(option)),
    ),
  );
  return make("label", { class: "choice" }, make("span", { text: label }), select);
}

/** Copies a text, and says so on the button for a moment. */
export async function copy(text, button) {
  const said = button.textContent;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "copied";
  } catch {
    // A page from a file may have no clipboard: the old way works there.
    const area = make("textarea", { style: "position:fixed;opacity:0" });
    area.value = text;
    document.body.append(area);
    area.select();
    button.textContent = document.execCommand("copy") ? "copied" : "press Ctrl+C";
    area.remove();
  }
  button.setAttribute("aria-live", "polite");
  setTimeout(() => (button.textContent = said), 1500);
}

/** Says of what is wider than its frame that it scrolls, and fades the right edge, or else the lower one, where more is hidden. */
export function hintScrolling(root) {
  for (const one of root.querySelectorAll(".scroll, .plot-scroll")) {
    const mark = () => {
      const right = one.scrollLeft + one.clientWidth < one.scrollWidth - 2;
      one.classList.toggle("wide", one.clientWidth < one.scrollWidth - 2);
      one.classList.toggle("more", right);
      one.classList.toggle("more-below", !right && one.scrollTop + one.clientHeight < one.scrollHeight - 2);
    };
    one.addEventListener("scroll", mark, { passive: true });
    new ResizeObserver(mark).observe(one);
  }
}
