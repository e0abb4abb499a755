// Axes and curves on a plain canvas: loops, portraits, spectra and maps.
const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
const PLAIN = new Set(["", "1", "kg", "rad"]);

export function prefixed(size, unit) {
  if (PLAIN.has(unit) || !(size > 0)) return [1, unit === "1" ? "" : unit];
  const [factor, letter] = PREFIXES.find(([each]) => size >= each * 0.9995 && !(each > 1 && unit.startsWith("m/"))) ?? PREFIXES.at(-1);
  return [1 / factor, letter + spelled(unit)];
}
export const spelled = (unit) => unit.replace(/\^2/g, "²").replace(/\^3/g, "³").replaceAll(" ", "·");

export function ticks(low, high, count) {
  const span = high - low;
  if (!(span > 0)) return [low];
  const rough = span / count, size = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((each) => each * size >= rough) * size;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) found.push(k * step);
  return found;
}
export const tick = (value) => (Math.abs(value) < 1e-12 ? "0" : String(+value.toPrecision(8))); // as fine as the step is
export const shortly = (value) => (Math.abs(value) < 1e-12 ? "0" : String(+value.toPrecision(4)));

export function range(values, margin = 0.06) {
  let low = Infinity, high = -Infinity;
  for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
  if (!(high >= low)) return [0, 1];
  const room = (high - low) * margin || Math.abs(high) * 0.1 || 1;
  return [low - room, high + room];
}

// Clear, draw axes, and give the pen with `x(value)`, `y(value)` in pixels; an axis is {low, high, label, unit, log}.
export function axes(canvas, x, y, palette, left = 58) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const box = { left, right: width - 14, top: 8, bottom: height - 38 };
  const place = (axis, from, to) => {
    const scale = axis.log ? Math.log10 : (value) => value;
    const low = scale(axis.low), span = scale(axis.high) - low || 1;
    return (value) => from + ((scale(value) - low) / span) * (to - from);
  };
  const at = { x: place(x, box.left, box.right), y: place(y, box.bottom, box.top) };
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 1;
  for (const [axis, across] of [[x, true], [y, false]]) {
    const [factor, unit] = axis.factor ? [axis.factor, axis.unit] : prefixed(Math.max(Math.abs(axis.low), Math.abs(axis.high)), axis.unit ?? "");
    const marks = axis.log ? decades(axis.low, axis.high) : ticks(axis.low * factor, axis.high * factor, across ? Math.max(3, width / 65) : 5).map((mark) => mark / factor);
    pen.textAlign = across ? "center" : "right";
    pen.textBaseline = across ? "top" : "middle";
    for (const mark of marks) {
      const p = Math.round(across ? at.x(mark) : at.y(mark)) + 0.5;
      pen.strokeStyle = palette.line;
      pen.beginPath();
      if (across) { pen.moveTo(p, box.top); pen.lineTo(p, box.bottom); } else { pen.moveTo(box.left, p); pen.lineTo(box.right, p); }
      pen.stroke();
      pen.fillStyle = palette.soft;
      const words = axis.log ? power(mark * factor) : tick(mark * factor);
      if (across) pen.fillText(words, Math.min(p, width - pen.measureText(words).width / 2 - 1), box.bottom + 4); else pen.fillText(words, box.left - 5, p);
    }
    const label = axis.label + (unit ? ` [${unit}]` : "");
    pen.fillStyle = palette.soft;
    pen.textAlign = "center";
    if (across) pen.fillText(label, (box.left + box.right) / 2, box.bottom + 21);
    else { pen.save(); pen.translate(9, (box.top + box.bottom) / 2); pen.rotate(-Math.PI / 2); pen.textBaseline = "middle"; pen.fillText(label, 0, 0); pen.restore(); }
  }
  return { pen, box, ...at };
}
function decades(low, high) {
  const found = [];
  const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
  const step = Math.max(1, Math.ceil((last - first) / 5));
  for (let k = first; k <= last; k += step) found.push(10 ** k);
  return found;
}
const power = (value) => { const k = Math.round(Math.log10(value)); return k >= -2 && k <= 4 ? shortly(value) : `1e${k}`; };

export function line(plan, xs, ys, { from = 0, to = xs.length, colour, width = 1.3 }) {
  const { pen } = plan;
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.lineJoin = "round";
  pen.beginPath();
  for (let k = from; k < to; k++) { const x = plan.x(xs[k]), y = plan.y(ys[k]); if (k === from) pen.moveTo(x, y); else pen.lineTo(x, y); }
  pen.stroke();
}
