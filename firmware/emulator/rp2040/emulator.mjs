// A Raspberry Pi Pico on rp2040js: runs a real image in lockstep with requests on standard input, with the same
// requests and replies as ../emulator.c, which explains them. Its EEPROM are the two slots in the flash.
//
// Two requests are of this board alone: L with a rate and a flag opens or closes the USB port, U with a UF2 file
// copies it onto the drive of BOOTSEL. The flag 4 of a reply means that the board shows that drive.
//
//   node emulator.mjs --image FILE.uf2 [--motor EN,IN1,IN2,STANDBY,SHORTS]... [--sonar TRIGGER,ECHO]...
//        [--gyro ADDRESS]

import { readFileSync, readSync, writeSync } from "node:fs";

import { Board } from "./board.mjs";

const FIRST_SONAR = 128;
const FIRST_GYRO = 160;
const CHUNK = 65536;
const UARTS = 2; // the second is the USB port

let read = Buffer.alloc(0);

// The next `size` bytes of standard input; ends the program with it.
function take(size) {
  while (read.length < size) {
    const chunk = Buffer.alloc(CHUNK);
    const got = readSync(0, chunk, 0, CHUNK, null);
    if (got === 0) process.exit(0);
    read = Buffer.concat([read, chunk.subarray(0, got)]);
  }
  const taken = read.subarray(0, size);
  read = read.subarray(size);
  return taken;
}

function reply(bytes) {
  let at = 0;
  while (at < bytes.length) at += writeSync(1, bytes, at);
}

function answerStep(board, began) {
  const out = Buffer.alloc(13 + 9 * board.events.length + 6 * board.sent.length);
  out.writeBigUInt64LE(BigInt(board.now), 0);
  out.writeUInt16LE(board.events.length, 8);
  out.writeUInt16LE(board.sent.length, 10);
  out.writeUInt8((board.wasReset ? 1 : 0) | (board.inBootsel ? 4 : 0), 12);
  let at = 13;
  for (const event of board.events) {
    out.writeUInt32LE(event.time - began, at);
    out.writeUInt8(event.motor, at + 4);
    out.writeInt16LE(event.duty, at + 5);
    out.writeInt16LE(event.shorted, at + 7);
    at += 9;
  }
  for (const { time, uart, byte } of board.sent) {
    out.writeUInt32LE(time - began, at);
    out.writeUInt8(uart, at + 4);
    out.writeUInt8(byte, at + 5);
    at += 6;
  }
  board.events = [];
  board.sent = [];
  board.wasReset = false;
  reply(out);
}

function step(board) {
  const head = take(8 + 4 + 2 * UARTS);
  const until = Number(head.readBigUInt64LE(0));
  const began = board.now;
  for (let left = head.readUInt16LE(8); left > 0; left--) {
    const change = take(6);
    board.transition(began + change.readUInt32LE(0), change[4], change[5]);
  }
  for (let left = head.readUInt16LE(10); left > 0; left--) {
    const analog = take(3);
    const value = analog.readUInt16LE(1);
    if (analog[0] >= FIRST_GYRO) board.gyro?.set(analog[0] - FIRST_GYRO, value);
    else if (analog[0] >= FIRST_SONAR) board.sonars.set(analog[0] - FIRST_SONAR, value);
    else board.analog(analog[0], value);
  }
  for (let uart = 0; uart < UARTS; uart++) {
    const bytes = take(head.readUInt16LE(12 + 2 * uart));
    (uart === 0 ? board.line : board.usb).receive(bytes);
  }
  board.run(until);
  answerStep(board, began);
}

function handle(board) {
  switch (String.fromCharCode(take(1)[0])) {
    case "S":
      return step(board);
    case "R":
      board.reset(take(1)[0]);
      break;
    case "H":
      board.hang();
      break;
    case "Q":
      return reply(board.flash.store());
    case "W":
      board.flash.setStore(take(board.flash.store().length));
      break;
    case "P": {
      const train = take(13);
      board.pulses(train[0], train.readUInt32LE(1), train.readUInt32LE(5), train.readUInt32LE(9));
      break;
    }
    case "L": {
      const port = take(5);
      board.usb.setPort(port.readUInt32LE(0), port[4] !== 0);
      break;
    }
    case "U":
      board.program(take(take(4).readUInt32LE(0)));
      break;
    case "F": {
      const place = take(8);
      const start = place.readUInt32LE(0);
      return reply(board.flash.bytes.subarray(start, start + place.readUInt32LE(4)));
    }
    case "D": {
      const count = Buffer.alloc(4);
      count.writeUInt32LE(board.flash.dirtyWrites);
      return reply(count);
    }
    default:
      process.exit(1);
  }
  reply(Buffer.alloc(1));
}

function options(words) {
  const found = { image: null, motors: [], sonars: [], gyro: 0 };
  for (let at = 0; at < words.length; at += 2) {
    const value = words[at + 1];
    if (words[at] === "--image") found.image = readFileSync(value);
    else if (words[at] === "--motor") found.motors.push(value.split(",").map(Number));
    else if (words[at] === "--sonar") found.sonars.push(value.split(",").map(Number));
    else if (words[at] === "--gyro") found.gyro = Number(value);
    else throw new Error(`unknown option ${words[at]}`);
  }
  return found;
}

const board = new Board(options(process.argv.slice(2)));
for (;;) handle(board);
