/* Detection of an encoder pin that changes faster than its wheel can turn: a loose or noisy wire. Such
   a pin could keep the chip in its interrupt for ever, since external interrupts come before all
   others. Pure; also built for the host. */
#ifndef STORM_H
#define STORM_H

#include <stdbool.h>
#include <stdint.h>

/* Period of storm_check in ms. */
#define STORM_CHECK_MS 100

typedef struct {
    /* Interrupts that the pin may still raise before storm_tick is called again: a bound on the time
       that it can take from the main loop. */
    volatile uint_fast8_t allowance;
    volatile bool muted;       /* its interrupt is off */
    volatile uint16_t changes; /* number of interrupts; wraps */
    uint8_t pause_ms;          /* until the interrupt is tried again */
    uint8_t score;             /* of muting: raised by each, lowered by each ms without */
    uint8_t implausible;       /* successive checks that found too many changes or edges */
    uint16_t checked_changes, checked_edges; /* numbers at the last check */
    uint16_t edges_most;       /* edges of the fastest wheel between two checks */
} storm_t;

/* Forgets all storms. `edges_per_s`: edges per second of the wheel at full duty, 0 if unknown. */
void storm_begin(storm_t *storm, uint32_t edges_per_s);

/* From the interrupt of the pin: false when it must be switched off. */
static inline bool storm_admits(storm_t *storm)
{
    if (storm->allowance == 0) {
        storm->muted = true;
        return false;
    }
    storm->allowance--;
    storm->changes++;
    return true;
}

/* To be called each millisecond with interrupts off: true when the interrupt of a muted pin must be
   switched on again. */
bool storm_tick(storm_t *storm);

/* To be called each STORM_CHECK_MS: `changes` is a copy of the storm's, `edges` the number of edges
   that passed the glitch filter; both may wrap. */
void storm_check(storm_t *storm, uint16_t changes, uint16_t edges);

/* True while the pin changes too fast, and for a moment afterwards. */
bool storm_present(const storm_t *storm);

#endif
