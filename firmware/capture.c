#include "capture.h"

#define RING 32 /* a power of two */
/* Edges are sent after 100 ms at the latest: their 14 bits of time wrap after a second. */
#define WAIT_UNITS 1563
#define WHEEL 0x8000
#define LEVEL 0x4000

static volatile uint16_t ring[RING];
static volatile uint8_t head, tail;
static bool lost;
static uint8_t sequence;

void capture_put(uint8_t wheel, bool level, ticks_t now)
{
    uint8_t next = (uint8_t)(head + 1) % RING;
    uint16_t entry = (uint16_t)(now >> 4) & CAPTURE_TIME;
    if (next == tail) {
        lost = true;
        return;
    }
    if (wheel)
        entry |= WHEEL;
    if (level)
        entry |= LEVEL;
    ring[head] = entry;
    head = next;
}

bool capture_take(capture_t *frame, ticks_t now)
{
    uint8_t waiting = (uint8_t)(head - tail) % RING;
    uint16_t waited = ((uint16_t)(now >> 4) - ring[tail]) & CAPTURE_TIME;
    if (waiting == 0 || (waiting < CAPTURE_EDGES && waited < WAIT_UNITS))
        return false;
    *frame = (capture_t){.type = TYPE_CAPTURE, .sequence = sequence++, .time = now >> 4};
    frame->lost = lost;
    lost = false;
    uint8_t used = 0;
    do {
        frame->edges[used++] = ring[tail];
        tail = (uint8_t)(tail + 1) % RING;
    } while (used < CAPTURE_EDGES && tail != head);
    frame->used = used;
    return true;
}
