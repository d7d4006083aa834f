// What these results decide of the paper's claims, and nothing else.
import { make } from "../dom.js";
import { plural } from "../words.js";

const HERE = "this study";

export function claims({ model }) {
  const { claims: decided, report, reference, paper } = model.data;
  return [
    ...(paper ?? []).map((text) => make("p", { class: "main-claim", text })),
    make(
      "p",
      { class: "lead tally" },
      "Does the paper hold? ",
      ["holds", "holds with a condition", "does not hold"].map((verdict) => {
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
    make("p", {
      class: "note",
      text: `${plural(decided.length, "claim")} of Zachmann and Weller (2006), experiments (E), then theory (T), judged by thresholds in analysis/claims.json: by these results where they decide, else by the reference run that comes with the project${reference ? ` (${reference})` : ""}. Sizes here count the moving body only, as in the paper.`,
    }),
    ...decided.map((one) => {
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
              make("p", { class: "note", text: "Measured factors, without motion evaluation, of each pair that is compared:" }),
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
