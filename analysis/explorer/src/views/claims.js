// What these results decide of the paper's claims, and nothing else.
import { make } from "../dom.js";
import { plural } from "../words.js";

export function claims({ model }) {
  const { claims: decided, report } = model.data;
  return [
    make("p", {
      class: "lead",
      text: `${plural(decided.length, "claim")} of Zachmann and Weller (2006), theory (T) and experiments (E), that these results decide. Verdicts follow from thresholds in analysis/claims.json.`,
    }),
    ...decided.map((one) => {
      const picture = make("div", { class: "drawn" });
      picture.innerHTML = one.picture; // made by analysis/claim_pictures.py
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
            " ",
            one.brief,
          ),
          report &&
            make(
              "p",
              { class: "note" },
              make("a", { href: `${report}#claim-${one.id}`, text: "points, conditions and figures in the report" }),
            ),
        ),
        one.picture && picture,
      );
    }),
  ];
}
