// HC-SR04 sensors at the pins, with the figures of their data sheet, which ../sonars.c explains.

const TRIGGER = 10e3; // ns
const BURST = 450e3;
const LONGEST = 38e6;
const SILENT = 0;
const ENDLESS = 0xffff;
const US = 1e3;

export class Sonars {
  constructor(board) {
    this.board = board;
    this.sonars = board.options.sonars.map(([trigger, echo]) => ({ trigger, echo, width: SILENT, sent: null }));
  }

  connect(chip) {
    for (const sonar of this.sonars) {
      sonar.listens = sonar.isTriggered = false;
      sonar.begin = chip.clock.createAlarm(() => this.beginEcho(sonar));
      sonar.end = chip.clock.createAlarm(() => this.endEcho(sonar));
      chip.gpio[sonar.trigger].addListener((state) => this.triggered(sonar, state === 1));
      this.board.pins.drive(sonar.echo, 0);
    }
  }

  get now() {
    return this.board.chip.clock.nanos;
  }

  // Length of the echo of a sensor's target in us, or SILENT or ENDLESS.
  set(number, us) {
    if (number < this.sonars.length) this.sonars[number].width = us;
  }

  triggered(sonar, level) {
    if (level && !sonar.isTriggered) sonar.raised = this.now;
    const isLong = this.now - sonar.raised >= TRIGGER;
    if (!level && sonar.isTriggered && isLong && !sonar.listens && sonar.width !== SILENT) {
      sonar.begin.schedule(BURST);
    }
    sonar.isTriggered = level;
  }

  beginEcho(sonar) {
    sonar.sent = this.now;
    sonar.listens = true;
    this.board.pins.drive(sonar.echo, 1);
    if (sonar.width === ENDLESS) return;
    sonar.ends = this.now + LONGEST;
    sonar.end.schedule(LONGEST);
    for (const other of this.sonars) {
      if (other.sent !== null) this.receive(sonar, other);
      if (other !== sonar && other.listens && other.width !== ENDLESS) this.receive(other, sonar);
    }
  }

  // The burst of `sender` arrives at a sensor that listens: the first one ends its echo.
  receive(sonar, sender) {
    const arrival = sender.sent + sender.width * US;
    if (sender.width === SILENT || arrival <= this.now || arrival >= sonar.ends) return;
    sonar.ends = arrival;
    sonar.end.schedule(arrival - this.now);
  }

  endEcho(sonar) {
    sonar.listens = false;
    this.board.pins.drive(sonar.echo, 0);
  }
}
