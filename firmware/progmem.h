/* Tables in program memory; plain constants when built for the host. */
#ifndef PROGMEM_H
#define PROGMEM_H

#ifdef __AVR__
#include <avr/pgmspace.h>
#elif !defined pgm_read_byte
#define PROGMEM
#define pgm_read_byte(at) (*(const uint8_t *)(at))
#define pgm_read_word(at) (*(const uint16_t *)(at))
#endif

#endif
