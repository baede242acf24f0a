/* The emulated board: simavr's Mega 2560 with what simavr leaves out. */
#ifndef EMULATED_BOARD_H
#define EMULATED_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_io.h>

#define MOTORS 2
#define EEPROM_SIZE 4096
#define EVENTS 4096
#define BYTES 16384
#define TRANSITIONS 65536

typedef struct {
    const char *hex, *boot, *eeprom;
    bool pty;
    unsigned motors;
    uint8_t motor[MOTORS][3]; /* pins of enable, in1, in2 */
} options_t;

typedef struct {
    uint64_t time; /* ns */
    uint8_t motor, brake;
    int16_t duty;
} event_t;

typedef struct {
    uint64_t time;
    uint8_t pin, level;
} transition_t;

typedef struct board board_t;

/* One UART: bytes that wait for their turn on the wire, both ways. */
typedef struct {
    board_t *board;
    unsigned number;
    avr_irq_t *input;
    uint8_t waiting[65536];
    unsigned head, tail;
    bool feeding;
    int master, slave, watch;
    char name[64];
} line_t;

/* Flash as silicon has it: writing can only clear bits, erasing is by page. */
typedef struct {
    avr_io_t io;
    board_t *board;
    uint16_t page[128];
    bool filled[128];
} flash_t;

struct board {
    avr_t *avr;
    options_t options;
    line_t uarts[2];
    flash_t flash;
    event_t events[EVENTS];
    unsigned event_count;
    struct {
        uint64_t time;
        uint8_t uart, byte;
    } bytes[BYTES];
    unsigned byte_count;
    transition_t transitions[TRANSITIONS];
    unsigned first, last;
    uint32_t dirty_writes;
    uint8_t flags;
    int16_t duty[MOTORS];
    uint8_t brake[MOTORS];
    uint64_t eeprom_saved;
};

enum { FLAG_RESET = 1, FLAG_CRASHED = 2 };

void board_begin(board_t *board, const options_t *options);
void board_end(board_t *board);
uint64_t board_now(const board_t *board);
void board_run(board_t *board, uint64_t until);
void board_reset(board_t *board, uint8_t cause);
void board_hang(board_t *board);
void board_transition(board_t *board, uint64_t time, uint8_t pin, uint8_t level);
void board_analog(board_t *board, uint8_t channel, uint16_t millivolts);
void board_receive(board_t *board, unsigned uart, const uint8_t *bytes, unsigned count);
void board_eeprom_get(board_t *board, uint8_t *bytes);
void board_eeprom_set(board_t *board, const uint8_t *bytes);

/* lines.c */
void lines_begin(board_t *board);
void lines_reset(board_t *board);
void lines_poll(board_t *board); /* pseudo-terminals: bytes in, and the opening that resets */
void lines_end(board_t *board);

/* flash.c */
void flash_begin(board_t *board);
void flash_load(board_t *board, const char *file);

/* motors.c */
void motors_poll(board_t *board);

/* pins.c */
typedef struct {
    char port;
    uint8_t bit;
    uint16_t control, compare; /* data addresses of TCCRnA and OCRnx; 0 without PWM */
    uint8_t connect;           /* bit COMnx1 */
} place_t;
place_t pin_place(uint8_t pin);
uint16_t pin_address(char port); /* of PINx */

static inline uint64_t cycles_to_ns(uint64_t cycles)
{
    return cycles * 125 / 2; /* 16 MHz: 62.5 ns */
}

static inline uint64_t ns_to_cycles(uint64_t ns)
{
    return ns * 2 / 125;
}

#endif
