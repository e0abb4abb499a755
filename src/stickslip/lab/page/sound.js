// A sound that goes on until it is ended.
export function played(samples, fs) {
  const context = new AudioContext();
  const buffer = context.createBuffer(1, samples.length, fs);
  const fade = Math.min(400, samples.length >> 2), values = Float32Array.from(samples);
  for (let k = 0; k < fade; k++) { values[k] *= k / fade; values[values.length - 1 - k] *= k / fade; }
  buffer.copyToChannel(values, 0);
  const source = new AudioBufferSourceNode(context, { buffer, loop: true });
  const quieter = new GainNode(context, { gain: 0.5 });
  source.connect(quieter).connect(context.destination);
  source.start();
  return () => { source.stop(); context.close(); };
}
