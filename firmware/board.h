/* What each pin of a board can do. A board is a table (board_<name>.c); nothing else knows pins. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#define BOARD_NONE 0xFF

typedef struct {
    uint16_t port; /* data address of PINx; DDRx and PORTx follow it */
    uint8_t mask;
    uint8_t pwm;       /* number of the PWM output, or BOARD_NONE */
    uint8_t interrupt; /* number of the external interrupt, or BOARD_NONE */
    bool link;         /* carries a serial link */
} pin_t;

typedef struct {
    uint16_t control; /* data address of TCCRnA */
    uint16_t compare; /* data address of OCRnx */
    uint8_t connect;  /* the COMnx1 bit */
    bool wide;        /* a 16-bit timer */
} pwm_t;

extern const uint8_t board_code; /* BOARD_... of the protocol */
extern const uint8_t board_analogs;

/* The pin's abilities; false when the board has no such pin. */
bool board_pin(uint8_t number, pin_t *pin);
pwm_t board_pwm(uint8_t number);

/* Starts the timers that make PWM (8-bit, fast, 977 Hz). */
void board_start_timers(void);

/* External interrupt `number` on a rising, falling or any edge; see ISCn in the data sheet. */
enum { SENSE_ANY = 1, SENSE_FALLING = 2, SENSE_RISING = 3 };
void board_sense(uint8_t number, uint8_t sense);
void board_interrupts_off(void);

#endif
