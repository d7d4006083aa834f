// What these results decide of the paper's claims, and nothing else.
import { make } from "../dom.js";
import { plural } from "../words.js";

const HERE = "this study";
/** The verdicts, from the best to the worst. */
const VERDICTS = ["holds", "holds with a condition", "does not hold"];
/** The orders of the list, by the words of the choice: the data have the claims by number. */
export const ORDERS = { number: "by number: E1, E2, …", worst: "what does not hold first", best: "what holds first" };

/** Returns claims in an order of ORDERS; those of one verdict stay by number, and so do all in an unknown order. */
export function inOrder(claims, order) {
  const sign = { worst: -1, best: 1 }[order] ?? 0;
  return claims.toSorted((a, b) => sign * (VERDICTS.indexOf(a.verdict) - VERDICTS.indexOf(b.verdict)));
}

export function claims({ model, state }) {
  const { claims: decided, report, reference, paper } = model.data;
  return [
    make(
      "p",
      { class: "lead tally" },
      "Does the paper hold? ",
      VERDICTS.map((verdict) => {
        const mine = decided.filter((one) => one.verdict === verdict);
        const by = mine.filter((one) => one.source !== HERE).length;
        return (
          mine.length > 0 && [
            make("span", { class: `verdict ${verdict.replaceAll(" ", "-")}`, text: verdict }),
            ` ${mine.length}${by ? ` (${by} by the reference run)` : ""}  `,
          ]
        );
      }),
    ),
    ...(paper ?? []).map((text) => make("p", { class: "main-claim", text })),
    make("p", {
      class: "note",
      text: `The ${plural(decided.length, "claim")} of Zachmann and Weller (2006): experiments (E), theory (T) and conclusions (C). These results judge the claims that they can decide; the reference run that comes with the project${reference ? ` (${reference})` : ""} judges the others. The thresholds are in analysis/claims.json. Sizes here count the moving body only, as in the paper.`,
    }),
    ...inOrder(decided, state.claims).map((one) => {
      const picture = make("div", { class: "drawn" });
      picture.innerHTML = one.picture; // made by analysis/claims/claim_pictures.py
      const verdict = (text) => make("span", { class: `verdict ${text.replaceAll(" ", "-")}`, text });
      return make(
        "details",
        { class: "claim", id: `claim-${one.id}` },
        make(
          "summary",
          {},
          make("span", { class: "id", text: one.id }),
          verdict(one.verdict),
          one.claim,
          one.source !== HERE && make("span", { class: "note", text: " (by the reference run)" }),
        ),
        make(
          "div",
          { class: "inside" },
          make(
            "div",
            {},
            one.paper && make("p", { class: "note", text: `${one.id.startsWith("E") ? "Paper" : "Bound"}: ${one.paper}` }),
            one.corners?.length > 0 && [
              make("p", { class: "note", text: "What was measured, without motion evaluation, for each pair of programs that is compared:" }),
              make(
                "ul",
                { class: "corners" },
                one.corners.map(([name, span, own]) => make("li", {}, verdict(own), ` ${name}: `, make("strong", { text: span }))),
              ),
            ],
            // The ranges above say which structures the extremes of the sentence belong to.
            make("p", { text: one.corners?.length ? one.brief.replace(/Measured: .*; claimed: /, "Claimed: ") : one.brief }),
            report && make("p", { class: "note" }, make("a", { href: `${report}#claim-${one.id}`, text: "corners and conditions in the report" })),
          ),
          one.picture && picture,
        ),
      );
    }),
  ];
}
