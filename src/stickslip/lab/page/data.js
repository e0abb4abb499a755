// The records: files dropped, channels looked at, a question asked, its answer shown.

import { prefixed, tick } from "./canvas.js";

const ROLES = {
  x: "displacement", v: "velocity", a: "acceleration", z: "base displacement", friction: "friction force",
  load: "load cell", force: "applied force", normal: "normal force", coefficient: "coefficient of friction",
  theta: "angle", sound: "sound pressure", y: "normal displacement", normal_acceleration: "normal acceleration",
  torsion_velocity: "torsion velocity",
};
const QUESTIONS = {
  analyze: "How much friction is there, and does it stick?",
  decay: "What makes a free decay die away?",
  wavelet: "What rings, and when?",
  squeak: "Does it squeak?",
  fit: "Which friction law is it?",
};
const READING = {
  fs: ["Sampling rate", "Hz", "1000"], time: ["Time column", "", "t, or #1 [ms]"], rows: ["Rows", "", "0:5000"],
  delimiter: ["Delimiter of a text", "", ";"], decimal: ["Decimal sign of a text", "", ","],
};
const FIELDS = {
  mass: ["Mass", "kg", "2.42, or 250 g"], stiffness: ["Spring", "N/m", "2310, or 1.2 N/mm"],
  damping: ["Damping", "N s/m", "0.12"], frequencies: ["Range", "Hz", "500:8000"],
  laws: ["Laws", "all unless given", "Coulomb, compliant"],
  damper: ["Damper ends on", "", ["ground", "base"]], contact: ["Mass slides on", "", ["ground", "base"]],
  curve: ["Or a curve of friction", "", ["coulomb", "viscous", "stribeck", "asymmetric", "tabulated", "dahl", "jenkins",
    "iwan", "maxwell", "aging", "slip"]],
};

let lab;
let root;
let files = [];
let described = null;
let job = null;
let asked = 0;
let charts = [];
const parts = {};

export function start(section, given) {
  lab = given;
  root = section;
  const panel = make("div", { class: "panel" },
    make("h2", {}, "Your records"), dropZone(),
    (parts.files = make("div", { class: "data-files" })),
    (parts.progress = make("div", { class: "data-running" })),
    (parts.asking = make("div", { class: "data-asking" })));
  const shown = make("div", { class: "data-shown" },
    (parts.answer = make("div", { class: "data-answer", tabindex: "-1" })),
    (parts.records = make("div", { class: "data-records" }, welcome())));
  root.replaceChildren(make("div", { class: "beside" }, panel, shown));
  dropping(root);
  lab.onTheme(redraw);
  addEventListener("pagehide", leave);
  lab.sessions.data = { save: () => ({ rig, told, question: parts.question }), load };
  if (lab.restored?.data) load(lab.restored.data);
}

// Of a session the files are not kept: what was said of them and of the rig is.
function load(held) {
  Object.assign(rig, held.rig);
  told = { ...nothing(), ...held.told };
  parts.question = held.question;
  if (ready().length) guarded(describe);
}

function welcome() {
  const steps = [
    "Drop what your rig recorded: displacement, velocity, acceleration, forces or sound, in one file or several.",
    "See the channels as they were understood, and say what the files do not tell.",
    "Ask, and read what was found, with its 95 % interval and what keeps it from being sure.",
  ];
  return make("div", { class: "card data-welcome" }, make("h2", {}, "Drop a record here: get its friction"),
    make("ol", {}, ...steps.map((text) => make("li", {}, text))),
    make("h3", {}, "What is answered"), make("ul", {}, ...Object.values(QUESTIONS).map((text) => make("li", {}, text))),
    make("p", { class: "note" }, "Nothing leaves this computer; files are removed when you close the page."));
}

// ---- files

function dropZone() {
  const input = make("input", { type: "file", multiple: "", id: "data-input", class: "hidden" });
  input.addEventListener("change", () => { const chosen = [...input.files]; input.value = ""; guarded(() => add(chosen)); });
  const example = make("button", { type: "button", id: "data-example" }, "Try the example record");
  example.addEventListener("click", () => guarded(useExample));
  const zone = make("div", { class: "data-drop" },
    make("p", {}, "Drop files here, or"), input, make("label", { for: "data-input", class: "button" }, "Choose files …"),
    make("p", { class: "note" }, "CSV, oscilloscopes, TDMS, UFF, MAT, WAV, HDF5, Parquet, LVM, JSON, MCAP, ROS bags, MDF"), example);
  return zone;
}

function dropping(place) {
  for (const kind of ["dragenter", "dragover"]) {
    place.addEventListener(kind, (event) => { event.preventDefault(); place.classList.add("data-over"); });
  }
  place.addEventListener("dragleave", (event) => {
    if (!place.contains(event.relatedTarget)) place.classList.remove("data-over");
  });
  place.addEventListener("drop", (event) => {
    event.preventDefault();
    place.classList.remove("data-over");
    const dropped = [...event.dataTransfer.files];
    guarded(() => add(dropped));
  });
}

async function add(chosen) {
  if (!ready().length && !lab.restored?.data) told = nothing();
  const { largest } = await lab.ask("files");
  for (const file of chosen) {
    const entry = { name: file.name, size: file.size, sent: 0, id: null, error: "" };
    files.push(entry);
    if (file.size > largest) entry.error = `larger than ${size(largest)}, which is the limit here`;
  }
  showFiles();
  for (const [entry, file] of files.slice(-chosen.length).map((each, number) => [each, chosen[number]])) {
    if (entry.error) continue;
    try {
      entry.id = (await send(file, entry)).id;
      entry.sent = entry.size;
    } catch (error) {
      entry.error = error.message;
    }
    showFiles();
  }
  await guarded(describe);
}

function send(file, entry) {
  return new Promise((resolve, reject) => {
    const request = entry.request = new XMLHttpRequest();
    request.onabort = () => reject(new Error("removed before it was sent"));
    request.open("POST", `files?name=${encodeURIComponent(file.name)}`);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.onprogress = (event) => { entry.sent = event.loaded; entry.bar?.setAttribute("value", event.loaded); };
    request.onload = () => {
      const told = JSON.parse(request.responseText || "{}");
      if (request.status === 201) resolve(told);
      else reject(new Error(told.error || `the lab answered ${request.status}`));
    };
    request.onerror = () => reject(new Error("the lab does not answer; is it still running?"));
    request.send(file);
  });
}

async function useExample() {
  const told = await lab.ask("files/example", { method: "POST" });
  files.push({ ...told, sent: told.size, error: "" });
  showFiles();
  await describe();
}

function showFiles() {
  const rows = files.map((entry) => {
    const remove = make("button", { type: "button", "aria-label": `Remove ${entry.name}` }, "Remove");
    remove.addEventListener("click", () => guarded(() => forget(entry)));
    entry.bar = make("progress", { max: entry.size || 1, value: entry.sent, "aria-label": `${entry.name} sent` });
    const state = entry.error ? make("span", { class: "data-error" }, entry.error) : entry.id ? "" : entry.bar;
    return make("li", {}, make("strong", {}, entry.name), ` ${size(entry.size)} `, state, " ", remove);
  });
  const pieces = [make("ul", { class: "data-list" }, ...rows)];
  if (ready().length > 1) {
    pieces.push(choice("data-together", "These files are", { apart: "one record each", together: "parts of one record" },
      parts.together || "apart", (value) => { parts.together = value; guarded(describe); }));
  }
  if (ready().length) pieces.push(howRead());
  parts.files.replaceChildren(...(files.length ? pieces : []));
}

// What the files may leave open, to be said at any time: also where one could not be read.
function howRead() {
  const boxes = Object.entries(READING).map(([name, [label, unit, hint]]) => {
    const [box, input] = field(`data-read-${name}`, label, unit, hint, told[name]);
    input.addEventListener("change", () => { told[name] = input.value.trim(); guarded(describe); });
    return box;
  });
  const more = make("details", {}, make("summary", {}, "How the files are read"), ...boxes);
  more.open = Object.keys(READING).some((name) => told[name]);
  return more;
}

async function forget(entry) {
  if (entry === ready()[0]) told = nothing(); // what was said of its columns
  files = files.filter((each) => each !== entry);
  entry.request?.abort();
  if (entry.id) await lab.ask(`files/${entry.id}`, { method: "DELETE" });
  showFiles();
  await describe();
}

function leave() {
  for (const id of [job, parts.job]) if (id) fetch(`jobs/${id}`, { method: "DELETE", keepalive: true });
  for (const { id } of ready()) fetch(`files/${id}`, { method: "DELETE", keepalive: true });
}

function ready() {
  return files.filter((entry) => entry.id);
}

function records() {
  const keys = ready().map((entry) => entry.id);
  return parts.together === "together" ? [keys] : keys.map((key) => [key]);
}

// ---- channels

const rig = {}; // what was typed of the rig: it stays when the question or the record changes
const nothing = () => ({ columns: null, repair: [], fs: "", time: "", delimiter: "", decimal: "", rows: "" });
let told = nothing();

// What stands is replaced when the answer comes, and the focus stays where it was.
async function describe() {
  if (!ready().length) {
    parts.records.replaceChildren(welcome());
    parts.asking.replaceChildren();
    parts.answer.replaceChildren();
    return;
  }
  const answer = await run("describe", {});
  if (!answer) return;
  described = answer;
  const focus = document.activeElement?.id;
  parts.records.replaceChildren(...answer.records.map(showRecord));
  showQuestions();
  if (focus) document.getElementById(focus)?.focus();
  lab.say(`${answer.records.map((record) => record.name).join(", ")} read`);
}

function reading() {
  const said = { repair: told.repair };
  for (const name of Object.keys(READING)) if (told[name]) said[name] = told[name];
  if (told.columns) {
    said.channels = Object.fromEntries(told.columns.map(({ name, column, unit }) =>
      [name, `\`${column}\`${unit ? ` [${unit}]` : ""}`]));
  }
  return said;
}

function showRecord(record, number) {
  const length = record.duration === null ? "" : `, ${digits(record.duration)} s at ${digits(record.fs)} Hz`;
  const box = make("article", { class: "card data-record" },
    make("h2", {}, record.name), make("p", {}, `${record.rows.toLocaleString("en")} rows${length}`));
  if (record.fs === null) box.append(rateField(record.asks));
  if (record.unknown.length) {
    box.append(make("p", { class: "data-needed" }, `The file states no unit for ${record.unknown.join(", ")}: ` +
      "write it below (what has a known meaning is taken in SI units otherwise)."));
  }
  box.append(make("p", { class: "note" }, "Where a column was not understood, choose under “Is” what it measures."),
    channelTable(record, number), ...(record.fs === null ? [] : [chosen(record)]), previews(record));
  if (record.faults.length) box.append(make("h3", {}, "What the check-up found"), faults(record));
  if (record.notes.length) {
    box.append(make("details", {}, make("summary", {}, "How it was read"),
      make("ul", {}, ...record.notes.map((note) => make("li", {}, note)))));
  }
  return box;
}

function rateField(asks) {
  const [box, input] = field("data-fs", "Sampling rate", "Hz", "1000", told.fs);
  input.required = true;
  input.addEventListener("change", () => { told.fs = input.value.trim(); showFiles(); guarded(describe); });
  return make("div", { class: "data-needed" }, make("p", {}, asks), box);
}

function channelTable(record, number) {
  const head = make("tr", {}, ...["Column", "Is", "Unit", "From", "To"].map((text) => make("th", { scope: "col" }, text)));
  const rows = record.channels.map((channel, row) => {
    const column = told.columns?.[row]?.column || channel.column;
    const words = { ...ROLES };
    if (!(channel.name in words)) words[channel.name] = `${channel.name} (not used)`;
    const role = select(`data-role-${number}-${column}`, words, channel.name);
    role.setAttribute("aria-label", `What ${column} is`);
    const typed = told.columns?.[row]?.unit;
    const unit = make("input", { type: "text", size: "7", value: typed || (record.unknown.includes(channel.name) ? "" : channel.unit) });
    unit.id = `data-unit-${number}-${column}`;
    unit.setAttribute("aria-label", `Unit of ${column}`);
    if (record.unknown.includes(channel.name)) {
      unit.placeholder = channel.unit === "1" ? "unit?" : `${channel.unit}?`;
      unit.classList.add("data-needed");
    }
    const change = () => retell(record, row, role.value, unit.value.trim());
    role.addEventListener("change", change);
    unit.addEventListener("change", change);
    return make("tr", {}, make("th", { scope: "row" }, column), make("td", {}, role), make("td", {}, unit),
      make("td", {}, amount(channel.low, channel.unit)), make("td", {}, amount(channel.high, channel.unit)));
  });
  return make("div", { class: "data-scroll", tabindex: "0", role: "region", "aria-label": `Channels of ${record.name}` },
    make("table", {}, make("thead", {}, head), make("tbody", {}, ...rows)));
}

// All columns, with what was said of one: the library reads the file again by this map.
function retell(record, number, name, unit) {
  told.columns ??= record.channels.map((channel) => ({ column: channel.column, name: channel.name, unit: "" }));
  const other = told.columns.find((each) => each.name === name);
  if (other) other.name = told.columns[number].name;
  told.columns[number].name = name;
  if (unit !== record.channels[number].unit) told.columns[number].unit = unit;
  guarded(describe);
}

function previews(record) {
  const box = make("div", { class: "data-previews" });
  queueMicrotask(() => {
    for (const channel of record.channels) {
      const place = make("div", { class: "data-preview" });
      box.append(place);
      draw(place, {
        title: ROLES[channel.name] || channel.name, unit: channel.unit, time: record.preview.time,
        series: [{ label: channel.name, values: record.preview.channels[channel.name] }],
        chosen: (from, to) => span(record, from, to),
      });
    }
  });
  return box;
}

// A stretch of time, dragged over: only its rows are read from then on.
function span(record, from, to) {
  const before = told.rows ? Number(told.rows.split(":")[0]) || 0 : 0;
  const row = (time) => before + Math.max(0, Math.round((time - record.start) * record.fs));
  told.rows = `${row(from)}:${row(to) + 1}`;
  showFiles();
  guarded(describe);
}
function chosen(record) {
  if (!told.rows) return make("p", { class: "note" }, "Drag over a stretch of a chart to take its rows alone.");
  const all = make("button", { type: "button", id: "data-all-rows" }, "Take all rows again");
  all.addEventListener("click", () => { told.rows = ""; showFiles(); guarded(describe); });
  return make("p", { class: "note" }, `Rows ${told.rows}, from ${digits(record.start)} s. `, all);
}

function faults(record) {
  return make("ul", { class: "data-faults" }, ...record.faults.map((fault, number) => {
    const line = make("li", {}, fault.message);
    if (fault.repair) {
      const box = make("input", { type: "checkbox", id: `data-repair-${record.name}-${number}` });
      box.checked = told.repair.includes(fault.repair);
      box.addEventListener("change", () => {
        told.repair = told.repair.filter((each) => each !== fault.repair).concat(box.checked ? [fault.repair] : []);
        guarded(describe);
      });
      line.append(" ", make("label", {}, box, " mend it"));
    }
    return line;
  }));
}

// ---- questions

function showQuestions() {
  const able = Object.keys(QUESTIONS).filter((name) => described.questions[name].able);
  if (!able.includes(parts.question)) parts.question = able[0];
  const options = Object.entries(QUESTIONS).map(([name, words]) => {
    const asked = described.questions[name];
    const input = make("input", { type: "radio", name: "data-question", id: `data-ask-${name}`, value: name });
    input.checked = name === parts.question;
    input.disabled = !asked.able;
    input.addEventListener("change", () => { parts.question = name; showFields(); });
    const why = asked.able ? "" : make("small", {}, ` (${asked.why})`);
    return make("div", {}, input, make("label", { for: `data-ask-${name}` }, ` ${words}`, why));
  });
  parts.form = make("form", { class: "data-form" });
  parts.form.addEventListener("change", ({ target }) => { if (target.dataset.option) rig[target.dataset.option] = target.value; });
  parts.form.addEventListener("submit", (event) => { event.preventDefault(); guarded(() => askIt()); });
  parts.asking.replaceChildren(make("fieldset", {}, make("legend", {}, "Ask"), ...options), parts.form);
  showFields();
}

function showFields() {
  const asked = described.questions[parts.question];
  const stated = described.records[0].stated || {};
  const one = (name, needed) => {
    const [label, unit, hint] = FIELDS[name];
    const id = `data-option-${name}`;
    if (Array.isArray(hint)) {
      const words = Object.fromEntries([["", "not stated"], ...hint.map((each) => [each, each])]);
      const input = select(id, words, "");
      input.dataset.option = name;
      input.value = rig[name] ?? "";
      return make("div", { class: "data-field" }, make("label", { for: id }, label), input);
    }
    const [box, input] = field(id, label, unit, hint, rig[name] ?? (name in stated ? digits(stated[name]) : ""));
    input.required = needed;
    input.dataset.option = name;
    if (needed) input.dataset.needed = name;
    return box;
  };
  const loads = asked.may.includes("normal") ? described.records.map((record, number) => {
    const name = described.records.length > 1 ? `Normal load, ${record.name}` : "Normal load";
    const [box, input] = field(`data-normal-${number}`, name, "N", "2.45", "");
    input.dataset.normal = number;
    return box;
  }) : [];
  const may = asked.may.filter((name) => name in FIELDS).map((name) => one(name, false));
  const more = make("details", {}, make("summary", {}, "What else you know of the rig"), ...may, ...loads);
  more.open = Object.keys(stated).length > 0 && asked.needs.length === 0;
  const needs = asked.needs.map((name) => one(name, true));
  const button = make("button", { type: "submit", class: "main", id: "data-run" }, "Ask the record");
  if (described.needs.length) button.disabled = true;
  parts.form.replaceChildren(
    ...(needs.length ? [make("p", {}, "The record can not tell this:"), ...needs] : []),
    ...(may.length + loads.length ? [more] : []), button);
  parts.form.querySelector("[data-option=curve]")?.addEventListener("change", (event) => needed(!event.target.value));
}

// A curve is fitted without mass and spring where friction is measured; the library says where it is not.
function needed(are) {
  for (const input of parts.form.querySelectorAll("[data-needed]")) input.required = are;
}

function options() {
  const said = {};
  for (const input of parts.form.querySelectorAll("[data-option]")) {
    if (input.value.trim()) said[input.dataset.option] = input.value.trim();
  }
  if (said.curve) delete said.laws;
  const loads = [...parts.form.querySelectorAll("[data-normal]")].map((input) => input.value.trim() || null);
  if (loads.some(Boolean)) said.normal = loads;
  return said;
}

async function askIt(more = {}) {
  const said = { ...options(), ...more };
  const answer = await run(parts.question, said);
  if (answer) showAnswer(answer, commandLine(parts.question, said), said);
}

// What to type for the same answer.
function commandLine(question, said) {
  const quoted = (text) => (/^[\w.,:+-]+$/.test(text) ? text : `'${String(text).replaceAll("'", "'\\''")}'`);
  const names = ready().map((entry) => entry.name);
  const groups = parts.together === "together" ? [names.join("+")] : names;
  const words = ["stickslip", question, ...groups.map(quoted)];
  const give = (name, value) => words.push(`--${name.replaceAll("_", "-")}`, quoted(value));
  const { channels = {}, repair, ...read } = reading();
  for (const [name, column] of Object.entries(channels)) give("channels", `${name}=${column}`);
  if (repair.length) give("repair", repair.join(","));
  const { normal = [], twins, ...plain } = said;
  if (question === "analyze" && !twins) give("twins", "0");
  for (const [name, value] of Object.entries({ ...read, ...plain })) give(name, value);
  normal.forEach((load, number) => { if (load) give("normal", groups.length > 1 ? `${groups[number]}=${load}` : load); });
  return words.join(" ");
}

// ---- running

// One at a time: a new question stops the one before, whose answer nobody waits for any more.
async function run(question, said) {
  parts.answer.replaceChildren();
  const mine = ++asked;
  const before = [job, parts.job].filter(Boolean);
  job = parts.job = null;
  for (const id of before) await lab.ask(`jobs/${id}`, { method: "DELETE" }).catch(() => {}); // it may be gone already
  if (mine !== asked) return null;
  const body = JSON.stringify({ question, records: records(), reading: reading(), options: said });
  const { id } = await lab.ask("jobs", { method: "POST", headers: { "Content-Type": "application/json" }, body });
  if (mine !== asked) {
    await lab.ask(`jobs/${id}`, { method: "DELETE" });
    return null;
  }
  job = id;
  const bar = make("progress", { max: 1, "aria-label": "How far it is" });
  const words = make("span", { class: "data-words" }, "starting");
  const stop = make("button", { type: "button", id: "data-cancel" }, "Cancel");
  stop.addEventListener("click", () => guarded(() => lab.ask(`jobs/${id}`, { method: "DELETE" })));
  parts.progress.replaceChildren(bar, " ", words, " ", stop);
  await ended(id, (told) => {
    words.textContent = told.words;
    if (told.state === "running") bar.value = told.share;
  });
  const { state, message, answer } = await lab.ask(`jobs/${id}`);
  if (mine !== asked) return null;
  job = null;
  parts.progress.replaceChildren();
  if (state === "done") {
    parts.job = id;
    return answer;
  }
  fail(message);
  return null;
}

function ended(id, watch) {
  return new Promise((resolve) => {
    const source = new EventSource(`jobs/${id}/events`);
    source.onmessage = (event) => {
      const told = JSON.parse(event.data);
      watch(told);
      if (!["waiting", "running"].includes(told.state)) { source.close(); resolve(); }
    };
    source.onerror = () => {
      if (source.readyState === EventSource.CLOSED) resolve();
    };
  });
}

function fail(message) {
  lab.say("");
  parts.answer.replaceChildren(make("p", { class: "card data-error", role: "alert" }, message));
}

async function guarded(work) {
  try {
    await work();
  } catch (error) {
    parts.progress.replaceChildren();
    fail(error.message);
  }
}

// ---- the answer

function showAnswer(answer, command, said) {
  const link = (path, text) => make("a", { href: `jobs/${parts.job}/${path}`, download: "", class: "button" }, text);
  const most = 8, rows = answer.lines.map((line) => make("tr", {}, make("th", { scope: "row" }, line[0]),
    ...line.slice(1, 3).map((cell) => make("td", {}, cell)), make("td", {}, line[3] ? `see ${line[3]}` : "ok")));
  const overlay = make("div", { class: "data-overlay" });
  parts.answer.replaceChildren(make("article", { class: "card" },
    make("h2", {}, answer.title),
    ...answer.headline.map((text) => make("p", { class: "data-headline" }, text)),
    ...answer.cautions.map((text, j) => make("p", { class: "data-caution" }, `${j + 1}. `, text)),
    ...(rows.length ? [results("data-results", rows.slice(0, most))] : []),
    ...(rows.length > most ? [folded(`${rows.length - most} more quantities`, results("data-more", rows.slice(most)))] : []),
    overlay, ...heard(answer.sounds), ...answer.figures.map(pictured),
    make("p", { class: "data-downloads" }, link("report?keep=1", "Report (HTML)"), link("results.json", "Numbers (JSON)"),
      link("results.zip", "All with figures (ZIP)"),
      make("a", { href: `jobs/${parts.job}/report`, target: "_blank", rel: "noopener", class: "button" }, "Report in a tab"),
      ...(parts.question === "analyze" && !said.twins ? [onTwins()] : [])),
    ...(answer.state ? [playIt(answer.state)] : []),
    folded("The same on the command line", make("pre", {}, command)),
    ...(answer.notes.length ? [folded("Notes", make("ul", {}, ...answer.notes.map((note) => make("li", {}, note))))] : [])));
  for (const each of answer.overlay) {
    const place = make("div", { class: "data-preview" });
    overlay.append(place);
    draw(place, {
      title: `${each.record}: ${ROLES[each.channel] || each.channel}, measured and fitted`, unit: each.unit, time: each.time,
      series: [{ label: "measured", values: each.measured }, { label: "fitted", values: each.fitted, dash: [7, 4] }],
    });
  }
  parts.answer.focus();
  lab.say("Done.");
}

function results(id, rows) {
  const head = ["Quantity", "Value", "95 % interval", "How sure"].map((text) => make("th", { scope: "col" }, text));
  return make("div", { class: "data-scroll" },
    make("table", { id, class: "data-results" }, make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows)));
}

function folded(words, ...within) {
  return make("details", {}, make("summary", {}, words), ...within);
}

// A figure as the report has it; the first is open.
function pictured([title, svg, caption], number) {
  const image = make("img", { src: `data:image/svg+xml,${encodeURIComponent(svg)}`, alt: title, class: "data-figure" });
  const box = folded(title, image, make("p", { class: "note" }, caption));
  box.open = number === 0;
  return box;
}

function heard(sounds) {
  return sounds.map(([caption, wav]) => make("p", { class: "data-sound" },
    make("audio", { controls: "", preload: "none", src: `data:audio/wav;base64,${wav}`, "aria-label": caption }), ` ${caption}`));
}

function onTwins() {
  const button = make("button", { type: "button", id: "data-twins" }, "Try the answers on 40 simulated rigs (a minute or two)");
  button.addEventListener("click", () => guarded(() => askIt({ twins: true })));
  return button;
}

function playIt(state) {
  const button = make("button", { type: "button", id: "data-play" }, "Play with the fitted law");
  button.addEventListener("click", () => lab.openInPlay(state));
  return make("p", {}, button);
}

// ---- charts, drawn again when the theme changes

function draw(place, told) {
  charts.push({ place, told, chart: plot(place, told) });
}

function redraw() {
  charts = charts.filter(({ place }) => place.isConnected);
  for (const each of charts) {
    each.chart.destroy();
    each.chart = plot(each.place, each.told);
  }
}

// ---- pieces

function make(tag, attributes, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

function field(id, label, unit, hint, value) {
  const input = make("input", { type: "text", id, placeholder: hint, value, autocomplete: "off" });
  return [make("div", { class: "data-field" }, make("label", { for: id }, unit ? `${label} [${unit}]` : label), input), input];
}

function select(id, words, value) {
  const element = make("select", { id });
  for (const [key, text] of Object.entries(words)) element.append(make("option", { value: key }, text));
  element.value = value;
  return element;
}

function choice(id, label, words, value, change) {
  const element = select(id, words, value);
  element.addEventListener("change", () => change(element.value));
  return make("div", { class: "data-field" }, make("label", { for: id }, label), element);
}

function size(bytes) {
  return bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function digits(value) {
  return String(Number(value.toPrecision(6)));
}

// In a readable unit, as the traces of a motion have it.
function amount(value, unit) {
  if (value === null) return "";
  const [factor, words] = prefixed(Math.abs(value), unit);
  return `${Number((value * factor).toPrecision(4))} ${words}`;
}

// A chart over time: {title, unit, time, series: [{label, values, colour, dash}]}.
function plot(element, { title, unit, time, series, chosen }) {
  const palette = lab.colours();
  const axis = {
    stroke: palette.soft, grid: { stroke: palette.line, width: 1 }, ticks: { stroke: palette.line },
    values: (chart, splits) => splits.map(tick),
  };
  const inks = ["blue", "orange", "green", "purple", "sky", "ink"];
  const lines = series.map(({ label, colour, dash }, j) =>
    ({ label, stroke: colour ?? palette[inks[j % 6]], width: 1.4, dash, points: { show: false } }));
  const chart = new uPlot({
    width: element.clientWidth || 600, height: 220, title, legend: { show: true }, scales: { x: { time: false } },
    axes: [{ ...axis, label: "time [s]" }, { ...axis, label: unit, size: 70 }], series: [{ label: "time" }, ...lines],
    cursor: { drag: { x: true, y: false, setScale: !chosen } },
    hooks: chosen ? { setSelect: [({ select: { left, width }, posToVal }) => { if (width > 4) chosen(posToVal(left, "x"), posToVal(left + width, "x")); }] } : {},
  }, [time, ...series.map((line) => line.values)], element);
  new ResizeObserver(() => chart.setSize({ width: element.clientWidth, height: 220 })).observe(element);
  return chart;
}
