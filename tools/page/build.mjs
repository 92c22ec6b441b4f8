// build.mjs NODE_MODULES OUTPUT.cc: makes the page of this folder one file of HTML, and of that and of its view a
// source of the program. Needs no network.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const [nodeModules, output] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const esbuild = createRequire(join(nodeModules, "x.js"))("esbuild");

function bundle(file) {
  const built = esbuild.buildSync({
    entryPoints: [join(here, file)],
    bundle: true,
    minify: true,
    write: false,
    format: "iife",
    target: ["chrome100", "firefox100", "safari15"],
    nodePaths: [nodeModules],
    logLevel: "warning",
  });
  return built.outputFiles[0].text;
}

// A function, so that no "$" of the code is taken for a reference.
const page = readFileSync(join(here, "page.html"), "utf8")
  .replace("%STYLE%", () => bundle("page.css"))
  .replace("%CODE%", () => bundle("main.js"));
const view = readFileSync(join(here, "ads.json"), "utf8");

for (const placeholder of ["%TITLE%", "%DATA%"]) {
  if (page.split(placeholder).length !== 2) {
    throw new Error(`the page must have ${placeholder} once`);
  }
}

// In pieces: a compiler need not take long literals.
function literal(text) {
  const pieces = text.match(/[^]{1,8000}/g) ?? [];
  return pieces.map((piece) => `    R"~page~(${piece})~page~"`).join("\n");
}

writeFileSync(
  output,
  `#include "page.h"

namespace fastcycle::tool {

std::string_view page_html() {
  return
${literal(page)};
}

std::string_view page_view() {
  return
${literal(view)};
}

}  // namespace fastcycle::tool
`,
);
