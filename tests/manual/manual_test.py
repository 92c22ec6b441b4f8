#!/usr/bin/env python3
"""manual_test.py PROGRAM SHARE: there is a manual page for each command and none besides, it names each option,
and bash completes commands, options and values. What the program accepts is read from its --help."""

import pathlib
import re
import shutil
import subprocess
import sys
import unittest

PROGRAM, SHARE = sys.argv[1], pathlib.Path(sys.argv[2])


def help_of(words):
    return subprocess.run([PROGRAM, *words, "--help"], check=True, capture_output=True, text=True).stdout


def commands_of(text):
    found = re.search(r"^Subcommands:\n((?:  .*\n)+)", text, flags=re.M)
    return re.findall(r"^  (\S+)", found[1], flags=re.M) if found else []


def options_of(text):
    found = re.search(r"^Options:\n((?:  .*\n)+)", text, flags=re.M)
    return re.findall(r"^  (?:-\w,)?(--[\w-]+)", found[1], flags=re.M)


def tree(words=()):
    text = help_of(words)
    yield words, text
    for command in commands_of(text):
        yield from tree((*words, command))


TREE = dict(tree())


def complete(*words):
    """What bash offers for the last of the words after `fastcycle`."""
    quoted = " ".join(f"'{word}'" for word in ("fastcycle", *words))
    script = (f"source {SHARE}/bash-completion/completions/fastcycle; COMP_WORDS=({quoted}); "
              f"COMP_CWORD={len(words)}; _fastcycle; printf '%s\\n' \"${{COMPREPLY[@]}}\"")
    done = subprocess.run(["bash", "-c", script], check=True, capture_output=True, text=True)
    return sorted(done.stdout.split())


class Manual(unittest.TestCase):
    def test_every_command_has_a_page_and_no_other_page_is_there(self):
        wanted = sorted("-".join(("fastcycle", *words)) + ".1" for words in TREE)
        self.assertGreater(len(wanted), 40)
        self.assertEqual(sorted(page.name for page in (SHARE / "man/man1").iterdir()), wanted)

    def test_a_page_names_every_option_and_every_example(self):
        for words, text in TREE.items():
            page = (SHARE / "man/man1" / ("-".join(("fastcycle", *words)) + ".1")).read_text(encoding="utf-8")
            plain = re.sub(r"\\f[BIR]", "", page).replace("\\-", "-").replace("\\(aq", "'").replace("\\e", "\\")
            self.assertRegex(plain, r"(?m)^\.SH NAME\n\S+ - \w")
            for word in options_of(text) + re.findall(r"^  (fastcycle .*)$", text, flags=re.M):
                self.assertIn(word, plain, " ".join(words))

    def test_pages_are_well_formed(self):
        if not shutil.which("groff"):
            self.skipTest("needs groff")
        for page in sorted((SHARE / "man/man1").iterdir()):
            done = subprocess.run(["groff", "-man", "-Tutf8", "-Kutf8", "-ww", "-z", str(page)],
                                  capture_output=True, text=True)
            self.assertEqual(done.stderr, "", page.name)


class Completion(unittest.TestCase):
    def test_commands_and_options_of_every_command_are_offered(self):
        for words, text in TREE.items():
            self.assertEqual(complete(*words, "--"), sorted(options_of(text)), words)
            if commands_of(text):
                self.assertEqual(complete(*words, ""), sorted(commands_of(text)), words)

    def test_what_was_begun_is_completed(self):
        self.assertEqual(complete("rec"), ["record", "recover"])
        self.assertEqual(complete("topic", "ec"), ["echo"])
        self.assertEqual(complete("run", "--clock", ""), ["live", "simulated"])

    def test_files_are_offered_for_the_rest(self):
        files = sorted(path.name for path in pathlib.Path.cwd().iterdir())
        self.assertEqual(complete("run", ""), files)
        self.assertEqual(complete("run", "--overlay", ""), files)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
