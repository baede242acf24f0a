// The motor drivers: for what share of a pulse they drive or short a motor, from the levels of the pins.

const FULL = 32767;
const NO_PIN = 255;
const STEPS = 255; // of a pulse
const FUNCTION_PWM = 4;
const FUNCTION_SIO = 5;
// What a driver does to its motor, besides 1 and -1: driven.
const OPEN = 0;
const SHORTED = 2;
// In what states of the inputs the driver shorts the motor; in others it leaves it open.
const ENABLE_LOW = 1;
const BOTH_LOW = 2;
const BOTH_HIGH = 4;

// By the truth tables of the data sheets; 1 when the first input drives.
function effect({ shorts, in2 }, [enabled, first, second]) {
  if (in2 === NO_PIN) second = !first;
  if (!enabled && !(shorts & ENABLE_LOW)) return OPEN;
  if (first === second) return shorts & (first ? BOTH_HIGH : BOTH_LOW) ? SHORTED : OPEN;
  return enabled ? first - second : SHORTED;
}

export class Motors {
  constructor(board) {
    this.board = board;
    this.motors = board.options.motors.map(([enable, in1, in2, standby, shorts]) => ({
      enable, in1, in2, standby, shorts, duty: 0, shorted: 0,
    }));
  }

  // 1 for an output that is high
  level(pin) {
    const { gpio, sio } = this.board.chip;
    return gpio[pin].functionSelect === FUNCTION_SIO ? (sio.gpioOutputEnable & sio.gpioValue) >>> pin & 1 : 0;
  }

  // Steps of a pulse for which a pin is high, from its begin on. An input without a pin is wired high.
  high(pin) {
    if (pin === NO_PIN) return STEPS;
    const { gpio, pwm } = this.board.chip;
    if (gpio[pin].functionSelect !== FUNCTION_PWM) return this.level(pin) ? STEPS : 0;
    const { cc, top, csr } = pwm.channels[(pin >> 1) & 7];
    const compare = pin & 1 ? cc >>> 16 : cc & 0xffff;
    return csr & 1 ? Math.trunc((Math.min(compare, top + 1) * STEPS) / (top + 1)) : 0;
  }

  // Shares of a pulse: duty, positive when the first input drives, and shorted.
  shares(motor) {
    const highs = [motor.enable, motor.in1, motor.in2].map((pin) => this.high(pin));
    let [driven, shorted] = [0, 0];
    const awake = motor.standby === NO_PIN || this.level(motor.standby);
    for (let at = 0, next; awake && at < STEPS; at = next) {
      next = Math.min(STEPS, ...highs.filter((high) => high > at));
      const does = effect(motor, highs.map((high) => high > at));
      if (does === SHORTED) shorted += next - at;
      else driven += does * (next - at);
    }
    return [driven, shorted].map((steps) => Math.trunc((steps * FULL) / STEPS));
  }

  // Records an event for each motor for which these shares have changed.
  poll() {
    this.motors.forEach((motor, number) => {
      const [duty, shorted] = this.shares(motor);
      if (duty === motor.duty && shorted === motor.shorted) return;
      motor.duty = duty;
      motor.shorted = shorted;
      this.board.events.push({ time: this.board.now, motor: number, duty, shorted });
    });
  }
}
