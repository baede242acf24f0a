/* Tables in program memory; plain constants where the pure parts are built for the host. */
#ifndef PROGMEM_H
#define PROGMEM_H

#ifdef __AVR__
#include <avr/pgmspace.h>
#else
#include <string.h>
#define PROGMEM
#define memcpy_P memcpy
#endif

#endif
