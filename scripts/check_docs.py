#!/usr/bin/env python3
"""Checks the documents: links and the headings they name, code that the tests build and run, tables, headings,
phrases that docs/terms.json rules out, and spelling, where codespell is installed. Prints each problem with its file; exits
with 1 if there is any."""

import json
import pathlib
import re
import shutil
import subprocess
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


def headings(text):
    return re.findall(r"^#{1,6} +(.*)$", re.sub(r"```.*?```", "", text, flags=re.S), flags=re.M)


def anchors(document):
    """The anchors of its headings, as GitHub and the site make them."""
    text = document.read_text(encoding="utf-8")
    found = set(re.findall(r'<a (?:id|name)="([^"]+)"', text))
    counts = {}
    for heading in headings(text):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        anchor = re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")
        count = counts.get(anchor, 0)
        counts[anchor] = count + 1
        found.add(f"{anchor}-{count}" if count else anchor)
    return found


def dead_anchors():
    known = {}
    for document in documents():
        for target in re.findall(r"\]\(([^)\s]+)\)", without_code(document.read_text(encoding="utf-8"))):
            path, _, anchor = target.partition("#")
            aim = (document.parent / path).resolve() if path else document
            if re.match(r"[a-z]+:", target) or not anchor or aim.suffix != ".md" or not aim.exists():
                continue
            if anchor not in known.setdefault(aim, anchors(aim)):
                yield f"{document.relative_to(ROOT)}: {target} names no heading"


def broken_tables(document):
    """Rows with another number of cells than the row before."""
    cells = None
    for line in re.sub(r"```.*?```", "", document.read_text(encoding="utf-8"), flags=re.S).split("\n"):
        count = re.sub(r"`[^`]*`", "", line).replace("\\|", "").count("|") if line.startswith("|") else None
        if None not in (cells, count) and cells != count:
            yield f"{document.relative_to(ROOT)}: a row of a table has {count - 1} cells, that before {cells - 1}: {line[:60]}…"
        cells = count


def broken_headings(document):
    for heading in headings(document.read_text(encoding="utf-8")):
        if heading.count("`") % 2 or re.search(r"\s[,:;.]|[,:;.]$", heading):
            yield f"{document.relative_to(ROOT)}: the heading is broken: {heading}"


def ruled_out(document, terms):
    """Phrases for which there is a better one; what is quoted or code may have them."""
    text = without_code(document.read_text(encoding="utf-8"))
    for phrase, better in terms.items():
        for found in re.finditer(rf"\b{phrase}\b", text, flags=re.I):
            line = text.count("\n", 0, found.start()) + 1
            yield f"{document.relative_to(ROOT)}: \"{found.group()}\" (line {line} without code): {better}"


def misspelled(ignored):
    if shutil.which("codespell") is None:
        return
    files = [str(document) for document in documents()] + [str(path) for path in sorted((ROOT / "include").rglob("*.h"))]
    files += [str(path) for path in sorted((ROOT / "tools").rglob("*.cc")) if not path.name.endswith("_test.cc")]
    found = subprocess.run(["codespell", "--quiet-level", "3", "--ignore-words-list", ",".join(ignored), *files],
                           capture_output=True, text=True, check=False)
    yield from found.stdout.replace(f"{ROOT}/", "").splitlines()


def unknown_names():
    """The flows and the architecture name classes with a member, `Class::member`, that the code has."""
    known = set()
    for folder in ("src", "include", "tools", "components", "messages", "ads"):
        for file in (ROOT / folder).rglob("*"):
            if file.suffix in (".h", ".cc", ".proto"):
                known.update(re.findall(r"\w+", file.read_text(encoding="utf-8")))
    for document in [*sorted((ROOT / "docs/flows").glob("*.md")), ROOT / "docs/architecture.md"]:
        for code in re.findall(r"`([^`\n]+)`", document.read_text(encoding="utf-8")):
            for name in re.findall(r"[A-Za-z_]\w*(?:::~?\w+)+", code):
                if not known.issuperset(re.findall(r"\w+", name)):
                    yield f"{document.relative_to(ROOT)}: the code has no {name}"


def main():
    problems = [problem for document in documents() for problem in dead_links(document)]
    terms = json.loads((ROOT / "docs/terms.json").read_text(encoding="utf-8"))
    problems += dead_anchors()
    for document in documents():
        problems += broken_tables(document)
        problems += broken_headings(document)
        problems += ruled_out(document, terms["ruled_out"])
    problems += misspelled(terms["spelled_so"])
    problems += strange_snippets()
    problems += unbuilt_snippets()
    problems += lonely_snippets()
    problems += homeless_snippets()
    problems += strange_lessons()
    problems += unknown_names()
    print("\n".join(problems) if problems else "check_docs: links, code, tables, headings, terms and spelling are in order")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
