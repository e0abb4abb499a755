// Map: which motion is where, computed while one looks; a click plays the point.
import { Conversation } from "./socket.js";
import { at, put, readable, written } from "./controls.js";
import { axes, line, shortly } from "./canvas.js";
import { cividis } from "./pictures.js";
import { current } from "./play.js";

const MEASURES = {
  stops: "stops per cycle", micro_slips: "micro-slips per cycle", period: "cycles until it repeats (0: never)",
  stick_share: "share of time that it holds", amplitude: "amplitude [m]",
};
const SIDES = { x: ["Across", "across"], y: ["Upwards", "upwards"] };
const COUNT = { x: 28, y: 20 };
const NONE = -1, REST = -2; // as the lab sends them
const WORDS = { [NONE]: "no such system", [REST]: "comes to rest" };
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

let begun = 0, line1931 = [];
let lab, state, canvas, conversation, number = 0, parts = [], wanted = null, plan = null, place = [0.5, 0.5];
const $ = (id) => document.getElementById(id);

export function start(root, given) {
  lab = given;
  root.innerHTML = form();
  canvas = $("map-canvas");
  conversation = new Conversation("map", heard);
  listen();
  lab.onTheme(redraw);
  new ResizeObserver(redraw).observe(canvas);
  lab.onShow.map = offer;
  offer();
  lab.ask("boundary").then(({ boundary }) => { line1931 = boundary; redraw(); }, () => {}); // a map is whole without it
}

function form() {
  const side = ([name, [legend, words]]) => `<fieldset><legend>${legend}</legend>
    <div class="field"><label class="hidden" for="map-${name}">Parameter ${words}</label>
      <select id="map-${name}"></select></div>
    <div class="knob"><label for="map-${name}-from">from</label><input type="text" id="map-${name}-from">
      <label for="map-${name}-to">to</label><input type="text" id="map-${name}-to"></div></fieldset>`;
  const measures = Object.entries(MEASURES).map(([name, words]) => `<option value="${name}">${words}</option>`);
  return `<div class="beside">
    <form class="panel" id="map-form" aria-label="The map" autocomplete="off">
      <p class="note" id="map-of"></p>
      ${Object.entries(SIDES).map(side).join("")}
      <fieldset><legend>Colour</legend><div class="field"><label class="hidden" for="map-measure">What is shown</label>
        <select id="map-measure">${measures.join("")}</select></div></fieldset>
      <div class="row"><button class="main" type="submit">Draw the map</button>
        <button type="button" id="map-cancel" disabled>Cancel</button></div>
      <p><label class="hidden" for="map-done">How far it is</label>
        <progress id="map-done" max="1" value="0"></progress></p>
      <p class="note" id="map-left"></p>
      <p class="fault note" id="map-fault"></p>
    </form>
    <div class="card"><h2 id="map-title">Stops per cycle</h2>
      <canvas id="map-canvas" role="application" tabindex="0"
        aria-label="Regime map. Arrow keys move, Enter plays the point."></canvas>
      <p class="legend" id="map-legend"></p>
      <p class="note" id="map-point" aria-live="polite">Click a point of the map to play it.
        With the keyboard: arrows, then Enter.</p></div>
  </div>`;
}

function listen() {
  $("map-form").addEventListener("submit", (event) => { event.preventDefault(); draw(); });
  $("map-cancel").addEventListener("click", cancel);
  for (const side of Object.keys(SIDES)) $(`map-${side}`).addEventListener("change", () => limits(side));
  canvas.addEventListener("pointermove", (event) => { place = placed(event); point(); });
  canvas.addEventListener("click", (event) => { place = placed(event); play(); });
  canvas.addEventListener("keydown", (event) => {
    if (event.key === "Enter") play();
    const step = ARROWS[event.key];
    if (!step) return;
    event.preventDefault();
    place = place.map((each, j) => within(each + step[j] / (event.shiftKey ? 10 : 100)));
    point();
  });
}
const within = (share) => Math.min(1, Math.max(0, share));
const cancel = () => conversation.send({ id: ++number, want: "cancel" });

// The parameters of what is played now.
function offer() {
  const now = current();
  if (state && JSON.stringify(state) === JSON.stringify(now)) return;
  state = now;
  const found = numbers(state, []);
  for (const [side, first] of [["x", "drive.frequency"], ["y", "law.kinetic"]]) {
    const choice = $(`map-${side}`), kept = choice.value || first, dotted = found.map((path) => path.join("."));
    choice.replaceChildren(...found.map((path, j) => new Option(called(path), dotted[j], false, dotted[j] === kept)));
    if (!dotted.includes(kept)) choice.selectedIndex = side === "x" ? 0 : Math.min(1, found.length - 1);
    limits(side);
  }
  $("map-of").textContent =
    `Of the system that plays: ${state.law?.name ?? "a structure"}, ${state.drive?.name ?? "Release"}.`;
  draw();
}

// Where numbers stand that a map can span, but for those of the start and the run.
function numbers(part, path) {
  return Object.entries(part).flatMap(([name, value]) => {
    const at = [...path, name];
    if (["start", "run"].includes(at[0])) return [];
    if (typeof value === "number") return value === 0 ? [] : [at];
    const list = Array.isArray(value) && typeof value[0] !== "object";
    return value && typeof value === "object" && !list ? numbers(value, at) : [];
  });
}
const called = (path) =>
  path.join(" ").replace(/^system /, "").replace("contacts ", "contact ").replaceAll("_", " ");
// As the library names it: the system's own parameters without their table, contacts counted from one.
const named = (dotted) => dotted.replace(/^system\./, "").replace(/^contacts\.(\d+)/, (_, j) => `contacts.${+j + 1}`);
// As the library declares it, of the law or drive, the system, or the contact that the parameter belongs to.
function unitOf(dotted) {
  const path = dotted.split("."), name = path.pop(), kind = path.at(-1), { catalog } = lab;
  const declared = { law: catalog.laws, drive: catalog.drives }[kind]?.[at(state, path)?.name]
    ?? (kind === "system" ? catalog.system : catalog.contact);
  return declared.parameters.find((each) => each.name === name)?.unit ?? "";
}

// A ratio where the field speaks of one: frequency over the natural, friction over the drive's force.
function ratio(dotted) {
  const { system, drive = {}, law = {} } = state;
  if (typeof system.mass !== "number" || !(system.stiffness > 0)) return null;
  const natural = Math.sqrt(system.stiffness / system.mass) / (2 * Math.PI);
  if (dotted === "drive.frequency") return [natural, "frequency ratio, drive over natural"];
  const force = { HarmonicBase: system.stiffness * drive.amplitude, HarmonicForce: drive.amplitude }[drive.name];
  const rigid = dotted === "law.kinetic" && force > 0 && !("static" in law);
  return rigid ? [force, "friction ratio, over the drive's force"] : null;
}

function limits(side) {
  const dotted = $(`map-${side}`).value, value = at(state, dotted.split(".")), found = ratio(dotted);
  const [low, high] = found
    ? (dotted === "drive.frequency" ? [0.1, 2] : [0.02, 1.1]).map((share) => share * found[0])
    : [value / 5, value * 2].sort((a, b) => a - b);
  for (const [end, number] of [["from", low], ["to", high]]) {
    $(`map-${side}-${end}`).value = readable(+number.toPrecision(3), unitOf(dotted));
  }
}

function axisOf(side) {
  const dotted = $(`map-${side}`).value, end = (which) => written($(`map-${side}-${which}`).value, unitOf(dotted));
  return { name: named(dotted), dotted, from: end("from"), to: end("to"), count: COUNT[side] };
}

function draw() {
  let ends;
  try { ends = [axisOf("x"), axisOf("y")]; } catch (error) { $("map-fault").textContent = error.message; return; }
  if (ends.some(({ from, to }) => !(typeof from === "number" && to > from))) {
    $("map-fault").textContent = "An axis goes from a number to a larger one; write both, with their unit or in SI.";
    return;
  }
  wanted = { id: ++number, want: "map", state, measure: $("map-measure").value, x: ends[0], y: ends[1] };
  parts = [];
  $("map-title").textContent = MEASURES[wanted.measure].replace(/^./, (letter) => letter.toUpperCase());
  $("map-fault").textContent = "";
  $("map-cancel").disabled = false;
  begun = performance.now();
  conversation.send(wanted);
  redraw();
  lab.busy("Drawing the map …", begun);
}

function heard(answer) {
  if (answer.kind === "cancelled") { ended("Cancelled; what is drawn stays."); return; }
  if (answer.id !== wanted?.id) return;
  if (answer.kind === "compiling") lab.busy(lab.COMPILES, begun);
  else if (answer.kind === "error") { $("map-fault").textContent = answer.error; ended(""); }
  else if (answer.kind === "done") ended("The map is done.");
  else arrived(answer);
}
function arrived(part) {
  if (!parts.length) lab.busy("Drawing the map …", begun);
  parts.push(part);
  const { level, done, of } = part, past = (performance.now() - begun) / 1000;
  const points = parts.reduce((sum, each) => sum + each.arrays.values.length, 0);
  const seconds = Math.max(1, Math.round((past * (of - done)) / done));
  const left = level === "coarse" ? "then its borders" : `about ${seconds} s left`;
  if (done % 5 === 0) $("map-left").textContent = `${points} motions so far, ${left}.`;
  $("map-done").value = level === "coarse" ? (0.4 * done) / of : 0.4 + (0.6 * done) / of;
  if (plan && level === "fine") paint(part); else redraw();
}
function ended(words) {
  $("map-cancel").disabled = true;
  $("map-done").value = words.startsWith("The map") ? 1 : 0;
  $("map-left").textContent = "";
  if (plan) boundary();
  lab.say(words);
  legend();
}

/* ---------- drawing ---------- */
const counted = () => !["stick_share", "amplitude"].includes(wanted.measure);
function most() {
  let high = 0;
  for (const part of parts) for (const value of part.arrays.values) if (value > high) high = value;
  return high || 1;
}
// By how the stops are counted together: up to which number, what it is called, and its share of the colours.
const LEVELS = [
  [0, "slides without a stop", 0.04], [1, "1 stop", 0.3], [2, "2 stops", 0.48], [4, "3 or 4", 0.62],
  [6, "5 or 6", 0.74], [8, "7 or 8", 0.84], [12, "9 to 12", 0.92], [Infinity, "more than 12", 1],
];
const levelOf = (value) => wanted.measure === "stops"
  ? LEVELS.findIndex(([last]) => Math.round(value) <= last)
  : Math.min(LEVELS.length - 1, Math.round(value));
function colour(value, high, palette) {
  if (value === NONE || Number.isNaN(value)) return palette.card;
  if (value === REST) return palette.faint;
  return `rgb(${cividis(counted() ? LEVELS[levelOf(value)][2] : value / high)})`;
}

function redraw() {
  if (!wanted || !canvas?.clientWidth) return;
  const side = ({ dotted, from, to }) => {
    const found = ratio(dotted), ends = { low: from, high: to };
    return found
      ? { ...ends, label: found[1], factor: 1 / found[0], unit: "" }
      : { ...ends, label: called(dotted.split(".")), unit: unitOf(dotted) };
  };
  if (!(wanted.x.to > wanted.x.from && wanted.y.to > wanted.y.from)) return;
  plan = axes(canvas, side(wanted.x), side(wanted.y), lab.colours());
  for (const part of parts) paint(part);
  boundary();
  legend();
}

// Whether Den Hartog's boundary of 1931 holds for what is drawn: rigid friction alone, stops counted.
function bounded() {
  const { system, law = {}, drive = {} } = wanted.state;
  const rigid = law.name === "Coulomb" && !("static" in law) && !system.damping;
  const driven = /^Harmonic/.test(drive.name ?? "") && drive.contact !== "base";
  const ratios = wanted.x.dotted === "drive.frequency" && wanted.y.dotted === "law.kinetic";
  return rigid && driven && ratios && wanted.measure === "stops";
}
// Where sliding without a stop ends.
function boundary() {
  if (!line1931.length || !bounded()) return;
  const [natural] = ratio(wanted.x.dotted), [force] = ratio(wanted.y.dotted), { pen } = plan, ink = "#ffffff";
  const xs = line1931.map(([b]) => b * natural), ys = line1931.map(([, r]) => r * force);
  clipped(() => {
    line(plan, xs, ys, { colour: ink, width: 1.6 });
    pen.fillStyle = ink;
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.fillText("Den Hartog 1931", plan.x(1.35 * natural), plan.y(0.675 * force) + 22);
  });
}
// Draw within the axes alone.
function clipped(drawing) {
  const { pen, box } = plan;
  pen.save();
  pen.beginPath();
  pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
  pen.clip();
  drawing();
  pen.restore();
}

function paint({ arrays: { x, y, values } }) {
  const { pen } = plan, high = most(), palette = lab.colours();
  const xs = edges(x, wanted.x), ys = edges(y, wanted.y);
  clipped(() => xs.forEach(([left, right], i) => ys.forEach(([low, up], j) => {
    pen.fillStyle = colour(values[i * ys.length + j], high, palette);
    const from = plan.x(left), top = plan.y(up);
    pen.fillRect(from, top, plan.x(right) - from + 0.6, plan.y(low) - top + 0.6);
  })));
}
// From where to where each value of an axis stands: half way to its neighbours.
function edges(values, { from, to, count }) {
  const alone = (to - from) / (count - 1) / 2, last = values.length - 1;
  return Array.from(values, (value, j) => {
    const before = j ? (value - values[j - 1]) / 2 : null, after = j < last ? (values[j + 1] - value) / 2 : null;
    return [value - (before ?? after ?? alone), value + (after ?? before ?? alone)];
  });
}

function legend() {
  $("map-legend").replaceChildren(...[...keys()].map(([words, ink]) => {
    const each = Object.assign(document.createElement("span"), { textContent: words });
    const box = document.createElement("span");
    box.className = "swatch";
    box.style.background = ink;
    each.prepend(box);
    return each;
  }));
}
// What the colours that are seen mean.
function keys() {
  const palette = lab.colours(), high = most(), shown = new Map(), seen = new Set();
  for (const part of parts) for (const value of part.arrays.values) {
    if (value in WORDS) shown.set(WORDS[value], colour(value, 1, palette));
    else if (!Number.isNaN(value)) seen.add(counted() ? Math.round(value) : 0);
  }
  if (!counted()) {
    for (const share of [0, 0.5, 1]) shown.set(shortly(share * high), `rgb(${cividis(share)})`);
    return shown;
  }
  for (const value of [...seen].sort((a, b) => a - b)) {
    const level = LEVELS[levelOf(value)];
    shown.set(wanted.measure === "stops" ? level[1] : `${value}`, `rgb(${cividis(level[2])})`);
  }
  return shown;
}

/* ---------- the point ---------- */
function placed(event) {
  const { box } = plan, frame = canvas.getBoundingClientRect();
  const x = (event.clientX - frame.left - box.left) / (box.right - box.left);
  const y = (box.bottom - (event.clientY - frame.top)) / (box.bottom - box.top);
  return [within(x), within(y)];
}
const value = (side, share) => wanted[side].from + share * (wanted[side].to - wanted[side].from);
function found(x, y) {
  let best = null, nearest = Infinity;
  const far = (side, from) => ((from - { x, y }[side]) / (wanted[side].to - wanted[side].from)) ** 2;
  for (const part of parts) {
    const { x: xs, y: ys, values } = part.arrays;
    xs.forEach((a, i) => ys.forEach((b, j) => {
      const distance = far("x", a) + far("y", b);
      if (distance < nearest) { nearest = distance; best = values[i * ys.length + j]; }
    }));
  }
  return best;
}
function point() {
  if (!wanted || !plan) return;
  const spot = { x: value("x", place[0]), y: value("y", place[1]) };
  const where = Object.keys(SIDES).map((side) => {
    const { dotted } = wanted[side];
    return `${called(dotted.split("."))} ${readable(+spot[side].toPrecision(4), unitOf(dotted))}`;
  });
  $("map-point").textContent = `${where.join(", ")}: ${toldOf(found(spot.x, spot.y))}. Click, or Enter, plays it.`;
}
function toldOf(here) {
  if (here === null) return "not computed yet";
  if (Number.isNaN(here)) return "no answer";
  return here in WORDS ? WORDS[here] : `${shortly(here)} ${MEASURES[wanted.measure].replace(/ \[.*/, "")}`;
}
function play() {
  if (!wanted) return;
  const chosen = structuredClone(wanted.state);
  for (const [side, share] of [["x", place[0]], ["y", place[1]]]) {
    put(chosen, wanted[side].dotted.split("."), +value(side, share).toPrecision(6));
  }
  lab.openInPlay(chosen);
}
