// Live: a rig as it is measured; traces, loops cycle by cycle, the sensors' check-up; record, mark, stop.
import { Conversation } from "./socket.js";
import { axes, line, prefixed, range, shortly } from "./canvas.js";

const SPAN = 4, LOOPS = 12, FORGOTTEN = 3, ROOM = 0.06; // s of traces, loops that stay, cycles that a flaw stays; share of a strip left free above and below
let lab, conversation, state = {}, traces = new Map(), loops = [], flaws = new Map(), cycle = 0, number = 0, drawing = false, turned = true, oldest = 0;
const $ = (id) => document.getElementById(id);
const ask = (want, more = {}) => conversation.send({ id: ++number, want, ...more });

export function start(root, given) {
  lab = given;
  root.innerHTML = form();
  conversation = new Conversation("live", heard, () => lab.say("The lab does not answer; it is asked again.", true));
  $("live-open").addEventListener("click", () => {
    lab.busy(state.open ? "Closing …" : `Opening ${$("live-device").value} …`, performance.now());
    ask(state.open ? "close" : "open", { device: $("live-device").value });
  });
  $("live-record").addEventListener("click", () => ask(recorded === null ? "record" : "stop"));
  $("live-mark").addEventListener("click", () => { ask("mark", { text: $("live-text").value }); });
  $("live-drive").addEventListener("submit", (event) => {
    event.preventDefault();
    const value = (id) => Number($(id).value.replace(",", "."));
    ask("drive", { output: $("live-output").value, amplitude: value("live-amplitude"), frequency: value("live-frequency") });
  });
  $("live-rest").addEventListener("click", () => ask("drive", { output: $("live-output").value, amplitude: 0, frequency: 0 }));
  lab.onTheme(afresh);
  new ResizeObserver(afresh).observe($("live-shown"));
}

function form() {
  return `<div class="beside">
    <div class="panel">
      <div class="field"><label for="live-device">Device</label><select id="live-device"></select>
        <p class="note" id="live-model"></p></div>
      <div class="row"><button class="main" type="button" id="live-open">Open</button></div>
      <fieldset><legend>Record</legend>
        <div class="row"><button type="button" id="live-record" aria-pressed="false" disabled>Record</button>
          <span id="live-time" class="note"></span></div>
        <div class="row"><label class="hidden" for="live-text">What is marked</label>
          <input type="text" id="live-text" value="mark" size="10" maxlength="200">
          <button type="button" id="live-mark" disabled>Mark</button></div></fieldset>
      <form id="live-drive" autocomplete="off"><fieldset id="live-outputs" hidden><legend>Move</legend>
        <div class="field"><label for="live-output">Output</label><select id="live-output"></select></div>
        <div class="knob"><label for="live-amplitude" id="live-unit">amplitude</label><input type="text" id="live-amplitude" value="0.65e-3">
          <label for="live-frequency">frequency [Hz]</label><input type="text" id="live-frequency" value="2.5"></div>
        <div class="row"><button type="submit">Move</button><button type="button" id="live-rest">Rest</button></div></fieldset></form>
      <p class="note" id="live-said" role="status"></p>
    </div>
    <div id="live-shown">
      <div class="card"><h2>Sensors</h2><ul id="live-flaws" aria-live="polite"><li>Open a device.</li></ul></div>
      <div class="card"><canvas id="live-traces" role="img" aria-label="Each channel over the last seconds"></canvas></div>
      <div id="live-views">
        <figure class="card"><figcaption>Friction over displacement</figcaption><canvas id="live-loop-x" role="img" aria-label="Friction against displacement, cycle by cycle"></canvas></figure>
        <figure class="card"><figcaption>Friction over velocity</figcaption><canvas id="live-loop-v" role="img" aria-label="Friction against velocity, cycle by cycle"></canvas></figure>
        <div class="card"><h2>Of the last cycles</h2><table><thead><tr><th></th><th>Value</th><th>95 % interval</th></tr></thead><tbody id="live-rows"></tbody></table><p class="note" id="live-untold"></p></div>
      </div>
    </div></div>`;
}

let recorded = null, late = null;
function heard(answer) {
  if (answer.kind === "error") lab.say(answer.error, true);
  else if (answer.kind === "state") begin(answer);
  else if (answer.kind === "block" && state.open) block(answer);
  else if (answer.kind === "cycle" && state.open) ended(answer);
  else if (answer.kind === "numbers" && state.open) numbers(answer);
}

function begin(answer) {
  state = answer;
  traces = new Map((answer.inputs ?? []).map((one) => [one.name, { ...one, low: [], high: [] }]));
  loops = []; flaws = new Map(); cycle = 0; recorded = late = null;
  const chosen = answer.open ?? $("live-device").value;
  $("live-device").replaceChildren(...answer.devices.map((name) => new Option(name, name, false, name === chosen)));
  $("live-device").disabled = Boolean(answer.open);
  $("live-model").textContent = answer.open ? `${answer.model}; ${answer.fs} Hz` : "";
  $("live-open").textContent = answer.open ? "Close" : "Open";
  for (const id of ["live-record", "live-mark"]) $(id).disabled = !answer.open;
  $("live-outputs").hidden = !(answer.outputs ?? []).length;
  $("live-output").replaceChildren(...(answer.outputs ?? []).map((one) => new Option(one.name, one.name)));
  $("live-output").onchange = () => { $("live-unit").textContent = `amplitude [${answer.outputs[$("live-output").selectedIndex].unit}]`; };
  if (answer.outputs?.length) $("live-output").onchange();
  $("live-rows").replaceChildren();
  $("live-untold").textContent = "";
  $("live-traces").style.height = `${Math.max(1, traces.size) * 92 + 30}px`;
  lab.say(answer.failed ?? "", Boolean(answer.failed));
  checkup();
  afresh();
}

function block(answer) {
  for (const trace of traces.values()) {
    trace.step = answer.step;
    trace.low.push(...answer.arrays[`low ${trace.name}`]);
    trace.high.push(...answer.arrays[`high ${trace.name}`]);
    const most = Math.round(SPAN / answer.step);
    if (trace.low.length > most) { trace.low.splice(0, trace.low.length - most); trace.high.splice(0, trace.high.length - most); }
    trace.end = answer.start + (answer.arrays[`low ${trace.name}`].length) * answer.step;
  }
  if (answer.said !== $("live-said").textContent) $("live-said").textContent = answer.said;
  if ((recorded === null) !== (answer.recorded === null)) {
    $("live-record").textContent = answer.recorded === null ? "Record" : "Stop";
    $("live-record").setAttribute("aria-pressed", answer.recorded !== null);
  }
  recorded = answer.recorded;
  $("live-time").textContent = (recorded === null ? "" : `${recorded.toFixed(1)} s`) + (answer.lost ? ` ${answer.lost} samples lost` : "");
  oldest = oldest || answer.oldest;
  soon();
}

function ended(answer) {
  cycle += 1;
  late = answer.late;
  if (answer.arrays.friction.length) { loops.push(answer.arrays); loops.splice(0, loops.length - LOOPS); }
  turned = true;
  for (const flaw of answer.flaws) flaws.set(flaw.channel + flaw.kind, { ...flaw, cycle });
  for (const [key, flaw] of flaws) if (cycle - flaw.cycle > FORGOTTEN) flaws.delete(key);
  checkup();
}

function checkup() {
  const words = [...flaws.values()].map((flaw) => flaw.words);
  const seen = late === null ? "whether one comes late can not be told here" : `x or a would be named from ${(1e3 * late).toPrecision(2)} ms of delay on`;
  const none = !state.open ? "Open a device." : cycle ? `Nothing is wrong with the sensors; ${seen}.` : "Waiting for a cycle.";
  $("live-flaws").replaceChildren(...(words.length ? words : [none]).map((text) => Object.assign(document.createElement("li"), { textContent: text, className: words.length ? "fault" : "" })));
}

function numbers(answer) {
  $("live-rows").replaceChildren(...answer.rows.map((cells) => {
    const row = document.createElement("tr");
    for (const text of cells) row.append(Object.assign(document.createElement("td"), { textContent: text }));
    return row;
  }));
  $("live-untold").textContent = answer.untold.join(" ");
}

function afresh() { turned = true; soon(); }

function soon() {
  if (drawing || $("live").hidden) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    draw();
    if (oldest) { // how long ago the oldest sample that is new on the screen was measured
      document.dispatchEvent(new CustomEvent("live-drawn", { detail: Date.now() - 1000 * oldest }));
      oldest = 0;
    }
  });
}

function draw() {
  const palette = lab.colours();
  strips($("live-traces"), palette);
  if (!turned) return; // loops change with a cycle alone
  turned = false;
  loop($("live-loop-x"), "x", { label: "displacement", unit: "m" }, palette);
  loop($("live-loop-v"), "v", { label: "velocity", unit: "m/s" }, palette);
}

// All channels, one strip each, on one canvas.
function strips(canvas, palette) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight, inks = ["blue", "orange", "green", "purple", "sky", "ink"];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  const left = 118, high = (height - 30) / Math.max(1, traces.size), right = width - 8;
  let place = 0;
  for (const trace of traces.values()) {
    const top = place * high + 4, bottom = top + high - 10, ink = palette[inks[place % 6]];
    place += 1;
    pen.strokeStyle = palette.line;
    pen.strokeRect(left + 0.5, Math.round(top) + 0.5, right - left, Math.round(bottom - top));
    const [low, topmost] = range([...trace.low, ...trace.high], ROOM), edge = (topmost - low) * ROOM / (1 + 2 * ROOM), [factor, unit] = prefixed(Math.max(Math.abs(low), Math.abs(topmost)), trace.unit);
    pen.fillStyle = ink;
    pen.textAlign = "left"; pen.textBaseline = "middle";
    pen.fillText(`${trace.name} [${unit}]`, 0, (top + bottom) / 2);
    if (!trace.low.length) continue;
    pen.fillStyle = palette.soft;
    pen.textAlign = "right";
    pen.fillText(shortly(Number(((topmost - edge) * factor).toPrecision(3))), left - 5, top + 7);
    pen.fillText(shortly(Number(((low + edge) * factor).toPrecision(3))), left - 5, bottom - 7);
    const y = (value) => bottom - ((value - low) / (topmost - low || 1)) * (bottom - top), most = Math.round(SPAN / trace.step), offset = most - trace.low.length;
    const x = (k) => left + ((k + offset) / most) * (right - left);
    pen.strokeStyle = ink;
    pen.lineWidth = 1; // of a wider line the browser fills the outline: 20 ms a frame for four channels, where this takes 1
    pen.beginPath();
    for (let k = 0; k < trace.low.length; k++) { pen.lineTo(x(k), y(trace.low[k])); if (trace.high[k] !== trace.low[k]) pen.lineTo(x(k), y(trace.high[k])); }
    pen.stroke();
  }
  const first = traces.values().next().value;
  if (!first?.low.length) return;
  pen.fillStyle = palette.soft;
  pen.textAlign = "center"; pen.textBaseline = "top";
  for (let s = Math.max(0, Math.ceil(first.end - SPAN)); s <= first.end; s++) pen.fillText(`${s} s`, left + ((s - first.end + SPAN) / SPAN) * (right - left), height - 22);
}

function loop(canvas, across, axis, palette) {
  const known = loops.filter((each) => each[across].length);
  if (!known.length) { canvas.width = 0; return; } // nothing was seen: no axes
  const limits = (name) => known.map((each) => range(each[name], 0.08)).reduce(([a, b], [c, d]) => [Math.min(a, c), Math.max(b, d)], [Infinity, -Infinity]);
  const [[xl, xh], [yl, yh]] = [limits(across), limits("friction")];
  const plan = axes(canvas, { low: xl, high: xh, ...axis }, { low: yl, high: yh, label: "friction", unit: "N" }, palette);
  known.forEach((each, j) => line(plan, each[across], each.friction, { colour: j === known.length - 1 ? palette.orange : palette.faint, width: j === known.length - 1 ? 1.8 : 0.8 }));
}
