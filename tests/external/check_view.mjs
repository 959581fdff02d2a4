// Opens `flexura view` in headless Chromium: a save renews the page without losing the time and the camera, a broken text is
// told over the last good page and goes away with the next good one, a slider moves the mechanism, Solve solves.
//
//     node check_view.mjs FLEXURA DESIGN.mech PARAMETER [--pictures FOLDER] [--local SOURCE_FOLDER]
//
// The design's folder (its lock, tables and solids with it) is copied and changed there. `--local` serves scripts and styles from the source tree, to try
// changes to them. `puppeteer-core` is looked for along NODE_PATH, the browser in $CHROMIUM or as /usr/bin/chromium.
import { createRequire } from "node:module";
import { spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";

const require = createRequire(import.meta.url);
const puppeteer = require("puppeteer-core");
const args = process.argv.slice(2);
const option = (name) => {
    const at = args.indexOf(name);
    return at < 0 ? null : args.splice(at, 2)[1];
};
const pictures = option("--pictures"), local = option("--local");
const [flexura, design, parameter] = args;
if (pictures) mkdirSync(pictures, { recursive: true });

let failed = 0;
function must(holds, what) {
    if (holds) return;
    failed += 1;
    console.error(`  FAILS: ${what}`);
}

const folder = mkdtempSync(join(tmpdir(), "flexura-view-"));
const source = join(folder, basename(design)), lock = source.replace(/\.mech$/, ".lock");
cpSync(dirname(design), folder, { recursive: true, filter: (path) => basename(path) !== "out" });
const text = readFileSync(source, "utf8");

async function started() {
    const view = spawn(flexura, ["view", source], { stdio: ["ignore", "pipe", "inherit"] });
    const ended = new Promise((done) => view.on("exit", done));
    const address = await new Promise((found, lost) => {
        view.stdout.once("data", (d) => found(String(d).trim()));
        view.once("exit", (code) => lost(new Error(`it ended with ${code}`)));
    });
    return { address, end: async () => { view.kill("SIGINT"); return ended; } };
}
let { address, end } = await started();
const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM || "/usr/bin/chromium",
    headless: true,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"],
});
const told = [];

async function open({ width, height, dark }) {
    const page = await browser.newPage();
    page.on("console", (m) => { if (["error", "warn", "assert"].includes(m.type())) told.push(`console: ${m.text()}`); });
    page.on("pageerror", (e) => told.push(`error: ${e.message}`));
    await page.setRequestInterception(true);
    page.on("request", (r) => {
        const url = r.url();
        if (!url.startsWith(address) && !url.startsWith("data:") && !url.startsWith("blob:")) told.push(`request: ${url}`);
        const files = { "report.js": "src/emit/report/page/report.js", "live.js": "src/cli/view/page/live.js", "live.css": "src/cli/view/page/live.css" };
        const file = local && files[url.slice(address.length)];
        if (!file) return r.continue();
        r.respond({ contentType: file.endsWith("css") ? "text/css" : "text/javascript", body: readFileSync(join(local, file)) });
    });
    await page.setViewport({ width, height, deviceScaleFactor: width < 500 ? 2 : 1 });
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: dark ? "dark" : "light" }]);
    await page.goto(address, { waitUntil: "load" });
    return page;
}

const drawn = (page) => until(page, "it is drawn", () => document.documentElement.dataset.ready === "yes" && document.documentElement.dataset.drawn !== undefined);
async function shown(how) {
    const page = await open(how);
    await drawn(page);
    return page;
}

/** Waits for something in the page; how long it took, ms. */
async function until(page, what, test, ...given) {
    const began = Date.now();
    try {
        await page.waitForFunction(test, { timeout: 120000, polling: 50 }, ...given);
    } catch (e) {
        must(false, `${what}: ${e.message}`);
    }
    return Date.now() - began;
}
const picture = async (page, name) => { if (pictures) writeFileSync(join(pictures, `${name}.png`), await page.screenshot()); };
const version = (page) => page.evaluate(() => Number(document.documentElement.dataset.version));
const newer = (page, than) => until(page, "a newer page", (v) => Number(document.documentElement.dataset.version) > v, than);
const look = (page) => page.evaluate(() => globalThis.flexura.look());
/** Where the first trace leads: what the page shows of the motion. */
const trace = (page) => page.evaluate(() => JSON.parse(document.getElementById("data").textContent).traces.map((t) => t.path.slice(2).join()).join(";"));

let page = await shown({ width: 1360, height: 900, dark: false });
console.log(`${basename(design)} at ${address}`);
await until(page, "solids", () => document.documentElement.dataset.phase === "");
await page.evaluate(() => new Promise((done) => setTimeout(done, 400)));

// Somebody turns the view and looks at a state.
await page.focus("#time");
for (let k = 0; k < 7; k++) await page.keyboard.press("ArrowRight");
await page.focus("#view");
for (let k = 0; k < 5; k++) await page.keyboard.press("ArrowLeft");
await page.evaluate(() => scrollTo({ top: 120, behavior: "instant" }));
const before = await look(page), path = await trace(page);
let at = await version(page);
await picture(page, "view-light");

// A save that changes what is seen, of no value that is solved for: the requirement's bound.
writeFileSync(source, `${text}// saved\n`);
const took = await newer(page, at);
const after = await look(page);
must(Math.abs(after.state - before.state) < 1e-9, `after a save the time is ${after.state}, it was ${before.state}`);
must(after.camera.every((x, k) => Math.abs(x - before.camera[k]) < 1e-6), `after a save the camera is at ${after.camera}, it was at ${before.camera}`);
must(await page.evaluate(() => scrollY) === 120, "after a save the page is scrolled elsewhere");
must(await page.evaluate(() => document.activeElement.id) === "view", "after a save the focus is elsewhere");

// Broken, and mended.
const broken = text.replace(/^mechanism .*$/m, (l) => `${l}\n    point Broken = (1 mm, nowhere)`);
at = await version(page);
writeFileSync(source, broken);
const faulted = await until(page, "the error is told", () => document.getElementById("live-fault")?.checkVisibility());
const said = await page.$eval("#live-fault", (e) => e.textContent);
must(said.includes("nowhere") && /E\d{4}/.test(said), `it says "${said.slice(0, 200)}"`);
must(await page.evaluate(() => document.getElementById("view").checkVisibility()), "the last good page is gone");
must(await version(page) === at, "a broken text makes a page");
await picture(page, "view-broken");
writeFileSync(source, text);
const mended = await until(page, "the error goes away", () => !document.getElementById("live-fault"));
await newer(page, at);

// A slider.
const slider = await page.$$eval("#live-sliders label", (all, name) => all.find((l) => l.textContent === name)?.htmlFor, parameter);
must(Boolean(slider), `there is no slider for ${parameter}`);
let moved = 0;
if (slider) {
    const start = await trace(page);
    at = await version(page);
    const bytes = existsSync(lock) ? readFileSync(lock, "utf8") : "";
    await page.focus(`#${slider}`);
    for (let k = 0; k < 6; k++) await page.keyboard.press("ArrowRight");
    moved = await newer(page, at);
    await until(page, "the slider's page", () => document.documentElement.dataset.phase !== "reading");
    must(await trace(page) !== start, "the slider does not change the mechanism");
    must(readFileSync(source, "utf8") === text, "the slider writes the source");
    must((existsSync(lock) ? readFileSync(lock, "utf8") : "") === bytes, "the slider writes the lock");
    must(await page.evaluate(() => document.activeElement.id) === slider, "the slider loses the focus");
    await page.evaluate(() => new Promise((done) => setTimeout(done, 300)));
    await picture(page, "view-slider");

    // Optimised for it, live; the lock on the disk is that of the text.
    at = await version(page);
    await page.waitForSelector("#live-solve:not([disabled])", { timeout: 60000 });
    await page.evaluate(() => document.getElementById("live-solve").click());
    await until(page, "the optimiser's progress", () => /iteration \d+/.test(document.getElementById("live-status").textContent));
    await until(page, "points of its curve", () => document.querySelectorAll("#live-progress path.curve").length > 0);
    await picture(page, "view-solving");
    await newer(page, at);
    await until(page, "it is solved", () => document.getElementById("live-stop").hidden && document.getElementById("live-solve").disabled);
    must((existsSync(lock) ? readFileSync(lock, "utf8") : "") === bytes, "what is tried out writes the lock");
    at = await version(page);
    await page.evaluate(() => document.getElementById("live-reset").click());
    await newer(page, at);
    await until(page, "as it was written", () => document.getElementById("live-reset").hidden);
    await until(page, "as written the mechanism is that of before", (paths) => paths ===
        JSON.parse(document.getElementById("data").textContent).traces.map((t) => t.path.slice(2).join()).join(";"), path);
}
const wide = await page.evaluate(() => document.documentElement.scrollWidth);
must(wide <= 1360, `the page is ${wide} pixels wide`);
await page.close();

page = await shown({ width: 1360, height: 900, dark: true });
await picture(page, "view-dark");
await page.close();
page = await shown({ width: 375, height: 740, dark: false });
const narrow = await page.evaluate(() => document.documentElement.scrollWidth);
must(narrow <= 375, `on a phone the page is ${narrow} pixels wide`);
await picture(page, "view-phone");
await page.evaluate(() => document.getElementById("live").scrollIntoView({ behavior: "instant" }));
await picture(page, "view-phone-sliders");
at = await version(page);
writeFileSync(source, broken);
await until(page, "the error on a phone", () => document.getElementById("live-fault")?.checkVisibility());
await picture(page, "view-phone-broken");
const nameless = await page.evaluate(() => [...document.querySelectorAll("button, input, canvas, [tabindex], summary")]
    .filter((e) => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim())).map((e) => e.outerHTML.slice(0, 80)));
must(nameless.length === 0, `without a name: ${nameless}`);
must(told.length === 0, told.join("\n         "));

const code = await end();
must(code === 0, `Ctrl-C ends it with ${code}`);
await page.close();

// Begun with a broken text, which is still there.
({ address, end } = await started());
page = await open({ width: 1360, height: 900, dark: false });
await until(page, "the error from the beginning", () => document.getElementById("live-fault")?.checkVisibility());
must(!(await page.$eval("#live-status", (e) => e.textContent)).includes("last page"), "it speaks of a page that never was");
must(await page.$eval("#live-fault pre", (e) => getComputedStyle(e).textAlign) !== "center", "the text's lines are centred");
await picture(page, "view-begun-broken");
writeFileSync(source, text);
await drawn(page);
await until(page, "the error goes away", () => !document.getElementById("live-fault"));
must(told.length === 0, told.join("\n         "));
await end();
await browser.close();
rmSync(folder, { recursive: true });
console.log(`  renewed ${took} ms after a save, error told after ${faulted} ms, gone after ${mended} ms, slider shown after ${moved} ms`);
process.exit(failed ? 1 : 0);
