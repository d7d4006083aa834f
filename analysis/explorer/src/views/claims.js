// What these results decide of the paper's claims, and nothing else.
import { make } from "../dom.js";
import { plural } from "../words.js";

const HERE = "this study";

export function claims({ model }) {
  const { claims: decided, report, reference } = model.data;
  return [
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
      text: `${plural(decided.length, "claim")} of Zachmann and Weller (2006), theory (T) and experiments (E), judged by thresholds in analysis/claims.json: by these results where they decide, else by the reference run that comes with the project${reference ? ` (${reference})` : ""}.`,
    }),
    ...decided.map((one) => {
      const picture = make("div", { class: "drawn" });
      picture.innerHTML = one.picture; // made by analysis/claims/claim_pictures.py
      return make(
        "article",
        { class: "claim", id: `claim-${one.id}` },
        make(
          "div",
          {},
          make("h3", {}, make("span", { class: "id", text: one.id }), " ", one.claim),
          one.paper &&
            make("p", { class: "note", text: `${one.id.startsWith("T") ? "Bound" : "Paper"}: ${one.paper}` }),
          make(
            "p",
            {},
            make("span", { class: `verdict ${one.verdict.replaceAll(" ", "-")}`, text: one.verdict }),
            one.source === HERE ? " " : make("span", { class: "note", text: " by the reference run " }),
            one.brief,
          ),
          report &&
            make(
              "p",
              { class: "note" },
              make("a", { href: `${report}#claim-${one.id}`, text: "corners and conditions in the report" }),
            ),
        ),
        one.picture && picture,
      );
    }),
  ];
}
