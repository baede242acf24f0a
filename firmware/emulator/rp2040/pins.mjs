// Levels at the chip's pins from outside, also as pulses that the emulator makes itself.

const PADS = 0x4001c;
const PINS = 30;

// xorshift32: Marsaglia, "Xorshift RNGs" (2003)
function random(train) {
  train.state ^= train.state << 13;
  train.state ^= train.state >>> 17;
  train.state ^= train.state << 5;
  return train.state >>> 0;
}

export class Pins {
  constructor() {
    this.levels = new Map(); // pins that something drives
    this.changes = [];
    this.trains = new Map();
  }

  connect(chip) {
    this.chip = chip;
    this.change = chip.clock.createAlarm(() => this.makeChanges());
    this.showPullUps(chip.peripherals[PADS]);
    for (const [pin, level] of this.levels) chip.gpio[pin].setInputValue(level !== 0);
    this.scheduleChange();
    for (const train of this.trains.values()) this.start(train);
  }

  // A pin that nothing drives is high when its pull-up is on.
  showPullUps(pads) {
    const { writeUint32 } = pads;
    pads.writeUint32 = (offset, value) => {
      writeUint32.call(pads, offset, value);
      const pin = offset / 4 - 1;
      if (pin < 0 || pin >= PINS || this.levels.has(pin)) return;
      const gpio = this.chip.gpio[pin];
      if (gpio.rawInputValue !== gpio.pullupEnabled) gpio.setInputValue(gpio.pullupEnabled);
    };
  }

  drive(pin, level) {
    if (this.levels.get(pin) === level) return;
    this.levels.set(pin, level);
    this.chip.gpio[pin].setInputValue(level !== 0);
  }

  at(time, pin, level) {
    this.changes.push({ time, pin, level });
    if (this.changes.length === 1) this.scheduleChange();
  }

  scheduleChange() {
    if (this.changes.length) this.change.schedule(Math.max(0, this.changes[0].time - this.chip.clock.nanos));
  }

  makeChanges() {
    let made = 0;
    for (; made < this.changes.length && this.changes[made].time <= this.chip.clock.nanos; made++) {
      this.drive(this.changes[made].pin, this.changes[made].level);
    }
    this.changes.splice(0, made);
    this.scheduleChange();
  }

  // All 0 ends the pulses of this pin.
  pulses(pin, high, low, jitter) {
    this.trains.get(pin)?.alarm.cancel();
    this.trains.delete(pin);
    if (!high && !low) return;
    const train = { pin, high, low, jitter, state: pin + 1 };
    this.trains.set(pin, train);
    this.start(train);
  }

  start(train) {
    train.alarm = this.chip.clock.createAlarm(() => {
      const level = this.levels.get(train.pin) ? 0 : 1;
      this.drive(train.pin, level);
      const more = train.jitter ? random(train) % (train.jitter + 1) : 0;
      train.alarm.schedule((level ? train.high : train.low) + more);
    });
    train.alarm.schedule(train.low);
  }
}
