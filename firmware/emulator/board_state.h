/* State of the emulated board, shared by its modules. */
#ifndef BOARD_STATE_H
#define BOARD_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_io.h>

#define MOTORS 2
#define EEPROM_SIZE 4096 /* of the largest chip; requests always carry as much */
#define UARTS 2
#define EVENTS 4096
#define BYTES 16384
#define TRANSITIONS 65536
#define PULSE_TRAINS 4
#define SONARS 4

/* What differs between the chips. */
typedef struct {
    const char *mcu;
    unsigned uarts, eeprom_size;
    uint32_t page;       /* bytes of a flash page */
    uint32_t hang;       /* a word that neither program nor bootloader uses */
    uint8_t sda, scl;    /* pins of the I2C bus */
} chip_t;

typedef struct {
    const chip_t *chip;
    const char *hex, *boot, *eeprom;
    bool pty;
    unsigned motors;
    uint8_t motor[MOTORS][5]; /* pins of enable, in1, in2, standby, 255: none; what shorts the motor */
    unsigned sonars;
    uint8_t sonar[SONARS][2]; /* pins of trigger and echo */
    unsigned gyro;            /* I2C address; 0: none */
} options_t;

typedef struct {
    uint64_t time; /* ns */
    uint8_t motor;
    int16_t duty, shorted; /* shares of a pulse, of 32767 */
} event_t;

typedef struct {
    uint64_t time;
    uint8_t pin, level;
} transition_t;

typedef struct board board_t;

/* Pulses at a pin that the emulator makes itself. Times are cycles. */
typedef struct {
    board_t *board;
    uint8_t pin, level; /* level at present */
    uint32_t high, low; /* of each level; 0 and 0: no pulses */
    uint32_t jitter;    /* largest random addition to each of them */
    uint64_t random_state;
} pulse_train_t;

/* An HC-SR04. Times are cycles. */
typedef struct {
    board_t *board;
    uint8_t trigger, echo;
    uint32_t width;           /* of the echo for its own target; SONAR_SILENT, SONAR_ENDLESS */
    bool is_triggered;        /* the trigger pin is high */
    avr_cycle_count_t raised; /* when it went high */
    avr_cycle_count_t sent;   /* when its last burst left */
    bool listens;             /* between its burst and the end of its echo */
} sonar_t;
enum { SONAR_SILENT = 0, SONAR_ENDLESS = 0xFFFF };

/* A gyro, and the chip's bus unit that it is read with. */
#define GYRO_REGISTERS 128
typedef struct {
    board_t *board;
    avr_twi_t *unit;
    uint8_t registers[GYRO_REGISTERS], pointer;
    int16_t rates[3];         /* about x, y, z; 0.02 deg/s */
    int16_t accelerations[3]; /* along x, y, z; 1/16384 g */
    uint8_t fault, input; /* at present; as the input had it last */
    enum { ADDRESSING, POINTING, WRITING, READING } phase;
    bool owned;         /* between start and stop */
    bool starts;        /* the step under way is a start */
    avr_cycle_count_t bit; /* length of a bit */
    bool clock_low;     /* by the chip's pin */
    uint8_t pulses;     /* of the clock by the chip's pin, since the fault began */
} gyro_t;
enum {
    GYRO_WORKS,
    GYRO_SILENT,
    GYRO_BUS_HELD,
    GYRO_BUS_IN_READING, /* held until the clock has ended the reading */
    GYRO_STUCK,
    GYRO_SUPPLY_DIP,
};

/* One UART: bytes that wait to be received, and its pseudo-terminal. */
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

/* Flash as in the chip: writing only clears bits, erasing is by page. */
typedef struct {
    avr_io_t io;
    board_t *board;
    uint16_t page[128];
    bool filled[128];
} flash_t;

struct board {
    avr_t *avr;
    options_t options;
    line_t uarts[UARTS];
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
    pulse_train_t trains[PULSE_TRAINS];
    sonar_t sonars[SONARS];
    gyro_t gyro;
    uint32_t dirty_writes;
    uint16_t ram_end; /* last address of the chip's memory */
    uint8_t flags;
    int16_t duty[MOTORS], shorted[MOTORS];
    uint64_t eeprom_saved;
};

enum { FLAG_RESET = 1, FLAG_CRASHED = 2 };

static inline uint64_t cycles_to_ns(uint64_t cycles)
{
    return cycles * 125 / 2; /* 16 MHz: 62.5 ns */
}

static inline uint64_t ns_to_cycles(uint64_t ns)
{
    return ns * 2 / 125;
}

/* ns since the start. */
static inline uint64_t board_now(const board_t *board)
{
    return cycles_to_ns(board->avr->cycle);
}

#endif
