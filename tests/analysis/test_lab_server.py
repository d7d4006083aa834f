"""The server of the lab answers this machine only, and nothing outside of its two folders."""

import http.client
import json
import os
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import paths

SERVER = paths.HERE.parents[1] / "analysis" / "lab" / "serve.py"


class Server(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        (self.root / "lab").mkdir()
        (self.root / "lab" / "index.html").write_text("the lab")
        scene = self.root / "study" / "scenes" / "cloth 1"
        scene.mkdir(parents=True)
        (scene / "0-cloth.obj").write_text("v 0 0 0\n")
        (scene / "card.json").write_text('{"scene": "cloth"}')
        (self.root / "study" / "results.jsonl").write_text("secret")

    def start(self, *words: str) -> int:
        process = subprocess.Popen([sys.executable, str(SERVER), str(self.root / "lab"), "--port", "0", *words],
                                   stdout=subprocess.PIPE, text=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.terminate)
        line = process.stdout.readline()
        self.assertTrue(line.startswith("http://127.0.0.1:"), line)
        return int(line.split(":")[2].split("/")[0])

    def get(self, port: int, path: str, host: str = "127.0.0.1") -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        connection.request("GET", path, headers={"Host": host})
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer.status, body

    def test_serves_the_lab_and_the_scenes_of_a_study(self) -> None:
        port = self.start("--study", str(self.root / "study"))
        self.assertEqual(self.get(port, "/"), (200, b"the lab"))
        status, body = self.get(port, "/study/scenes.json")
        scenes = json.loads(body)
        self.assertEqual((status, scenes[0]["name"], len(scenes)), (200, "cloth", 1))
        self.assertEqual(self.get(port, "/" + scenes[0]["files"][0]), (200, b"v 0 0 0\n"))

    def test_serves_nothing_else(self) -> None:
        port = self.start("--study", str(self.root / "study"))
        for path in ("/../study/results.jsonl", "/study/..%2fresults.jsonl", "/study/../results.jsonl", "/study/", "/study/cloth%201/",
                     "/study/cloth%201/card.json", "/study/cloth%201/..%2f..%2fresults.jsonl", "/study/../../lab/x.obj",
                     "/%2e%2e/study/results.jsonl", "//etc/passwd", "/study//etc/passwd.obj"):
            self.assertEqual(self.get(port, path)[0], 404, path)
        for path in ("/", "/study/scenes.json"):
            self.assertEqual(self.get(port, path, "other.example")[0], 403, path)

    def test_without_a_study_there_is_none(self) -> None:
        port = self.start()
        self.assertEqual(self.get(port, "/study/scenes.json"), (200, b"[]"))
        self.assertEqual(self.get(port, "/study/cloth%201/0-cloth.obj")[0], 404)

    def test_opens_a_browser_where_there_is_a_screen(self) -> None:
        browser, seen = self.root / "browser", self.root / "seen"
        browser.write_text(f"#!/bin/sh\necho $1 > {seen}\n")
        browser.chmod(0o755)
        os.environ["BROWSER"] = str(browser)
        self.addCleanup(os.environ.pop, "BROWSER")
        for screen in ("", ":7"):
            before = os.environ.get("DISPLAY")
            os.environ.update({"DISPLAY": screen, "WAYLAND_DISPLAY": ""})
            try:
                port = self.start("--open")
            finally:
                os.environ.pop("WAYLAND_DISPLAY")
                os.environ.pop("DISPLAY") if before is None else os.environ.update({"DISPLAY": before})
            self.assertEqual(self.get(port, "/")[0], 200)
            if not screen:
                time.sleep(0.5)
                self.assertFalse(seen.exists())
                continue
            for _ in range(200):
                if seen.exists() and seen.read_text():
                    break
                time.sleep(0.1)
            self.assertEqual(seen.read_text(), f"http://127.0.0.1:{port}/\n")

    def test_says_what_is_wrong(self) -> None:
        for words, said in ((("nowhere",), "no built lab in nowhere"),
                            ((str(self.root / "lab"), "--study", str(self.root / "lab")), "no scenes in")):
            done = subprocess.run([sys.executable, str(SERVER), *words], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2)
            self.assertIn(said, done.stderr)


if __name__ == "__main__":
    unittest.main()
