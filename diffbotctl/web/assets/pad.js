// The joystick: drives while a finger, the mouse or an arrow key holds it.
//
// Each press has a number. A press during which the page was hidden or the connection lost drives
// no more: the finger must be lifted. The server decides that too, on its own clock.

const PERIOD_MS = 50; // 20 commands a second
const DEAD_ZONE = 0.08; // share of the radius
const ARROWS = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };

export class Pad {
  constructor(element, knob, connection, onVelocity) {
    this.element = element;
    this.knob = knob;
    this.connection = connection;
    this.onVelocity = onVelocity;
    this.limits = { speed: 0, turnRate: 0 };
    this.share = 0.5; // of the limits
    this.press = 0; // the time of its beginning, so that a later press has a greater number
    this.timer = null;
    this.pointer = null;
    this.keys = new Set();
    this.stick = [0, 0]; // forward and left, -1 to 1
    element.addEventListener("pointerdown", (event) => this.onDown(event));
    element.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(name, (event) => this.onUp(event));
    }
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("keydown", (event) => this.onKey(event, true));
    addEventListener("keyup", (event) => this.onKey(event, false));
    addEventListener("blur", () => this.lose("blurred"));
    addEventListener("pagehide", () => this.lose("hidden"));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.lose("hidden");
    });
  }

  get isPressed() {
    return this.timer !== null;
  }

  onDown(event) {
    if (this.pointer !== null || this.isPressed || !this.connection.isReady) return;
    event.preventDefault();
    this.pointer = event.pointerId;
    this.element.setPointerCapture(event.pointerId);
    this.begin();
    this.onMove(event);
  }

  onMove(event) {
    if (event.pointerId !== this.pointer || !this.isPressed) return;
    const box = this.element.getBoundingClientRect();
    const radius = box.width / 2;
    const x = (event.clientX - box.left - radius) / radius;
    const y = (event.clientY - box.top - radius) / radius;
    const length = Math.max(Math.hypot(x, y), 1);
    this.move(-y / length, -x / length);
  }

  onUp(event) {
    if (event.pointerId !== this.pointer) return;
    this.pointer = null;
    this.release();
  }

  onKey(event, isDown) {
    if (!(event.key in ARROWS) || /INPUT|SELECT/.test(event.target.tagName)) return;
    event.preventDefault();
    if (isDown && (event.repeat || this.pointer !== null || !this.connection.isReady)) return;
    if (isDown) this.keys.add(event.key);
    else this.keys.delete(event.key);
    if (!this.keys.size) {
      if (this.pointer === null) this.release();
      return;
    }
    if (!this.isPressed && isDown && this.keys.size === 1) this.begin();
    const sums = [...this.keys].map((key) => ARROWS[key]);
    if (this.isPressed) this.move(...[0, 1].map((i) => sums.reduce((sum, each) => sum + each[i], 0)));
  }

  begin() {
    this.element.classList.remove("locked");
    this.press = Math.max(Date.now(), this.press + 1);
    this.timer = setInterval(() => this.command(), PERIOD_MS);
  }

  move(forward, left) {
    const zone = (value) => (Math.abs(value) < DEAD_ZONE ? 0 : value);
    const isFirst = !this.stick[0] && !this.stick[1];
    this.stick = [zone(forward), zone(left)];
    const reach = this.element.clientWidth / 2 - this.knob.clientWidth / 2;
    this.knob.style.transform = `translate(${-left * reach}px, ${-forward * reach}px)`;
    if (isFirst) this.command();
  }

  command() {
    const linear = this.stick[0] * this.share * this.limits.speed;
    const angular = this.stick[1] * this.share * this.limits.turnRate;
    this.onVelocity(linear, angular);
    this.connection.send({ do: "drive", press: this.press, n: this.connection.number, linear, angular });
  }

  /** The finger was lifted. */
  release() {
    if (this.isPressed) this.connection.send({ do: "release", press: this.press });
    this.end();
    this.element.classList.remove("locked");
  }

  /** The page can no longer be relied on while it drives. */
  lose(reason) {
    if (this.isPressed) this.connection.send({ do: "lost", reason });
    this.lock();
  }

  /** Drive no more until the finger is lifted. */
  lock() {
    const wasPressed = this.isPressed;
    this.end();
    if (wasPressed) this.element.classList.add("locked");
  }

  end() {
    clearInterval(this.timer);
    this.timer = null;
    this.keys.clear();
    this.stick = [0, 0];
    this.knob.style.transform = "";
    this.onVelocity(0, 0);
  }
}
