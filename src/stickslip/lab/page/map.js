// Map: which motion is where, computed while one looks; a click plays the point.
import { Conversation } from "./socket.js";
import { at, put, readable, written } from "./controls.js";
import { axes, cividis, line, shortly } from "./canvas.js";
import { current } from "./play.js";

const MEASURES = { stops: "stops per cycle", micro_slips: "micro-slips per cycle", period: "cycles until it repeats (0: never)", stick_share: "share of time that it holds", amplitude: "amplitude [m]" };
const COUNT = { x: 28, y: 20 };
const NONE = -1, REST = -2; // as the lab sends them
const WORDS = { [NONE]: "no such system", [REST]: "comes to rest" };

let begun = 0;
let lab, state, canvas, conversation, number = 0, parts = [], wanted = null, plan = null, place = [0.5, 0.5];

export function start(root, given) {
  lab = given;
  root.innerHTML = `<div class="beside">
    <form class="panel" id="map-form" aria-label="The map" autocomplete="off">
      <p class="note" id="map-of"></p>
      ${["x", "y"].map((side) => `<fieldset><legend>${side === "x" ? "Across" : "Upwards"}</legend>
        <div class="field"><label class="hidden" for="map-${side}">Parameter ${side === "x" ? "across" : "upwards"}</label><select id="map-${side}"></select></div>
        <div class="knob"><label for="map-${side}-from">from</label><input type="text" id="map-${side}-from"><label for="map-${side}-to">to</label><input type="text" id="map-${side}-to"></div></fieldset>`).join("")}
      <fieldset><legend>Colour</legend><div class="field"><label class="hidden" for="map-measure">What is shown</label><select id="map-measure">${Object.entries(MEASURES).map(([name, words]) => `<option value="${name}">${words}</option>`).join("")}</select></div></fieldset>
      <div class="row"><button class="main" type="submit">Draw the map</button><button type="button" id="map-cancel" disabled>Cancel</button></div>
      <p><label class="hidden" for="map-done">How far it is</label><progress id="map-done" max="1" value="0"></progress></p>
      <p class="note" id="map-left"></p>
      <p class="fault note" id="map-fault"></p>
    </form>
    <div class="card"><h2 id="map-title">Stops per cycle</h2>
      <canvas id="map-canvas" role="application" tabindex="0" aria-label="Regime map. Arrow keys move, Enter plays the point."></canvas>
      <p class="legend" id="map-legend"></p><p class="note" id="map-point" aria-live="polite">Click a point of the map to play it. With the keyboard: arrows, then Enter.</p></div>
  </div>`;
  const $ = (id) => document.getElementById(id);
  canvas = $("map-canvas");
  conversation = new Conversation("/map", heard);
  $("map-form").addEventListener("submit", (event) => { event.preventDefault(); draw(); });
  $("map-cancel").addEventListener("click", () => conversation.send({ id: ++number, want: "cancel" }));
  for (const side of ["x", "y"]) $(`map-${side}`).addEventListener("change", () => limits(side));
  canvas.addEventListener("pointermove", (event) => { place = placed(event); point(); });
  canvas.addEventListener("click", (event) => { place = placed(event); play(); });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "Enter") play();
    if (!step) return;
    event.preventDefault();
    place = place.map((each, j) => Math.min(1, Math.max(0, each + step[j] / (event.shiftKey ? 10 : 100))));
    point();
  });
  lab.onTheme(redraw);
  new ResizeObserver(redraw).observe(canvas);
  lab.onShow.map = offer;
  offer();
}
const $ = (id) => document.getElementById(id);

// The parameters of what is played now.
function offer() {
  const now = current();
  if (state && JSON.stringify(state) === JSON.stringify(now)) return;
  state = now;
  const found = [];
  const walk = (part, path) => {
    for (const [name, value] of Object.entries(part)) {
      if (typeof value === "number" && !["start", "run"].includes(path[0]) && value !== 0) found.push([...path, name]);
      else if (value && typeof value === "object" && !(Array.isArray(value) && typeof value[0] !== "object") && !["start", "run"].includes(name)) walk(value, [...path, name]);
    }
  };
  walk(state, []);
  for (const [side, first] of [["x", "drive.frequency"], ["y", "law.kinetic"]]) {
    const kept = $(`map-${side}`).value || first;
    $(`map-${side}`).replaceChildren(...found.map((path) => new Option(called(path), path.join("."), false, path.join(".") === kept)));
    if (!found.some((path) => path.join(".") === kept)) $(`map-${side}`).selectedIndex = side === "x" ? 0 : Math.min(1, found.length - 1);
    limits(side);
  }
  $("map-of").textContent = `Of the system that plays: ${state.law?.name ?? "a structure"}, ${state.drive?.name ?? "Release"}.`;
  draw();
}
const called = (path) => path.join(" ").replace(/^system /, "").replace("contacts ", "contact ").replaceAll("_", " ");
// As the library names it: the system's own parameters without their table, contacts counted from one.
const named = (dotted) => dotted.replace(/^system\./, "").replace(/^contacts\.(\d+)/, (_, j) => `contacts.${+j + 1}`);
const UNITS = { frequency: "Hz", kinetic: "N", static: "N", mass: "kg", damping: "N s/m", speed: "m/s", viscous: "N s/m" };
function unitOf(dotted) {
  const name = dotted.split(".").at(-1), drive = state.drive?.name;
  if (name === "amplitude") return drive === "HarmonicForce" ? "N" : "m";
  return UNITS[name] ?? (name === "stiffness" ? "N/m" : "");
}

// A ratio where the field speaks of one: frequency over the natural, friction over the drive's force.
function ratio(dotted) {
  const { system, drive = {}, law = {} } = state;
  if (typeof system.mass !== "number" || !(system.stiffness > 0)) return null;
  if (dotted === "drive.frequency") return [Math.sqrt(system.stiffness / system.mass) / (2 * Math.PI), "frequency ratio, drive over natural"];
  const force = drive.name === "HarmonicBase" ? system.stiffness * drive.amplitude : drive.name === "HarmonicForce" ? drive.amplitude : 0;
  return dotted === "law.kinetic" && force > 0 && !("static" in law) ? [force, "friction ratio, over the drive's force"] : null;
}

function limits(side) {
  const dotted = $(`map-${side}`).value, value = at(state, dotted.split(".")), found = ratio(dotted), unit = unitOf(dotted);
  const [low, high] = found ? (dotted === "drive.frequency" ? [0.1 * found[0], 2 * found[0]] : [0.02 * found[0], 1.1 * found[0]]) : [value > 0 ? value / 5 : value * 2, value > 0 ? value * 2 : value / 5];
  $(`map-${side}-from`).value = readable(+low.toPrecision(3), unit);
  $(`map-${side}-to`).value = readable(+high.toPrecision(3), unit);
}

function draw() {
  const axis = (side) => {
    const dotted = $(`map-${side}`).value;
    return { name: named(dotted), dotted, from: written($(`map-${side}-from`).value, unitOf(dotted)), to: written($(`map-${side}-to`).value, unitOf(dotted)), count: COUNT[side] };
  };
  let ends;
  try { ends = [axis("x"), axis("y")]; } catch (error) { $("map-fault").textContent = error.message; return; }
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
  lab.say("Drawing the map …");
}

function heard(answer) {
  if (answer.kind === "cancelled") { ended("Cancelled; what is drawn stays."); return; }
  if (answer.id !== wanted?.id) return;
  if (answer.kind === "error") { $("map-fault").textContent = answer.error; ended(""); }
  else if (answer.kind === "done") ended("The map is done.");
  else {
    parts.push(answer);
    const points = parts.reduce((sum, part) => sum + part.arrays.values.length, 0), past = (performance.now() - begun) / 1000;
    const left = answer.level === "coarse" ? "then its borders" : `about ${Math.max(1, Math.round((past * (answer.of - answer.done)) / answer.done))} s left`;
    if (answer.done % 5 === 0) $("map-left").textContent = `${points} motions so far, ${left}.`;
    $("map-done").value = answer.level === "coarse" ? (0.4 * answer.done) / answer.of : 0.4 + (0.6 * answer.done) / answer.of;
    if (plan && answer.level === "fine") paint(answer); else redraw();
  }
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
const STEPS = [0.04, 0.3, 0.48, 0.62, 0.74, 0.84, 0.92, 1];
const levels = (value) => { const whole = Math.round(value); return whole > 12 ? 7 : whole > 8 ? 6 : whole > 6 ? 5 : whole > 4 ? 4 : whole > 2 ? 3 : whole; };
function colour(value, high, palette) {
  if (value === NONE || Number.isNaN(value)) return palette.card;
  if (value === REST) return palette.faint;
  const share = counted() ? STEPS[wanted.measure === "stops" ? levels(value) : Math.min(7, Math.round(value))] : value / high;
  return `rgb(${cividis(share)})`;
}

function redraw() {
  if (!wanted || !canvas?.clientWidth) return;
  const side = (axis) => {
    const found = ratio(axis.dotted), unit = unitOf(axis.dotted);
    return found ? { low: axis.from, high: axis.to, label: found[1], factor: 1 / found[0], unit: "" } : { low: axis.from, high: axis.to, label: called(axis.dotted.split(".")), unit };
  };
  if (!(wanted.x.to > wanted.x.from && wanted.y.to > wanted.y.from)) return;
  plan = axes(canvas, side(wanted.x), side(wanted.y), lab.colours());
  for (const part of parts) paint(part);
  boundary();
  legend();
}
// Where sliding without a stop ends under rigid friction (Den Hartog 1930), at the ratios that the library's table has.
function boundary() {
  const { system, law = {}, drive = {} } = wanted.state;
  const rigid = law.name === "Coulomb" && !("static" in law) && !system.damping && /^Harmonic/.test(drive.name ?? "") && drive.contact !== "base";
  if (!rigid || wanted.measure !== "stops" || wanted.x.dotted !== "drive.frequency" || wanted.y.dotted !== "law.kinetic") return;
  const [natural] = ratio(wanted.x.dotted), [force] = ratio(wanted.y.dotted), { pen, box } = plan, ink = "#ffffff";
  pen.save();
  pen.beginPath();
  pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
  pen.clip();
  line(plan, lab.boundary.map(([b]) => b * natural), lab.boundary.map(([, r]) => r * force), { colour: ink, width: 1.6 });
  pen.fillStyle = ink;
  for (const [b, r] of lab.boundary) { pen.beginPath(); pen.arc(plan.x(b * natural), plan.y(r * force), 3, 0, 7); pen.fill(); }
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.fillText("Den Hartog 1930", plan.x(1.35 * natural), plan.y(0.675 * force) + 22);
  pen.restore();
}
function paint({ arrays: { x, y, values } }) {
  const { pen, box } = plan, high = most(), palette = lab.colours();
  const edges = (line, to) => [...line].map((value, j) => [j ? (line[j - 1] + value) / 2 : value - (line.length > 1 ? (line[1] - value) / 2 : step(to)), j < line.length - 1 ? (line[j + 1] + value) / 2 : value + (line.length > 1 ? (value - line[j - 1]) / 2 : step(to))]);
  const xs = edges(x, wanted.x), ys = edges(y, wanted.y);
  pen.save();
  pen.beginPath();
  pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
  pen.clip();
  xs.forEach(([left, right], i) => ys.forEach(([low, up], j) => {
    pen.fillStyle = colour(values[i * ys.length + j], high, palette);
    const from = plan.x(left), top = plan.y(up);
    pen.fillRect(from, top, plan.x(right) - from + 0.6, plan.y(low) - top + 0.6);
  }));
  pen.restore();
}
const step = ({ from, to, count }) => (to - from) / (count - 1) / 2;

function legend() {
  const palette = lab.colours(), high = most(), shown = new Map();
  const key = (words, ink) => { if (!shown.has(words)) shown.set(words, ink); };
  const seen = new Set();
  for (const part of parts) for (const value of part.arrays.values) { if (value in WORDS) key(WORDS[value], colour(value, 1, palette)); else if (!Number.isNaN(value)) seen.add(wanted.measure === "stops" ? levels(value) : Math.round(value)); }
  if (counted()) for (const value of [...seen].sort((a, b) => a - b)) key(wanted.measure === "stops" ? ["slides without a stop", "1 stop", "2 stops", "3 or 4", "5 or 6", "7 or 8", "9 to 12", "more than 12"][value] : `${value}`, `rgb(${cividis(STEPS[Math.min(7, value)])})`);
  else for (const share of [0, 0.5, 1]) key(shortly(share * high), `rgb(${cividis(share)})`);
  $("map-legend").replaceChildren(...[...shown].map(([words, ink]) => {
    const each = Object.assign(document.createElement("span"), { textContent: words }), box = document.createElement("span");
    box.className = "swatch";
    box.style.background = ink;
    each.prepend(box);
    return each;
  }));
}

/* ---------- the point ---------- */
function placed(event) {
  const { box } = plan, frame = canvas.getBoundingClientRect();
  return [(event.clientX - frame.left - box.left) / (box.right - box.left), (box.bottom - (event.clientY - frame.top)) / (box.bottom - box.top)].map((each) => Math.min(1, Math.max(0, each)));
}
const value = (side, share) => wanted[side].from + share * (wanted[side].to - wanted[side].from);
function found(x, y) {
  let best = null, nearest = Infinity;
  for (const part of parts) {
    const { x: xs, y: ys, values } = part.arrays;
    xs.forEach((a, i) => ys.forEach((b, j) => {
      const far = ((a - x) / (wanted.x.to - wanted.x.from)) ** 2 + ((b - y) / (wanted.y.to - wanted.y.from)) ** 2;
      if (far < nearest) { nearest = far; best = values[i * ys.length + j]; }
    }));
  }
  return best;
}
function point() {
  if (!wanted || !plan) return;
  const [x, y] = [value("x", place[0]), value("y", place[1])], here = found(x, y);
  const told = here === null ? "not computed yet" : Number.isNaN(here) ? "no answer" : here in WORDS ? WORDS[here] : `${shortly(here)} ${MEASURES[wanted.measure].replace(/ \[.*/, "")}`;
  $("map-point").textContent = ["x", "y"].map((side, j) => `${called(wanted[side].dotted.split("."))} ${readable(+[x, y][j].toPrecision(4), unitOf(wanted[side].dotted))}`).join(", ") + `: ${told}. Click, or Enter, plays it.`;
}
function play() {
  if (!wanted) return;
  const chosen = structuredClone(wanted.state);
  for (const [side, share] of [["x", place[0]], ["y", place[1]]]) put(chosen, wanted[side].dotted.split("."), +value(side, share).toPrecision(6));
  lab.openInPlay(chosen);
}
