#include "capture.h"

#include <util/atomic.h>

#define RING 32
/* After 100 ms what there is goes out, so that slow edges are not seen late. */
#define WAIT_UNITS 1563
#define TIME_MASK 0x1FFFFFFUL
#define WHEEL_BIT 31
#define LEVEL_BIT 30

/* Entry: wheel, level, time in 64 us (28 bits of it come from the clock). */
static volatile uint32_t ring[RING];
static volatile uint8_t head, tail;
static volatile bool lost;
static uint8_t sequence;

void capture_put(uint8_t wheel, bool level, uint32_t now)
{
    uint8_t next = (uint8_t)(head + 1) % RING;
    if (next == tail) {
        lost = true;
        return;
    }
    ring[head] = (now >> 4) | (uint32_t)wheel << WHEEL_BIT | (uint32_t)level << LEVEL_BIT;
    head = next;
}

static uint32_t time_of(uint32_t entry)
{
    return entry & TIME_MASK;
}

bool capture_take(capture_t *frame, uint32_t now)
{
    uint8_t waiting = (uint8_t)(head - tail + RING) % RING;
    if (waiting == 0)
        return false;
    uint32_t before = time_of(ring[tail]);
    uint32_t waited = ((now >> 4) - before) & TIME_MASK;
    if (waiting < CAPTURE_EDGES && waited < WAIT_UNITS)
        return false;
    *frame = (capture_t){.sequence = sequence++ & 0x3F, .time = before};
    while (frame->used < CAPTURE_EDGES && tail != head) {
        uint32_t entry = ring[tail];
        uint32_t interval = (time_of(entry) - before) & TIME_MASK;
        uint16_t bits = (uint16_t)(entry >> 16 & 0xC000);
        if (interval >= CAPTURE_FILLER) {
            frame->edges[frame->used++] = CAPTURE_FILLER;
            before = (before + CAPTURE_FILLER) & TIME_MASK;
            continue;
        }
        frame->edges[frame->used++] = bits | (uint16_t)interval;
        before = time_of(entry);
        tail = (uint8_t)(tail + 1) % RING;
    }
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        frame->lost = lost;
        lost = false;
    }
    return true;
}
