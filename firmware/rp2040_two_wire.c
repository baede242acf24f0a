/* Master of the I2C bus on the RP2040's bus unit, which does a whole transfer by itself. */
#include "two_wire.h"

#include "board.h"
#include "rp2040_registers.h"

enum {
    CONTROL = 0x00, TARGET = 0x04, COMMAND = 0x10, HIGH_COUNT = 0x14, LOW_COUNT = 0x18, EVENTS = 0x34,
    ENABLE = 0x6C, HOLD = 0x7C,
};
#define MASTER (1u | 1u << 1 | 1u << 5 | 1u << 6) /* at standard speed, with repeated starts */
/* 100 kHz at 48 MHz; the data line changes 0.3 us after the clock. */
#define HIGH_CYCLES 192
#define LOW_CYCLES 288
#define HOLD_CYCLES 15
/* Beside a byte that is written: */
enum { READ = 1 << 8, STOP = 1 << 9, RESTART = 1 << 10 };
enum { ABORTED = 1 << 6, STOPPED = 1 << 9 };
#define HALF_PULSE_TICKS 2 /* at least 4 us */

static bool reads;
static volatile uint8_t bytes[TWO_WIRE_BYTES];
static uint8_t state;

static void pin(uint8_t number, uint32_t function)
{
    REGISTER(SIO_OUTPUT + SIO_CLEAR) = 1u << number;
    REGISTER(PAD(number)) = PAD_INPUT | PAD_SCHMITT | PAD_4_MA;
    REGISTER(IO_CTRL(number)) = function;
}

void board_two_wire_release(void)
{
    SET(RESETS) = RESET_I2C0;
    REGISTER(I2C0 + ENABLE) = 0;
    pin(board_sda, FUNCTION_SIO);
    pin(board_scl, FUNCTION_SIO);
    REGISTER(SIO_DIRECTION + SIO_CLEAR) = 1u << board_sda | 1u << board_scl;
    if (REGISTER(SIO_LEVELS) & 1u << board_sda)
        return;
    REGISTER(SIO_DIRECTION + SIO_SET) = 1u << board_scl;
    ticks_t begun = board_now();
    while (board_now() - begun < HALF_PULSE_TICKS)
        ;
    REGISTER(SIO_DIRECTION + SIO_CLEAR) = 1u << board_scl;
}

void two_wire_begin(uint8_t address, uint8_t number, uint8_t value)
{
    board_two_wire_release();
    rp2040_start(RESET_I2C0);
    REGISTER(I2C0 + CONTROL) = MASTER;
    REGISTER(I2C0 + TARGET) = address;
    REGISTER(I2C0 + HIGH_COUNT) = HIGH_CYCLES;
    REGISTER(I2C0 + LOW_COUNT) = LOW_CYCLES;
    REGISTER(I2C0 + HOLD) = HOLD_CYCLES;
    REGISTER(I2C0 + ENABLE) = 1;
    pin(board_sda, FUNCTION_I2C);
    pin(board_scl, FUNCTION_I2C);
    state = TWO_WIRE_BUSY;
    reads = value == WIRE_READS;
    REGISTER(I2C0 + COMMAND) = number;
    REGISTER(I2C0 + COMMAND) = reads ? READ | RESTART : value | STOP;
    if (reads)
        REGISTER(I2C0 + COMMAND) = READ | STOP;
}

uint8_t two_wire_state(void)
{
    uint32_t events = REGISTER(I2C0 + EVENTS);
    if (state != TWO_WIRE_BUSY)
        return state;
    if (events & ABORTED) {
        state = TWO_WIRE_FAILED;
    } else if (events & STOPPED) {
        for (uint8_t i = 0; i < TWO_WIRE_BYTES && reads; i++)
            bytes[i] = (uint8_t)REGISTER(I2C0 + COMMAND);
        state = TWO_WIRE_DONE;
    }
    return state;
}

const volatile uint8_t *two_wire_bytes(void)
{
    return bytes;
}
