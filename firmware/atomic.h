/* Sections that no interrupt divides; plain code when built for the host. */
#ifndef ATOMIC_H
#define ATOMIC_H

#ifdef __AVR__
#include <util/atomic.h>
#define ATOMIC ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
#elif defined __arm__
#include <stdint.h>

static inline uint32_t atomic_begin(void)
{
    uint32_t masked;
    __asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(masked)::"memory");
    return masked;
}

static inline void atomic_end(const uint32_t *masked)
{
    __asm__ volatile("msr primask, %0" ::"r"(*masked) : "memory");
}

#define ATOMIC \
    for (uint32_t masked __attribute__((cleanup(atomic_end))) = atomic_begin(), once = 1; once; once = 0)
#elif defined ARDUINO
#include <stdint.h>

uint32_t esp32_lock(void);
void esp32_unlock(uint32_t state);

static inline void atomic_end(const uint32_t *state)
{
    esp32_unlock(*state);
}

#define ATOMIC \
    for (uint32_t state __attribute__((cleanup(atomic_end))) = esp32_lock(), once = 1; once; once = 0)
#else
#define ATOMIC
#endif

#endif
