/* The hardware layer: all that touches a register of the microcontroller. No other module does.

   board_<name>.c has the pins and timers of one board; avr_pins.c, avr.c and interrupts.c have what all
   AVR boards share, rp2040.c and the other files with that name what is of the RP2040, esp32/ what is of the
   ESP32. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "progmem.h"
#include "ticks.h"

/* LINKS, BOARD_SHARES_PWM, BOARD_LIGHT, BOARD_NOTHING, BOARD_LINK and the types bit_t and pwm_t. Built for the host, the
   pure parts use those of the AVR boards. */
#ifdef __arm__
#include "rp2040_types.h"
#elif defined ARDUINO
#include "esp32_types.h"
#else
#include "avr_types.h"
#endif

enum { LEVEL, DIRECTION, OUTPUT };

typedef struct {
    bit_t bit;         /* mask 0: only an analog input */
    uint8_t pwm;       /* number of the PWM output, or BOARD_NOTHING */
    uint8_t interrupt; /* number of the external interrupt, BOARD_LINK or BOARD_NOTHING */
} pin_t;

extern const uint8_t board_code; /* BOARD_... of the protocol */
extern const uint8_t board_analogs;
extern const uint8_t board_first_analog; /* pin of analog channel 0 */

/* Functions of a pin; false when the board has no such pin. */
bool board_pin(uint8_t number, pin_t *pin);

/* Sets or clears the bit in the register `offset` after its own. Atomic: the single instructions for
   this do not reach ports above G. */
void board_write(const bit_t *bit, uint8_t offset, bool high);

/* True when the pin is high. */
bool board_read(const bit_t *bit);

/* Makes the pin an input with pull-up, for open-collector outputs; false without such a pin. */
bool board_input(uint8_t number, bit_t *bit);

/* Removes the pull-up of an input. */
void board_release_input(const bit_t *bit);

void board_pwm(uint8_t number, pwm_t *output);

/* Drives a pin, which is an output, by its PWM output or, at duty 0 and 255, at a constant level. */
void board_set_duty(const bit_t *pin, const pwm_t *output, uint8_t duty);

/* Starts the timers of the PWM outputs (8-bit, fast, 977 Hz). */
void board_start_timers(void);

/* Disables external interrupt `number`, or all; the first from an interrupt. */
void board_mute(uint8_t number);
void board_mute_all(void);

/* Enables external interrupt `number` for an EDGE_... of the protocol. */
void board_sense(uint8_t number, uint8_t sense);

/* Group of pins (0 to 2) whose changes share an interrupt, or NO_GROUP for a pin without one. */
#define NO_GROUP 3
uint8_t board_group(const bit_t *bit);

/* Interrupts at each change of this pin, and of no other; none with null. */
void board_watch(const bit_t *bit);

/* Starts the clock of 4 us per tick; only differences of its times have a meaning. */
void board_start_clock(void);

/* Present time. May be called with interrupts on or off. */
ticks_t board_now(void);

/* Its low 16 bits; with interrupts off. */
uint16_t board_now_low(void);

/* The two alarms call clock_millisecond and clock_sample when the low bits of the clock are those of a time, as
   many as the timer has: an alarm can come a round of the timer too early, and comes a round too late
   when its time has passed as it is set. So both look at the clock themselves. */
enum { ALARM_MILLISECOND, ALARM_SAMPLE };
void board_alarm(uint8_t alarm, uint16_t time);

/* Serial links. Sending on: link_empty is called whenever a byte can be written. */
void board_start_link(uint8_t link, uint8_t baud);
void board_set_baud(uint8_t link, uint8_t baud); /* BAUD_... of the protocol */
uint8_t board_received(uint8_t link);
void board_send(uint8_t link, uint8_t byte);
void board_sending(uint8_t link, bool on);

/* Analog converter: starts a conversion of a channel, about 104 us long; its result (10 bits). */
void board_convert(uint8_t channel);
uint16_t board_converted(void);

/* The I2C bus: at 100 kHz, since a robot's wires are long. board_two_wire begins a step, whose end calls
   two_wire_stepped with the status of the bus unit. */
extern const uint8_t board_sda, board_scl; /* pins */
enum { WIRE_LAST = 0, WIRE_MORE = 0x40, WIRE_START = 0x20, WIRE_STOP = 0x11 }; /* MORE: acknowledges */
void board_two_wire(uint8_t step);
void board_two_wire_send(uint8_t byte);
uint8_t board_two_wire_received(void);

/* Switches the bus unit off, which ends what it does. A device that holds the data line in the middle of
   a reading gets a clock pulse: nine of them end every reading. */
void board_two_wire_release(void);

/* Memory that keeps its content without power. Writing a byte goes on in the background. A slot of
   BOARD_STORE_SLOT bytes is cleared before its bytes are written: that sets its first byte to 0xFF. */
#define BOARD_STORE_SLOT 128
void board_store_read(uint16_t address, void *to, uint8_t size);
bool board_store_ready(void);
void board_store_clear(uint16_t slot);
void board_store_write(uint16_t address, uint8_t byte);

/* Cause of the reset that the chip reports: a RESET_... of the protocol; RESET_UNKNOWN when the
   bootloader has cleared it. */
uint8_t board_reset_cause(void);

/* The watchdog: resets the chip 120 ms after the last call of board_feed. A program that hangs while
   interrupts are off drives on until then. An ESP32 takes 250 ms. */
void board_start_watchdog(void);
void board_feed(void);

/* Fills the free stack with a pattern; bytes of it that were never used. */
void board_paint_stack(void);
uint16_t board_free_stack(void);

/* Enables interrupts; waits for the next one. */
void board_start_interrupts(void);
void board_sleep(void);

#endif
