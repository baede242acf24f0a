#include "two_wire.h"

#include "board.h"

/* Status of the AVR's bus unit (data sheet, tables 24-3 and 24-4). */
enum {
    STARTED = 0x08,
    STARTED_AGAIN = 0x10,
    ADDRESSED_TO_WRITE = 0x18,
    WRITTEN = 0x28,
    ADDRESSED_TO_READ = 0x40,
    RECEIVED = 0x50,
    RECEIVED_LAST = 0x58,
};

enum { ADDRESS, NUMBER, VALUE, SENT };
static uint8_t to_send[SENT], sent;
static volatile uint8_t state;
static volatile uint8_t bytes[TWO_WIRE_BYTES];

void two_wire_begin(uint8_t address, uint8_t number, uint8_t value)
{
    board_two_wire_release(); /* its interrupt does not run from here to the start */
    to_send[ADDRESS] = (uint8_t)(address << 1);
    to_send[NUMBER] = number;
    to_send[VALUE] = value;
    sent = 0;
    state = TWO_WIRE_BUSY;
    board_two_wire(WIRE_START);
}

uint8_t two_wire_state(void)
{
    return state;
}

const volatile uint8_t *two_wire_bytes(void)
{
    return bytes;
}

/* Sends address, register and value; a second start for a reading comes in place of the value. */
static uint8_t send_next(void)
{
    if (sent == VALUE && to_send[VALUE] == WIRE_READS)
        return WIRE_START;
    if (sent == SENT) {
        state = TWO_WIRE_DONE;
        return WIRE_STOP;
    }
    board_two_wire_send(to_send[sent++]);
    return WIRE_LAST;
}

void two_wire_stepped(uint8_t status)
{
    uint8_t next = WIRE_LAST;
    switch (status) {
    case STARTED:
    case ADDRESSED_TO_WRITE:
    case WRITTEN:
        next = send_next();
        break;
    case STARTED_AGAIN:
        board_two_wire_send(to_send[ADDRESS] | 1);
        break;
    case ADDRESSED_TO_READ:
        next = WIRE_MORE;
        break;
    case RECEIVED:
        bytes[0] = board_two_wire_received();
        break;
    case RECEIVED_LAST:
        bytes[1] = board_two_wire_received();
        state = TWO_WIRE_DONE;
        next = WIRE_STOP;
        break;
    default:
        state = TWO_WIRE_FAILED;
        next = WIRE_STOP;
        break;
    }
    board_two_wire(next);
}
