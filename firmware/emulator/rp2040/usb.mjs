// The other end of the USB cable: a host that finds the board's serial port, as a computer does, and a program that
// has it open. rp2040js has the controller of the chip.

const PACKET = 64;
const PACKET_TIME = 50; // us, with its place in the frame
const DATA_ENDPOINT = 2;
const TO_HOST = 0x80;
const GET_DESCRIPTOR = 6;
const SET_ADDRESS = 5;
const SET_CONFIGURATION = 9;
const SET_LINE_CODING = 0x20;
const SET_CONTROL_LINES = 0x22;
const OF_INTERFACE = 0x21;
const DEVICE = 1;
const CONFIGURATION = 2;
const STRING = 3;
const BITS = 8;
const EXCEPTION = 16 + 5;

function setup(type, request, value, size) {
  return Uint8Array.of(type, request, value & 0xff, value >> 8, 0, 0, size & 0xff, size >> 8);
}

function descriptor(kind, index, size) {
  return { request: setup(TO_HOST, GET_DESCRIPTOR, (kind << 8) | index, size), size };
}

function lineCoding(baud) {
  const data = Buffer.alloc(7);
  data.writeUInt32LE(baud);
  data[6] = BITS;
  return { request: setup(OF_INTERFACE, SET_LINE_CODING, 0, data.length), data };
}

function controlLines(open) {
  return { request: setup(OF_INTERFACE, SET_CONTROL_LINES, open ? 3 : 0, 0) };
}

export class Usb {
  constructor(board) {
    this.board = board;
    this.baud = 115200;
    this.open = true;
  }

  // A new chip: whatever was under way is lost. The host finds the device again.
  connect(chip) {
    const usb = chip.usbCtrl;
    const { core } = chip;
    const enter = core.exceptionEntry.bind(core);
    // An interrupt that the program has raised by itself is no longer pending when it is entered.
    core.exceptionEntry = (number) => {
      enter(number);
      if (number === EXCEPTION) usb.checkInterrupts();
    };
    this.usb = usb;
    this.transfers = [];
    this.transfer = null;
    this.descriptors = [];
    this.waiting = [];
    this.takes = false; // the board waits for a packet
    this.found = false;
    this.states = [];
    this.confirmed = chip.clock.createAlarm(() => {
      this.descriptors.push(this.transfer.answer);
      this.begin();
    });
    usb.onUSBEnabled = () => usb.resetDevice();
    usb.onResetReceived = () => this.find();
    usb.onEndpointWrite = (endpoint, bytes) => {
      if (endpoint === 0) this.answered(bytes);
      else if (endpoint === DATA_ENDPOINT) this.sent(bytes);
    };
    usb.onEndpointRead = (endpoint) => {
      if (endpoint === 0) this.asked();
      else if (endpoint === DATA_ENDPOINT) {
        this.takes = true;
        this.deliver();
      }
    };
  }

  find() {
    this.transfers = [
      descriptor(DEVICE, 0, 18),
      { request: setup(0, SET_ADDRESS, 1, 0) },
      descriptor(CONFIGURATION, 0, 9),
      descriptor(CONFIGURATION, 0, 255),
      descriptor(STRING, 0, 255),
      descriptor(STRING, 1, 255),
      descriptor(STRING, 2, 255),
      descriptor(STRING, 3, 255),
      { request: setup(0, SET_CONFIGURATION, 1, 0) },
      lineCoding(this.baud),
      controlLines(this.open),
    ];
    this.line = { baud: this.baud, open: this.open };
    this.begin();
  }

  // A program opens the port at this rate, or closes it.
  setPort(baud, open) {
    [this.baud, this.open] = [baud, open];
    this.states.push({ baud, open });
    if (this.found) this.tell();
    if (this.found && !this.transfer) this.begin();
  }

  // What the board does not know of the port yet: it may have been opened, and closed again, while the host found
  // the device.
  tell() {
    for (const { baud, open } of this.states.splice(0)) {
      if (baud !== this.line.baud) this.transfers.push(lineCoding(baud));
      if (open !== this.line.open) this.transfers.push(controlLines(open));
      this.line = { baud, open };
    }
  }

  begin() {
    if (!this.transfers.length && !this.found) {
      this.found = true;
      this.tell();
    }
    this.transfer = this.transfers.shift() ?? null;
    if (!this.transfer) return;
    this.transfer.answer = [];
    this.usb.sendSetupPacket(this.transfer.request);
  }

  // A packet of the board's answer; an empty one confirms what it was sent.
  answered(bytes) {
    const { transfer } = this;
    if (!transfer) return;
    if (!transfer.size) {
      this.begin();
      return;
    }
    transfer.answer.push(...bytes);
  }

  // The board waits for a packet of the control endpoint: data, or the confirmation of its answer.
  asked() {
    const { transfer } = this;
    if (!transfer) return;
    this.usb.endpointReadDone(0, transfer.data ?? new Uint8Array(0), PACKET_TIME);
    if (transfer.data) return;
    this.confirmed.schedule(PACKET_TIME * 1000);
  }

  sent(bytes) {
    for (const byte of bytes) this.board.sent.push({ time: this.board.now, uart: 1, byte });
  }

  receive(bytes) {
    if (!this.open) return;
    this.waiting.push(...bytes);
    this.deliver();
  }

  deliver() {
    if (!this.takes || !this.waiting.length) return;
    this.takes = false;
    this.usb.endpointReadDone(DATA_ENDPOINT, Uint8Array.from(this.waiting.splice(0, PACKET)), PACKET_TIME);
  }
}
