"""Makes the reference run from a folder with the results of plan `paper`: packed results, theory.json and claims.json.

The verdicts are computed from what is kept, so that they follow from it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Optional

from claims import claims
from claims.claim_points import ClaimError
from results import files, keep
from results.load import FILE_NAME, ResultError, load

REFERENCE = Path(__file__).resolve().parents[1] / "reference"


def make(folder: Path, out: Path) -> claims.Claims:
    """Writes the reference run to `out`; theory.json only if `folder` has one. Raises ResultError, ClaimError and OSError."""
    commits = set(load(folder).runs["commit"])
    if len(commits) != 1:
        raise ResultError(f"{folder} has results of {len(commits)} commits: a reference has one.")
    out.mkdir(parents=True, exist_ok=True)
    files.write_whole(out / (FILE_NAME + ".xz"), keep.packed(folder / FILE_NAME))
    (out / FILE_NAME).unlink(missing_ok=True)  # it would hide the packed one
    theory = folder / "theory.json"
    if theory.exists() and folder.resolve() != out.resolve():
        files.write_whole(out / theory.name, theory.read_bytes())
    found = claims.evaluate(load(out), out)
    claims.write(found, out)
    return found


def main(arguments: Optional[list[str]] = None) -> int:
    """Runs the command; returns the exit code: 0, or 2 for unusable input."""
    parser = argparse.ArgumentParser(prog="keep_reference.py", description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("folder", metavar="RESULTS_DIR", type=Path, help="folder with results.jsonl (and theory.json)")
    parser.add_argument("--out", metavar="DIR", type=Path, default=REFERENCE, help="folder of the reference run")
    options = parser.parse_args(arguments)

    def work() -> int:
        found = make(options.folder, options.out)
        print(claims.plain(found))
        return 0

    return files.run_command("keep_reference", (ResultError, ClaimError), work)
