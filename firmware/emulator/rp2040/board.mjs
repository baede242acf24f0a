// The emulated board: rp2040js's chip, and the parts that it lacks.

import { RP2040 } from "rp2040js";

import { Flash } from "./flash.mjs";
import { Gyro } from "./gyro.mjs";
import { Line } from "./line.mjs";
import { Motors } from "./motors.mjs";
import { Pins } from "./pins.mjs";
import { Sonars } from "./sonars.mjs";
import { Usb } from "./usb.mjs";

const RAM = 0x20000000;
// Where the boot ROM puts the boot code, and a word of RAM that nothing else uses.
const BOOT = 0x20041f00;
const HANG = 0x20041000;
const BRANCH_TO_ITSELF = 0xe7fe;
const BOOT_SIZE = 256;
const POLYNOMIAL = 0x04c11db7;
const REFERENCE = 3300; // mV of the converter
const CHANNELS = 3;
// Causes of a reset, as in the request, and what the chip's registers tell of them.
const POWER = 1;
const LINE = 2;
const BROWNOUT = 4;
const WATCHDOG = 8;
const HAD_POWER_ON = 1 << 8;
const HAD_RUN_PIN = 1 << 16;
const WATCHDOG_TIMER = 1;
const UNPOWERED = 0x5a; // what RAM may hold after the supply was off
const ADC_QUEUE = 0x0c;
// In the boot ROM: places of two pointers, what they point to, and a function that ends in a breakpoint.
const TABLE_POINTER = 0x14;
const SEARCH_POINTER = 0x18;
const TABLE = 0x100;
const SEARCH = 0x200;
const BREAK = 0x300;
const BOOT_FROM_USB = 0x4255; // "UB"
const BREAKPOINT = 0xbe00;
const SEARCH_CODE = [
  0x8802, // search: ldrh r2, [r0]
  0x2a00, // cmp r2, #0
  0xd004, // beq none
  0x428a, // cmp r2, r1
  0xd002, // beq found
  0x3004, // adds r0, #4
  0xe7f8, // b search
  0x46c0, // nop
  0x8840, // none, found: ldrh r0, [r0, #2]
  0x4770, // bx lr
];
// Cycles of the core to an interrupt's first instruction and back (Cortex-M0+ manual, section 3.3.1): rp2040js
// leaves them out.
const CYCLES_OF_ENTRY = 15;
const CYCLES_OF_RETURN = 13;

// The CRC-32 of the boot ROM.
function checksum(bytes) {
  let value = 0xffffffff;
  for (const byte of bytes) {
    value ^= byte << 24;
    for (let bit = 0; bit < 8; bit++) value = value & 0x80000000 ? (value << 1) ^ POLYNOMIAL : value << 1;
  }
  return value >>> 0;
}

export class Board {
  constructor(options) {
    this.options = options;
    this.events = []; // of the motors
    this.sent = []; // bytes
    this.wasReset = false;
    this.inBootsel = false;
    this.flash = new Flash(options.image);
    this.pins = new Pins();
    this.line = new Line(this);
    this.usb = new Usb(this);
    this.motors = new Motors(this);
    this.sonars = new Sonars(this);
    this.gyro = options.gyro ? new Gyro(this, options.gyro) : null;
    this.millivolts = new Array(CHANNELS).fill(0);
    this.begin(POWER, null);
  }

  // ns since the start
  get now() {
    return Math.floor(this.chip.clock.nanos);
  }

  // A new chip, since rp2040js has no reset of all its parts. `ram`: what it held before.
  begin(cause, ram) {
    const chip = new RP2040();
    chip.clock.nanosCounter = this.chip ? this.chip.clock.nanos : 0;
    chip.logger = { debug() {}, info() {}, warn() {}, error() {} };
    this.chip = chip;
    this.resets = 0;
    this.interruptCycles = 0;
    if (ram) chip.sram.set(ram);
    else chip.sram.fill(UNPOWERED);
    this.completeParts(cause);
    this.completeRom();
    this.flash.connect(chip);
    this.pins.connect(chip);
    this.line.connect(chip);
    this.usb.connect(chip);
    this.sonars.connect(chip);
    if (cause & POWER) this.gyro?.powerUp();
    this.gyro?.connect(chip);
    this.showAnalogs();
    this.wasReset = true;
    this.boot();
    this.motors.poll();
  }

  // What rp2040js leaves out, or does otherwise than the data sheet.
  completeParts(cause) {
    const { chip } = this;
    const watchdog = chip.peripherals[0x40058];
    watchdog.reason = cause & WATCHDOG ? WATCHDOG_TIMER : 0;
    watchdog.onWatchdogTrigger = () => {
      watchdog.alarm.enable = false; // else it would go off again and again at this time
      this.resets = WATCHDOG;
    };
    const causes = cause & LINE ? HAD_RUN_PIN : cause & (POWER | BROWNOUT) ? HAD_POWER_ON : 0;
    chip.peripherals[0x40064].readUint32 = (offset) => (offset === 8 ? causes : 0);
    const { adc } = chip;
    const readUint32 = adc.readUint32.bind(adc);
    adc.readUint32 = (offset) => {
      const value = readUint32(offset);
      if (offset === ADC_QUEUE) adc.checkInterrupts();
      return value;
    };
    const { core } = chip;
    for (const [method, cycles] of [["exceptionEntry", CYCLES_OF_ENTRY], ["exceptionReturn", CYCLES_OF_RETURN]]) {
      const plain = core[method].bind(core);
      core[method] = (value) => {
        this.interruptCycles += cycles;
        return plain(value);
      };
    }
    // Duty is read from the registers; the outputs need not change at each period.
    for (const channel of chip.pwm.channels) channel.updateEnable = () => {};
  }

  // The boot ROM's table of functions, with the one for BOOTSEL alone, and the function that searches it (data
  // sheet, section 2.8.3).
  completeRom() {
    const { chip } = this;
    const rom = new DataView(chip.bootrom.buffer);
    rom.setUint16(TABLE_POINTER, TABLE, true);
    rom.setUint16(SEARCH_POINTER, SEARCH | 1, true);
    rom.setUint16(TABLE, BOOT_FROM_USB, true);
    rom.setUint16(TABLE + 2, BREAK | 1, true);
    SEARCH_CODE.forEach((code, number) => rom.setUint16(SEARCH + 2 * number, code, true));
    rom.setUint16(BREAK, BREAKPOINT, true);
    chip.onBreak = () => {
      this.inBootsel = true;
    };
  }

  // A program that is copied to the drive which the board shows in BOOTSEL.
  program(image) {
    this.flash.program(image);
    this.inBootsel = false;
    this.reset(WATCHDOG);
  }

  // What the boot ROM does with a valid image; without one it waits in BOOTSEL for a program.
  boot() {
    const { core, sram } = this.chip;
    const code = this.flash.bytes.subarray(0, BOOT_SIZE);
    const given = Buffer.from(code).readUInt32LE(BOOT_SIZE - 4);
    if (given !== checksum(code.subarray(0, BOOT_SIZE - 4))) this.inBootsel = true;
    this.runs = !this.inBootsel;
    if (!this.runs) return;
    sram.set(code, BOOT - RAM);
    core.SP = BOOT;
    core.PC = BOOT;
  }

  reset(cause) {
    if (cause !== WATCHDOG) this.inBootsel = false; // a request: the boot ROM resets by its watchdog
    this.begin(cause, cause & POWER ? null : this.chip.sram);
  }

  // The main program stops making progress; interrupts still run.
  hang() {
    const { core } = this.chip;
    while (core.IPSR !== 0) this.advance(Infinity);
    this.chip.writeUint16(HANG, BRANCH_TO_ITSELF);
    core.PC = HANG;
    core.waiting = false;
  }

  transition(time, pin, level) {
    this.pins.at(time, pin, level);
  }

  pulses(pin, high, low, jitter) {
    this.pins.pulses(pin, high, low, jitter);
  }

  analog(channel, millivolts) {
    if (channel < CHANNELS) this.millivolts[channel] = millivolts;
    this.showAnalogs();
  }

  showAnalogs() {
    this.millivolts.forEach((millivolts, channel) => {
      this.chip.adc.channelValues[channel] = Math.min(4095, Math.round((millivolts * 4096) / REFERENCE));
    });
  }

  // One instruction, or the time until something happens, at most until `end`.
  advance(end) {
    const { chip } = this;
    const { core, clock } = chip;
    if (!core.waiting && this.runs) {
      const cycles = core.executeInstruction() + this.interruptCycles;
      this.interruptCycles = 0;
      clock.tick((cycles * 1e9) / chip.clkSys);
      if (core.waiting) this.motors.poll();
    } else {
      const next = clock.nextAlarm ? clock.nextAlarm.nanos : Infinity;
      clock.tick(Math.min(next, end) - clock.nanos);
    }
  }

  run(until) {
    while (this.chip.clock.nanos < until) {
      this.advance(until);
      if (this.inBootsel && this.runs) this.reset(WATCHDOG);
      if (this.resets) this.reset(this.resets);
    }
    this.motors.poll();
  }
}
