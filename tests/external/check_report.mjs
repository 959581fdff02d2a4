// Opens reports in headless Chromium: no error and no request, the mechanism is seen and moves with the slider, the page
// is usable by keyboard and fits a phone.
//
//     node check_report.mjs REPORT.html... [--pictures FOLDER]
//
// `puppeteer-core` is looked for along NODE_PATH, the browser in $CHROMIUM or as /usr/bin/chromium.
import { createRequire } from "node:module";
import { mkdirSync, statSync, writeFileSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const require = createRequire(import.meta.url);
const puppeteer = require("puppeteer-core");
const args = process.argv.slice(2);
const at = args.indexOf("--pictures");
const pictures = at < 0 ? null : args.splice(at, 2)[1];
if (pictures) mkdirSync(pictures, { recursive: true });
const MOST_BYTES = 6e6;

let failed = 0;
function must(holds, what) {
    if (holds) return;
    failed += 1;
    console.error(`  FAILS: ${what}`);
}

const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM || "/usr/bin/chromium",
    headless: true,
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"],
});

/** Colours of the view's pixels, as the compositor shows them. */
async function pixels(page) {
    const shot = await (await page.$("#view")).screenshot({ encoding: "base64" });
    return page.evaluate(async (data) => {
        const image = new Image();
        image.src = `data:image/png;base64,${data}`;
        await image.decode();
        const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext("2d");
        context.drawImage(image, 0, 0);
        return Array.from(context.getImageData(0, 0, image.width, image.height).data);
    }, shot);
}

function different(a, b) {
    let count = 0;
    for (let i = 0; i < a.length; i += 4) {
        if (Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) + Math.abs(a[i + 2] - b[i + 2]) > 24) count += 1;
    }
    return count / (a.length / 4);
}

/** Waits until the view has drawn a state. */
const drawn = (page, test) => page.waitForFunction(test, { timeout: 60000 });
const state = (page) => page.evaluate(() => Number(document.documentElement.dataset.drawn));

async function open(file, { width, height, dark }, told) {
    const page = await browser.newPage();
    page.on("console", (m) => { if (["error", "warn", "assert"].includes(m.type())) told.push(`console: ${m.text()}`); });
    page.on("pageerror", (e) => told.push(`error: ${e.message}`));
    page.on("request", (r) => { if (!r.url().startsWith("data:") && !r.url().startsWith("blob:") && r.url() !== pathToFileURL(file).href) told.push(`request: ${r.url()}`); });
    await page.setViewport({ width, height, deviceScaleFactor: width < 500 ? 2 : 1 });
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: dark ? "dark" : "light" }]);
    await page.goto(pathToFileURL(file).href);
    await drawn(page, () => document.documentElement.dataset.ready === "yes" && document.documentElement.dataset.drawn !== undefined);
    return page;
}

async function picture(page, name, full) {
    if (!pictures) return;
    writeFileSync(join(pictures, `${name}.png`), await page.screenshot({ fullPage: full }));
}

async function check(file) {
    const name = basename(file, ".html"), told = [], bytes = statSync(file).size, began = Date.now();
    console.log(`${name}: ${(bytes / 1e6).toFixed(2)} MB`);
    must(bytes < MOST_BYTES, `${bytes} bytes are more than ${MOST_BYTES}`);
    let page = await open(file, { width: 1280, height: 900, dark: false }, told);
    const opened = Date.now() - began;
    const last = await page.$eval("#time", (e) => Number(e.max));

    // What is seen beside the empty stage: the mechanism, and nothing once it is hidden.
    const first = await pixels(page);
    const back = new Array(first.length);
    for (let i = 0; i < first.length; i++) back[i] = first[i % 4 + 4 * 8];
    const seen = different(first, back);
    must(seen > 0.01, `only ${(100 * seen).toFixed(2)} % of the view differ from its corner`);
    await page.evaluate(() => { const s = document.getElementById("view"); s.style.visibility = "hidden"; });
    const empty = await pixels(page);
    await page.evaluate(() => { document.getElementById("view").style.visibility = ""; });
    const mechanism = different(first, empty);
    must(mechanism > 0.01, `the mechanism covers ${(100 * mechanism).toFixed(2)} % of the view`);

    // The slider moves it: by the keyboard, and back to the same picture.
    await page.focus("#time");
    const steps = Math.max(Math.floor(last / 3), 1);
    for (let k = 0; k < steps; k++) await page.keyboard.press("ArrowRight");
    await page.waitForFunction((s) => Number(document.documentElement.dataset.drawn) === s, { timeout: 60000 }, steps);
    const moved = await pixels(page);
    const change = different(first, moved);
    must(change > 0.001, `the slider changes ${(100 * change).toFixed(3)} % of the view`);
    const value = await page.$eval("#time", (e) => e.getAttribute("aria-valuetext"));
    must(value.includes(`state ${steps} of ${last}`), `the slider says "${value}"`);
    await page.keyboard.press("Home");
    await page.$eval("#time", (e) => { e.value = "0"; e.dispatchEvent(new Event("input")); });
    await drawn(page, () => Number(document.documentElement.dataset.drawn) === 0);
    must(different(first, await pixels(page)) < 0.001, "back at the start the view is another one");

    // It plays, and stops.
    await page.click("#play");
    await drawn(page, () => Number(document.documentElement.dataset.drawn) > 0.5);
    await page.click("#play");
    const wait = () => new Promise((done) => setTimeout(done, 500));
    await wait();
    const stopped = await state(page);
    await wait();
    must(await state(page) === stopped, "it does not stop");

    // Before and after differ, and so do the colours.
    const choose = async (value) => {
        await page.$eval(`input[value="${value}"]`, (e) => e.click());
        await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
        return pixels(page);
    };
    const after = await choose("after"), before = await choose("before"), both = await choose("both");
    must(different(after, before) > 0.005 && different(after, both) > 0.0005, "before and after look alike");
    await picture(page, `${name}-both`, false);
    await choose("after");

    // Everything that can be used has a name and is reached by the tabulator.
    const nameless = await page.evaluate(() => [...document.querySelectorAll("button, input, canvas, [tabindex], summary")]
        .filter((e) => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim())).map((e) => e.outerHTML.slice(0, 80)));
    must(nameless.length === 0, `without a name: ${nameless}`);
    const ids = await page.evaluate(() => { const all = [...document.querySelectorAll("[id]")].map((e) => e.id); return all.length - new Set(all).size; });
    must(ids === 0, `${ids} ids stand twice`);
    await page.evaluate(() => document.activeElement.blur());
    const reached = new Set();
    for (let k = 0; k < 60; k++) {
        await page.keyboard.press("Tab");
        reached.add(await page.evaluate(() => document.activeElement.id || document.activeElement.name || document.activeElement.dataset.view || ""));
    }
    for (const id of ["view", "play", "time", "show", "colour"]) must(reached.has(id), `the tabulator does not reach ${id}`);
    const plots = await page.$$eval("svg[data-plot]", (all) => all.length);
    must(plots >= 1, "there are no plots");
    await page.evaluate(() => { document.activeElement.blur(); scrollTo(0, 0); });
    await picture(page, `${name}-light`, true);
    await page.close();

    page = await open(file, { width: 1280, height: 900, dark: true }, told);
    const paper = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    must(paper.match(/\d+/g).slice(0, 3).every((c) => Number(c) < 60), `dark paper is ${paper}`);
    await picture(page, `${name}-dark`, true);
    await page.close();

    page = await open(file, { width: 375, height: 740, dark: false }, told);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    must(wide <= 375, `on a phone the page is ${wide} pixels wide`);
    await picture(page, `${name}-phone`, false);
    await page.evaluate(() => document.getElementById("requirements")?.scrollIntoView({ behavior: "instant" }));
    await picture(page, `${name}-phone-below`, false);
    await page.close();
    must(told.length === 0, told.join("\n         "));
    console.log(`  mechanism ${(100 * mechanism).toFixed(1)} % of the view, slider changes ${(100 * change).toFixed(1)} %, ${plots} plots, ready after ${opened} ms`);
}

for (const file of args) await check(resolve(file));
await browser.close();
process.exit(failed || !args.length ? 1 : 0);
