// The flash memory and the serial unit that it hangs on: a W25Q16 as its data sheet describes it. rp2040js has
// only registers there. Writing clears bits, erasing is by sectors of 4096 bytes, and both take their time.

const SIZE = 2 * 1024 * 1024;
const SECTOR = 4096;
const PAGE = 256;
const ERASING = 45e6; // ns, typically
const WRITING = 30e3; // of a byte
const WRITE_PAGE = 0x02;
const READ_STATUS = 0x05;
const ENABLE_WRITING = 0x06;
const ERASE_SECTOR = 0x20;
const READ_IDENTITY = 0x4b;
const BEFORE_IDENTITY = 5; // the command, and bytes without a meaning
const IDENTITY = Buffer.from("e66058388332172c", "hex");
const BUSY = 1;
const LATCH = 2;
// The serial unit's registers and flags, and the select line's override.
const ENABLE = 0x08;
const STATUS = 0x28;
const DATA = 0x60;
const EMPTY = 1 << 2;
const ROOM = 1 << 1;
const RECEIVED = 1 << 3;
const SELECT_CTRL = 0x0c;
const LOW = 2;
// UF2 (see rp2040_image.py), and where the firmware keeps its settings (see rp2040_store.c).
const BLOCK = 512;
const PAYLOAD = 256;
const START = 0x10000000;
const SLOTS_AT = 0x1fd000;
const SLOTS = 2;
const SLOT = 128;
const STORE = 4096;

export class Flash {
  constructor(image) {
    this.bytes = Buffer.alloc(SIZE, 0xff);
    this.dirtyWrites = 0; // bytes with a bit that only erasing could have set
    if (image) this.program(image);
  }

  program(image) {
    for (let at = 0; at < image.length; at += BLOCK) {
      const place = image.readUInt32LE(at + 12) - START;
      image.copy(this.bytes, place, at + 32, at + 32 + PAYLOAD);
    }
  }

  // After a reset: the command under way is lost, what the memory does by itself goes on.
  connect(chip) {
    this.clock = chip.clock;
    this.memory = chip.flash;
    this.memory.set(this.bytes);
    this.command = [];
    this.selected = false;
    this.received = [];
    this.latch = false;
    this.busyUntil ??= 0;
    this.registers = {};
    chip.peripherals[0x18000] = this.unit();
    chip.peripherals[0x40018] = this.selectLine();
  }

  unit() {
    return {
      readUint32: (offset) => {
        if (offset === STATUS) return EMPTY | ROOM | (this.received.length ? RECEIVED : 0);
        if (offset === DATA) return this.received.shift() ?? 0;
        return this.registers[offset] ?? 0;
      },
      writeUint32Atomic: (offset, value) => {
        if (offset === DATA) this.received.push(this.exchange(value & 0xff));
        else this.registers[offset] = value;
        if (offset === ENABLE && !value) this.received = [];
      },
    };
  }

  selectLine() {
    return {
      readUint32: () => 0,
      writeUint32Atomic: (offset, value) => {
        if (offset !== SELECT_CTRL) return;
        const selected = ((value >> 8) & 3) === LOW;
        if (this.selected && !selected) this.execute();
        this.selected = selected;
        this.command = [];
      },
    };
  }

  get busy() {
    return this.clock.nanos < this.busyUntil;
  }

  exchange(byte) {
    if (!this.selected) return 0xff;
    this.command.push(byte);
    const number = this.command.length - 1; // of this byte
    if (this.command[0] === READ_IDENTITY) return IDENTITY[number - BEFORE_IDENTITY] ?? 0xff;
    if (this.command[0] !== READ_STATUS || !number) return 0xff;
    return (this.busy ? BUSY : 0) | (this.latch ? LATCH : 0);
  }

  // The select line has gone high: a command that changes something is done now.
  execute() {
    const [code, high, middle, low, ...data] = this.command;
    const at = (high << 16) | (middle << 8) | low;
    if (this.busy) return; // the memory ignores all but its status
    if (code === ENABLE_WRITING) {
      this.latch = true;
      return;
    }
    if (!this.latch) return;
    if (code === ERASE_SECTOR && this.command.length === 4) this.erase(at);
    if (code === WRITE_PAGE && data.length) this.write(at, data);
    if (code === ERASE_SECTOR || code === WRITE_PAGE) this.latch = false;
  }

  erase(at) {
    const first = at - (at % SECTOR);
    this.bytes.fill(0xff, first, first + SECTOR);
    this.memory.set(this.bytes.subarray(first, first + SECTOR), first);
    this.busyUntil = this.clock.nanos + ERASING;
  }

  write(at, data) {
    data.forEach((byte, index) => {
      const place = at - (at % PAGE) + ((at + index) % PAGE);
      if (byte & ~this.bytes[place]) this.dirtyWrites++;
      this.bytes[place] &= byte;
      this.memory[place] = this.bytes[place];
    });
    this.busyUntil = this.clock.nanos + WRITING;
  }

  // The slots, in the form of the other boards' EEPROM.
  store() {
    const content = Buffer.alloc(STORE, 0xff);
    for (let slot = 0; slot < SLOTS; slot++) {
      const at = SLOTS_AT + slot * SECTOR;
      this.bytes.copy(content, slot * SLOT, at, at + SLOT);
    }
    return content;
  }

  setStore(content) {
    this.bytes.fill(0xff, SLOTS_AT, SLOTS_AT + (SLOTS + 1) * SECTOR);
    for (let slot = 0; slot < SLOTS; slot++) {
      content.copy(this.bytes, SLOTS_AT + slot * SECTOR, slot * SLOT, (slot + 1) * SLOT);
    }
    this.memory.set(this.bytes);
  }
}
