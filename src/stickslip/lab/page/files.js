// What leaves Play as text or a file, and comes back from one.
const $ = (id) => document.getElementById(id);

export function saved(text, name) {
  const href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const anchor = Object.assign(document.createElement("a"), { href, download: name });
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 1000);
}
async function copied(lab, text, words) {
  const refused = () => lab.say("The browser does not let the page copy; the address bar holds the link.", true);
  await Promise.resolve().then(() => navigator.clipboard.writeText(text)).then(() => lab.say(words), refused);
}
export async function shared({ lab, link }) {
  history.replaceState(null, "", link());
  const words = "The link is copied: it opens this very system in any lab at this address.";
  await copied(lab, `${location.origin}/${link()}`, words);
}
function dialog() {
  const made = Object.assign(document.createElement("dialog"), { id: "text" });
  made.setAttribute("aria-labelledby", "text-title");
  made.innerHTML = `<h2 id="text-title"></h2>
    <pre id="text-body" tabindex="0"></pre>
    <div class="bar"><button id="text-copy" type="button">Copy</button><button id="text-save" type="button">Save as a file</button><span class="gap"></span><button id="text-close" type="button">Close</button></div>`;
  return made;
}
export async function texts({ lab, current }, form, title, file) {
  const headers = { "content-type": "application/json" };
  const held = await lab.ask("export", { method: "POST", body: JSON.stringify(current()), headers });
  if (!$("text")) $("play").append(dialog());
  $("text-title").textContent = title;
  $("text-body").textContent = held[form];
  $("text-close").onclick = () => $("text").close();
  $("text-copy").onclick = () => copied(lab, held[form], "Copied.");
  $("text-save").onclick = () => saved(held[form], file);
  $("text").showModal();
}

// What a session's file holds: what plays, what was kept as A, and what each other tab says of itself.
export function saveSession({ lab, current, kept }) {
  const others = Object.entries(lab.sessions).map(([name, { save }]) => [name, save()]);
  const held = { program: "stickslip lab", play: current(), a: kept(), ...Object.fromEntries(others) };
  saved(JSON.stringify(held, null, 1), "session.json");
}
export async function openFile({ lab, opened, restored }) {
  const [file] = $("file").files;
  $("file").value = "";
  if (!file) return;
  const text = await file.text();
  if (file.name.endsWith(".json")) {
    const held = JSON.parse(text);
    if (held.program !== "stickslip lab" || !held.play) throw new Error("The file holds no session of the lab; open one that it saved.");
    restored(held.a);
    for (const [name, { load }] of Object.entries(lab.sessions)) if (held[name]) load(held[name]);
    lab.restored = held;
    opened(held.play);
  } else {
    const headers = { "content-type": "text/plain" };
    opened((await lab.ask("open", { method: "POST", body: text, headers })).state);
  }
  lab.say(`${file.name} is open.`);
}
