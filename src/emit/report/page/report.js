// The report's page: the mechanism in 3D, its slider, and the cursors of the plots. All data stand in the page.
(() => {
"use strict";
const byId = (id) => document.getElementById(id);
let data, last, duration;
/** Takes the description that stands in the page. */
function adopt() {
    data = JSON.parse(byId("data").textContent);
    last = data.times.length - 1;
    duration = Math.max(data.times[last] || 1, 1e-3);
}
adopt();

// ---- the block of arrays -----------------------------------------------------------------------
async function unpack() {
    const text = atob(byId("block").textContent);
    const packed = Uint8Array.from(text, (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return new Response(stream).arrayBuffer();
}

/** Positions as they were, three numbers each. */
function positions(block, [at, count, x, y, z, wide, high, deep]) {
    const coarse = new Uint16Array(block, at, 3 * count), fine = new Float32Array(3 * count);
    const low = [x, y, z], size = [wide, high, deep];
    for (let i = 0; i < fine.length; i++) fine[i] = low[i % 3] + size[i % 3] * coarse[i] / 65535;
    return fine;
}

function corners(block, [at, count, bytes]) {
    const steps = bytes === 2 ? new Uint16Array(block, at, count) : new Uint32Array(block, at, count);
    const out = bytes === 2 ? new Uint16Array(count) : new Uint32Array(count);
    let now = 0;
    // Sums wrap round as the differences do.
    for (let i = 0; i < count; i++) now = out[i] = bytes === 2 ? (now + steps[i]) & 0xffff : (now + steps[i]) >>> 0;
    return out;
}

/** Places and turns of one body over the cycle, or of all stations of a flexure, state by state. */
function frames(block, s) {
    const p = positions(block, s.p), coarse = new Int16Array(block, s.q, 4 * s.p[1]), q = new Float32Array(coarse.length);
    for (let i = 0; i < q.length; i++) q[i] = coarse[i] / 32767;
    return { p, q };
}

// ---- time ----------------------------------------------------------------------------------------
const slider = byId("time"), clock = byId("clock"), play = byId("play");
let plotFollowers = [], viewFollowers = [];
let state = 0, running = false, way = 1, lastTime = 0;

function go(to, fromSlider) {
    state = Math.min(Math.max(to, 0), last);
    if (!fromSlider) slider.value = String(state);
    const time = (data.times[Math.floor(state)] || 0) + (state % 1) * duration / Math.max(last, 1);
    clock.textContent = `${time.toFixed(2)} s · ${Math.round(state)}/${last}`;
    slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds, state ${Math.round(state)} of ${last}`);
    for (const follow of [...plotFollowers, ...viewFollowers]) follow(state);
}

function run(on) {
    if (last < 1) return;
    running = on;
    play.setAttribute("aria-pressed", String(on));
    play.setAttribute("aria-label", on ? "Pause" : "Play");
    if (on) {
        lastTime = performance.now();
        requestAnimationFrame(step);
    }
}

let closed = true;
function step(now) {
    if (!running) return;
    const dt = Math.min(now - lastTime, 100) / 1000;
    lastTime = now;
    let next = state + way * dt * last / Math.max(duration, 1.2);
    // What ends where it began goes on, all else goes back and forth.
    if (closed) next %= last;
    else if (next >= last || next <= 0) {
        way = next >= last ? -1 : 1;
        next = Math.min(Math.max(next, 0), last);
    }
    go(next);
    requestAnimationFrame(step);
}

slider.addEventListener("input", () => { run(false); go(Number(slider.value), true); });
slider.addEventListener("keydown", (e) => {
    // A key goes from state to state: "any" would have steps of its own.
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[e.key];
    if (by === undefined) return;
    e.preventDefault();
    run(false);
    go(Math.round(state) + by);
});
play.addEventListener("click", () => run(!running));
document.addEventListener("keydown", (e) => {
    if (e.key !== " " || e.target.closest("button, input, summary, a, select, textarea")) return;
    e.preventDefault();
    run(!running);
});

// ---- plots ---------------------------------------------------------------------------------------
function shown(v) {
    if (v === null || v === undefined) return "";
    const size = Math.abs(v);
    return (size >= 100 ? v.toFixed(0) : size >= 10 ? v.toFixed(1) : v.toFixed(2)).replace("-", "−");
}
function wirePlots() {
plotFollowers = [];
for (const plot of data.plots) {
    const svg = document.querySelector(`svg[data-plot="${plot.id}"]`);
    const outputs = document.querySelectorAll(`output[data-value="${plot.id}"]`);
    const line = svg.querySelector(".cursor path"), dots = svg.querySelectorAll(".cursor circle");
    const [left, right, bottom, top, low, high] = plot.frame;
    plotFollowers.push((s) => {
        const below = Math.min(Math.floor(s), Math.max(last - 1, 0)), share = s - below;
        const x = left + (right - left) * s / Math.max(last, 1);
        line.setAttribute("d", `M${x.toFixed(1)} ${top}V${bottom}`);
        plot.values.forEach((values, k) => {
            const a = values[below], b = values[below + 1] ?? a;
            if (a === null || a === undefined) return;
            const v = a + share * (b - a);
            dots[k].setAttribute("cx", x.toFixed(1));
            dots[k].setAttribute("cy", (bottom - (bottom - top) * (v - low) / (high - low)).toFixed(1));
            outputs[k].textContent = `${shown(v)} ${plot.unit}`;
        });
    });
    const seek = (e) => {
        const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
        const x = (e.clientX - box.left) * view.width / box.width;
        run(false);
        go(last * (x - left) / (right - left));
    };
    svg.addEventListener("pointerdown", (e) => { svg.setPointerCapture(e.pointerId); seek(e); });
    svg.addEventListener("pointermove", (e) => { if (svg.hasPointerCapture(e.pointerId)) seek(e); });
}
}

// ---- the mechanism -------------------------------------------------------------------------------
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The view of what stands in the block; `old` is the one that it follows, whose place it takes. */
function build(block, old) {
    const T = THREE, canvas = byId("view"), stage = byId("stage");
    const renderer = old ? old.renderer : new T.WebGLRenderer({ canvas, antialias: true, alpha: true });
    const left = old ? old.leave() : null, ending = new AbortController(), signal = ending.signal;
    renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    const scene = new T.Scene(), camera = new T.PerspectiveCamera(28, 1, 1, 10000);
    const hemisphere = new T.HemisphereLight(0xffffff, 0x8790a0, 1.9), sun = new T.DirectionalLight(0xffffff, 2.1), fill = new T.DirectionalLight(0xffffff, 0.5);
    scene.add(hemisphere, camera);
    camera.add(sun, fill, sun.target, fill.target);
    sun.position.set(-0.6, 0.9, 0.6); fill.position.set(0.9, -0.3, 0.4);
    sun.target.position.set(0, 0, -1); fill.target.position.set(0, 0, -1);

    const geometry = (v, n, i, count) => {
        const g = new T.BufferGeometry();
        g.setAttribute("position", new T.BufferAttribute(v, 3));
        g.setAttribute("normal", n);
        g.setIndex(new T.BufferAttribute(i, 1));
        return g;
    };
    const movers = [], bounds = new T.Box3();
    const point = new T.Vector3(), turn = new T.Quaternion(), other = new T.Quaternion();
    /** Moves an object as a body over the cycle. */
    const follow = (object, s) => {
        const { p, q } = frames(block, s);
        if (p.length === 0) return;
        const count = p.length / 3;
        movers.push((at) => {
            const a = Math.min(Math.floor(at), count - 1), b = Math.min(a + 1, count - 1), u = at - a;
            object.position.fromArray(p, 3 * a).lerp(point.fromArray(p, 3 * b), u);
            object.quaternion.fromArray(q, 4 * a).normalize().slerp(other.fromArray(q, 4 * b).normalize(), u);
        });
    };

    const looks = [0, 1, 2, 3, 4].map(() => new T.MeshStandardMaterial({ roughness: 0.72, metalness: 0 }));
    const solids = new T.Group(), ghosts = new T.Group(), lines = new T.Group();
    scene.add(solids, ghosts, lines);
    /** The same object once more, elsewhere. */
    const again = (mesh, like, look) => {
        const place = new T.Group(), copy = new T.Mesh(mesh.geometry, look);
        place.quaternion.fromArray(like.turn).normalize();
        place.position.fromArray(like.shift);
        copy.position.copy(mesh.position);
        copy.frustumCulled = mesh.frustumCulled;
        place.add(copy);
        solids.add(place);
        return copy;
    };
    /** A box that is put elsewhere, as one that holds it. */
    const boxOf = (mesh, like) => {
        const box = mesh.geometry.boundingBox.clone().translate(mesh.position);
        if (!like) return box;
        const place = new T.Matrix4().compose(point.fromArray(like.shift), turn.fromArray(like.turn).normalize(), new T.Vector3(1, 1, 1));
        return box.applyMatrix4(place);
    };
    const linkMeshes = [], ribbonMeshes = [];
    for (const link of data.links) {
        if (link.like) {
            const first = linkMeshes[link.like.of], copy = again(first, link.like, looks[link.part % looks.length]);
            linkMeshes.push(copy);
            follow(copy, data.links[link.like.of].s);
            bounds.union(boxOf(first, link.like));
            continue;
        }
        const v = positions(block, link.v), normals = new T.BufferAttribute(new Int8Array(block, link.n, v.length), 3, true);
        const mesh = new T.Mesh(geometry(v, normals, corners(block, link.i)), looks[link.part % looks.length]);
        mesh.position.fromArray(link.center);
        solids.add(mesh);
        follow(mesh, link.s);
        mesh.geometry.computeBoundingBox();
        linkMeshes.push(mesh);
        bounds.union(boxOf(mesh));
    }

    // Flexures: each vertex rides with a station, as the sections of a rod do.
    const shades = data.shades.map((s) => new T.Color(s)), shade = new T.Color();
    const flexureLook = new T.MeshStandardMaterial({ roughness: 0.6, metalness: 0, vertexColors: true, side: T.DoubleSide });
    const recolour = [];
    let colouring = "now";
    for (const ribbon of data.ribbons) {
        if (ribbon.like) {
            // Its vertices are those of the first, which move already.
            ribbonMeshes.push(again(ribbonMeshes[ribbon.like.of], ribbon.like, flexureLook));
            continue;
        }
        const local = positions(block, ribbon.v), count = local.length / 3;
        const normal = new Int8Array(block, ribbon.n, 3 * count), at = new Uint8Array(block, ribbon.at, count);
        const peak = new Uint8Array(block, ribbon.peak, count);
        const { p, q } = frames(block, ribbon.s), stations = ribbon.stations;
        const states = Math.max(p.length / (3 * stations), 1), now = new Uint8Array(block, ribbon.now, stations * states);
        const v = new T.BufferAttribute(new Float32Array(3 * count), 3), n = new T.BufferAttribute(new Float32Array(3 * count), 3);
        const c = new T.BufferAttribute(new Float32Array(3 * count), 3);
        const g = geometry(v.array, n, corners(block, ribbon.i));
        g.setAttribute("position", v);
        g.setAttribute("color", c);
        const mesh = new T.Mesh(g, flexureLook);
        mesh.frustumCulled = false;
        solids.add(mesh);
        ribbonMeshes.push(mesh);
        movers.push((t) => {
            const a = Math.min(Math.floor(t), states - 1), b = Math.min(a + 1, states - 1), u = t - a;
            for (let k = 0; k < count; k++) {
                const i = a * stations + at[k], j = b * stations + at[k];
                turn.fromArray(q, 4 * i).normalize().slerp(other.fromArray(q, 4 * j).normalize(), u);
                point.fromArray(local, 3 * k).applyQuaternion(turn);
                v.array[3 * k] = point.x + p[3 * i] + u * (p[3 * j] - p[3 * i]);
                v.array[3 * k + 1] = point.y + p[3 * i + 1] + u * (p[3 * j + 1] - p[3 * i + 1]);
                v.array[3 * k + 2] = point.z + p[3 * i + 2] + u * (p[3 * j + 2] - p[3 * i + 2]);
                point.set(normal[3 * k], normal[3 * k + 1], normal[3 * k + 2]).applyQuaternion(turn).normalize().toArray(n.array, 3 * k);
            }
            v.needsUpdate = n.needsUpdate = true;
            if (colouring === "now") colour(t);
        });
        const colour = (t) => {
            const a = Math.min(Math.floor(t), states - 1), b = Math.min(a + 1, states - 1), u = t - a;
            for (let k = 0; k < count; k++) {
                if (colouring === "part") {
                    shade.copy(looks[ribbon.part % looks.length].color);
                } else {
                    const i = a * stations + at[k], j = b * stations + at[k];
                    const level = (colouring === "peak" ? peak[k] : now[i] + u * (now[j] - now[i])) / 255 * (shades.length - 1);
                    const below = Math.min(Math.floor(level), shades.length - 2);
                    shade.copy(shades[below]).lerp(shades[below + 1], level - below);
                }
                shade.toArray(c.array, 3 * k);
            }
            c.needsUpdate = true;
        };
        recolour.push(() => colour(state));
    }

    const ghostLook = new T.MeshStandardMaterial({ transparent: true, opacity: 0.5, depthWrite: false, roughness: 0.8 });
    for (const ghost of data.ghosts) {
        const body = new T.Group();
        body.position.fromArray(ghost.center);
        for (const [a, b] of ghost.bars) {
            const from = new T.Vector3(...a), to = new T.Vector3(...b), long = from.distanceTo(to);
            const bar = new T.Mesh(new T.CylinderGeometry(ghost.radius, ghost.radius, long, 12), ghostLook);
            bar.position.copy(from).add(to).multiplyScalar(0.5);
            bar.quaternion.setFromUnitVectors(new T.Vector3(0, 1, 0), to.sub(from).normalize());
            body.add(bar);
            for (const end of [a, b]) {
                const eye = new T.Mesh(new T.SphereGeometry(ghost.radius * 1.5, 16, 10), ghostLook);
                eye.position.fromArray(end);
                body.add(eye);
            }
        }
        ghosts.add(body);
        follow(body, ghost.s);
    }

    /** A thin tube along points; where `dash` is given, in pieces so long. */
    const tube = (points, radius, look, dash) => {
        const sides = 6, v = [], index = [], axis = new T.Vector3(), side = new T.Vector3(), up = new T.Vector3();
        let gone = 0;
        for (let k = 0; k + 5 < points.length; k += 3) {
            const a = new T.Vector3().fromArray(points, k), b = new T.Vector3().fromArray(points, k + 3), long = a.distanceTo(b);
            if (long < 1e-6) continue;
            const pieces = dash ? Math.max(Math.ceil(long / (dash / 4)), 1) : 1;
            for (let i = 0; i < pieces; i++) {
                const middle = gone + long * (i + 0.5) / pieces;
                if (dash && middle % (2 * dash) > dash) continue;
                const ends = [a.clone().lerp(b, i / pieces), a.clone().lerp(b, (i + 1) / pieces)];
                axis.copy(b).sub(a).normalize();
                side.set(Math.abs(axis.x) < 0.7 ? 1 : 0, Math.abs(axis.x) < 0.7 ? 0 : 1, 0).cross(axis).normalize();
                up.copy(axis).cross(side);
                const first = v.length / 3;
                for (const end of ends) {
                    for (let s = 0; s < sides; s++) {
                        const angle = 2 * Math.PI * s / sides, cos = radius * Math.cos(angle), sin = radius * Math.sin(angle);
                        v.push(end.x + side.x * cos + up.x * sin, end.y + side.y * cos + up.y * sin, end.z + side.z * cos + up.z * sin);
                    }
                }
                for (let s = 0; s < sides; s++) {
                    const t = (s + 1) % sides;
                    index.push(first + s, first + t, first + sides + t, first + s, first + sides + t, first + sides + s);
                }
            }
            gone += long;
        }
        const g = new T.BufferGeometry();
        g.setAttribute("position", new T.BufferAttribute(new Float32Array(v), 3));
        g.setIndex(index);
        return new T.Mesh(g, look);
    };
    const flat = () => new T.MeshBasicMaterial({ side: T.DoubleSide });
    const traceLook = flat(), targetLook = flat(), startLook = flat(), beforeLines = [];
    for (const trace of data.traces) {
        for (const path of [trace.path, trace.target, trace.before]) {
            const all = positions(block, path);
            for (let k = 0; k < all.length; k += 3) bounds.expandByPoint(point.fromArray(all, k));
        }
    }
    const size = Math.max(bounds.getSize(new T.Vector3()).length(), 1), thin = size / 420;
    for (const trace of data.traces) {
        const path = positions(block, trace.path);
        if (path.length === 0) continue;
        lines.add(tube(positions(block, trace.target), thin * 0.8, targetLook, size / 120));
        lines.add(tube(path, thin, traceLook));
        const start = tube(positions(block, trace.before), thin * 0.7, startLook, size / 60);
        beforeLines.push(start);
        lines.add(start);
        const tip = new T.Mesh(new T.SphereGeometry(thin * 3.2, 20, 14), traceLook);
        lines.add(tip);
        movers.push((at) => {
            const a = Math.min(Math.floor(at), path.length / 3 - 1), b = Math.min(a + 1, path.length / 3 - 1);
            tip.position.fromArray(path, 3 * a).lerp(point.fromArray(path, 3 * b), at - a);
        });
    }

    // Colours are the page's.
    const paint = () => {
        looks.forEach((look, k) => look.color.set(css(`--part-${k}`)));
        ghostLook.color.set(css("--ghost"));
        traceLook.color.set(css("--trace"));
        targetLook.color.set(css("--target"));
        startLook.color.set(css("--start"));
        recolour.forEach((f) => f());
        draw();
    };

    // ---- looking at it ----
    const controls = new T.OrbitControls(camera, canvas);
    controls.enableZoom = false;
    controls.zoomToCursor = true;
    canvas.style.touchAction = "pan-y";
    // The wheel scrolls the page until the view is taken into hand.
    canvas.addEventListener("pointerdown", () => { controls.enableZoom = true; }, { signal });
    canvas.addEventListener("focusout", () => { controls.enableZoom = false; }, { signal });
    const from = { iso: [0.45, 0.38, 1], front: [0, 0, 1], top: [0, 1, 0.0001], right: [1, 0, 0] };
    if (data.flat && Math.abs(data.flat[2]) > 0.9) from.iso = [0.28, 0.3, 1];
    // Where something is at some time: what a view has to hold.
    const places = [];
    for (const each of data.links) {
        const link = each.like ? data.links[each.like.of] : each;
        const all = positions(block, link.v), { p, q } = frames(block, link.s), states = p.length / 3;
        if (!states || !all.length) continue;
        const low = [Infinity, Infinity, Infinity], high = low.map((x) => -x);
        for (let k = 0; k < all.length; k++) {
            low[k % 3] = Math.min(low[k % 3], all[k]);
            high[k % 3] = Math.max(high[k % 3], all[k]);
        }
        for (let a = 0; a < states; a += Math.max(Math.floor(states / 6), 1)) {
            turn.fromArray(q, 4 * a).normalize();
            for (let c = 0; c < 8; c++) {
                const corner = new T.Vector3(c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]);
                corner.applyQuaternion(turn).add(point.fromArray(p, 3 * a));
                if (each.like) corner.applyQuaternion(other.fromArray(each.like.turn).normalize()).add(point.fromArray(each.like.shift));
                places.push(corner);
            }
        }
    }
    for (const trace of data.traces) {
        const all = positions(block, trace.path);
        for (let k = 0; k < all.length; k += 3) places.push(new T.Vector3().fromArray(all, k));
    }
    let view = "iso";
    const fit = (name) => {
        if (!places.length) return;
        view = name || view;
        const towards = new T.Vector3(...from[view]).normalize();
        const right = new T.Vector3(0, 1, 0).cross(towards).normalize(), up = towards.clone().cross(right);
        const extent = (axis) => {
            const all = places.map((p) => p.dot(axis));
            return [Math.min(...all), Math.max(...all)];
        };
        const ends = [extent(right), extent(up), extent(towards)];
        const middle = new T.Vector3();
        [right, up, towards].forEach((axis, k) => middle.addScaledVector(axis, (ends[k][0] + ends[k][1]) / 2));
        // As near as all of it allows; above stand the buttons, below the scale.
        const slope = Math.tan(camera.fov * Math.PI / 360), room = 1 - (stage.clientWidth > 640 ? 84 : 40) / Math.max(stage.clientHeight, 200);
        let far = 0;
        for (const p of places) {
            const away = p.clone().sub(middle), depth = away.dot(towards);
            far = Math.max(far, depth + Math.abs(away.dot(up)) / (slope * room), depth + Math.abs(away.dot(right)) / (slope * camera.aspect * 0.94));
        }
        camera.position.copy(middle).addScaledVector(towards, Math.max(far, size / 10));
        camera.near = size / 500; camera.far = size * 20;
        camera.updateProjectionMatrix();
        controls.target.copy(middle);
        controls.update();
        draw();
    };
    let touched = false, due = false;
    const draw = () => {
        if (due) return;
        due = true;
        requestAnimationFrame(() => {
            due = false;
            if (signal.aborted) return;
            renderer.render(scene, camera);
            document.documentElement.dataset.drawn = state.toFixed(3);
        });
    };
    controls.addEventListener("change", draw);
    controls.addEventListener("start", () => { touched = true; });
    canvas.addEventListener("keydown", (e) => {
        const turned = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
        const near = { "+": 0.88, "=": 0.88, "-": 1.14 }[e.key];
        const away = camera.position.clone().sub(controls.target);
        if (turned) {
            const radius = away.length(), up = Math.min(Math.max(Math.acos(away.y / radius) + turned[1] * 0.1, 0.02), Math.PI - 0.02);
            const round = Math.atan2(away.x, away.z) + turned[0] * 0.1;
            away.set(radius * Math.sin(up) * Math.sin(round), radius * Math.cos(up), radius * Math.sin(up) * Math.cos(round));
        } else if (near) away.multiplyScalar(near);
        else if (e.key === "0") { touched = false; e.preventDefault(); return fit(); }
        else return;
        e.preventDefault();
        touched = true;
        camera.position.copy(controls.target).add(away);
        controls.update();
        draw();
    }, { signal });
    const resize = () => {
        const { clientWidth: w, clientHeight: h } = stage;
        if (!w || !h) return;
        renderer.setSize(w, h, false);
        camera.aspect = w / h;
        camera.updateProjectionMatrix();
        if (!touched) fit();
        draw();
    };

    // ---- what is shown ----
    const show = (what) => {
        solids.visible = what !== "before";
        ghosts.visible = what !== "after";
        ghostLook.opacity = what === "before" ? 0.95 : 0.5;
        ghostLook.depthWrite = what === "before";
        beforeLines.forEach((l) => { l.visible = what === "both"; });
        byId("scale").hidden = what === "before" || colouring === "part" || !data.ribbons.length;
        draw();
    };
    const chosen = (name) => document.querySelector(`input[name="${name}"]:checked`).value;
    document.querySelectorAll('input[name="show"]').forEach((i) => i.addEventListener("change", () => show(i.value), { signal }));
    document.querySelectorAll('input[name="colour"]').forEach((i) => i.addEventListener("change", () => {
        colouring = i.value;
        recolour.forEach((f) => f());
        show(chosen("show"));
    }, { signal }));
    document.querySelectorAll("button[data-view]").forEach((b) => b.addEventListener("click", () => { touched = false; fit(b.dataset.view); }, { signal }));
    byId("scale").style.setProperty("--shades", `linear-gradient(90deg, ${data.shades.join(",")})`);

    byId("drawing").hidden = true;
    canvas.hidden = byId("look").hidden = false;
    viewFollowers = [(at) => { movers.forEach((f) => f(at)); draw(); }];
    // A cycle is closed where all bodies end as they begin.
    closed = data.links.every((l) => {
        if (l.like) return true;
        const { p } = frames(block, l.s), n = p.length - 3;
        return n <= 0 || Math.hypot(p[n] - p[0], p[n + 1] - p[1], p[n + 2] - p[2]) < 1e-3 * size;
    });
    colouring = chosen("colour");
    const observer = new ResizeObserver(resize);
    observer.observe(stage);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint, { signal });
    resize();
    fit(left?.view);
    if (left?.touched) {
        // Whoever has turned it goes on looking from there.
        touched = true;
        camera.position.copy(left.position);
        controls.target.copy(left.target);
        controls.update();
    }
    show(chosen("show"));
    paint();
    return {
        renderer,
        camera,
        /** Ends it: what it held is free, and where it looked from is given on. */
        leave() {
            ending.abort();
            observer.disconnect();
            controls.dispose();
            scene.traverse((o) => o.geometry?.dispose());
            for (const look of [...looks, flexureLook, ghostLook, traceLook, targetLook, startLook]) look.dispose();
            return { view, touched, position: camera.position.clone(), target: controls.target.clone() };
        },
    };
}

// ---- a newer page in place of this one -------------------------------------------------------------
let viewer = null;
async function show3d() {
    try {
        viewer = build(await unpack(), viewer);
    } catch (why) {
        byId("no3d").hidden = false;
        byId("view").hidden = byId("look").hidden = true;
        byId("drawing").hidden = false;
        console.warn(String(why));
    }
}

/** What can be kept of a section while a newer one takes its place: which details are open, how far tables are scrolled. */
function replace(old, next) {
    const open = new Map([...old.querySelectorAll("details")].map((d) => [d.firstElementChild?.firstChild?.textContent, d.open]));
    for (const d of next.querySelectorAll("details")) d.open = open.get(d.firstElementChild?.firstChild?.textContent) ?? d.open;
    old.replaceWith(next);
}

/** Takes over all of a newer report; the time in the cycle and the place of the camera stay. */
async function swap(text) {
    const doc = new DOMParser().parseFromString(text, "text/html"), share = last > 0 ? state / last : 0;
    const same = doc.getElementById("data").textContent === byId("data").textContent && doc.getElementById("block").textContent === byId("block").textContent;
    document.title = doc.title;
    for (const what of [".top > div", "nav ul", "#drawing", "#key"]) {
        const old = document.querySelector(what), next = doc.querySelector(what);
        next.hidden = old.hidden;
        old.replaceWith(next);
    }
    const main = byId("content"), before = [...main.querySelectorAll(":scope > section:not(#motion)")];
    const name = (s) => s.getAttribute("aria-labelledby");
    let after = [...main.children].filter((e) => !before.includes(e)).at(-1);
    for (const next of [...doc.querySelectorAll("#content > section:not(#motion)")]) {
        const old = before.find((s) => name(s) === name(next));
        const kept = old && old.outerHTML === next.outerHTML ? old : next;
        if (kept === next && old) replace(old, next);
        if (kept.previousElementSibling !== after) after.after(kept);
        after = kept;
    }
    const stay = new Set([...doc.querySelectorAll("#content > section")].map(name));
    before.filter((s) => s.isConnected && !stay.has(name(s))).forEach((s) => s.remove());
    if (!same) {
        byId("data").textContent = doc.getElementById("data").textContent;
        byId("block").textContent = doc.getElementById("block").textContent;
    }
    byId("scale").lastElementChild.textContent = doc.getElementById("scale").lastElementChild.textContent;
    adopt();
    slider.max = String(Math.max(last, 0));
    byId("run").hidden = last < 1;
    wirePlots();
    if (!same) await show3d();
    go(share * last);
}

async function main() {
    // Read out when asked for, not at every step of the motion.
    document.querySelectorAll("output").forEach((o) => o.setAttribute("aria-live", "off"));
    addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
    byId("run").hidden = last < 1;
    byId("key").hidden = false;
    wirePlots();
    await show3d();
    go(0);
    document.documentElement.dataset.ready = "yes";
}
globalThis.flexura = { swap, ready: main(), look: () => ({ state, last, camera: viewer?.camera.position.toArray() ?? null }) };
})();
