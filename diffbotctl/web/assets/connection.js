// The web socket to the server. It connects again by itself; the session is a cookie.

const PROOF = "proof"; // kept with the origin, unlike a cookie, which other ports of a machine get
const RETRY_MS = 700;
// The server sends ten pictures a second. What is shown is old after the first time without any,
// after the second the connection is made anew.
const SILENCE_MS = 1000;
const RECONNECT_MS = 3000;
const CHECK_MS = 250;

export class Connection {
  /** `onMessage` takes each message, `onState` a text: empty when all is well. */
  constructor(onMessage, onState) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.socket = null;
    this.number = 0; // the newest of the server, echoed by drive commands
    this.receivedAt = 0;
    this.ended = false;
    this.isSilent = false;
    setInterval(() => this.checkSilence(), CHECK_MS);
  }

  /** Present the code of the link, if there is one, and connect. */
  async enter() {
    const code = location.hash.slice(1);
    let words = "";
    if (code) {
      history.replaceState(null, "", location.pathname);
      const reply = await fetch("/session", { method: "POST", body: code });
      const text = await reply.text();
      if (reply.ok) localStorage.setItem(PROOF, text);
      else words = text;
    }
    await this.connect(words);
  }

  async connect(words = "") {
    if (this.ended) return;
    let reply;
    try {
      reply = await fetch("/session");
    } catch {
      this.retry("no connection to the robot's computer");
      return;
    }
    if (!reply.ok) {
      this.onState(words || (await reply.text()));
      return;
    }
    this.socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/socket", localStorage.getItem(PROOF) ?? []);
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = () => this.retry("no connection to the robot's computer");
    this.socket.onopen = () => {
      this.receivedAt = performance.now();
      this.isSilent = false;
      this.onState("");
    };
  }

  retry(words) {
    this.socket = null;
    this.number = 0;
    if (this.ended) return;
    this.onState(words);
    setTimeout(() => this.connect(), RETRY_MS);
  }

  take(message) {
    this.receivedAt = performance.now();
    if (this.isSilent) {
      this.isSilent = false;
      this.onState("");
    }
    if (message.n !== undefined) this.number = message.n;
    if (message.ended) {
      this.ended = true;
      this.onState("the run has ended");
    }
    this.onMessage(message);
  }

  /** A network that is gone closes no socket: say so, and start anew. */
  checkSilence() {
    if (this.socket?.readyState !== WebSocket.OPEN) return;
    if (document.hidden || this.ended) return;
    const silence = performance.now() - this.receivedAt;
    if (silence > SILENCE_MS && !this.isSilent) {
      this.isSilent = true;
      this.onState("nothing comes from the robot's computer; what is shown is old");
    }
    if (silence > RECONNECT_MS) {
      const silent = this.socket;
      silent.onclose = null;
      silent.close();
      this.retry("nothing came from the robot's computer");
    }
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Whether a command could echo a number of the server. */
  get isReady() {
    return this.isOpen && this.number > 0;
  }

  /** Whether the command could be sent. */
  send(command) {
    if (this.isOpen) this.socket.send(JSON.stringify(command));
    return this.isOpen;
  }
}
