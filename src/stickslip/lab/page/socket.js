// One conversation with the lab: requests as JSON, answers as a header and arrays.
export function unframed(buffer) {
  const view = new DataView(buffer);
  const length = view.getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const kinds = { "<f8": Float64Array, "<i4": Int32Array, u1: Uint8Array };
  const arrays = {};
  let place = 4 + length;
  for (const [name, kind, size] of header.arrays) {
    arrays[name] = new kinds[kind](buffer, place, size);
    place += Math.ceil(arrays[name].byteLength / 8) * 8;
  }
  return { ...header, arrays };
}

export class Conversation {
  constructor(path, heard, lost) {
    Object.assign(this, { path, heard, lost, waiting: new Map() });
    this.open();
  }
  open() {
    this.socket = new WebSocket(`ws://${location.host}${location.pathname}${this.path}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      for (const text of this.waiting.values()) this.socket.send(text);
      this.waiting.clear();
      if (this.before) this.again?.();
      this.before = true;
    };
    this.socket.onmessage = (event) => this.heard(unframed(event.data));
    this.socket.onclose = () => { this.lost?.(); setTimeout(() => this.open(), 1500); };
  }
  send(request) {
    const text = JSON.stringify(request);
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(text);
    else this.waiting.set(request.want, text);
  }
}
