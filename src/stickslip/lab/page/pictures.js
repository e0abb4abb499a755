// The slower pictures of Play, and the colours of maps.
import { axes, line } from "./canvas.js";

// Cividis: even in lightness, alike for all eyes; `share` from 0 to 1.
const CIVIDIS = [[0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]];
export function cividis(share) {
  const place = Math.min(1, Math.max(0, share)) * (CIVIDIS.length - 1), low = Math.min(CIVIDIS.length - 2, Math.floor(place));
  return CIVIDIS[low].map((value, j) => Math.round(value + (CIVIDIS[low + 1][j] - value) * (place - low)));
}

export function spectrum(canvas, run, palette) {
  const { frequency, amplitude } = run.arrays;
  const most = amplitude.reduce((high, value) => Math.max(high, value), 1e-300);
  let end = Math.min(frequency.length, frequency.findIndex((each) => each > 60 / run.cycle) >>> 0);
  end = Math.max(end, Math.min(frequency.length, 60));
  const low = most * 1e-4;
  const across = { low: 0, high: frequency[end - 1], label: "frequency", unit: "Hz" };
  const upwards = { low, high: most * 1.6, label: "amplitude [m/s²]", factor: 1, unit: "", log: true };
  const plan = axes(canvas, across, upwards, palette);
  line(plan, frequency, amplitude.map((value) => Math.max(value, low)), { to: end, colour: palette.purple });
}

export function wavelet(canvas, map, palette) {
  const { levels, frequency, time } = map.arrays, columns = time.length, image = new ImageData(columns, map.rows);
  const up = frequency[0] > frequency[1];
  for (let row = 0; row < map.rows; row++) {
    const from = (up ? row : map.rows - 1 - row) * columns;
    for (let k = 0; k < columns; k++) {
      const [red, green, blue] = cividis(levels[from + k] / 255);
      image.data.set([red, green, blue, 255], 4 * (row * columns + k));
    }
  }
  const picture = new OffscreenCanvas(columns, map.rows);
  picture.getContext("2d").putImageData(image, 0, 0);
  const low = Math.min(frequency[0], frequency.at(-1)), high = Math.max(frequency[0], frequency.at(-1));
  const across = { low: time[0], high: time.at(-1), label: "time", unit: "s" };
  const upwards = { low, high, label: "frequency [Hz]", factor: 1, unit: "", log: true };
  const plan = axes(canvas, across, upwards, palette);
  const { left, right, top, bottom } = plan.box;
  plan.pen.drawImage(picture, left, top, right - left, bottom - top);
}
