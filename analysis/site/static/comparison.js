// The first page's comparison: the lab with two strategies on one cloth, playing, and what it measures as one sentence.
(() => {
  const place = document.querySelector("[data-comparison]");
  if (!place) return;
  const finding = place.querySelector(".finding"), target = place.querySelector(".comparison-lab");
  const state = { format: "kbvh-lab", version: 1, sceneId: "cloth-on-box", strategy: "kinetic_aabb", compare: { strategy: "bottom_up" },
    view: { panel: "work" } };

  const load = (name, attributes, parent) => new Promise((resolve, reject) => {
    const element = Object.assign(document.createElement(name), attributes, { onload: resolve, onerror: () => reject(new Error(`${attributes.src ?? attributes.href} is missing`)) });
    parent.append(element);
  });

  /// "39 times fewer", from two totals.
  const times = (large, small) => (large / small < 10 ? (large / small).toFixed(1) : Math.round(large / small).toLocaleString("en"));

  /// Writes the sentence when both strategies have been played to the end.
  function tell({ work, frames }) {
    const [kinetic, refit] = work?.series ?? [];
    if (!kinetic || !frames || !work.timed) return false;
    const total = (series, id) => (series.counters[id] ?? []).reduce((sum, value) => sum + value, 0);
    const values = [kinetic, refit].map((series) => total(series, "values_written")), clock = [kinetic, refit].map((series) => total(series, "milliseconds"));
    if (!(values[0] > 0 && clock[1] > 0)) return false;
    const slower = clock[0] > clock[1];
    finding.innerHTML = `On this cloth a kinetic AABB tree writes <b>${times(values[1], values[0])} times fewer values</b> than a refit, and is <b>${slower ? times(clock[0], clock[1]) : times(clock[1], clock[0])} times ${slower ? "slower" : "faster"}</b>.`;
    place.dataset.told = "yes";
    return true;
  }

  /// The lab follows the theme switch of the page.
  function follow(lab) {
    const theme = () => lab.view({ theme: document.body.dataset.theme || "auto" });
    new MutationObserver(theme).observe(document.body, { attributeFilter: ["data-theme"] });
    theme();
  }

  async function start() {
    await load("link", { rel: "stylesheet", href: "lab/lab.css" }, document.head);
    await load("script", { src: "lab/lab.js" }, document.head);
    const lab = await globalThis.kbvhLab.mountLab(target, state, { compact: true, page: "lab/index.html", views: ["transport", "stage", "panels"], panels: ["work"], metrics: ["values_written", "milliseconds"] });
    follow(lab);
    // Playing would disturb the measurement.
    const look = () => {
      if (!tell(lab.state)) setTimeout(look, 300);
      else if (!matchMedia("(prefers-reduced-motion: reduce)").matches) lab.play();
    };
    look();
  }

  start().catch((error) => { finding.textContent = `The comparison could not start: ${error.message}`; });
})();
