"""Lists, fetches and verifies the data sets of the field, which data.json describes.

usage: data.py FOLDER list [NAME]
       data.py FOLDER fetch NAME... [--only PART]
       data.py FOLDER verify NAME... [--only PART]
       data.py --check
FOLDER is the data folder. PART chooses the files whose path contains it.
Exit codes: 0 all is as it should be, 1 files are missing or wrong, 2 wrong use, 3 a file cannot be fetched.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
import urllib.error
import urllib.parse
import urllib.request
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

CATALOGUE = Path(__file__).with_name("data.json")
#: What every set and every file has; a null needs its reason, under the same name with "_why".
SET_KEYS = ("name", "title", "what", "citation", "page", "licence", "converter", "use", "files")
FILE_KEYS = ("path", "address", "size", "sha256")


class Problem(Exception):
    """Ends the program with one sentence and an exit code."""

    def __init__(self, text: str, code: int = 2) -> None:
        super().__init__(text)
        self.code = code


def sets() -> dict[str, dict[str, Any]]:
    return {one["name"]: one for one in json.loads(CATALOGUE.read_text())["sets"]}


def found(name: str) -> dict[str, Any]:
    known = sets()
    if name in known:
        return known[name]
    near = difflib.get_close_matches(name, known, 1)
    raise Problem(f"there is no data set '{name}'; known are {', '.join(known)}" + (f"; did you mean '{near[0]}'?" if near else ""))


def chosen(one: dict[str, Any], part: str | None) -> list[dict[str, Any]]:
    files = [file for file in one["files"] if part is None or part in file["path"]]
    if not files:
        raise Problem(f"{one['name']} has no file whose path contains '{part}'")
    return files


def in_words(size: int | None) -> str:
    if size is None:
        return "size unknown"
    for unit in ("B", "KB", "MB"):
        if size < 1000 or unit == "MB":
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000  # type: ignore[assignment]
    return ""


def licence(one: dict[str, Any]) -> str:
    return one["licence"]["name"] or f"licence unknown ({one['licence']['why']})"


def sha256(file: Path) -> str:
    digest = hashlib.sha256()
    with open(file, "rb") as content:
        while block := content.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def unpacked(folder: Path, file: dict[str, Any]) -> Path | None:
    """Returns the note that an archive of the set has been unpacked, and with which checksum."""
    return folder / (file["path"] + ".sha256") if file.get("unpack") else None


def defect(folder: Path, file: dict[str, Any]) -> str:
    """Returns what is wrong with a file in the data folder, or an empty text."""
    path = folder / file["path"]
    if path.is_dir():
        return "" if any(path.iterdir()) else "is an empty folder"
    if not path.exists():
        note = unpacked(folder, file)
        return "" if note is not None and note.exists() else "is missing"
    size = path.stat().st_size
    if file["size"] is not None and size != file["size"]:
        return f"has {size} bytes instead of {file['size']}"
    if file["sha256"] is not None and sha256(path) != file["sha256"]:
        return f"has the SHA-256 {sha256(path)} instead of {file['sha256']}"
    return ""


def show(folder: Path, name: str | None) -> int:
    if name is None:
        rows = [("data set", "licence", "files", "size", "here", "what")]
        for one in sets().values():
            sizes = [file["size"] for file in one["files"]]
            size = in_words(sum(sizes)) if None not in sizes else in_words(None)
            here = sum(defect(folder, file) != "is missing" for file in one["files"])
            rows.append((one["name"], one["licence"]["name"] or "unknown", str(len(sizes)), size, str(here), one["title"]))
        widths = [max(len(row[column]) for row in rows) for column in range(5)]
        for row in rows:
            print("  ".join(cell.ljust(width) for cell, width in zip(row, widths)) + "  " + row[5])
        print(f"Folder: {folder}")
        return 0
    one = found(name)
    print(f"{one['title']}\n{one['what']}.\n{one['citation']}\n{one['page']}\nLicence: {licence(one)}")
    print(f"Converter: {one['converter'] or 'none: ' + one['converter_why']}")
    for use in one["use"]:
        print(f"  {use}")
    if one.get("instead"):
        print(f"Without it: the built-in scenes {', '.join(one['instead'])}")
    for file in one["files"]:
        address = file["address"] or f"no address: {file['address_why']}"
        print(f"  {file['path']}  {in_words(file['size'])}  {address}")
    return 0


def download(address: str, target: Path) -> None:
    """Fetches a file by curl, or by Python where there is no curl. Raises Problem."""
    host = urllib.parse.urlsplit(address).hostname
    if shutil.which("curl") is not None:
        done = subprocess.run(
            ["curl", "--fail", "--location", "--silent", "--show-error", "--retry", "2", "--connect-timeout", "20",
             "--output", str(target), address],
            capture_output=True, text=True,
        )  # fmt: skip
        if done.returncode == 0:
            return
        why = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"curl ended with {done.returncode}"
    else:
        try:
            with urllib.request.urlopen(address, timeout=20) as answer, open(target, "wb") as file:
                shutil.copyfileobj(answer, file)
            return
        except (OSError, urllib.error.URLError, ValueError) as problem:
            why = str(problem)
    raise Problem(f"{address} cannot be fetched from {host} ({why})", 3)


def unpack(archive: Path, kind: str) -> None:
    """Unpacks an archive where it lies. Entries that are neither files nor folders below it are refused."""
    target = archive.parent
    if kind == "zip":
        with zipfile.ZipFile(archive) as content:
            check_names(archive, content.namelist())
            content.extractall(target)
        return
    with tarfile.open(archive, "r:gz") as content:
        members = content.getmembers()
        check_names(archive, [member.name for member in members])
        if odd := next((member.name for member in members if not (member.isfile() or member.isdir())), None):
            raise Problem(f"{archive}: {odd} is neither a file nor a folder; nothing was unpacked", 1)
        content.extractall(target)


def check_names(archive: Path, names: list[str]) -> None:
    for name in names:
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or "\\" in name:
            raise Problem(f"{archive}: {name} would lie outside of its folder; nothing was unpacked", 1)


def fetch(folder: Path, names: list[str], part: str | None) -> int:
    for one in [found(name) for name in names]:
        print(f"{one['name']}: {licence(one)}; {one['page']}")
        for file in chosen(one, part):
            path = folder / file["path"]
            wrong = defect(folder, file)
            if not wrong:
                print(f"  {file['path']} is there")
                continue
            if file["address"] is None:
                print(f"  {file['path']} {wrong}, and has no address: {file['address_why']}")
                continue
            if wrong != "is missing":
                raise Problem(f"{path} {wrong}; remove it, and it will be fetched", 1)
            path.parent.mkdir(parents=True, exist_ok=True)
            partial = path.with_name(path.name + ".part")
            try:
                download(file["address"], partial)
            except Problem as problem:
                partial.unlink(missing_ok=True)
                raise Problem(f"{problem}; a copy by hand works as well: put it at {path}", 3) from None
            found_defect = defect(folder, file | {"path": file["path"] + ".part", "unpack": None})
            if found_defect:
                wrong_file = path.with_name(path.name + ".wrong")
                partial.replace(wrong_file)
                raise Problem(f"{file['address']} {found_defect}; it is kept as {wrong_file}", 1)
            digest = sha256(partial)
            partial.replace(path)
            print(f"  {file['path']} fetched" + ("" if file["sha256"] else f", SHA-256 {digest} (none is known: {file['sha256_why']})"))
            if note := unpacked(folder, file):
                unpack(path, file["unpack"])
                note.write_text(f"{digest}  {path.name}\n")
                print(f"  {file['path']} unpacked")
    return 0


def verify(folder: Path, names: list[str], part: str | None) -> int:
    wrong = 0
    for one in [found(name) for name in names]:
        for file in chosen(one, part):
            problem = defect(folder, file)
            if not problem and file["sha256"] is None and (note := unpacked(folder, file)) is not None and note.exists():
                path = folder / file["path"]
                if path.exists() and sha256(path) != note.read_text().split()[0]:
                    problem = f"differs from what was unpacked ({note})"
            if problem:
                wrong += 1
                print(f"  {file['path']} {problem}")
            else:
                print(f"  {file['path']} " + ("is right" if file["sha256"] else f"is there; no checksum: {file['sha256_why']}"))
    print(f"{wrong} files are missing or wrong in {folder}" if wrong else "all files are there, and none is known to be wrong")
    return 1 if wrong else 0


def check() -> int:
    """Checks the catalogue itself: every null has a reason, and every checksum and address is well formed."""
    catalogue = json.loads(CATALOGUE.read_text())
    problems: list[str] = []
    names = [one.get("name") for one in catalogue["sets"]]
    problems += [f"{name} is there twice" for name in set(names) if names.count(name) > 1]
    for one in catalogue["sets"]:
        name = one.get("name")
        problems += [f"{name}: {key} is missing" for key in SET_KEYS if key not in one]
        if one["licence"]["name"] is None and not one["licence"].get("why"):
            problems.append(f"{name}: a licence that is null has no reason")
        if one["licence"]["name"] is not None and not one["licence"].get("source"):
            problems.append(f"{name}: the licence has no source")
        if one["converter"] is None and not one.get("converter_why"):
            problems.append(f"{name}: no converter, and no reason")
        for file in one["files"]:
            place = f"{name}: {file.get('path')}"
            for key in FILE_KEYS:
                if key not in file:
                    problems.append(f"{place}: {key} is missing")
                elif file[key] is None and not file.get(key + "_why"):
                    problems.append(f"{place}: {key} is null without a reason")
            path = PurePosixPath(file["path"])
            if path.is_absolute() or ".." in path.parts:
                problems.append(f"{place}: leads out of the data folder")
            if file["sha256"] is not None and (len(file["sha256"]) != 64 or set(file["sha256"]) - set("0123456789abcdef")):
                problems.append(f"{place}: is no SHA-256")
            if file["address"] is not None and urllib.parse.urlsplit(file["address"]).scheme not in ("http", "https"):
                problems.append(f"{place}: is no address")
    print("\n".join(problems) or f"{len(names)} data sets, {sum(len(one['files']) for one in catalogue['sets'])} files")
    return 1 if problems else 0


def main(words: list[str]) -> int:
    if words == ["--check"]:
        return check()
    parser = argparse.ArgumentParser(prog="kbvh data", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("what", choices=("list", "fetch", "verify"))
    parser.add_argument("names", nargs="*")
    parser.add_argument("--only")
    options = parser.parse_args(words)
    if options.what == "list":
        if len(options.names) > 1:
            raise Problem("list takes one name, or none")
        return show(options.folder, options.names[0] if options.names else None)
    if not options.names:
        raise Problem(f"{options.what} needs the name of a data set (kbvh data list shows them)")
    return (fetch if options.what == "fetch" else verify)(options.folder, options.names, options.only)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Problem as problem:
        print(f"kbvh: {problem}", file=sys.stderr)
        sys.exit(problem.code)
    except OSError as problem:
        print(f"kbvh: {problem}", file=sys.stderr)
        sys.exit(3)
