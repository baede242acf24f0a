// The motor drivers: duty and brake, from the chip's registers, by the truth tables of the drivers' data sheets.

const FULL = 32767;
const NO_PIN = 255;
const ENABLE_DIRECTION = 1;
const TWO_PWM = 2;
const FUNCTION_PWM = 4;
const FUNCTION_SIO = 5;

export class Motors {
  constructor(board) {
    this.board = board;
    this.motors = board.options.motors.map(([enable, in1, in2, kind, standby]) => ({
      enable, in1, in2, kind, standby, duty: 0, brake: 0,
    }));
  }

  // 1 for an output that is high
  level(pin) {
    const { gpio, sio } = this.board.chip;
    return gpio[pin].functionSelect === FUNCTION_SIO ? (sio.gpioOutputEnable & sio.gpioValue) >>> pin & 1 : 0;
  }

  driven(pin) {
    const { gpio, pwm } = this.board.chip;
    if (gpio[pin].functionSelect !== FUNCTION_PWM) return this.level(pin) ? FULL : 0;
    const { cc, top, csr } = pwm.channels[(pin >> 1) & 7];
    const compare = pin & 1 ? cc >>> 16 : cc & 0xffff;
    return csr & 1 ? Math.trunc((Math.min(compare, top + 1) * FULL) / (top + 1)) : 0;
  }

  // Duty, positive when the first input drives, and brake.
  outputs({ enable, in1, in2, kind, standby }) {
    if (standby !== NO_PIN && !this.level(standby)) return [0, 0];
    if (kind === TWO_PWM) {
      const [first, second] = [this.driven(in1), this.driven(in2)];
      return [first - second, first === FULL && second === FULL ? 1 : 0];
    }
    const duty = this.driven(enable);
    if (kind === ENABLE_DIRECTION) return [this.level(in1) ? duty : -duty, duty === 0 ? 1 : 0];
    const [first, second] = [this.level(in1), this.level(in2)];
    const shorted = first === second && duty !== 0 && (first || standby === NO_PIN);
    return [(first - second) * duty, shorted ? 1 : 0];
  }

  // Records an event for each motor whose duty or brake has changed.
  poll() {
    this.motors.forEach((motor, number) => {
      const [duty, brake] = this.outputs(motor);
      if (duty === motor.duty && brake === motor.brake) return;
      motor.duty = duty;
      motor.brake = brake;
      this.board.events.push({ time: this.board.now, motor: number, duty, brake });
    });
  }
}
