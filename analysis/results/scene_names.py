"""Groups results by scene: names identify scenes only if their hashes agree."""

from __future__ import annotations

import re
from typing import Any

import pandas as pd

#: The end of a scene's name that tells what was asked instead of pairs at frames, and the kernels that a study holds kbvh to.
ANSWER = re.compile(r"( \((contacts|changes of (candidates|pairs)|(in)?coherent rays(, any)?|within [\d.e-]+|\w+ kernels)\))*$")


def family(name: str, bodies: Any) -> str:
    """Removes the numbers of primitives from a scene's name, so that its sizes belong together.

    `tablecloth-2048-200` is `tablecloth` if its bodies have 2048 and 200 primitives. The kind of answer stays: "(contacts)",
    "(changes of pairs)", "(coherent rays)", "(sse kernels)".
    """
    answer = ANSWER.search(name)[0]
    name = name.removesuffix(answer)
    listed = bodies if isinstance(bodies, list) else []
    counts = {str(body.get("primitives")) for body in listed if isinstance(body, dict)}
    head, *rest = name.split("-")
    return "-".join([head, *(part for part in rest if part not in counts)]) + answer


def words(name: str) -> str:
    """Writes the id of a built-in scene as words for a reader: "waving_sheet-800" is "waving sheet-800". Other names stay."""
    return name.replace("_", " ") if re.fullmatch(r"[a-z]+(_[a-z]+)+(-\d+)*", ANSWER.sub("", name)) else name


def short(name: str) -> str:
    """Writes a scene's name for readers without the size of one of its bodies, which stands next to the size of all: "dress 65k" is "dress"."""
    return re.sub(r"(?<=\w) \d+(\.\d+)?[kM](?= |$)", "", words(name))


def told_apart(runs: pd.DataFrame) -> tuple[pd.Series, list[str]]:
    """Returns the scene of each run, and a sentence for every name that several scenes share.

    Of several scenes with one name and size, for example after a correction of a mesh, the one measured last keeps the name;
    the others have their hash appended. Scenes from files and shapes have sizes only if their names contain them.
    """
    told = list(runs[["hash", "card", "scalar"]].itertuples())
    card_of = {row.hash: row.card for row in told if row.hash and row.card}
    cards = [row.card or card_of.get(row.hash, "") for row in told]
    # Without a card a hash is of one scalar: another scalar's is no other scene.
    scalars = ["" if card else row.scalar for row, card in zip(told, cards)]
    one_size = runs["origin"].isin(("files", "shapes")) & (runs["scene"] == runs["scene_name"])
    table = pd.DataFrame(
        {
            "identity": [card or row.hash for row, card in zip(told, cards)],
            "place": list(zip(runs["scene"], runs["primitives"].where(~one_size, 0), scalars)),
            "scene": runs["scene"].to_list(),
            "hash": runs["hash"].to_list(),
        }
    )
    scenes = list(table["scene"])
    notes = []
    for _, rows in table[table["identity"] != ""].groupby("place", sort=False):
        newest = rows["identity"].iloc[-1]
        for _, older in rows[rows["identity"] != newest].groupby("identity", sort=False):
            for at in older.index:
                scenes[at] = f"{older['scene'].iloc[0]} (hash {older['hash'].iloc[0][:8]})"
        if rows["identity"].nunique() > 1:
            notes.append(
                f"{rows['identity'].nunique()} scenes are called {rows['scene'].iloc[0]}: "
                "the one measured last has the bare name, the others have their hash appended."
            )
    return pd.Series(scenes, index=runs.index), list(dict.fromkeys(notes))
