// An MPU6050 or an LSM6DSO on the bus unit I2C0, as far as the firmware needs them: their registers (register map of the
// MPU6050, revision 4.2; data sheet of the LSM6DSO), their faults, and the time of each byte at 100 kHz.

const SDA = 4;
const SCL = 5;
const CONFIG = 0x1b;
const ACCELERATION_CONFIG = 0x1c;
const ACCELERATION = 0x3b;
const XOUT = 0x43;
const POWER = 0x6b;
const IDENTITY = 0x75;
const REGISTERS = 128;
const ASLEEP = 0x40;
const LSB_PER_DEGREE = 131; // at 250 deg/s; half of it at each larger scale
const UNITS_PER_DEGREE = 50;
// The LSM6DSO, as in ../gyro.c.
const LSM6_ADDRESS = 0x6a;
const LSM6_IDENTITY = 0x0f;
const LSM6_ACCELERATION_CONFIG = 0x10;
const RATE_AND_SCALE = 0x11;
const CONTROL = 0x12;
const LSM6_XOUT = 0x22;
const LSM6_ACCELERATION = 0x28;
const RATE_BITS = 0xf0;
const BLOCKS = 0x40;
const INCREMENTS = 0x04;
const RANGE_245_MICRODEGREES = 8750; // of a bit; twice that at each larger scale
const UNIT_MICRODEGREES = 20000;
const PULSES_TO_RELEASE = 9; // rest of a byte, and its acknowledge
const BIT = 10e3; // ns
const BYTE = 9 * BIT;
const RESET = 0x0;
const RESET_I2C0 = 1 << 3;
const WRITE = 0;
// The faults of the request, as ../board_state.h names them.
const SILENT = 1;
const BUS_HELD = 2;
const BUS_IN_READING = 3;
const STUCK = 4;
const SUPPLY_DIP = 5;
const ACCELERATIONS = 4; // first of the inputs

const clamped = (value) => Math.max(-32768, Math.min(32767, value));

export class Gyro {
  constructor(board, address) {
    this.board = board;
    this.address = address;
    this.rates = [0, 0, 0];
    this.accelerations = [0, 0, 0];
    this.fault = this.input = this.pulses = 0;
    this.powerUp();
  }

  powerUp() {
    this.registers = new Uint8Array(REGISTERS);
    this.pointer = 0;
    if (this.isLsm6) {
      this.registers[LSM6_IDENTITY] = 0x6c;
      this.registers[CONTROL] = INCREMENTS;
    } else {
      this.registers[POWER] = ASLEEP;
      this.registers[IDENTITY] = 0x68;
    }
  }

  get isLsm6() {
    return (this.address & ~1) === LSM6_ADDRESS;
  }

  // After a reset of the board: what was under way is lost.
  connect(chip) {
    const i2c = chip.i2c[0];
    this.alarm = chip.clock.createAlarm(() => this.proceed());
    const later = (time, step) => {
      this.step = step;
      this.alarm.schedule(time);
    };
    i2c.onStart = () => later(BIT, () => i2c.completeStart());
    i2c.onConnect = (address, mode) =>
      later(BYTE, () => {
        this.isPointing = mode === WRITE;
        i2c.completeConnect(address === this.address && this.fault !== SILENT);
      });
    i2c.onWriteByte = (value) =>
      later(BYTE, () => {
        this.take(value);
        i2c.completeWrite(true);
      });
    i2c.onReadByte = () => later(BYTE, () => i2c.completeRead(this.give()));
    i2c.onStop = () => later(BIT, () => i2c.completeStop());
    this.resetUnit(chip, i2c);
    chip.gpio[SCL].addListener((state) => this.clocked(state === 0));
    this.driveData();
  }

  // rp2040js does not reset the unit.
  resetUnit(chip, i2c) {
    const resets = chip.peripherals[0x4000c];
    const { writeUint32 } = resets;
    resets.writeUint32 = (offset, value) => {
      writeUint32.call(resets, offset, value);
      if (offset !== RESET || !(value & RESET_I2C0)) return;
      this.alarm.cancel();
      i2c.txFIFO.reset();
      i2c.rxFIFO.reset();
      Object.assign(i2c, { state: 0, busy: false, stop: false, pendingRestart: false, intRaw: 0, abortSource: 0 });
    };
  }

  get isHeld() {
    return this.fault === BUS_HELD || this.fault === BUS_IN_READING;
  }

  // The bus unit waits for a free bus.
  proceed() {
    if (this.isHeld) this.alarm.schedule(BYTE);
    else this.step();
  }

  take(value) {
    if (this.isPointing) this.pointer = value % REGISTERS;
    else {
      this.registers[this.pointer] = value;
      this.pointer = (this.pointer + 1) % REGISTERS;
    }
    this.isPointing = false;
  }

  give() {
    const value = this.registers[this.pointer];
    if (!this.isLsm6 || this.registers[CONTROL] & INCREMENTS) this.pointer = (this.pointer + 1) % REGISTERS;
    return value;
  }

  driveData() {
    this.board.pins.drive(SDA, this.isHeld ? 0 : 1);
  }

  // The chip drives its clock pin low by making it an output.
  clocked(isLow) {
    if (!isLow || ++this.pulses !== PULSES_TO_RELEASE || this.fault !== BUS_IN_READING) return;
    this.fault = 0;
    this.driveData();
  }

  // Registers of the rates hold the last values while the gyro is off or stuck.
  latch() {
    if (this.fault === STUCK) return;
    if (this.isLsm6) this.latchLsm6();
    else this.latchMpu6050();
  }

  // Both measure up to 2 g, unless their full scale is another one, which this does not convert.
  latchAcceleration() {
    const config = this.registers[this.isLsm6 ? LSM6_ACCELERATION_CONFIG : ACCELERATION_CONFIG];
    if (config & (this.isLsm6 ? 0x0c : 0x18) || (this.isLsm6 && !(config & RATE_BITS))) return;
    const number = this.isLsm6 ? LSM6_ACCELERATION : ACCELERATION;
    this.accelerations.forEach((raw, axis) => {
      this.registers[number + 2 * axis + Number(this.isLsm6)] = raw >> 8;
      this.registers[number + 2 * axis + Number(!this.isLsm6)] = raw;
    });
  }

  latchMpu6050() {
    if (this.registers[POWER] & ASLEEP) return;
    this.latchAcceleration();
    const scale = (this.registers[CONFIG] >> 3) & 3;
    this.rates.forEach((rate, axis) => {
      const raw = clamped(Math.trunc((rate * LSB_PER_DEGREE) / (1 << scale) / UNITS_PER_DEGREE));
      this.registers[XOUT + 2 * axis] = raw >> 8;
      this.registers[XOUT + 2 * axis + 1] = raw;
    });
  }

  // Bytes that could be of two rates are as wrong as can be, so that a test shows them.
  latchLsm6() {
    this.latchAcceleration();
    const control = this.registers[RATE_AND_SCALE];
    if (!(control & RATE_BITS)) return;
    const microdegrees = RANGE_245_MICRODEGREES << ((control >> 2) & 3);
    this.rates.forEach((rate, axis) => {
      let raw = clamped(Math.trunc((rate * UNIT_MICRODEGREES) / microdegrees));
      if (!(this.registers[CONTROL] & BLOCKS)) raw ^= 0x80;
      this.registers[LSM6_XOUT + 2 * axis] = raw;
      this.registers[LSM6_XOUT + 2 * axis + 1] = raw >> 8;
    });
  }

  // Rates about x, y and z in 0.02 deg/s for inputs 0 to 2; input 3: a fault; from 4 on the accelerations
  // along x, y and z in 1/16384 g.
  set(input, value) {
    if (input < 3) {
      this.rates[input] = (value << 16) >> 16;
      this.latch();
      return;
    }
    if (input >= ACCELERATIONS) {
      this.accelerations[input - ACCELERATIONS] = (value << 16) >> 16;
      this.latch();
      return;
    }
    if (value === this.input) return;
    this.input = this.fault = value;
    this.pulses = 0;
    if (value === SUPPLY_DIP) {
      this.powerUp();
      if (!this.isLsm6) this.registers[POWER] = 0; // an MPU6500 does not sleep after it
    }
    this.driveData();
  }
}
