// The record with its model over it, its cycles as loops, and the command that asks about a span. No library, no network.
"use strict";
for (const place of document.querySelectorAll(".scope")) {
  const told = JSON.parse(place.querySelector("script").textContent);
  const one = (name) => place.querySelector(`[data-part=${name}]`);
  const chart = one("chart"), round = one("loop"), reading = one("reading");
  const LEFT = 52, BOTTOM = 24, GAP = 10, MOST_CYCLES = 40, NEAR = 6;
  const [near, far] = told.detail, end = told.count - 1;
  const friction = told.panels.find((panel) => panel.name === "friction");
  const cycles = told.cycles.map((time) => [time, time + told.period]);
  const folder = location.protocol === "file:" ? decodeURIComponent(location.pathname).replace(/[^/]*$/, "") : "";
  const here = folder.replaceAll("'", "'\\''");
  let view = [0, end], span = null, pointer = null, chosen = -1, drag = null, paper = false;

  function row(time) { return (time - told.start) * told.fs; }
  const time = (at) => told.start + at / told.fs;

  // Two bytes a value; 65535 is a gap.
  function decoded(text, line) {
    const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
    const levels = new DataView(bytes.buffer), values = new Float64Array(bytes.length / 2);
    for (let j = 0; j < values.length; j++) {
      const level = levels.getUint16(2 * j, true);
      values[j] = level === 65535 ? NaN : line.low + line.step * level;
    }
    return values;
  }
  for (const panel of [...told.panels, ...(told.across ? [told.across] : [])])
    for (const line of Object.values(panel.lines)) {
      line.values = decoded(line.detail, line);
      line.outline = line.whole ? decoded(line.whole, line) : null;
    }

  const colour = (name) => paper ? { ink: "#000", soft: "#444", rule: "#ccc", blue: "#0072b2", orange: "#d55e00", faint: "#999", shade: "#dde3ea" }[name]
    : getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  // The model is a thin line on a broad, pale one: both are seen where they agree.
  const STYLES = { measured: ["blue", 3, 0.5], model: ["orange", 1.3, 1], left: ["ink", 1, 1] };
  const style = (name) => (name === "measured" && !told.model ? ["blue", 1.5, 1] : STYLES[name] || ["faint", 1, 1]);

  function surface(canvas) {
    const scale = window.devicePixelRatio || 1, { width, height } = canvas.getBoundingClientRect();
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.font = "11px system-ui, sans-serif";
    return { pen, width, height };
  }

  function ticks(low, high, most) {
    const raw = (high - low) / most, size = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((each) => each * size).find((each) => each >= raw) || 10 * size;
    const found = [];
    for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) found.push(Math.abs(value) < step / 1e6 ? 0 : value);
    return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  }

  // What of a line lies in the view: samples where the page holds them, else the least and the most of each column.
  function seen(line, [from, to]) {
    if (!line.outline || (from >= near && to <= far - 1)) {
      const first = Math.max(0, Math.floor(from) - near), last = Math.min(line.values.length - 1, Math.ceil(to) - near);
      return { at: (j) => near + first + j, values: line.values.subarray(first, last + 1) };
    }
    const wide = told.count / line.outline.length, first = Math.max(0, Math.floor(from / wide)), last = Math.ceil(to / wide);
    return { at: (j) => (first + j) * wide, values: line.outline.subarray(first, last + 1) };
  }

  function range(parts) {
    let low = Infinity, high = -Infinity;
    for (const values of parts) for (const value of values) if (value === value) { low = Math.min(low, value); high = Math.max(high, value); }
    const room = (high - low) * 0.06 || 1;
    return low <= high ? [low - room, high + room] : [-1, 1];
  }

  function curve(pen, { at, values }, x, y, name) {
    const [ink, width, alpha] = style(name), columns = Math.max(1, Math.floor(values.length / 1500));
    pen.strokeStyle = colour(ink);
    pen.lineWidth = width;
    pen.lineJoin = "round";
    pen.globalAlpha = alpha;
    pen.beginPath();
    let down = false;
    const put = (j) => {
      if (values[j] !== values[j]) { down = false; return; }
      pen[down ? "lineTo" : "moveTo"](x(at(j)), y(values[j]));
      down = true;
    };
    if (columns < 3) for (let j = 0; j < values.length; j++) put(j);
    else for (let j = 0; j < values.length; j += columns) { // the least and the most of some samples, in one column
      let low = j, high = j;
      for (let k = j; k < Math.min(j + columns, values.length); k++) { if (values[k] < values[low]) low = k; if (values[k] > values[high]) high = k; }
      put(Math.min(low, high));
      put(Math.max(low, high));
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  function drawChart() {
    const { pen, width, height } = surface(chart), each = (height - BOTTOM) / told.panels.length;
    const x = (at) => LEFT + (width - LEFT - 4) * (at - view[0]) / (view[1] - view[0]);
    const shade = ([from, to], name) => {
      const left = Math.max(LEFT, x(from)), right = Math.min(width, x(to));
      if (right <= left) return; // out of view
      pen.fillStyle = colour(name);
      pen.globalAlpha = 0.45;
      pen.fillRect(left, 0, right - left, height - BOTTOM);
      pen.globalAlpha = 1;
    };
    if (chosen >= 0 && row(cycles[chosen][1]) > view[0]) shade(cycles[chosen].map(row), "shade");
    if (span) shade(span, "sky");
    told.panels.forEach((panel, place) => {
      const top = place * each + GAP + 8, floor = (place + 1) * each - 2;
      const parts = Object.entries(panel.lines).map(([name, line]) => [name, seen(line, view)]);
      const [low, high] = range(parts.map(([, part]) => part.values));
      const y = (value) => floor - (floor - top) * (value - low) / (high - low);
      const { found, digits } = ticks(low, high, Math.min(8, Math.max(2, (floor - top) / 14)));
      pen.fillStyle = colour("soft");
      pen.textAlign = "right";
      pen.textBaseline = "middle";
      pen.strokeStyle = colour("rule");
      pen.lineWidth = 1;
      for (const value of found) {
        pen.fillText(value.toFixed(digits), LEFT - 6, y(value));
        pen.beginPath(); pen.moveTo(LEFT, y(value)); pen.lineTo(width, y(value)); pen.stroke();
      }
      pen.save();
      pen.beginPath(); pen.rect(LEFT, top - 2, width - LEFT, floor - top + 4); pen.clip();
      for (const [name, part] of parts.reverse()) if (name !== "model") curve(pen, part, x, y, name);
      const model = parts.find(([name]) => name === "model");
      if (model) curve(pen, model[1], x, y, "model");
      pen.restore();
      pen.textAlign = "left";
      pen.textBaseline = "alphabetic";
      pen.fillStyle = colour("ink");
      const merit = panel.merit === null ? "" : `   model fits ${panel.merit.toFixed(panel.merit > 99 ? 2 : 1)} %`;
      const beside = Object.keys(panel.lines).filter((name) => !(name in STYLES)).map((name) => `, thin: ${name}`).join("");
      pen.fillText(`${panel.name}${panel.unit ? ` [${panel.unit}]` : ""}${beside}${merit}`, LEFT + 2, top - 5);
    });
    const { found, digits } = ticks(time(view[0]), time(view[1]), width / 90);
    pen.fillStyle = colour("soft");
    pen.textAlign = "center";
    for (const value of found) if (x(row(value)) > LEFT + 12) pen.fillText(value.toFixed(digits), Math.min(x(row(value)), width - pen.measureText(value.toFixed(digits)).width / 2), height - 8);
    pen.textAlign = "right";
    pen.fillText("t [s]", LEFT - 6, height - 8);
    if (pointer !== null) {
      pen.strokeStyle = colour("ink");
      pen.globalAlpha = 0.5;
      pen.beginPath(); pen.moveTo(x(pointer), 0); pen.lineTo(x(pointer), height - BOTTOM); pen.stroke();
      pen.globalAlpha = 1;
    }
  }

  function drawLoop() {
    if (!round) return;
    const { pen, width, height } = surface(round), left = 44, top = 16, floor = height - 34;
    const cut = ([from, to]) => [Math.round(row(from)) - near, Math.round(row(to)) - near + 1];
    const shown = cycles.length > MOST_CYCLES ? cycles.filter((_, j) => j % Math.ceil(cycles.length / MOST_CYCLES) === 0) : cycles;
    const all = shown.map(cut), own = cut(cycles[Math.max(0, chosen)] || [time(near), time(far - 1)]);
    const u = told.across.lines, f = friction.lines;
    const part = (line, [from, to]) => line.values.subarray(from, to);
    const [ulow, uhigh] = range([...all, own].map((each) => part(u.measured, each)));
    const [flow, fhigh] = range([...all, own].map((each) => part(f.measured, each)));
    const x = (value) => left + (width - left - 6) * (value - ulow) / (uhigh - ulow);
    const y = (value) => floor - (floor - top) * (value - flow) / (fhigh - flow);
    pen.strokeStyle = colour("rule");
    pen.fillStyle = colour("soft");
    pen.textAlign = "right"; pen.textBaseline = "middle";
    const across = ticks(flow, fhigh, 5), along = ticks(ulow, uhigh, 5);
    for (const value of across.found) { pen.fillText(value.toFixed(across.digits), left - 5, y(value)); pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width, y(value)); pen.stroke(); }
    pen.textAlign = "center";
    for (const value of along.found) { pen.fillText(value.toFixed(along.digits), x(value), floor + 10); pen.beginPath(); pen.moveTo(x(value), top); pen.lineTo(x(value), floor); pen.stroke(); }
    pen.fillText(`displacement across the contact [${told.across.unit}]`, (left + width) / 2, height - 8);
    pen.textAlign = "left";
    pen.fillText(`friction [${friction.unit}]`, 2, 7);
    const trace = (lines, each, [ink, wide, alpha]) => {
      const us = part(lines[0], each), fs = part(lines[1], each);
      pen.strokeStyle = colour(ink); pen.lineWidth = wide; pen.globalAlpha = alpha;
      pen.beginPath();
      for (let j = 0; j < us.length; j++) pen[j ? "lineTo" : "moveTo"](x(us[j]), y(fs[j]));
      pen.stroke();
      pen.globalAlpha = 1;
    };
    for (const each of all) trace([u.measured, f.measured], each, ["faint", 0.7, 0.4]);
    trace([u.measured, f.measured], own, style("measured"));
    if (u.model && f.model) trace([u.model, f.model], own, style("model"));
  }

  function valuesAt(at) {
    const parts = told.panels.map((panel) => {
      const written = Object.entries(panel.lines).map(([name, line]) => {
        const inside = Math.round(at) >= near && Math.round(at) < far;
        const value = inside ? line.values[Math.round(at) - near] : line.outline[Math.min(line.outline.length - 1, Math.round(at * line.outline.length / told.count))];
        return value === value ? `${name === "measured" ? "" : `${name} `}${value.toPrecision(4)}` : "";
      }).filter(Boolean).join(", ");
      return `${panel.name} ${written} ${panel.unit}`;
    });
    return `${time(at).toPrecision(6)} s: ${parts.join("; ")}`;
  }

  function show() {
    drawChart();
    drawLoop();
    one("cycle").textContent = cycles.length ? (chosen < 0 ? `${cycles.length} cycles` : `cycle ${chosen + 1} of ${cycles.length}`) : "";
    reading.classList.toggle("idle", pointer === null);
    reading.textContent = pointer === null ? reading.dataset.rest : valuesAt(pointer);
    one("asked").hidden = !span;
    if (span) {
      const [first, last] = [Math.round(span[0]), Math.round(span[1]) + 1];
      one("span").textContent = `${time(span[0]).toFixed(4)} to ${time(span[1]).toFixed(4)} s, ${last - first} samples`;
      one("command").textContent = told.command.replaceAll("{here}", here).replace("{first}", first + told.first).replace("{last}", last + told.first);
    }
  }

  function zoom(factor, about = (view[0] + view[1]) / 2) {
    const wide = Math.min(end, Math.max(20, (view[1] - view[0]) * factor)), share = (about - view[0]) / (view[1] - view[0]);
    const from = Math.min(end - wide, Math.max(0, about - share * wide));
    view = [from, from + wide];
    show();
  }
  function pan(share) {
    const wide = view[1] - view[0], from = Math.min(end - wide, Math.max(0, view[0] + share * wide));
    view = [from, from + wide];
    show();
  }
  function choose(number) {
    if (!cycles.length) return;
    chosen = (number + cycles.length) % cycles.length;
    const [from, to] = cycles[chosen].map(row), wide = to - from;
    if (from < view[0] || to > view[1] || view[1] - view[0] > 40 * wide) view = [Math.max(0, from - 2 * wide), Math.min(end, to + 2 * wide)];
    show();
  }
  const place_of = (event) => {
    const box = chart.getBoundingClientRect(), share = (event.clientX - box.left - LEFT) / (box.width - LEFT - 4);
    return Math.min(end, Math.max(0, view[0] + Math.min(1, Math.max(0, share)) * (view[1] - view[0])));
  };

  chart.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return; // the page scrolls on
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, place_of(event));
  }, { passive: false });
  chart.addEventListener("pointerdown", (event) => { drag = { x: event.clientX, at: place_of(event) }; chart.setPointerCapture(event.pointerId); });
  chart.addEventListener("pointermove", (event) => {
    pointer = place_of(event);
    if (drag && Math.abs(event.clientX - drag.x) > NEAR) span = [Math.min(drag.at, pointer), Math.max(drag.at, pointer)];
    show();
  });
  chart.addEventListener("pointerup", (event) => {
    if (drag && Math.abs(event.clientX - drag.x) <= NEAR) { // a click: the cycle there
      span = null;
      const at = time(place_of(event)), found = cycles.findIndex(([from, to]) => from <= at && at < to);
      if (found >= 0) choose(found);
    }
    drag = null;
    show();
  });
  chart.addEventListener("pointerleave", () => { if (!drag) { pointer = null; show(); } });
  chart.addEventListener("pointercancel", () => { drag = null; });
  chart.addEventListener("dblclick", () => { view = [0, end]; span = null; show(); });
  chart.addEventListener("keydown", (event) => {
    const done = { "+": () => zoom(0.6), "-": () => zoom(1.6), ArrowLeft: () => pan(-0.2), ArrowRight: () => pan(0.2), Home: () => { view = [0, end]; show(); },
      n: () => choose(chosen + 1), p: () => choose(chosen - 1), Escape: () => { span = null; show(); } }[event.key];
    if (done) { event.preventDefault(); done(); }
  });
  const press = (name, done) => one(name)?.addEventListener("click", done);
  press("in", () => zoom(0.5));
  press("out", () => zoom(2));
  press("all", () => { view = [0, end]; span = null; show(); });
  press("next", () => choose(chosen + 1));
  press("before", () => choose(chosen < 0 ? 0 : chosen - 1));
  press("closer", () => { view = [...span]; span = null; show(); });
  press("copy", async () => {
    const text = one("command").textContent;
    try { await navigator.clipboard.writeText(text); } catch { getSelection().selectAllChildren(one("command")); document.execCommand("copy"); }
    one("copy").textContent = "Copied";
    setTimeout(() => { one("copy").textContent = "Copy"; }, 1500);
  });

  place.hidden = false;
  if (told.view) view = told.view.map(row);
  else if (cycles.length > 8) view = [row(cycles[0][0]), row(cycles[5][1])];
  else if (told.count > far - near) view = [near, far - 1];
  chosen = cycles.length ? cycles.length - 1 >> 1 : -1;
  if (cycles.length > 8) chosen = Math.max(0, cycles.findIndex(([from]) => row(from) > (view[0] + view[1]) / 2 - 0.5 * told.period * told.fs));
  new ResizeObserver(show).observe(chart);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  addEventListener("beforeprint", () => { paper = true; show(); });
  addEventListener("afterprint", () => { paper = false; show(); });
  show();
}
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => { each.open = true; }));
