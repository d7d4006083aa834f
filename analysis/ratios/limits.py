"""The limits of a study's conclusions, computed from its data."""

from __future__ import annotations

import pandas as pd

from results import scene_names, text
from results.load import READ_COUNTERS, Study

NOISY = 0.1  #: spread of repetitions from which a run is called noisy


def limits(study: Study) -> list[tuple[str, str]]:
    """Returns pairs of a heading and one or two sentences."""
    runs, timed = study.runs, study.timed
    found = [_noise(timed), _origin(runs), _oracle(runs), _extent(runs), _machine(runs), _hidden(runs), _absent(study)]
    if study.notes:
        found.append(("Input", " ".join(study.notes)))
    return [entry for entry in found if entry[1]]


def _noise(timed: pd.DataFrame) -> tuple[str, str]:
    if timed.empty:
        return "Noise", "Nothing was timed."
    single = int((timed["repetitions"] < 2).sum())
    several = timed[(timed["repetitions"] > 1) & timed["spread"].notna()]
    words = []
    if len(several):
        spread = several["spread"].median()
        worst = several.loc[several["spread"].idxmax()]
        noisy = int((several["spread"] > NOISY).sum())
        words.append(
            f"Repetitions of one run differ by {text.percent(spread)} (median of largest minus smallest total) and by up to "
            f"{text.percent(worst['spread'])} ({worst['label']}, {scene_names.words(worst['scene'])}, l = {worst['l']:g}); smaller differences "
            "are not findings."
        )
        if noisy:
            words.append(f"{noisy} of {text.plural(len(several), 'run')} spread by more than {text.percent(NOISY)}.")
        fewest = int(several["repetitions"].min())
        if fewest < 5:
            words.append(f"Some runs have only {text.plural(fewest, 'repetition')}: their ranges underestimate the noise.")
    if single:
        words.append(f"{text.plural(single, 'run')} of {len(timed)} had a single repetition and no estimate of noise.")
    sessions = timed.groupby("group")["session"].nunique()
    if (sessions > 1).any():
        words.append(
            f"In {text.plural(int((sessions > 1).sum()), 'table')} of {len(sessions)} the times come from several sessions, "
            "between which the machine may have changed; ratios across them are marked ~."
        )
    return "Noise", " ".join(words)


def _origin(runs: pd.DataFrame) -> tuple[str, str]:
    commits = [commit for commit in runs["commit"].unique() if commit]
    words = []
    if len(commits) > 1:
        words.append(
            f"The results come from {len(commits)} commits ({text.listing([c[:10] for c in commits])}); each ratio is of two "
            "runs of one commit."
        )
    dirty = int(runs["dirty"].sum())
    if dirty:
        words.append(
            f"{dirty} of {text.plural(len(runs), 'run')} came from a tree with uncommitted changes: the commit alone does not "
            "reproduce them."
        )
    kinds = [kind for kind in runs["build_type"].unique() if kind and kind.lower() not in ("release", "relwithdebinfo")]
    if kinds:
        words.append(f"The build type was {text.listing(kinds)}, not Release: times are not comparable with others.")
    return "Origin", " ".join(words)


def _oracle(runs: pd.DataFrame) -> tuple[str, str]:
    sampled = runs[runs["sampled_every"] > 1]
    words = []
    if len(sampled):
        low, high = int(sampled["sampled_every"].min()), int(sampled["sampled_every"].max())
        every = text.ordinal(low) if low == high else f"{text.ordinal(low)} to {text.ordinal(high)}"
        words.append(
            f"{text.plural(len(sampled), 'run')} of {len(runs)} {'was' if len(sampled) == 1 else 'were'} compared with the "
            f"oracle on every {every} frame only; an error between these frames would go unseen, and missed and extra pairs "
            "are counts of the sample."
        )
    else:
        words.append("Every frame of every run was compared with the oracle.")
    checked = int(runs["verified_frames"].fillna(0).sum())
    words.append(f"{text.plural(checked, 'frame')} were compared in all.")
    return "Verification", " ".join(words)


def _extent(runs: pd.DataFrame) -> tuple[str, str]:
    low, high = runs["primitives"].min(), runs["primitives"].max()
    sizes = text.size(low) if low == high else f"{text.size(low)} to {text.size(high)}"
    depths = sorted(runs["l"].unique())
    scalars = sorted(runs["scalar"].unique())
    words = [
        f"{text.plural(runs['scene'].nunique(), 'scene')} with {sizes} primitives, l = "
        f"{text.listing([f'{value:g}' for value in depths])}, in {text.listing(scalars)}: nothing is known outside of these "
        "values."
    ]
    shorter = runs[runs["frames"] < 100]
    if len(shorter):
        words.append(
            f"{text.plural(len(shorter), 'run')} of {len(runs)} had fewer than 100 frames: their 99th percentile is the worst "
            "frame."
        )
    seeds = runs["seed"][runs["seed"] != ""].unique()
    if len(seeds) == 1:
        words.append(f"One seed only ({seeds[0]}): the variation between scenes of one kind was not measured.")
    return "Extent", " ".join(words)


def _machine(runs: pd.DataFrame) -> tuple[str, str]:
    machines = runs["machine"].nunique()
    words = [f"{machines} machines; ratios are only formed within one machine." if machines > 1 else "One machine."]
    scaling = "" if (runs["threads"] > 1).any() else "scaling over cores, "
    said = threads_said(runs)
    words.append(
        f"{said[0].upper()}{said[1:]}; {scaling}GPUs, energy and hardware counters (cache misses, mispredicted branches) were "
        "not measured."
    )
    return "Machine", " ".join(words)


def threads_said(runs: pd.DataFrame) -> str:
    """Says on how many threads the contestants of a study ran, without a capital letter."""
    several = runs[runs["threads"] > 1]
    if several.empty:
        return "every contestant ran on one thread"
    counts = text.listing([f"{count}" for count in sorted(several["threads"].unique())])
    some = "every contestant" if len(several) == len(runs) else text.listing(sorted(several["title"].unique()))
    rest = "" if len(several) == len(runs) else ", everything else on one"
    return f"{some} ran on {counts} threads{rest}"


def _hidden(runs: pd.DataFrame) -> tuple[str, str]:
    hidden = sorted(runs[~runs["audited"]]["title"].unique())
    if not hidden:
        return "Hidden boxes", ""
    return (
        "Hidden boxes",
        f"The boxes of {text.listing(hidden)} are not visible, so protrusion and looseness are unknown there; pairs were "
        "checked nevertheless.",
    )


def _absent(study: Study) -> tuple[str, str]:
    timed = study.timed
    words = []
    counted = timed[[f"{name}_per_frame" for name in READ_COUNTERS]].notna().any(axis=1)
    if len(timed) and not counted.all():
        words.append(f"{text.plural(int((~counted).sum()), 'run')} of {len(timed)} recorded no counters.")
    if len(timed) and not timed["baseline"].any():
        words.append("No baseline was timed, so there are no ratios.")
    if len(study.refused):
        words.append(f"{text.plural(len(study.refused), 'contestant run')} got no time; the reason is given below the table.")
    if len(timed) and not (timed["over_time"].map(len) > 0).any():
        words.append("These results have no quality of boxes over time, because they are from an older program.")
    return "Not measured", " ".join(words)
