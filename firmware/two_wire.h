/* Master of the I2C bus: one transfer at a time, carried out by interrupts. */
#ifndef TWO_WIRE_H
#define TWO_WIRE_H

#include <stdint.h>

enum { TWO_WIRE_DONE, TWO_WIRE_BUSY, TWO_WIRE_FAILED };
#define TWO_WIRE_BYTES 2 /* of each reading */

/* Begins to write `value` to a register of the device, or with WIRE_READS to read two bytes from it on.
   What was under way is given up. */
#define WIRE_READS 0xFF
void two_wire_begin(uint8_t address, uint8_t number, uint8_t value);

/* TWO_WIRE_BUSY until the transfer has ended; a bus that is held low never ends it. */
uint8_t two_wire_state(void);

/* Bytes of the last reading, once it is done. */
const volatile uint8_t *two_wire_bytes(void);

/* The bus has done a step, with this status; from its interrupt. */
void two_wire_stepped(uint8_t status);

#endif
