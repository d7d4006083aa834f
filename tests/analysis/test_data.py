"""The data sets of the field: the catalogue, and how files are fetched, verified and refused."""

import contextlib
import http.server
import io
import json
import sys
import tarfile
import tempfile
import threading
import unittest
import zipfile
from pathlib import Path
from unittest import mock

import paths  # noqa: F401

sys.path.insert(0, str(paths.HERE.parents[1] / "experiments" / "data"))
import data  # noqa: E402


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Case(unittest.TestCase):
    """A catalogue and a server of its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.served, self.here = Path(folder.name) / "served", Path(folder.name) / "data"
        self.served.mkdir()
        server = http.server.ThreadingHTTPServer(
            ("127.0.0.1", 0), lambda *arguments: Quiet(*arguments, directory=str(self.served))
        )
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        self.address = f"http://127.0.0.1:{server.server_port}/"
        self.catalogue = Path(folder.name) / "data.json"
        self.enterContext(mock.patch.object(data, "CATALOGUE", self.catalogue))
        # The server of this test is reached directly, not through this machine's proxies.
        self.enterContext(mock.patch.dict("os.environ", {"no_proxy": "*", "NO_PROXY": "*"}))

    def serve(self, *files, **more):
        """Writes a catalogue of one set."""
        one = {
            "name": "balls", "title": "Balls", "what": "two balls", "citation": "us", "page": self.address,
            "licence": {"name": "CC0-1.0", "source": "us"}, "converter": None, "converter_why": "none is needed",
            "use": ["kbvh"], "files": list(files),
        }  # fmt: skip
        self.catalogue.write_text(json.dumps({"schema": "kbvh-data-1", "sets": [one | more]}))

    def file(self, name, content, **more):
        (self.served / name).write_bytes(content)
        digest = data.sha256(self.served / name)
        return {"path": f"unc/{name}", "address": self.address + name, "size": len(content), "sha256": digest} | more

    def call(self, *words):
        """Returns the exit code and the whole output."""
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                code = data.main([str(self.here), *words])
            except data.Problem as problem:
                print(problem)
                code = problem.code
        return code, said.getvalue()


class Catalogue(unittest.TestCase):
    def test_every_null_has_a_reason(self):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            self.assertEqual(data.main(["--check"]), 0, said.getvalue())

    def test_the_issue_s_data_sets_are_there(self):
        self.assertLessEqual(
            {"unc-dynamic-scenes", "scalable-ccd-samples", "tight-inclusion-queries", "deformation-transfer", "utah-animations"},
            set(data.sets()),
        )


class CheckSees(Case):
    def test_faults_of_a_catalogue(self):
        good = {"path": "a", "address": "http://x/a", "size": 1, "sha256": "0" * 64}
        for fault, what in (
            ({"size": None}, "size is null without a reason"),
            ({"sha256": "0" * 63}, "is no SHA-256"),
            ({"path": "../a"}, "leads out of the data folder"),
            ({"address": "ftp://x/a"}, "is no address"),
        ):
            self.serve(good | fault)
            with contextlib.redirect_stdout(io.StringIO()) as said:
                self.assertEqual(data.main(["--check"]), 1, fault)
            self.assertIn(what, said.getvalue())
        self.serve(good, licence={"name": None})
        with contextlib.redirect_stdout(io.StringIO()) as said:
            self.assertEqual(data.main(["--check"]), 1)
        self.assertIn("a licence that is null has no reason", said.getvalue())


class Fetching(Case):
    def test_fetches_verifies_and_keeps(self):
        self.serve(self.file("a.obj", b"v 0 0 0\n"))
        self.assertEqual(self.call("verify", "balls")[0], 1)
        code, said = self.call("fetch", "balls")
        self.assertEqual(code, 0, said)
        self.assertEqual((self.here / "unc/a.obj").read_bytes(), b"v 0 0 0\n")
        self.assertEqual(self.call("verify", "balls")[0], 0)
        (self.served / "a.obj").unlink()  # not asked for again
        self.assertIn("is there", self.call("fetch", "balls")[1])

    def test_by_python_where_there_is_no_curl(self):
        self.serve(self.file("a.obj", b"v 0 0 0\n"))
        with mock.patch.object(data.shutil, "which", return_value=None):
            self.assertEqual(self.call("fetch", "balls")[0], 0)

    def test_what_differs_is_refused_and_kept_apart(self):
        self.serve(self.file("a.obj", b"v 0 0 0\n"))
        (self.served / "a.obj").write_bytes(b"v 0 0 1\n")
        code, said = self.call("fetch", "balls")
        self.assertEqual(code, 1)
        self.assertIn("has the SHA-256", said)
        self.assertFalse((self.here / "unc/a.obj").exists())
        self.assertTrue((self.here / "unc/a.obj.wrong").exists())
        # A wrong file that was put there by hand is not overwritten.
        (self.here / "unc/a.obj").write_bytes(b"mine")
        code, said = self.call("fetch", "balls")
        self.assertEqual((code, (self.here / "unc/a.obj").read_bytes()), (1, b"mine"))
        self.assertIn("has 4 bytes instead of 8", said)

    def test_no_network(self):
        file = self.file("a.obj", b"v 0 0 0\n", address="http://127.0.0.1:9/a.obj")
        self.serve(file)
        for which in ("/usr/bin/curl" if data.shutil.which("curl") else None, None):
            with mock.patch.object(data.shutil, "which", return_value=which):
                code, said = self.call("fetch", "balls")
            self.assertEqual(code, 3)
            self.assertIn("cannot be fetched from 127.0.0.1", said)
            self.assertIn(f"put it at {self.here / 'unc/a.obj'}", said)
            self.assertEqual(list((self.here / "unc").iterdir()), [])
        self.assertIn("a.obj is missing", self.call("verify", "balls")[1])
        (self.here / "unc/a.obj").write_bytes(b"v 0 0 0\n")  # by hand
        self.assertEqual(self.call("fetch", "balls")[0], 0)
        self.assertEqual(self.call("verify", "balls")[0], 0)

    def test_archives_are_unpacked_once(self):
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w") as content:
            content.writestr("balls/1.obj", "v 0 0 0\n")
        unknown = {"sha256": None, "sha256_why": "not stated", "size": None, "size_why": "not stated", "unpack": "zip"}
        self.serve(self.file("balls.zip", archive.getvalue(), **unknown))
        code, said = self.call("fetch", "balls")
        self.assertEqual(code, 0, said)
        self.assertTrue((self.here / "unc/balls/1.obj").exists())
        self.assertIn("none is known: not stated", said)
        (self.here / "unc/balls.zip").unlink()  # no longer needed
        self.assertEqual(self.call("verify", "balls")[0], 0)
        self.assertIn("is there", self.call("fetch", "balls")[1])
        (self.here / "unc/balls.zip").write_bytes(b"another")
        self.assertIn("differs from what was unpacked", self.call("verify", "balls")[1])

    def test_archives_that_lead_elsewhere_are_refused(self):
        unknown = {"sha256": None, "sha256_why": "not stated"}
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w") as content:
            content.writestr("../../outside", "x")
        self.serve(self.file("a.zip", archive.getvalue(), unpack="zip", **unknown))
        code, said = self.call("fetch", "balls")
        self.assertEqual(code, 1)
        self.assertIn("would lie outside", said)
        archive = io.BytesIO()
        with tarfile.open(fileobj=archive, mode="w:gz") as content:
            link = tarfile.TarInfo("link")
            link.type, link.linkname = tarfile.SYMTYPE, "/etc"
            content.addfile(link)
        self.serve(self.file("a.tgz", archive.getvalue(), unpack="tar.gz", **unknown))
        code, said = self.call("fetch", "balls")
        self.assertEqual(code, 1)
        self.assertIn("is neither a file nor a folder", said)
        self.assertFalse((self.here / "unc/link").exists())

    def test_wrong_use(self):
        self.serve(self.file("a.obj", b"v 0 0 0\n"))
        for words, what in (
            (("fetch",), "needs the name"),
            (("fetch", "bals"), "did you mean 'balls'?"),
            (("fetch", "balls", "--only", "none"), "no file whose path contains"),
            (("list", "balls", "balls"), "takes one name"),
        ):
            code, said = self.call(*words)
            self.assertEqual(code, 2, words)
            self.assertIn(what, said)
        self.assertIn("Balls", self.call("list", "balls")[1])
        self.assertIn("CC0-1.0", self.call("list")[1])


if __name__ == "__main__":
    unittest.main()
