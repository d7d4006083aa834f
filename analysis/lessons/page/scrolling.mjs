// Marks what is wider than its place, so that a reader sees that it scrolls: `data-more` names the sides on which something is hidden.

const wide = "nav.course, .scroll, .table, .math, pre";

function mark(element) {
  const hidden = element.scrollWidth - element.clientWidth, at = element.scrollLeft;
  const sides = hidden < 2 ? [] : [at > 1 ? "left" : "", at < hidden - 1 ? "right" : ""].filter(Boolean);
  element.dataset.more = sides.join(" ");
}

export function markScrolling() {
  const sizes = new ResizeObserver((entries) => entries.forEach(({ target }) => mark(target)));
  for (const element of document.querySelectorAll(wide)) {
    if (element.closest(".lab-place")) continue;
    if (!element.matches("[tabindex], nav")) element.tabIndex = element.scrollWidth > element.clientWidth ? 0 : -1;
    element.addEventListener("scroll", () => mark(element), { passive: true });
    sizes.observe(element);
    mark(element);
  }
}
