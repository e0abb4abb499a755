// Play: sliders send the state, newest first; the answer is drawn at once, the slower pictures when it rests.
import { Controls } from "./controls.js";
import { Conversation } from "./socket.js";
import { Stage } from "./stage.js";
import { axes, line, prefixed, range, shortly, tick } from "./canvas.js";

const $ = (id) => document.getElementById(id);
const say = (words, wrong) => { if (!$("play").hidden) lab.say(words, wrong); }; // another tab says its own
const PANELS = [["x", "displacement"], ["x", "angle", true], ["v", "velocity"], ["v", "angular velocity", true],
  ["a", "acceleration"], ["friction", "friction"]];
const INKS = { x: "blue", v: "green", a: "purple", friction: "orange" };
const MORE_INKS = ["blue", "orange", "green", "purple", "sky", "ink"];
const HEIGHT = 96, REST = 90, IDLE = 350; // pixels of a trace; ms without a change until numbers, and until the rest
const KINDS = ["slip", "microstick", "stick", "flight"];
const SLOWER = [2, 5, 10, 100, 1000].map((times) => [`${times} × slower`, 1 / times]);
const PACES = [["one cycle in 2 s", null], ["true time", 1], ...SLOWER, ["10 × faster", 10]];
const SHORT = 8; // cycles of a pictured scenario, so that their shape is seen
const FONT = "12px system-ui, sans-serif";

const newest = {}; // number of the last request of each kind
let lab, state, controls, stage, conversation, run, charts = [], plans = {}, number = 0, flying = null, next = null;
let begun = "", ghost = null, rested = null, kept = null;
let changedLast = null, patience = 0, resting = 0, idling = 0, silenced = null; // ends the sound that is heard

export async function start(given) {
  lab = given;
  lab.openInPlay = (opened) => { own(); use(opened); lab.show("play"); };
  stage = new Stage($("stage"), moved);
  const lost = () => say("The lab does not answer; is 'stickslip lab' still running?", true);
  conversation = new Conversation("play", heard, lost);
  conversation.again = () => { if (state) ask(performance.now(), true); };
  for (const [words, pace] of PACES) $("pace").add(new Option(words, pace ?? ""));
  buttons();
  const shared = fromLink();
  const slow = setTimeout(() => say("The lab is starting …"), 700);
  const catalog = await lab.ask("catalog").catch((error) => say(error.message, true));
  clearTimeout(slow);
  if (!catalog) return;
  lab.catalog = catalog;
  whole(catalog);
  controls = new Controls($("parts"), catalog, (path, since, afresh = false) => {
    changedLast = path;
    own();
    ask(since, afresh);
  });
  presets(shared ? {} : catalog.first);
  use(shared ?? catalog.first.state);
  // The event's own address: by now the address bar may hold again what rested meanwhile.
  addEventListener("hashchange", ({ newURL }) => {
    const opened = fromLink(new URL(newURL).hash);
    if (opened) { own(); use(opened); }
  });
  lab.onTheme(() => { if (run) { build(); drawTraces(); drawViews(); stage.show(run, lab.colours()); } });
}

// What the catalog leaves out of a parameter, because it is as most are.
function whole({ laws, drives, system, contact }) {
  const plain = { unit: "", words: "", default: null, optional: false, choices: [], part: false };
  for (const part of [...Object.values(laws), ...Object.values(drives), system, contact]) {
    part.parameters = part.parameters.map((each) => ({ ...plain, ...each }));
  }
}

function use(given) {
  state = given;
  state.run ??= { cycles: 40 };
  changedLast = null;
  controls.show(state);
  tries();
  ask(performance.now(), true);
}

// What is changed is no scenario any more; choosing it again goes back.
function own() {
  if (!begun) return;
  $("about").textContent = `Changed from ${begun}; choose it again to go back.`;
  if (state) state.about = `changed from ${begun}`;
  begun = $("preset").value = "";
  pressed();
}

// Six to begin with, each by its friction loop; the others by words.
const PICTURED = [
  ["THESIS rigid 2.5Hz fk=1.1", "Stick-slip", "M8 8V26H52V8Z"],
  ["THESIS rigid 8.7Hz", "Slides through", "M8 8C8 4 52 4 52 8V26C52 30 8 30 8 26Z"],
  ["THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)", "Contact that gives", "M8 26L16 8H52L44 26Z"],
  ["BS-1", "Pulled by a belt", "M8 28L22 6L26 24L40 6L44 24L54 10"],
  ["FD-4", "Let go", "M6 6C12 40 18 4 24 14C28 26 32 14 36 17H54"],
  ["SQUEAK wet 6.13 N", "Squeals", "M6 17C8 2 10 32 12 17S16 2 18 17S22 32 24 17S28 2 30 17S34 32 36 17S40 2 42 17S46 32 48 17"],
];
function presets({ name: chosen = "", about = "A system of your own, or from a link or file." }) {
  let listed; // the names, promised once somebody searches
  const list = async () => {
    const words = new Map();
    const { presets } = await lab.ask("scenarios").catch(failed) ?? { presets: [] };
    for (const { about, names } of presets) for (const name of names) words.set(name, about);
    for (const [name, about] of words) $("presets").append(new Option("", `${plainly(name, about)} (${name})`));
    return words;
  };
  $("preset").addEventListener("focus", () => { listed ??= list(); });
  for (const [name, title, path] of PICTURED) {
    const button = $("pictured").appendChild(document.createElement("button"));
    button.type = "button";
    button.dataset.name = name;
    button.append(picture(path), title);
    button.addEventListener("click", () => begin(name, true));
  }
  const begin = async (name, short = false) => {
    const { state } = await lab.ask(`scenarios/${encodeURIComponent(name)}`).catch(failed) ?? {};
    if (!state) return;
    if (short && state.run?.cycles > SHORT) state.run.cycles = SHORT;
    begun = name;
    $("about").textContent = state.about;
    pressed();
    use(state);
  };
  begun = chosen;
  $("about").textContent = about;
  pressed();
  $("preset").addEventListener("change", async () => {
    const name = /\((.*)\)$/.exec($("preset").value)?.[1] ?? $("preset").value;
    if ((await (listed ??= list())).has(name)) begin(name);
    else if (name) say(`No scenario is called “${name}”; choose one of the list.`, true);
  });
}
function picture(path) {
  const [svg, line] = ["svg", "path"].map((name) => document.createElementNS("http" + "://www.w3.org/2000/svg", name));
  svg.setAttribute("viewBox", "0 0 60 34");
  svg.setAttribute("aria-hidden", "true");
  line.setAttribute("d", path);
  svg.append(line);
  return svg;
}
function pressed() {
  for (const button of $("pictured").children) button.setAttribute("aria-pressed", button.dataset.name === begun);
}

// Three changes that show what matters, of a system that has what they change.
const TRIES = [
  ["Less friction: does it still stick?", (now) => { now.law.kinetic *= 0.3; if (now.law.static) now.law.static *= 0.3; }],
  ["Harder to start than to keep moving", (now) => { now.law.static = +(1.4 * now.law.kinetic).toPrecision(3); }],
  ["Nearer to resonance", (now) => {
    now.drive.frequency = +(0.8 * Math.sqrt(now.system.stiffness / now.system.mass) / (2 * Math.PI)).toPrecision(3);
  }],
];
function tries() {
  const able = typeof state.law?.kinetic === "number" && "frequency" in (state.drive ?? {}) && state.system.mass > 0;
  $("tries").replaceChildren(...(able ? TRIES : []).map(([words, change]) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: words });
    button.addEventListener("click", () => {
      const now = structuredClone(state);
      change(now);
      own();
      use(now);
    });
    return button;
  }));
  if (able) $("tries").prepend("Try: ");
}

const failed = (error) => say(error.message, true);

// A scenario's code in words: what its letters stand for, and what its group is about where it has none.
const SIGNS = [
  [/\bfk=([\d.]+)/, "friction $1 N"], [/\bKy=(\d+)000\b/, "contact $1 kN/m"], [/\bc=0\b/, "no contact damping"],
  [/\bz(?:=|(?=\.))([\d.]+)(\(.*?\))?/, "damping ratio $1$2"], [/([\d.]+) ?Hz\b/, "$1 Hz"],
  [/\bb=([\d.]+)/, "frequency ratio $1"], [/\br=([\d.]+)/, "friction ratio $1"], [/\bV=([\d.]+)/, "belt at $1"],
  [/\bv=([\d.]+)/, "speed $1"], [/\bX=(\d+)um/, "amplitude $1 µm"], [/\bXm=(\d+)/, "mass ratio $1"],
  [/\brate=(\d+)/, "$1 N/s"], [/\bt=(\d+)ms/, "after $1 ms"], [/\bd=(\d)/, "exponent $1"],
  [/\beta=([\d.,]+)/, "damping $1"],
];
function plainly(name, about) {
  const words = SIGNS.filter(([sign]) => sign.test(name)).map(([sign, to]) => sign.exec(name)[0].replace(sign, to));
  const kind = /\b(rigid|compliant|state variable|low|high|below|aging|slip|as printed|rate.*gamma|wet|dry)\b.*?/g;
  const told = [...(name.match(kind) ?? []), ...words];
  return told.length ? told.join(", ") : about.split(/[:(;]/)[0].trim();
}

// One run is under way at a time, and the newest state waits; one that takes long is overtaken.
function ask(since, afresh = false) {
  if (silenced) silence();
  next = { since, afresh: afresh || next?.afresh, state: structuredClone(state) };
  clearTimeout(resting);
  clearTimeout(idling);
  if (flying === null || afresh || performance.now() - flying.sent > 100) send();
}
function send() {
  flying = { ...next, id: ++number, sent: performance.now() };
  next = null;
  Object.assign(newest, { run: flying.id, tell: null, wavelet: null });
  conversation.send({ id: flying.id, want: "run", state: flying.state, afresh: flying.afresh });
  clearTimeout(patience);
  patience = setTimeout(() => waiting("Computing … what is shown is the motion before."), 600);
}
function waiting(words) {
  if (flying === null) return;
  clearTimeout(patience);
  stale(true);
  if (!$("play").hidden) lab.busy(words, flying.sent, cancel);
}
// What is under way is given up, and what waits.
function cancel() {
  conversation.send({ id: ++number, want: "cancel" });
  clearTimeout(patience);
  Object.assign(newest, { run: null, tell: null, wavelet: null });
  flying = next = null;
  say("Cancelled: what is shown is the motion before. Change anything to compute again.");
}

function more(want) {
  newest[want] = ++number;
  conversation.send({ id: number, want, state });
}

function heard(answer) {
  if (answer.id !== null && answer.id !== newest[answer.want]) return; // no one waits for it any more
  if (answer.kind === "compiling") { if (answer.want === "run") waiting(lab.COMPILES); }
  else if (answer.want === "run" || answer.kind === "error") arrived(answer);
  else if (answer.kind === "tell") told(answer);
  else if (answer.kind === "wavelet") { plans.map = answer; drawWavelet(); }
  else if (answer.kind === "sound") sounded(answer);
}

function arrived(answer) {
  if (answer.want === "run") clearTimeout(patience);
  if (answer.kind === "error") {
    controls.fault(changedLast, answer.error);
    if (answer.want === "run") stale(true);
    say(changedLast ? "" : answer.error, true);
  } else if (answer.kind === "run") {
    controls.fault(null);
    say("");
    stale(false);
    shown(answer, flying.since);
  }
  if (answer.want !== "run") return;
  flying = null;
  if (next) { send(); return; }
  resting = setTimeout(() => more("tell"), REST);
  idling = setTimeout(() => {
    if (answer.kind === "run") more("wavelet");
    history.replaceState(null, "", link());
  }, IDLE);
}

// The traces first; the other pictures when those are seen.
function shown(answer, since) {
  $("told").classList.add("stale");
  ghost = kept?.run ?? rested;
  run = answer;
  run.kinds = kinds(run.arrays);
  keys();
  drawTraces();
  queueMicrotask(() => {
    const detail = { id: answer.id, took: performance.now() - since };
    document.dispatchEvent(new CustomEvent("traces-drawn", { detail }));
    requestAnimationFrame(() => setTimeout(() => {
      if (run !== answer) return;
      drawViews();
      stage.show(run, lab.colours());
      pace();
    }));
  });
}

// The legend names what occurs.
function keys() {
  const seen = new Set(Array.from(run.arrays.kinds, (kind) => KINDS[kind] ?? "slip"));
  for (const kind of KINDS) $("legend").querySelector(`.${kind}`).hidden = !seen.has(kind);
  $("legend").querySelector(".micro").hidden = !run.arrays.microslips.length;
}

// What the contact does at each instant.
function kinds({ time, begins, ends, kinds: found }) {
  const held = new Uint8Array(time.length);
  let piece = 0;
  for (let k = 0; k < time.length; k++) {
    while (piece < begins.length - 1 && time[k] >= ends[piece]) piece++;
    held[k] = found[piece] ?? 0;
  }
  return held;
}

/* ---------- traces ---------- */
const shape = () => run.series.map((each) => each.name + each.unit).join();

const tall = () => (innerWidth < 960 ? 72 : HEIGHT);

function build() {
  for (const chart of charts) chart.destroy();
  $("traces").replaceChildren();
  charts = [];
  for (const [group, words, turns = false] of PANELS) {
    const lines = run.series.filter((each) => each.group === group && each.unit.startsWith("rad") === turns);
    if (lines.length) charts.push(panel(group, words, inked(lines, group)));
  }
  Object.assign(charts, { shape: shape(), tall: tall() });
}

// The lines of a panel with their colours: of several each has its own, and the spring's end is faint.
function inked(lines, group) {
  const palette = lab.colours(), several = lines.filter((each) => each.name !== "z").length > 1;
  return lines.map((each, j) => {
    const base = each.name === "z", ink = base ? palette.faint : palette[several ? MORE_INKS[j % 6] : INKS[group]];
    return { ...each, ink, key: base ? " ┄ spring's end" : several ? ` — ${each.name}` : "" };
  });
}

function panel(group, words, lines) {
  const box = $("traces").appendChild(document.createElement("div"));
  box.className = "trace";
  box.setAttribute("role", "img");
  box.setAttribute("aria-label", `${words} over time`);
  const title = caption(box, lines), last = group === "friction";
  const chart = new uPlot({
    width: $("traces").clientWidth - 26, height: tall() + (last ? 42 : 0), padding: [6, 8, last ? 0 : 4, 0],
    legend: { show: false }, scales: { x: { time: false } },
    cursor: { sync: { key: "play" }, points: { show: false }, drag: { x: true, y: false } },
    axes: scales(last),
    series: [{}, ...lines.map(({ ink, name }) =>
      ({ stroke: ink, width: 1.4, dash: name === "z" ? [5, 4] : undefined, points: { show: false } }))],
    hooks: {
      drawClear: [(plot) => { shade(plot, group); haunt(plot, lines); }],
      setCursor: [(plot) => values(plot)],
      setScale: [(plot, key) => { if (key === "x") zoom(plot); }],
    },
  }, null, box);
  Object.assign(chart, { lines, words, title, group, unit: lines[0].unit, factor: 1 });
  chart.reading = title.parentElement.appendChild(document.createElement("span"));
  chart.reading.className = "reading";
  chart.now = chart.over.appendChild(document.createElement("div"));
  chart.now.className = "now";
  return chart;
}
// The panel's title, to be told its unit, and the keys to its lines.
function caption(box, lines) {
  const above = box.appendChild(document.createElement("div")), palette = lab.colours();
  above.className = "caption";
  const title = above.appendChild(document.createElement("span"));
  for (const { key, ink, name } of lines.filter((each) => each.key)) {
    const told = above.appendChild(document.createElement("span"));
    told.textContent = key;
    told.style.color = name === "z" ? palette.soft : ink;
  }
  return title;
}
function scales(last) {
  const { soft, line } = lab.colours();
  const thin = { stroke: line, width: 1 };
  const axis = { stroke: soft, font: FONT, grid: thin, ticks: { ...thin, size: 4 } };
  return [
    { ...axis, size: last ? 24 : 0, values: (plot, splits) => (last ? splits.map(tick) : []),
      label: last ? "time [s]" : undefined, labelSize: 18, labelFont: FONT, gap: 2 },
    { ...axis, size: 60, values: (plot, splits) => splits.map((value) => tick(value * plot.factor)), space: 24 },
  ];
}

function drawTraces() {
  if (charts.shape !== shape()) build();
  const { arrays, first, last } = run, { min, max } = charts[0].scales.x;
  const kept = charts.zoomed && min >= first && max <= last;
  for (const chart of charts) {
    const rows = chart.lines.map((each) => arrays[each.name]);
    let most = 0;
    for (const row of rows) for (let k = 0; k < row.length; k++) if (Math.abs(row[k]) > most) most = Math.abs(row[k]);
    const [factor, unit] = prefixed(most, chart.unit);
    chart.factor = factor;
    chart.title.textContent = `${chart.words}${unit ? ` [${unit}]` : ""}`;
    charts.quiet = true;
    chart.setData([arrays.time, ...rows], !kept);
    if (kept) chart.redraw();
  }
  queueMicrotask(() => { charts.quiet = false; });
  if (!kept) charts.zoomed = false;
}

function zoom(plot) {
  if (charts.quiet || !run) return;
  const { min, max } = plot.scales.x;
  charts.zoomed = max - min < 0.999 * (run.last - run.first);
  charts.quiet = true;
  for (const chart of charts) {
    const { x } = chart.scales;
    if (chart !== plot && (x.min !== min || x.max !== max)) chart.setScale("x", { min, max });
  }
  queueMicrotask(() => { charts.quiet = false; });
}

function shade(plot, group) {
  if (!run) return;
  const { begins, ends, kinds: found, microslips } = run.arrays, { left, top, width, height } = plot.bbox;
  const palette = lab.colours(), inks = [null, palette.microstick, palette.stick, palette.flight], pen = plot.ctx;
  pen.save();
  pen.beginPath();
  pen.rect(left, top, width, height);
  pen.clip();
  for (let k = 0; k < begins.length; k++) {
    if (!inks[found[k]]) continue;
    const from = plot.valToPos(begins[k], "x", true), to = plot.valToPos(ends[k], "x", true);
    if (to < left || from > left + width) continue;
    pen.fillStyle = inks[found[k]];
    pen.fillRect(from, top, Math.max(1, to - from), height);
  }
  if (group === "friction") {
    pen.fillStyle = palette.purple;
    let before = -9;
    const size = 4 * (devicePixelRatio || 1);
    for (const time of microslips) {
      const x = plot.valToPos(time, "x", true);
      if (x - before < size) continue;
      before = x;
      pen.beginPath();
      pen.moveTo(x - size, top); pen.lineTo(x + size, top); pen.lineTo(x, top + 1.6 * size);
      pen.fill();
    }
  }
  pen.restore();
}

// The motion before, or A: faint, behind what plays; nothing where it has not the same lines.
function haunt(plot, lines) {
  if (!ghost || ghost === run) return;
  const { time } = ghost.arrays, pen = plot.ctx, { left, top, width, height } = plot.bbox;
  const { min, max } = plot.scales.x, step = Math.max(1, Math.floor(time.length / 4000));
  pen.save();
  pen.beginPath(); pen.rect(left, top, width, height); pen.clip();
  pen.strokeStyle = lab.colours().faint;
  pen.lineWidth = devicePixelRatio || 1;
  for (const { name } of lines) {
    const row = ghost.arrays[name];
    if (!row || name === "z") continue;
    pen.beginPath();
    for (let k = 0; k < time.length; k += step) {
      if (time[k] < min || time[k] > max) continue;
      pen.lineTo(plot.valToPos(time[k], "x", true), plot.valToPos(row[k], "y", true));
    }
    pen.stroke();
  }
  pen.restore();
}

// What stands under the pointer, beside the title of each trace.
function values(plot) {
  const { idx } = plot.cursor, chart = plot;
  if (!chart.reading) return;
  if (idx == null || !run) { chart.reading.textContent = ""; return; }
  const [, unit] = prefixed(1 / chart.factor, chart.unit);
  const told = chart.lines.map(({ name }) => shortly(run.arrays[name][idx] * chart.factor));
  chart.reading.textContent = ` ${told.join(", ")}${unit ? ` ${unit}` : ""} at ${shortly(run.arrays.time[idx])} s`;
}

/* ---------- loops, portrait, spectrum, wavelet map ---------- */
const unitOf = (group) => run.series.find((each) => each.group === group)?.unit ?? "";
const one = (name) => (run.arrays[name] ? name : `${name}1`);

function drawViews() {
  const palette = lab.colours(), friction = one("friction");
  plans.loopX = portrait("loop-x", ["way", "m", "displacement"], [friction, "N", "friction"], palette);
  plans.loopV = portrait("loop-v", ["slip", unitOf("slip"), "sliding velocity"], [friction, "N", "friction"], palette);
  const [x, v] = [one("x"), one("v")];
  plans.phase = portrait("phase", [x, unitOf("x"), "displacement"], [v, unitOf("v"), "velocity"], palette);
  drawSpectrum();
}

function portrait(id, [x, xUnit, xWords], [y, yUnit, yWords], palette) {
  const { time } = run.arrays, xs = run.arrays[x], ys = run.arrays[y];
  const [xLow, xHigh] = range(xs), [yLow, yHigh] = range(ys);
  const across = { low: xLow, high: xHigh, label: xWords, unit: xUnit };
  const plan = axes($(id), across, { low: yLow, high: yHigh, label: yWords, unit: yUnit }, palette);
  const cycle = run.last - run.cycle * (1 + 1e-9);
  const split = run.status === "at rest" ? 0 : Math.max(0, time.findIndex((each) => each >= cycle));
  if (split) line(plan, xs, ys, { to: split + 1, colour: palette.faint, width: 0.7 });
  const inks = [palette.orange, palette.sky, palette.blue, palette.purple];
  for (let from = split; from < xs.length - 1;) {
    let to = from + 1;
    while (to < xs.length && run.kinds[to] === run.kinds[from]) to++;
    const kind = run.kinds[from];
    line(plan, xs, ys, { from, to: Math.min(to + 1, xs.length), colour: inks[kind], width: kind ? 2.6 : 1.8 });
    from = to;
  }
  return { ...plan, xs, ys, canvas: $(id), dot: dotOf($(id)) };
}
function dotOf(canvas) {
  let dot = canvas.parentElement.querySelector(".dot");
  if (!dot) { dot = canvas.parentElement.appendChild(document.createElement("div")); dot.className = "dot"; }
  return dot;
}

// The slower pictures, whose part is loaded after the traces are drawn.
const pictures = (then) => import("./pictures.js").then(then).catch(failed);
const drawSpectrum = () => { const shown = run; pictures((part) => { if (run === shown) part.spectrum($("spectrum"), run, lab.colours()); }); };
const drawWavelet = () => { if (plans.map) pictures((part) => part.wavelet($("wavelet"), plans.map, lab.colours())); };

// What is shown is not what is asked for.
function stale(is) {
  for (const card of document.querySelectorAll("#shown .card")) card.classList.toggle("stale", is);
}

function told({ sentences, rows, state: found }) {
  rested = run;
  controls.follow(found);
  $("told").classList.remove("stale");
  $("happened").textContent = sentences.slice(0, 2).join(" ");
  const body = $("rows");
  const make = (tag, textContent) => Object.assign(document.createElement(tag), { textContent });
  $("sentences").replaceChildren(...sentences.map((each) => make("p", each)));
  body.replaceChildren(...rows.map((cells) => {
    const row = document.createElement("tr");
    row.append(...cells.map((each) => make("td", each)));
    return row;
  }));
}

/* ---------- motion ---------- */
function moved(time, index) {
  for (const chart of charts) {
    const { min, max } = chart.scales.x;
    chart.now.hidden = !(time >= min && time <= max);
    chart.now.style.transform = `translateX(${chart.valToPos(time, "x")}px)`;
  }
  for (const plan of [plans.loopX, plans.loopV, plans.phase]) {
    if (!plan || index >= plan.xs.length) continue;
    const x = plan.canvas.offsetLeft + plan.x(plan.xs[index]), y = plan.canvas.offsetTop + plan.y(plan.ys[index]);
    plan.dot.style.transform = `translate(${x}px, ${y}px)`;
  }
}
function pace() {
  const chosen = $("pace").value;
  stage.pace = chosen ? Number(chosen) : run.cycle / 2;
  const slower = 1 / stage.pace, times = shortly(+Math.max(slower, 1 / slower).toPrecision(2));
  $("stage-note").textContent =
    Math.abs(slower - 1) < 0.04 ? "in true time" : `${times} times ${slower > 1 ? "slower" : "faster"} than it is`;
}

/* ---------- buttons ---------- */
function buttons() {
  motionButtons();
  textButtons();
  $("keep").addEventListener("click", keep);
  $("swap").addEventListener("click", swap);
  new ResizeObserver(resized).observe($("traces"));
}
function motionButtons() {
  const still = () => {
    $("pause").textContent = stage.playing ? "Pause" : "Run";
    $("pause").setAttribute("aria-pressed", !stage.playing);
  };
  still();
  $("pause").addEventListener("click", () => { stage.playing = !stage.playing; still(); });
  $("pace").addEventListener("change", pace);
  $("hear").addEventListener("click", () => { if (silenced) silence(); else more("sound"); });
}
// What leaves the page as text or a file, and comes back from one: its part is loaded when it is first asked for.
function textButtons() {
  const files = (then) => () => import("./files.js").then(then).catch(failed);
  const within = {
    lab, link, restored,
    current: () => state,
    kept: () => kept?.state ?? null,
    opened: (given) => { own(); use(given); },
  };
  $("share").addEventListener("click", files((part) => part.shared(within)));
  $("python").addEventListener("click", files((part) => part.texts(within, "python", "The Python that does this", "lab.py")));
  $("toml").addEventListener("click", files((part) => part.texts(within, "toml", "The system's file", "system.toml")));
  $("session").addEventListener("click", files((part) => part.saveSession(within)));
  $("file").addEventListener("change", files((part) => part.openFile(within)));
}
function restored(a) {
  kept = a ? { state: a, run: null } : null;
  compared();
}

// A is kept and drawn behind what plays; showing it makes what plays the other.
function keep() {
  kept = { state: structuredClone(state), run };
  ghost = run;
  compared();
  for (const chart of charts) chart.redraw(false);
}
function swap() {
  const other = { state: structuredClone(state), run };
  const { state: shown } = kept;
  kept = other;
  ghost = run;
  own();
  use(structuredClone(shown));
}
function compared() {
  $("swap").hidden = !kept;
  $("keep").textContent = kept ? "Keep this as A instead" : "Keep as A";
}

function resized() {
  if (!run || !$("traces").clientWidth) return;
  if (charts.tall !== tall()) { build(); drawTraces(); }
  for (const chart of charts) chart.setSize({ width: $("traces").clientWidth - 26, height: chart.height });
  drawViews();
  drawWavelet();
  if (stage.run) stage.draw();
}

function link() {
  const text = btoa(String.fromCharCode(...new TextEncoder().encode(JSON.stringify(state))));
  return `#${text.replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
}
function fromLink(hash = location.hash) {
  if (hash.length < 2) return null;
  try {
    const text = atob(hash.slice(1).replaceAll("-", "+").replaceAll("_", "/"));
    return JSON.parse(new TextDecoder().decode(Uint8Array.from(text, (sign) => sign.charCodeAt(0))));
  } catch {
    say("The link holds no system; the page begins with its first one.", true);
    return null;
  }
}

/* ---------- sound ---------- */
async function sounded({ fs, words, arrays }) {
  silence();
  const { played } = await import("./sound.js");
  silenced = played(arrays.sound, fs);
  $("hear").textContent = "Silence";
  $("hear").setAttribute("aria-pressed", true);
  say(`You hear ${words}.`);
}
function silence() {
  silenced?.();
  silenced = null;
  $("hear").textContent = "Hear it";
  $("hear").setAttribute("aria-pressed", false);
}

export const current = () => structuredClone(state);
