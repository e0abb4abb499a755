// The page itself: tabs, theme, what is said aloud, and how the lab is asked.
import { start as startPlay } from "./play.js";

if (location.pathname !== "/") localStorage.setItem("inside", location.pathname); // for enter.js; other ports do not see it
const $ = (id) => document.getElementById(id);
const TABS = ["play", "map", "data", "live"];
const LEADS = {
  play: "Move a slider: the motion is computed anew, exactly, while you drag.",
  map: "Which motion is where: choose two parameters, then click a point to play it.",
  data: "Drop a record: get its friction.",
  live: "Watch a rig as it is measured, and record it.",
};
const onTheme = [];

export function say(words, wrong = false) {
  clearInterval(ticking);
  $("waiting").hidden = true;
  $("status").textContent = words;
  $("status").classList.toggle("wrong", wrong);
}

// Work that takes long: what it is, for how many seconds, and a way to end it, until something else is said.
let ticking = 0;
const COMPILES = "Compiling for this kind of motion: once after an installation, up to a minute. It is kept.";
function busy(words, since, cancel) {
  say(words);
  const tell = () => { $("elapsed").textContent = `${Math.round((performance.now() - since) / 1000)} s`; };
  ticking = setInterval(tell, 500);
  tell();
  $("waiting").hidden = false;
  $("waiting-cancel").hidden = !cancel;
  $("waiting-cancel").onclick = cancel;
}

export async function ask(path, options = {}) {
  const answer = await fetch(path, { credentials: "same-origin", ...options }).catch(() => {
    throw new Error("The lab does not answer; is 'stickslip lab' still running?");
  });
  const held = answer.status === 204 ? {} : await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(held.error ?? `The lab answered ${answer.status}.`);
  return held;
}

export function colours() {
  const style = getComputedStyle(document.documentElement);
  const names = "paper card ink soft faint line blue orange green purple sky stick microstick flight accent".split(" ");
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

function theme(choice) {
  document.documentElement.dataset.theme = choice;
  for (const then of onTheme) then(colours());
}

export function show(name) {
  for (const tab of TABS) {
    const chosen = tab === name;
    $(tab).hidden = !chosen;
    $(`tab-${tab}`).setAttribute("aria-selected", chosen);
    $(`tab-${tab}`).tabIndex = chosen ? 0 : -1;
  }
  $("lead").textContent = LEADS[name];
  say("");
  opened[name]?.();
  lab.onShow[name]?.();
}

// Tabs that are opened later: each loads its part, and what they wear.
const dressed = () => new Promise((done) => {
  document.head.append(Object.assign(document.createElement("link"), { rel: "stylesheet", href: "tabs.css", onload: done, onerror: done }));
});
let dress = null;
const opened = Object.fromEntries(["map", "data", "live"].map((name) => [name, () => {
  opened[name] = null;
  Promise.all([import(`./${name}.js`), dress ??= dressed(), name === "map" && ready]).then(([page]) => page.start($(name), lab));
}]));

export const lab = {
  ask, say, busy, COMPILES, colours, show,
  onTheme: (then) => onTheme.push(then),
  openInPlay: null, // by play.js
  sessions: {}, // by tab: {save, load} of what a session's file holds of it
  restored: null, // the session that was opened last: a tab that opens later takes its part
  onShow: {}, // by tab: what it does when it is shown again
};

for (const name of TABS) {
  $(`tab-${name}`).addEventListener("click", () => show(name));
  $(`tab-${name}`).addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = TABS[(TABS.indexOf(name) + step + TABS.length) % TABS.length];
    show(next);
    $(`tab-${next}`).focus();
  });
}
const dark = matchMedia("(prefers-color-scheme: dark)");
theme(dark.matches ? "dark" : "light");
dark.addEventListener("change", () => theme(dark.matches ? "dark" : "light"));
$("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
const ready = startPlay(lab);
