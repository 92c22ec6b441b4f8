#!/usr/bin/env python3
"""refuses_test.py PROGRAM: `fastcycle new` refuses what it cannot do, says why, and writes nothing then."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv[1]


class Refuses(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.folder = pathlib.Path(self.scratch.name)

    def new(self, *words, folder="."):
        return subprocess.run([PROGRAM, "new", *words], cwd=self.folder / folder, capture_output=True, text=True)

    def files(self):
        return {str(path.relative_to(self.folder)): path.read_bytes()
                for path in self.folder.rglob("*") if path.is_file()}

    def assert_refused(self, said, *words, folder="."):
        before = self.files()
        done = self.new(*words, folder=folder)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertIn(said, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertEqual(self.files(), before)

    def test_names_that_cannot_be_names(self):
        for name in ("Speed", "9lives", "_x", "a-b", "a/b", "..", "", "ä", "x" * 41):
            self.assert_refused("expected a name of at most 40 small letters", "app", name)
        for name in ("double", "static_cast", "co_await"):
            self.assert_refused(f'"{name}" is a keyword of C++', "app", name)
        for name in ("test", "component", "m", "linux", "gtest", "int32_t"):
            self.assert_refused(f'"{name}" is already used', "app", name)
        self.assert_refused('"index" is a function of the C library', "app", "index")

    def test_what_exists_is_not_written_over(self):
        (self.folder / "speed").mkdir()
        self.assert_refused("speed exists already", "app", "speed")
        (self.folder / "dangling").symlink_to("nowhere")
        self.assert_refused("dangling exists already", "app", "dangling")
        self.assertEqual(self.new("app", "garage").returncode, 0)
        (self.folder / "garage/components/motor_test.cc").write_text("mine")
        self.assert_refused("components/motor_test.cc exists already", "component", "motor", folder="garage")
        self.assert_refused("already contains fastcycle_component(NAME garage", "component", "garage", folder="garage")
        self.assert_refused("already contains fastcycle_messages(NAME garage_messages", "messages", "garage",
                            folder="garage")

    def test_a_component_needs_a_project_and_its_messages(self):
        self.assert_refused("this folder is not a FastCycle project", "component", "motor")
        self.assert_refused("this folder is not a FastCycle project", "messages", "motor")
        self.assertEqual(self.new("app", "garage").returncode, 0)
        self.assert_refused("there is no messages/radar/value.proto", "component", "motor", "--messages", "radar",
                            folder="garage")

    def test_an_application_that_cannot_be_changed_is_left_and_reported(self):
        self.assertEqual(self.new("app", "garage").returncode, 0)
        (self.folder / "garage/garage.json").write_text('{"name": "x"}')
        done = self.new("component", "motor", folder="garage")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn('{"name": "motor", "library": "motor"}', done.stdout)
        self.assertEqual((self.folder / "garage/garage.json").read_text(), '{"name": "x"}')

    def test_what_was_only_built_is_installed_first(self):
        done = self.new("app", "garage")
        self.assertIn(" --prefix $HOME/fastcycle\n  cmake -B build -DCMAKE_PREFIX_PATH=$HOME/fastcycle\n", done.stdout)

    def test_a_full_disk_leaves_all_as_it_was(self):
        self.assertEqual(self.new("app", "garage").returncode, 0)
        before = self.files()
        for words, folder in ((("app", "house"), "."), (("component", "motor"), "garage")):
            done = subprocess.run(["bash", "-c", 'trap "" XFSZ; ulimit -f 0; exec "$@"', "-", PROGRAM, "new", *words],
                                  cwd=self.folder / folder, capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("cannot be written: File too large; nothing was changed", done.stderr)
            self.assertEqual(self.files(), before)
        self.assertFalse((self.folder / "house").exists())

    def test_help_is_there(self):
        for words in ((), ("app",), ("component",), ("messages",)):
            self.assertEqual(self.new(*words, "--help").returncode, 0)
        self.assertEqual(self.new("ap", "x").returncode, 2)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
