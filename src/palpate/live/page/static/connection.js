// A WebSocket that reconnects by itself.

const FIRST = 250, LONGEST = 5000; // ms between attempts
const SILENT = 4000; // ms without a message: the server sends four per second

export class Connection {
  constructor({ onFrame, onMessage, onWords }) {
    Object.assign(this, { onFrame, onMessage, onWords });
    this.wait = FIRST;
    this.heard = 0;
    this.why = "";
    setInterval(() => this.check(), 500);
    this.open();
  }

  open() {
    this.onWords(this.why || "Connecting …", Boolean(this.why));
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.heard = performance.now();
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      this.wait = FIRST;
      this.why = "";
      if (typeof data === "string") this.onMessage(JSON.parse(data));
      else this.onFrame(data);
    };
    socket.onclose = ({ reason }) => { if (socket === this.socket) this.lost(reason); };
  }

  /** Treat a long silence as a lost connection, even if the network reports none. */
  check() {
    if (this.socket && performance.now() - this.heard > SILENT) {
      const silent = this.socket;
      this.lost("");
      silent.close();
    }
  }

  lost(reason) {
    this.socket = null;
    this.why = reason || this.why;
    const again = Date.now() + this.wait;
    this.wait = Math.min(2 * this.wait, LONGEST);
    this.refused();
    const count = () => {
      const left = Math.ceil((again - Date.now()) / 1000);
      if (left <= 0) { this.open(); return; }
      this.onWords(`${this.why || "Connection lost"}: reconnecting in ${left} s`, true);
      setTimeout(count, Math.min(again - Date.now(), 250));
    };
    count();
  }

  /** Find out why the server refused: a WebSocket does not tell a browser, an HTTP request does. */
  async refused() {
    try {
      const answer = await fetch("/", { method: "HEAD", cache: "no-store" });
      if (answer.status === 403) this.why = "Wrong token: open the address that palpate printed";
    } catch { /* no server */ }
  }

  ask(what, options = {}) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ ask: what, ...options }));
    return true;
  }
}
