/* Sections that no interrupt divides; plain code when built for the host. */
#ifndef ATOMIC_H
#define ATOMIC_H

#ifdef __AVR__
#include <util/atomic.h>
#define ATOMIC ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
#else
#define ATOMIC
#endif

#endif
