// The mass on its spring, as it was computed: true motion, slowed down as one likes, drawn larger.
import { prefixed, shortly } from "./canvas.js";

const COILS = 9;
const SCALES = [1, 2, 5];

export class Stage {
  constructor(canvas, moved) {
    const playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    Object.assign(this, { canvas, moved, time: 0, pace: 1, playing });
    const step = (now) => {
      const past = Math.min(0.1, (now - (this.before ?? now)) / 1000);
      this.before = now;
      if (this.run && this.playing && canvas.offsetParent) this.to(this.time + past * this.pace);
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
  show(run, palette) {
    Object.assign(this, { run, palette });
    const { arrays } = run;
    const largest = (name) => arrays[name].reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    this.bodies = run.series.filter((line) => line.group === "x" && line.name !== "z");
    this.felt = arrays.friction ? "friction" : "friction1";
    this.size = Math.max(...this.bodies.map(({ name }) => largest(name)), arrays.z ? largest("z") : 0) || 1;
    this.most = Math.max(1e-300, largest(this.felt));
    this.push = arrays.force ? Math.max(1e-300, largest("force")) : 0;
    if (!(this.time >= run.first && this.time <= run.last)) this.time = run.first;
    this.to(this.time);
  }
  to(time) {
    const { first, last } = this.run;
    this.time = time > last ? first : time;
    this.draw();
    this.moved(this.time, this.index);
  }
  // The value of a line now, straight between two instants.
  now(name) {
    const { time } = this.run.arrays, line = this.run.arrays[name], j = this.index;
    const step = time[j + 1] - time[j], share = Math.min(1, Math.max(0, (this.time - time[j]) / step));
    return step > 0 ? line[j] + (line[j + 1] - line[j]) * share : line[j];
  }
  find() {
    const { time } = this.run.arrays;
    let low = 0, high = time.length - 2;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (time[middle] <= this.time) low = middle; else high = middle - 1;
    }
    this.index = low;
  }
  draw() {
    this.find();
    const { run, palette } = this, plan = this.plan(), { pen, width, scale } = plan;
    this.ground(pen, plan.floor, width, scale, plan.height);
    this.end(plan);
    for (const [i, j] of run.springs ?? [[-1, 0]]) this.coupling(plan, i, j);
    const ink = [palette.orange, palette.sky, palette.blue, palette.purple][run.kinds[this.index]];
    this.bodies.forEach((body, j) => this.body(plan, body, j, j ? palette.faint : ink));
    this.ruler(pen, width, scale, palette);
  }
  // Where all stands: of each mass its place at rest and now, and the end of the first spring.
  plan() {
    const { canvas } = this, ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const floor = height - 24, room = (width - 120) / this.bodies.length, reach = 0.22 * Math.min(room, 520);
    const scale = reach / this.size, box = Math.min(64, floor - 30, room * 0.4);
    const middles = this.bodies.map((_, j) => 100 + room * (j + 0.5));
    const now = this.bodies.map(({ name }, j) => middles[j] + this.now(name) * scale);
    const end = this.run.arrays.z ? 26 + this.now("z") * scale + reach : 26;
    return { pen, width, height, floor, top: floor - box, box, scale, middles, now, end };
  }
  // What the first spring ends on: a wall, or the base that moves.
  end({ pen, floor, end }) {
    pen.fillStyle = this.palette.soft;
    if (!this.run.arrays.z) { pen.fillRect(20, floor - 66, 6, 66); return; }
    pen.fillRect(end - 7, floor - 60, 7, 60);
    pen.fillRect(end - 22, floor - 4, 22, 4);
  }
  // A spring between two masses, or (-1) from what does not move with them.
  coupling({ pen, top, box, now, end }, i, j) {
    const y = top + box / 2, left = now[j] - box / 2;
    if (i >= 0) this.spring(pen, now[i] + box / 2, left, j - i > 1 ? top - 6 : y);
    else if (j === 0) this.spring(pen, end, left, y);
    else this.hanger(pen, now[j], top);
  }
  hanger(pen, x, top) {
    pen.save();
    pen.translate(x, 4);
    pen.rotate(Math.PI / 2);
    this.spring(pen, 0, top - 4, 0, 4, 4);
    pen.restore();
    pen.fillStyle = this.palette.soft;
    pen.fillRect(x - 14, 0, 28, 4);
  }
  body({ pen, floor, top, box, middles, now }, { name, unit }, j, ink) {
    const { palette } = this, x = now[j], alone = this.bodies.length === 1;
    pen.fillStyle = ink;
    pen.fillRect(x - box / 2, top, box, box);
    pen.fillStyle = palette.card;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.font = "600 14px system-ui, sans-serif";
    pen.fillText(alone ? "m" : `${name}${unit.startsWith("rad") ? " ∠" : ""}`, x, top + box / 2);
    pen.strokeStyle = palette.faint;
    pen.setLineDash([3, 4]);
    pen.beginPath(); pen.moveTo(middles[j], top - 14); pen.lineTo(middles[j], floor); pen.stroke();
    pen.setLineDash([]);
    if (j) return;
    this.arrow(pen, x, floor + 13, (-this.now(this.felt) / this.most) * 60, palette.ink, "friction");
    if (alone && this.push) this.arrow(pen, x, top - 8, (this.now("force") / this.push) * 70, palette.green, "force");
  }
  ground(pen, floor, width, scale, height) {
    const { palette, run } = this;
    pen.strokeStyle = palette.soft;
    pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(0, floor + 0.5); pen.lineTo(width, floor + 0.5); pen.stroke();
    pen.lineWidth = 1;
    pen.strokeStyle = palette.faint;
    const gap = 14, shift = (((run.belt * this.time * scale) % gap) + gap) % gap;
    pen.beginPath();
    for (let x = shift - gap; x < width + gap; x += gap) {
      pen.moveTo(x, floor + 1);
      pen.lineTo(x - 8, Math.min(height, floor + 10));
    }
    pen.stroke();
  }
  spring(pen, from, to, y, side = 8, coils = COILS) {
    pen.strokeStyle = this.palette.ink;
    pen.lineWidth = 1.6;
    pen.beginPath();
    pen.moveTo(from, y);
    const step = (to - from) / (coils * 2 + 2);
    for (let k = 1; k <= coils * 2; k++) pen.lineTo(from + step * (k + 0.5), y + (k % 2 ? -side : side));
    pen.lineTo(to, y);
    pen.stroke();
  }
  arrow(pen, x, y, length, colour, words) {
    if (Math.abs(length) < 2) return;
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = 2.4;
    const side = Math.sign(length);
    pen.beginPath(); pen.moveTo(x, y); pen.lineTo(x + length - side * 6, y); pen.stroke();
    const back = x + length - side * 8;
    pen.beginPath(); pen.moveTo(x + length, y); pen.lineTo(back, y - 4); pen.lineTo(back, y + 4); pen.fill();
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = side > 0 ? "left" : "right";
    pen.fillText(words, x + length + side * 5, y - 1);
  }
  // How long a stretch of the picture is, and the time.
  ruler(pen, width, scale, palette) {
    const most = Math.min(120, width / 8) / scale, decade = 10 ** Math.floor(Math.log10(most));
    const length = SCALES.map((each) => each * decade).filter((each) => each <= most).at(-1);
    const [factor, unit] = prefixed(length, this.bodies[0].unit);
    pen.strokeStyle = pen.fillStyle = palette.soft;
    pen.lineWidth = 1.5;
    pen.beginPath(); pen.moveTo(width - 14 - length * scale, 14); pen.lineTo(width - 14, 14); pen.stroke();
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "top";
    pen.fillText(`${shortly(length * factor)} ${unit}`, width - 14, 18);
    if (width > 560) pen.fillText(`t = ${this.time.toFixed(this.run.cycle < 0.05 ? 4 : 2)} s`, width - 14, 34);
  }
}
