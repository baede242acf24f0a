// UART0 without a queue, as the firmware uses it, with the time that each byte takes. rp2040js's own sends at
// once and loses no byte that is not read in time.

const BITS_PER_BYTE = 10;
const DATA = 0x00;
const FLAGS = 0x18;
const RAISED = 0x40;
const CLEAR = 0x44;
const SENDS = 1 << 5;
const RECEIVES = 1 << 4;
const EMPTY = 1 << 7;
const FULL = 1 << 5;
const NOTHING_RECEIVED = 1 << 4;
const SENDING = 1 << 3;

export class Line {
  constructor(board) {
    this.board = board;
  }

  connect(chip) {
    const uart = chip.uart[0];
    const { readUint32, writeUint32 } = uart;
    this.uart = uart;
    this.waiting = []; // bytes that are to arrive
    this.received = null;
    this.sending = null; // the byte on the wire
    this.next = null; // the one after it
    this.sent = chip.clock.createAlarm(() => this.complete());
    this.arrival = chip.clock.createAlarm(() => this.arrive());
    uart.checkInterrupts = () => chip.setInterrupt(uart.irq, !!(uart.interruptStatus & uart.interruptMask));
    uart.readUint32 = (offset) => {
      if (offset === DATA) return this.take();
      if (offset === FLAGS) return this.flags();
      if (offset === RAISED) return uart.interruptStatus & uart.interruptMask;
      return readUint32.call(uart, offset);
    };
    uart.writeUint32 = (offset, value) => {
      if (offset === DATA) this.send(value & 0xff);
      else if (offset === CLEAR) this.mark(value, false);
      else writeUint32.call(uart, offset, value);
    };
  }

  get byteTime() {
    return (BITS_PER_BYTE * 16 * this.uart.baudDivider * 1e9) / this.uart.rp2040.clkPeri;
  }

  mark(bits, on) {
    if (on) this.uart.interruptStatus |= bits;
    else this.uart.interruptStatus &= ~bits;
    this.uart.checkInterrupts();
  }

  flags() {
    const sending = this.sending !== null ? SENDING : 0;
    return (this.received === null ? NOTHING_RECEIVED : 0) | (this.next === null ? EMPTY : FULL) | sending;
  }

  // The interrupt to send comes when the place of the next byte becomes free, not while it is.
  send(byte) {
    if (this.sending === null) {
      this.sending = byte;
      this.sent.schedule(this.byteTime);
      this.mark(SENDS, true);
    } else if (this.next === null) {
      this.next = byte;
      this.mark(SENDS, false);
    }
  }

  complete() {
    this.board.sent.push({ time: this.board.now, uart: 0, byte: this.sending });
    this.sending = this.next;
    if (this.sending === null) return;
    this.next = null;
    this.sent.schedule(this.byteTime);
    this.mark(SENDS, true);
  }

  receive(bytes) {
    const idle = this.waiting.length === 0;
    this.waiting.push(...bytes);
    if (idle && bytes.length) this.arrival.schedule(this.byteTime);
  }

  // A byte that was not read before the next one arrives is kept, and the new one lost.
  arrive() {
    const byte = this.waiting.shift();
    if (this.waiting.length) this.arrival.schedule(this.byteTime);
    if (this.received !== null || !this.uart.enabled) return;
    this.received = byte;
    this.mark(RECEIVES, true);
  }

  take() {
    const byte = this.received ?? 0;
    this.received = null;
    this.mark(RECEIVES, false);
    return byte;
  }
}
