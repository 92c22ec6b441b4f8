#!/usr/bin/env python3
"""site.py [<folder>]: builds the documentation site into the folder, by default build/site, and checks its links.

Every Markdown file of the project becomes a page at its own path. What else they link to becomes one as well: a source
file its text, a folder its listing. MkDocs creates the pages, Doxygen the reference of the public headers,
below api/. A link of any page that leads nowhere, also to a heading, is an error; the exit code is then 1."""

import html.parser
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse

import message_tables

ROOT = pathlib.Path(__file__).resolve().parent.parent
PICTURES = {".svg", ".png", ".jpg"}
LANGUAGES = {".cc": "cpp", ".h": "cpp", ".py": "python", ".json": "json", ".proto": "protobuf", ".sh": "bash",
             ".cmake": "cmake"}
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
CODE = re.compile(r"(```.*?```|`[^`\n]*`)", flags=re.S)
GUIDES = ["first_component", "parameters", "life_cycle", "quality_of_service", "choosing_queues", "kept_messages",
          "synchronized_inputs", "services_and_actions", "back_pressure", "modes", "supervision", "transforms",
          "writing_a_driver", "real_time", "latency_chains", "finding_a_latency", "debugging", "looking_inside", "on_a_vehicle", "troubleshooting", "from_ros2",
          "beside_ros2",
          "from_cyberrt"]


def documents():
    for document in sorted(ROOT.rglob("*.md")):
        parts = document.relative_to(ROOT).parts
        if parts[0] != "build" and not any(part.startswith(".") or part == "node_modules" for part in parts):
            yield document


def title(text, otherwise):
    found = re.search(r"^# (.+)$", text, flags=re.M)
    return re.sub(r"[`*]", "", found.group(1)) if found else otherwise


class Staging:
    """The sources of the site: a tree like the project's, in which every link leads to a file."""

    def __init__(self, folder):
        self.folder = folder
        self.pages = {document.relative_to(ROOT): document.read_text(encoding="utf-8") for document in documents()}
        self.todo = list(self.pages)

    def write(self):
        while self.todo:
            page = self.todo.pop()
            target = self.folder / page
            target.parent.mkdir(parents=True, exist_ok=True)
            pieces = CODE.split(self.pages[page])
            pieces[::2] = [LINK.sub(lambda link: self.relinked(page, link), piece) for piece in pieces[::2]]
            target.write_text("".join(pieces), encoding="utf-8")

    def add(self, page, text):
        if page not in self.pages:
            self.pages[page] = text
            self.todo.append(page)

    def relinked(self, page, link):
        """The link of `page`, to what stands here for what it means."""
        path, _, anchor = link.group(2).partition("#")
        if re.match(r"[a-z]+:", path) or not path:
            return link.group(0)
        target = (ROOT / page.parent / path).resolve()
        if not target.is_relative_to(ROOT) or not target.exists():
            return link.group(0)   # Dead: found below.
        name = target.relative_to(ROOT)
        if target.is_dir():
            name = self.folder_page(name)
        elif target.suffix in PICTURES:
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(target, self.folder / name)
        elif target.suffix != ".md":
            name = self.source_page(name)
        up = "../" * len(page.parent.parts)
        return f"{link.group(1)}{up}{name.as_posix()}{'#' + anchor if anchor else ''}{link.group(3)}"

    def source_page(self, name):
        text = (ROOT / name).read_text(encoding="utf-8", errors="replace")
        language = LANGUAGES.get(name.suffix, "cmake" if name.name == "CMakeLists.txt" else "text")
        page = name.with_name(name.name + ".md")
        self.add(page, f"# {name}\n\n~~~~{language}\n{text.rstrip()}\n~~~~\n")
        return page

    def folder_page(self, name):
        page = name / "README.md"
        rows = []
        for entry in sorted((ROOT / name).iterdir()):
            if entry.suffix == ".md":
                rows.append(f"- [{title(entry.read_text(encoding='utf-8'), entry.stem)}]({entry.name})")
            elif (entry / "README.md").exists():
                rows.append(f"- [{entry.name}]({entry.name}/README.md)")
            elif entry.is_file() and entry.suffix in LANGUAGES:
                rows.append(f"- [{entry.name}]({entry.name})")
        self.add(page, f"# {name}\n\n" + "\n".join(rows) + "\n")
        return page

    def entry(self, page):
        page = pathlib.Path(page)
        return {title(self.pages[page], page.stem): page.as_posix()}

    def entries(self, pattern, order=()):
        pages = sorted((page for page in self.pages if page.match(pattern) and page.name != "README.md"),
                       key=lambda page: (order.index(page.stem) if page.stem in order else len(order), page))
        return [self.entry(page) for page in pages]

    def navigation(self):
        lessons = sorted(page for page in self.pages if page.match("examples/[0-9]*/README.md"))
        modules = sorted(page for page in self.pages if page.match("ads/*/*/README.md") or page.match("ads/*/README.md"))
        return [
            {"FastCycle": "README.md"},
            {"Course": [{"Contents": "examples/README.md"}] + [self.entry(page) for page in lessons]},
            {"Guides": self.entries("docs/guides/*.md", GUIDES)},
            {"Reference": [{"Classes and functions": "api/index.html"}] + self.entries("docs/reference/*.md")},
            {"An ADS": [{"Overview": "ads/README.md"}] + [self.entry(page) for page in modules]},
            {"How it works": [self.entry("docs/architecture.md")] + self.entries("docs/flows/*.md")
                + [self.entry("docs/locks.md"), self.entry("docs/memory_order.md")]
                + [{"Measurements": [{"Benchmarks": "benchmarks/README.md"}]},
                   {"Decisions": [{"Contents": "docs/decisions/README.md"}] + self.entries("docs/decisions/*.md")}]},
            {"Project": [self.entry(f"{name}.md") for name in
                         ("docs/glossary", "docs/comparison", "CONTRIBUTING", "docs/testing", "docs/versioning", "SECURITY", "CHANGELOG")]},
        ]


def build_pages(folder):
    with tempfile.TemporaryDirectory() as name:
        staging = Staging(pathlib.Path(name) / "pages")
        for listed in ("docs/guides", "docs/reference", "docs/flows"):
            staging.folder_page(pathlib.Path(listed))
        staging.add(pathlib.Path("docs/reference/messages.md"), message_tables.tables(ROOT / "messages"))
        staging.write()
        shutil.copyfile(ROOT / "docs/site/site.css", staging.folder / "site.css")
        scheme = {"primary": "indigo", "accent": "indigo"}
        settings = {
            "site_name": "FastCycle", "docs_dir": str(staging.folder), "site_dir": str(folder),
            "use_directory_urls": False, "nav": staging.navigation(), "plugins": ["search"], "extra_css": ["site.css"],
            "theme": {"name": "material", "font": False, "language": "en",
                      "features": ["navigation.tabs", "navigation.top", "navigation.indexes"],
                      "palette": [
                          {"media": "(prefers-color-scheme: light)", "scheme": "default",
                           "toggle": {"icon": "material/weather-night", "name": "Dark"}} | scheme,
                          {"media": "(prefers-color-scheme: dark)", "scheme": "slate",
                           "toggle": {"icon": "material/weather-sunny", "name": "Light"}} | scheme]},
            "markdown_extensions": ["tables", "fenced_code", "sane_lists", {"toc": {"permalink": "#"}},
                                    {"codehilite": {"css_class": "highlight", "guess_lang": False}}],
        }
        file = pathlib.Path(name) / "mkdocs.yml"
        file.write_text(json.dumps(settings), encoding="utf-8")   # JSON is YAML.
        made = subprocess.run(["mkdocs", "build", "--quiet", "--clean", "--config-file", str(file)],
                              capture_output=True, text=True, check=False)
        if made.returncode != 0:
            sys.exit(f"mkdocs: {made.stdout}{made.stderr}")


def build_reference(folder):
    settings = (ROOT / "docs/Doxyfile").read_text(encoding="utf-8")
    settings += f'\nOUTPUT_DIRECTORY = "{folder}"\nHTML_OUTPUT = api\n'
    made = subprocess.run(["doxygen", "-"], input=settings, cwd=ROOT, capture_output=True, text=True, check=False)
    if made.returncode != 0 or "warning:" in made.stderr:
        sys.exit(f"doxygen: {made.stderr}")
    for page in (folder / "api").glob("*.html"):   # The way back.
        text = page.read_text(encoding="utf-8")
        page.write_text(text.replace('<div id="projectname">FastCycle',
                                     '<div id="projectname"><a href="../index.html">FastCycle</a>'), encoding="utf-8")


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.anchors = [], {"", "top"}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in ("id", "name") and value:
                self.anchors.add(value)
            if value and (name == "href" or (name == "src" and tag in ("img", "script"))):
                self.links.append(value)


def dead_links(folder):
    pages = {path: Page(path.read_text(encoding="utf-8", errors="replace")) for path in folder.rglob("*.html")}
    for path, page in sorted(pages.items()):
        for link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc or link.startswith("javascript"):
                continue
            target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            if parts.path.startswith("/") or path.name == "404.html":
                continue
            if target.is_dir():
                target /= "index.html"
            if not target.exists():
                yield f"{path.relative_to(folder)}: the link to {link} leads nowhere"
            elif target.parent.name == "api":   # Whose headings Doxygen makes, and links to, by itself.
                continue
            elif target in pages and urllib.parse.unquote(parts.fragment) not in pages[target].anchors:
                yield f"{path.relative_to(folder)}: {link} has no such heading"


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/site").resolve()
    for tool in ("mkdocs", "doxygen"):
        if not shutil.which(tool):
            sys.exit(f"site: needs {tool} (./dev setup)")
    folder.mkdir(parents=True, exist_ok=True)
    build_pages(folder)
    build_reference(folder)
    dead = sorted(set(dead_links(folder)))
    if dead:
        print("\n".join(dead))
        return 1
    print(f"site: {len(list(folder.rglob('*.html')))} pages, no dead link; to look at it, with search:\n"
          f"  python3 -m http.server -d {folder} --bind 127.0.0.1 8000")
    return 0


if __name__ == "__main__":
    sys.exit(main())
