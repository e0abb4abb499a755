// The form of a system: a slider and a number for each parameter that the library names, by law, drive, mass and run.
import { prefixed, spelled } from "./canvas.js";

const WORDS = {
  start: { x: "displacement at the start", v: "velocity at the start" },
  run: { cycles: "cycles", duration: "time" },
};
const UNITS = { s: "s", x: "m", v: "m/s", duration: "s", cycles: "1" };
const NOT_DRAWN = new Set(["Recorded"]); // needs a file: kept where a state has it

export const at = (state, path) => path.reduce((held, key) => held?.[key], state);
export function put(state, path, value) {
  const last = path.at(-1);
  const part = path.slice(0, -1).reduce((held, key) => (held[key] ??= {}), state);
  if (value === undefined) delete part[last]; else part[last] = value;
}

export function readable(value, unit) {
  if (typeof value !== "number") return typeof value === "string" ? value : JSON.stringify(value);
  const [factor, words] = prefixed(Math.abs(value), unit);
  return `${+(value * factor).toPrecision(6)}${words && ` ${words}`}`;
}
const LETTERS = { G: 1e9, M: 1e6, k: 1e3, m: 1e-3, "µ": 1e-6, u: 1e-6, n: 1e-9 };
const THOUSANDS = /^\s*[-+]?\d{1,3}(,\d{3})+(?!\d)/; // or a decimal comma: no one can tell
// A number in SI where the text is one, with or without a prefixed unit; other units are left to the library.
export function written(text, unit) {
  if (THOUSANDS.test(text)) {
    const [seen, plain] = [text.trim(), text.trim().replace(/,/g, "")];
    throw new Error(`${seen} may be read in two ways; write ${plain}, or a decimal point.`);
  }
  const found = /^\s*([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(.*?)\s*$/i.exec(text.replace(",", "."));
  if (!found || !Number.isFinite(Number(found[1]))) return text.trim() || undefined;
  const given = found[2].replaceAll("·", " ").replace("²", "^2"), number = Number(found[1]);
  if (!given || given === unit) return number;
  return given.slice(1) === unit && LETTERS[given[0]] ? number * LETTERS[given[0]] : text.trim();
}

export class Controls {
  constructor(root, catalog, changed) {
    Object.assign(this, { root, catalog, changed, units: new Map() });
  }
  show(state) {
    this.state = state;
    this.root.replaceChildren();
    this.knobs = new Map();
    this.followers = new Map();
    const several = Array.isArray(state.contacts);
    if (several) state.contacts.forEach((contact, j) => this.contact(contact, j));
    else this.part("Friction law", "laws", ["law"]);
    this.part("Drive", "drives", ["drive"]);
    this.group(several ? "Masses and springs" : "Mass and spring", this.catalog.system.parameters.filter((each) => !each.part), ["system"], "system");
    const extra = several ? Object.keys(state.system).filter((name) => !this.catalog.system.parameters.some((each) => each.name === name)) : [];
    const names = several ? Object.keys(state.start ?? {}) : ["x", "v"];
    const numbers = (found) => found.map((name) => ({ name, unit: UNITS[name] ?? UNITS[name[0]] ?? "", words: "", default: 0, optional: true, choices: [] }));
    if (extra.length) this.group("More of the structure", numbers(extra), ["system"], "system");
    this.group("Start", numbers(names), ["start"], "start", true);
    this.group("Run", numbers(["duration" in (state.run ?? {}) ? "duration" : "cycles"]), ["run"], "run", true);
  }
  contact(contact, j) {
    const box = this.fieldset(`Contact ${j + 1}`);
    this.part("Friction law", "laws", ["contacts", j, "law"], box);
    this.fill(box, this.catalog.contact.parameters.filter((each) => !each.part && contact[each.name] !== undefined), ["contacts", j], "contact");
  }
  fieldset(words, within = this.root) {
    const box = within.appendChild(document.createElement("fieldset"));
    box.appendChild(document.createElement("legend")).textContent = words;
    return box;
  }
  // A law or a drive: which one, its parameters, and what stands within it.
  part(words, kind, path, within) {
    const box = this.fieldset(words, within), part = at(this.state, path), known = this.catalog[kind];
    const id = path.join("-"), field = box.appendChild(document.createElement("div"));
    field.className = "field";
    const label = field.appendChild(document.createElement("label"));
    Object.assign(label, { htmlFor: id, className: "hidden", textContent: words });
    const choice = field.appendChild(document.createElement("select"));
    choice.id = id;
    for (const name of Object.keys(known)) if (!NOT_DRAWN.has(name) || name === part.name) choice.add(new Option(known[name].label, name, false, name === part.name));
    const note = field.appendChild(document.createElement("p"));
    note.className = "note";
    note.textContent = known[part.name].about;
    choice.addEventListener("change", () => {
      put(this.state, path, this.guessed(kind, choice.value, part));
      this.show(this.state);
      document.getElementById(id)?.focus();
      this.changed(path, performance.now(), true);
    });
    this.fill(box, known[part.name].parameters.filter((each) => !each.part), path, path.at(-1) === "drive" ? "drive" : "law");
    for (const inner of ["law", "drive"]) if (typeof part[inner] === "object") this.part(inner === "law" ? "Law within" : "Drive within", `${inner}s`, [...path, inner], box);
  }
  group(words, parameters, path, kind, folded = false) {
    if (!parameters.length) return;
    if (!folded) { this.fill(this.fieldset(words), parameters, path, kind); return; }
    const box = this.root.appendChild(document.createElement("details"));
    box.className = "knobs";
    box.open = this.open?.has(words);
    box.appendChild(document.createElement("summary")).textContent = words;
    box.addEventListener("toggle", () => { (this.open ??= new Set())[box.open ? "add" : "delete"](words); });
    this.fill(box, parameters, path, kind);
  }
  fill(box, parameters, path, kind) {
    for (const each of parameters) {
      const value = at(this.state, [...path, each.name]) ?? each.default;
      if (each.choices.length || typeof value === "boolean") this.choice(box, each, path, kind, value);
      else if (typeof value === "number" || value === null || value === undefined || (typeof value === "string" && each.unit !== "N" && each.name !== "curve")) this.number(box, each, path, kind, value);
      else this.words(box, each, path, kind, value);
    }
  }
  knob(box, each, path, kind) {
    const knob = box.appendChild(document.createElement("div")), id = [...path, each.name].join("-");
    knob.className = "knob";
    const label = knob.appendChild(document.createElement("label"));
    Object.assign(label, { htmlFor: id, textContent: each.label ?? WORDS[kind]?.[each.name] ?? each.name.replaceAll("_", " "), title: each.words ?? "" });
    this.knobs.set([...path, each.name].join("."), knob);
    return [knob, id, label.textContent];
  }
  choice(box, each, path, kind, value) {
    const [knob, id] = this.knob(box, each, path, kind), choice = knob.appendChild(document.createElement("select"));
    choice.id = id;
    const offered = each.choices.length ? each.choices : ["no", "yes"];
    const now = typeof value === "boolean" ? ["no", "yes"][+value] : value;
    for (const name of offered) choice.add(new Option(name, name, false, name === now));
    choice.addEventListener("change", () => this.set([...path, each.name], each.choices.length ? choice.value : choice.value === "yes"));
  }
  words(box, each, path, kind, value) {
    const [knob, id] = this.knob(box, each, path, kind), text = knob.appendChild(document.createElement("input"));
    Object.assign(text, { id, type: "text", className: "wide", value: typeof value === "string" ? value : JSON.stringify(value) });
    text.addEventListener("change", () => {
      let given = text.value;
      if (typeof value !== "string") try { given = JSON.parse(text.value); } catch { /* the library says what it is not */ }
      this.set([...path, each.name], given);
    });
  }
  number(box, each, path, kind, value) {
    const [knob, id, words] = this.knob(box, each, path, kind), place = [...path, each.name];
    const text = knob.appendChild(document.createElement("input")), slide = knob.appendChild(document.createElement("input"));
    const unit = spelled(each.unit);
    Object.assign(text, { id, type: "text", inputMode: "decimal", placeholder: each.optional && value == null ? each.name === "static" ? "= kinetic" : "as it is" : "", value: value == null ? "" : this.spelt(value, each.unit, id) });
    Object.assign(slide, { type: "range", min: 0, max: 1000, step: 1 });
    slide.setAttribute("aria-label", `${words}, slider`);
    const scale = this.scale(each, place, typeof value === "number" ? value : 0);
    const told = (now) => slide.setAttribute("aria-valuetext", now == null ? "not set" : readable(now, each.unit));
    slide.value = typeof value === "number" ? scale.place(value) : 0;
    told(value);
    slide.addEventListener("input", (event) => {
      const now = scale.value(Number(slide.value));
      text.value = this.spelt(now, each.unit, id);
      told(now);
      this.set(place, now, event.timeStamp);
    });
    text.addEventListener("change", (event) => {
      let now;
      try { now = written(text.value, each.unit); } catch (error) { this.fault(place, error.message); return; }
      const typed = text.value.replace(/^\s*[-+\d.,]+(e[-+]?\d+)?\s*/i, "").trim();
      if (typed && typed === unit) this.units.set(id, "");
      else if (typed && typed.slice(1) === unit && LETTERS[typed[0]]) this.units.set(id, typed[0].replace("u", "µ"));
      if (typeof now === "number") { slide.value = scale.place(now); text.value = this.spelt(now, each.unit, id); told(now); }
      this.set(place, now, event.timeStamp);
    });
    this.followers.set(place.join("."), (now) => { slide.value = scale.place(now); told(now); });
    if (unit && typeof value !== "number") text.title = `in ${unit}`;
  }
  // In the unit in which it was typed here, else in a readable one.
  spelt(value, unit, id) {
    if (!this.units.has(id)) return readable(value, unit);
    const letter = this.units.get(id);
    return `${+(value / (LETTERS[letter] ?? 1)).toPrecision(6)} ${letter}${spelled(unit)}`;
  }
  // Sliders go to values that were typed in units which only the library reads.
  follow(state) {
    for (const [dotted, move] of this.followers) {
      const path = dotted.split("."), now = at(state, path);
      if (typeof at(this.state, path) === "string" && typeof now === "number") move(now);
    }
  }
  // Positive values on a logarithmic scale, a decade to either side; those that are zero or signed on a linear one.
  scale(each, place, value) {
    const round = (number, digits = 3) => Number(number.toPrecision(digits));
    if (each.name === "cycles") return { place: (now) => 10 * now, value: (p) => Math.max(1, Math.round(p / 10)) };
    if (value > 0 && each.name !== "phase" && place[0] !== "start") {
      const clamp = (p) => Math.min(1000, Math.max(0, p));
      return { place: (now) => clamp(500 + 500 * Math.log10(now / value)), value: (p) => (p === 500 ? value : round(value * 10 ** ((p - 500) / 500))) };
    }
    const size = each.name === "phase" ? Math.PI : Math.abs(value) * 2 || this.size(each);
    const signed = each.name === "phase" || place[0] === "start" || value < 0;
    return signed
      ? { place: (now) => 500 + (500 * now) / size, value: (p) => round((size * (p - 500)) / 500) }
      : { place: (now) => (1000 * now) / size, value: (p) => round((size * p) / 1000) };
  }
  // How large a value of that unit is here, where nothing says it.
  size({ name, unit }) {
    const { system, law = {}, drive = {} } = this.state;
    const mass = +system.mass || 1, spring = +system.stiffness || 1, force = +law.kinetic || 1;
    const natural = Math.sqrt(spring / mass), way = drive.amplitude && drive.name === "HarmonicBase" ? +drive.amplitude : force / spring;
    const sizes = { N: force * (name === "static" ? 1.3 : 1), "N/m": 50 * spring, "N s/m": 0.2 * Math.sqrt(spring * mass), "m/s": way * natural, m: 2 * way, Hz: natural / 12, kg: mass / 20, s: 1 / natural, "s/m": 100 / (way * natural), "1/(N s)": 10 * natural / force, rad: Math.PI };
    return sizes[unit] ?? 1;
  }
  // A law or drive chosen anew: what it shares with the one before, what the library says, and else a size that fits.
  guessed(kind, name, before) {
    this.elements = name === "ElastoSlip";
    const part = { name }, old = { ...before, ...(typeof before.law === "object" ? before.law : {}) };
    for (const each of this.catalog[kind][name].parameters) {
      if (each.part) part[each.name] = each.name === "law" ? (name === "InSeries" ? { name: "Coulomb", kinetic: +old.kinetic || 1 } : { name: "Stribeck", kinetic: +old.kinetic || 1, static: 1.3 * (+old.kinetic || 1), speed: this.size({ unit: "m/s" }) / 5 }) : { name: "Belt", speed: this.size({ unit: "m/s" }) };
      else if (typeof old[each.name] === "number" && !(each.name === "amplitude")) part[each.name] = old[each.name];
      else if (each.default !== null) part[each.name] = each.default;
      else if (!each.optional) part[each.name] = this.listed(each) ?? this.size(each);
    }
    if (name === "RateState") Object.assign(part, { normal: 2 * this.size({ unit: "N" }), friction: 0.5, direct: 0.01, evolution: 0.015, distance: this.size({ unit: "m" }) / 50, reference: this.size({ unit: "m/s" }) / 10 });
    if (name === "RateState") this.state.start = { ...this.state.start, v: part.reference };
    if (name === "PositionLoad") part.gradient = (+old.kinetic || 1) / (4 * this.size({ unit: "m" }));
    if (name === "Dithered") Object.assign(part, { amplitude: this.size({ unit: "m" }) / 200, frequency: 100 * this.size({ unit: "Hz" }) });
    if (kind === "drives" && name === "HarmonicForce") part.amplitude = 1.5 * this.size({ unit: "N" });
    return part;
  }
  listed({ name }) {
    const force = this.size({ unit: "N" }), speed = this.size({ unit: "m/s" }), f = +this.size({ unit: "Hz" }).toPrecision(3);
    return {
      speeds: [0, speed / 5, speed], times: [0, 1 / f, 4 / f], forces: name === "forces" && this.elements ? [force / 2, force / 3, force / 6] : [1.3 * force, force, force], stiffnesses: [50, 20, 5].map((each) => each * (+this.state.system.stiffness || 1)),
      curve: `${force} * (1 + 0.3 * exp(-v / ${+(speed / 5).toPrecision(3)}))`, tones: [[this.size({ unit: "m" }), f, 0], [this.size({ unit: "m" }) / 3, 3 * f, 0]],
    }[name];
  }
  set(path, value, since = performance.now()) {
    put(this.state, path, value);
    this.changed(path, since);
  }
  // One sentence beside what was changed last; none where all is well.
  fault(path, words) {
    for (const old of this.root.querySelectorAll(".fault")) old.remove();
    if (!words) return;
    const place = this.knobs.get(path?.join(".")) ?? document.getElementById(path?.join("-"))?.parentElement ?? this.root;
    const told = place.appendChild(document.createElement("p"));
    told.className = "fault";
    told.textContent = words.replace(/^the system( \[[^\]]*\])?:? ?/, "").replace(", or raise budget=", "").replace(/correct (\w+)=/g, "correct it").replace(/(\w+)=(?=[ ,.;])/g, "$1");
  }
}
