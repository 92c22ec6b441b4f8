// build.mjs NODE_MODULES OUTPUT.cc: makes each page of this folder one file of HTML, and of these and of their view a
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

const read = (file) => readFileSync(join(here, file), "utf8");

// The text with each of the placeholders, which it must have once, replaced.
function filled(text, values) {
  for (const [placeholder, value] of Object.entries(values)) {
    expectOnce(text, placeholder);
    text = text.replace(placeholder, () => value);  // A function, so that no "$" of it is taken for a reference.
  }
  return text;
}

function expectOnce(text, placeholder) {
  if (text.split(placeholder).length !== 2) {
    throw new Error(`the page must have ${placeholder} once`);
  }
}

// So that it may stand in a page, as JSON without comments.
function viewJson(text) {
  return JSON.stringify(JSON.parse(text.replace(/^\s*\/\/.*$/gm, ""))).replaceAll("<", "\\u003c");
}

const view = read("ads.json");
const page = filled(read("page.html"), { "%STYLE%": bundle("page.css"), "%CODE%": bundle("main.js") });
for (const placeholder of ["%TITLE%", "%DATA%"]) {
  expectOnce(page, placeholder);
}
const live = filled(read("live/live.html"), {
  "%STYLE%": bundle("live/live.css"), "%VIEW%": viewJson(view), "%CODE%": bundle("live/main.js") });

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

std::string_view live_page_html() {
  return
${literal(live)};
}

std::string_view page_view() {
  return
${literal(view)};
}

}  // namespace fastcycle::tool
`,
);
