// The view's own script: follows the state that the server sends, takes newer pages over in place of this one, and lets the
// parameters be moved.
(() => {
"use strict";
const byId = (id) => document.getElementById(id);
const token = document.querySelector('meta[name="flexura-token"]').content;
const root = document.documentElement, status = byId("live-status"), bench = byId("live");
const make = (name, properties, ...children) => {
    const e = Object.assign(document.createElement(name), properties);
    e.append(...children);
    return e;
};

// ---- to the server ---------------------------------------------------------------------------------
const post = (path, body) => fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json", "X-Flexura-Token": token },
    body: JSON.stringify(body ?? {}),
}).catch(() => null);

/** The newest value of each parameter, one request at a time: what a slider passes is left out. */
const due = new Map();
let sending = false;
async function set(name, value) {
    due.set(name, value);
    if (sending) return;
    sending = true;
    while (due.size) {
        const [next] = due;
        due.delete(next[0]);
        await post("/set", { name: next[0], value: next[1] });
    }
    sending = false;
}

// ---- newer pages -----------------------------------------------------------------------------------
let shown = Number(document.querySelector('meta[name="flexura-version"]').content), wanted = shown, fetching = false;
root.dataset.version = String(shown);
async function renew() {
    if (fetching || wanted <= shown) return;
    fetching = true;
    while (wanted > shown) {
        try {
            const answer = await fetch("/", { cache: "no-store" });
            if (!answer.ok) break;
            const text = await answer.text();
            // Before the first page there is nothing to take over.
            if (!byId("stage")) return location.reload();
            await flexura.ready;
            await flexura.swap(text);
            const version = new DOMParser().parseFromString(text.slice(0, 4000), "text/html").querySelector('meta[name="flexura-version"]');
            shown = Number(version.content);
            root.dataset.version = String(shown);
        } catch (why) {
            console.warn(String(why));
            break;
        }
    }
    fetching = false;
}

// ---- what goes on ----------------------------------------------------------------------------------
const number = (v) => {
    if (!Number.isFinite(v)) return "–";
    const size = Math.abs(v);
    return (size !== 0 && (size < 1e-3 || size >= 1e5) ? v.toExponential(1) : String(Number(v.toPrecision(3)))).replace("-", "−");
};

function say(state) {
    const solving = state.solving, tried = state.parameters.filter((p) => p.set !== null).map((p) => p.path);
    let text = "Up to date.";
    if (state.fault) text = state.version ? "The text has errors: this is the last page without." : "The text has errors: the page comes with the first text without.";
    else if (solving?.running) {
        const first = solving.points[0], last = solving.points.at(-1);
        const of = solving.design ? ` ${solving.design}` : "";
        text = last ? `Optimising${of}: iteration ${last.n}, cost ${number(last.cost)}` : `Optimising${of} …`;
        if (last && last.n > 0 && first.cost > 0) text += ` (at the start ${number(first.cost)}, best ${number(solving.best)})`;
        if (last && last.error_mm !== null) text += `, largest error ${number(last.error_mm)} mm`;
        if (last) text += ".";
    } else if (state.phase === "solids") text = "The motion is up to date; solids and gaps are being made …";
    else if (state.phase) text = state.version ? `Working: ${state.phase} …` : "The first page is being made …";
    if (!state.fault && !solving?.running && state.stale) text += " These values were not solved for these parameters: Solve does.";
    else if (!solving?.running && state.unfinished) text += " The optimisation had not ended: Solve goes on.";
    if (tried.length) text += ` Tried out, not written: ${tried.join(", ")}.`;
    if (status.textContent !== text) status.textContent = text;
    const busy = Boolean(state.phase) && !state.fault;
    root.classList.toggle("live-busy", busy);
    root.classList.toggle("live-tried", tried.length > 0);
    root.classList.toggle("live-fault", Boolean(state.fault));
}

/** The findings, as the command shows them; the lines that name them stand out. */
function fault(text) {
    let sheet = byId("live-fault");
    if (!text) {
        sheet?.remove();
        return;
    }
    if (!sheet) {
        const hide = make("button", { type: "button", textContent: "hide" });
        sheet = make("div", { id: "live-fault" }, hide, make("h2", { textContent: "Not shown: the text has errors" }), make("pre", { tabIndex: 0 }));
        sheet.setAttribute("role", "alert");
        hide.addEventListener("click", () => { sheet.hidden = true; });
        document.body.append(sheet);
    }
    const pre = sheet.querySelector("pre");
    if (pre.dataset.text === text) return;
    pre.dataset.text = text;
    sheet.hidden = false;
    const line = (l) => /^\s*([EWA]\d{4}|[×⚠☞])/.test(l) ? make("b", { textContent: `${l}\n` }) : `${l}\n`;
    pre.replaceChildren(...text.split("\n").map(line));
}

/** Terms over the iterations, with a logarithmic scale. */
function progress(solving) {
    const box = byId("live-progress"), points = solving?.points ?? [];
    box.hidden = points.length < 2;
    if (box.hidden) return;
    const svg = box.querySelector("svg"), legend = box.querySelector("ul"), last = points.at(-1);
    const names = last.terms.map((t) => t[0]).filter((_, k) => points.some((p) => p.terms[k]?.[1] > 0));
    const value = (p, name) => p.terms.find((t) => t[0] === name)?.[1] ?? 0;
    const all = points.flatMap((p) => names.map((n) => value(p, n))).filter((v) => v > 0);
    const high = Math.ceil(Math.log10(Math.max(...all, 1e-12))), low = Math.max(Math.floor(Math.log10(Math.min(...all, 10 ** high))), high - 6);
    const x = (n) => 34 + 280 * (n - points[0].n) / Math.max(last.n - points[0].n, 1);
    const y = (v) => 118 - 110 * (Math.max(Math.log10(Math.max(v, 1e-300)), low) - low) / Math.max(high - low, 1);
    const shape = (name, attributes, text) => {
        const e = document.createElementNS("http://www.w3.org/2000/svg", name);
        for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
        if (text) e.textContent = text;
        return e;
    };
    const parts = [];
    for (const power of [low, high]) {
        parts.push(shape("path", { class: "grid", d: `M34 ${y(10 ** power)}H314` }), shape("text", { class: "tick end", x: 29, y: y(10 ** power) + 4 }, Math.abs(power) > 3 ? `1e${power}`.replace("-", "−") : number(10 ** power)));
    }
    names.forEach((name, k) => {
        const d = points.map((p, i) => `${i ? "L" : "M"}${x(p.n).toFixed(1)} ${y(value(p, name)).toFixed(1)}`).join("");
        parts.push(shape("path", { class: `curve c${k % 6}`, d }));
    });
    svg.replaceChildren(...parts);
    legend.replaceChildren(...names.map((name, k) => make("li", {}, make("i", { className: `c${k % 6}` }), `${name} `, make("output", { textContent: number(value(last, name)) }))));
}

// ---- sliders ---------------------------------------------------------------------------------------
let made = "";
const inputs = new Map();
function sliders(parameters) {
    const box = byId("live-sliders"), key = JSON.stringify(parameters.map((p) => [p.path, p.text, p.range, p.doc]));
    if (key !== made) {
        made = key;
        inputs.clear();
        box.replaceChildren(...parameters.map((p, k) => {
            const [low, high, step] = p.range, digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
            const slider = make("input", { type: "range", id: `live-p${k}`, min: low, max: high, step });
            const field = make("input", { type: "text", inputMode: "decimal", autocomplete: "off" });
            field.setAttribute("aria-label", `${p.path}, value`);
            const give = (v) => set(p.path, p.unit ? `${v} ${p.unit}` : String(v));
            slider.addEventListener("input", () => {
                field.value = Number(slider.value).toFixed(digits);
                give(field.value);
            });
            field.addEventListener("change", () => {
                // With a unit of its own it is taken as it is.
                if (/^[-+.\d e]+$/i.test(field.value.trim())) give(field.value.trim());
                else set(p.path, field.value);
            });
            const row = make("div", { className: "live-slider" },
                make("label", { htmlFor: slider.id, textContent: p.path }),
                make("span", { className: "live-value" }, field, make("small", { textContent: p.unit })),
                slider);
            if (p.doc) row.append(make("p", { textContent: p.doc }));
            inputs.set(p.path, { row, slider, field });
            return row;
        }));
    }
    for (const p of parameters) {
        const { row, slider, field } = inputs.get(p.path);
        row.classList.toggle("is-set", p.set !== null);
        // What is under somebody's hand is not moved.
        if (due.has(p.path) || sending) continue;
        const text = p.set ?? p.text, plain = p.unit && text.endsWith(` ${p.unit}`) ? text.slice(0, -p.unit.length - 1) : text;
        if (document.activeElement !== field) field.value = plain;
        if (document.activeElement !== slider) slider.value = plain;
    }
}

let now = null;
function follow(state) {
    now = state;
    say(state);
    fault(state.fault);
    if (bench) {
        sliders(state.parameters);
        progress(state.solving);
        byId("live-solve").hidden = !state.solvable;
        byId("live-solve").disabled = Boolean(state.fault) || state.solving?.running || !(state.stale || state.unfinished);
        byId("live-stop").hidden = !state.solving?.running;
        byId("live-reset").hidden = !state.parameters.some((p) => p.set !== null);
    }
    root.dataset.phase = state.phase;
    wanted = state.version;
    renew();
}

byId("live-solve")?.addEventListener("click", () => post("/solve"));
byId("live-stop")?.addEventListener("click", () => post("/stop"));
byId("live-reset")?.addEventListener("click", () => post("/reset"));

const events = new EventSource("/events");
events.addEventListener("state", (e) => { root.classList.remove("live-away"); follow(JSON.parse(e.data)); });
events.addEventListener("error", () => {
    root.classList.add("live-away");
    status.textContent = "The command has ended, or does not answer. This is its last page.";
});
})();
