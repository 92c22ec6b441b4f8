#!/usr/bin/env python3
"""Says which links of the documents lead nowhere, and which code of README.md, of the guides and lessons is not
code that the tests build and run. Exits with 1 if there is any."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# What README.md shows, and where it is built and run.
SNIPPETS = [("cpp", "tests/consumer/project/speed_limiter.cc")]
# The guides' code stands in these tests, word for word; tests/consumer builds this one as it stands.
GUIDE_TESTS = "tests/guides"
BUILT_WHOLE = "first_component.md"
# What a lesson shows stands in its own folder, which is built and run.
LESSONS = "examples"


def documents():
    for document in sorted(ROOT.rglob("*.md")):
        if "build" not in document.relative_to(ROOT).parts[:1]:
            yield document


def without_code(text):
    return re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.S)


def dead_links(document):
    text = without_code(document.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path = target.split("#")[0]
        if path and not (document.parent / path).exists():
            yield f"{document.relative_to(ROOT)}: the link to {target} leads nowhere"


def code_blocks(text, language):
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.S)


def words(text):
    """Code without comments that stand alone and without layout: a line may break elsewhere."""
    return re.sub(r"\s+", "", re.sub(r"^\s*//.*$", "", text, flags=re.M))


def strange_snippets():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for language, file in SNIPPETS:
        built = words((ROOT / file).read_text(encoding="utf-8"))
        if not any(words(block) in built for block in code_blocks(readme, language)):
            yield f"README.md: its {language} code is not that of {file}"


def unbuilt_snippets():
    built = [words(file.read_text(encoding="utf-8")) for file in sorted((ROOT / GUIDE_TESTS).rglob("*.cc"))]
    for guide in sorted((ROOT / "docs/guides").glob("*.md")):
        if guide.name == BUILT_WHOLE:
            continue
        text = guide.read_text(encoding="utf-8")
        for language in ("cpp", "json"):
            for block in code_blocks(text, language):
                if not any(words(block) in code for code in built):
                    yield f"{guide.relative_to(ROOT)}: no test in {GUIDE_TESTS} has its code {words(block)[:70]}…"


def lonely_snippets():
    """In the guides from other frameworks each of their snippets has one of ours below it."""
    for guide in sorted((ROOT / "docs/guides").glob("from_*.md")):
        languages = re.findall(r"```(\S+)\n.*?```", guide.read_text(encoding="utf-8"), flags=re.S)
        for theirs, ours in zip(languages[::2], languages[1::2] + [None] * (len(languages) % 2)):
            if theirs in ("cpp", "json") or ours not in ("cpp", "json"):
                yield f"{guide.relative_to(ROOT)}: {theirs} and {ours} are no pair of theirs and ours"


def homeless_snippets():
    for document in documents():
        name = document.relative_to(ROOT)
        is_checked = name.parts[0] in ("README.md", LESSONS) or name.parts[:2] == ("docs", "guides")
        if not is_checked and code_blocks(document.read_text(encoding="utf-8"), "cpp"):
            yield f"{name}: has cpp code; that is built in guides and lessons only"


def strange_lessons():
    for lesson in sorted((ROOT / LESSONS).glob("[0-9]*/README.md")):
        sources = [words(file.read_text(encoding="utf-8"))
                   for pattern in ("*.cc", "*.h", "*.json") for file in sorted(lesson.parent.glob(pattern))]
        for language in ("cpp", "json"):
            for block in code_blocks(lesson.read_text(encoding="utf-8"), language):
                if not any(words(block) in source for source in sources):
                    yield f"{lesson.relative_to(ROOT)}: no file beside it has its code {words(block)[:70]}…"


def main():
    problems = [problem for document in documents() for problem in dead_links(document)]
    problems += strange_snippets()
    problems += unbuilt_snippets()
    problems += lonely_snippets()
    problems += homeless_snippets()
    problems += strange_lessons()
    print("\n".join(problems) if problems else "check_docs: links lead somewhere, the code shown is built")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
