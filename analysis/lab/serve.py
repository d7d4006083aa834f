"""Serves a built lab to browsers on this machine, and with it the scenes of a study.

    serve.py FOLDER [--port P] [--study DIR] [--open]

The lab is at http://127.0.0.1:P/. For a study (a folder of `kbvh run`), study/scenes.json lists the scenes as
[{"name", "framesPerSecond", "files": [addresses]}] (without a study: none), and the files are served below study/. The server answers only requests
that name it as 127.0.0.1 or localhost, so that no page of another site can read from it.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
import urllib.parse
import webbrowser
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

SCENE_FILES = (".obj", ".pc2")


def scenes_of(study: Path) -> list[dict[str, object]]:
    """The scenes of a study that were written for pictures: keyframes a second apart."""
    found: list[dict[str, object]] = []
    for card in sorted(study.glob("scenes/*/card.json")):
        files = sorted(file.name for file in card.parent.iterdir() if file.suffix in SCENE_FILES)
        name = json.loads(card.read_text()).get("scene", card.parent.name)
        quoted = urllib.parse.quote(card.parent.name)
        found.append({"name": name, "framesPerSecond": 1,
                      "files": [f"study/{quoted}/{urllib.parse.quote(file)}" for file in files]})
    return found


class Handler(SimpleHTTPRequestHandler):
    """Files of the lab's folder; `study/` is another one. Nothing is listed, nothing outside is read."""

    extensions_map = SimpleHTTPRequestHandler.extensions_map | {".js": "text/javascript", ".wasm": "application/wasm"}

    def __init__(self, *args: object, lab: Path, study: Path | None, **more: object) -> None:
        self.study = study
        super().__init__(*args, directory=str(lab), **more)  # type: ignore[arg-type]

    def send_head(self):  # type: ignore[no-untyped-def]
        if not self.allowed():
            self.send_error(403, "this server is for this machine only")
            return None
        return super().send_head()

    def do_GET(self) -> None:
        if self.path.split("?")[0] == "/study/scenes.json" and self.allowed():
            text = json.dumps([] if self.study is None else scenes_of(self.study)).encode()
            self.send_response(200)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(text)))
            self.end_headers()
            self.wfile.write(text)
            return
        super().do_GET()

    def allowed(self) -> bool:
        """Whether the request names this server as this machine (and not by a name that leads here)."""
        return self.headers.get("Host", "").rsplit(":", 1)[0] in ("127.0.0.1", "localhost")

    def translate_path(self, path: str) -> str:
        parts = [part for part in urllib.parse.unquote(path.split("?")[0].split("#")[0]).split("/") if part]
        if len(parts) == 3 and parts[0] == "study" and self.study is not None:
            folder, file = parts[1:]
            known = folder not in (".", "..") and file.endswith(SCENE_FILES)
            return str(self.study / "scenes" / folder / file) if known else ""
        return super().translate_path(path)

    def list_directory(self, path):  # type: ignore[no-untyped-def]
        self.send_error(404, "there is no page here")
        return None

    def end_headers(self) -> None:
        self.send_header("Cache-Control", "no-cache")  # so that a lab that was built again is the one shown
        super().end_headers()

    def log_message(self, format: str, *args: object) -> None:
        pass


def open_browser(address: str) -> None:
    """Shows the page in the user's browser, if there is a screen for it."""
    if sys.platform == "darwin" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()  # it may wait for the page


def main(words: list[str]) -> int:
    parser = argparse.ArgumentParser(description="serves a built lab on this machine")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--port", type=int, default=8017)
    parser.add_argument("--study", type=Path)
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    given = parser.parse_args(words)
    if not (given.folder / "index.html").is_file():
        print(f"there is no built lab in {given.folder} (experiments/lab makes it)", file=sys.stderr)
        return 2
    if given.study is not None and not scenes_of(given.study):
        print(f"there are no scenes in {given.study / 'scenes'} (`kbvh run --out {given.study}` writes them)", file=sys.stderr)
        return 2
    handler = partial(Handler, lab=given.folder, study=given.study)
    try:
        server = ThreadingHTTPServer(("127.0.0.1", given.port), handler)
    except OSError as problem:
        print(f"port {given.port} cannot be used: {problem.strerror} (--port names another, 0 a free one)", file=sys.stderr)
        return 2
    address = f"http://127.0.0.1:{server.server_address[1]}/"
    print(f"{address} (until Ctrl+C)", flush=True)
    if given.open:
        open_browser(address)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
