#include "capture.h"

#define RING 32 /* a power of two */
/* After 100 ms what there is goes out, so that slow edges are not seen late. */
#define WAIT_UNITS 1563
#define WHEEL 0x8000
#define LEVEL 0x4000

/* Entry: wheel, level, and the time since the edge before in 64 us. */
static volatile uint16_t ring[RING];
static volatile uint8_t head, tail;
static volatile bool lost;
static uint32_t newest; /* time of the edge last put, 64 us */
static uint32_t oldest; /* time of the edge before the one at the tail */
static uint8_t sequence;

static void put(uint16_t entry)
{
    uint8_t next = (uint8_t)(head + 1) % RING;
    if (next == tail) {
        lost = true;
        return;
    }
    ring[head] = entry;
    head = next;
}

void capture_put(uint8_t wheel, bool level, uint32_t now)
{
    now >>= 4;
    if (head == tail && !lost)
        oldest = newest = now; /* nothing waits: times may start anew */
    uint32_t interval = (now - newest) & 0xFFFFFFF;
    newest = now;
    if (interval >= CAPTURE_FILLER) {
        lost = true; /* more than a second after an edge that still waits: cannot be told */
        return;
    }
    put((uint16_t)interval | (wheel ? WHEEL : 0) | (level ? LEVEL : 0));
}

bool capture_take(capture_t *frame, uint32_t now)
{
    uint8_t waiting = (uint8_t)(head - tail) % RING;
    if (waiting == 0 && !lost)
        return false;
    if (waiting < CAPTURE_EDGES && ((now >> 4) - newest) < WAIT_UNITS)
        return false;
    *frame = (capture_t){.type = TYPE_CAPTURE, .sequence = sequence++, .lost = lost};
    frame->time = oldest;
    while (frame->used < CAPTURE_EDGES && tail != head) {
        uint16_t entry = ring[tail];
        oldest += entry & CAPTURE_FILLER;
        frame->edges[frame->used++] = entry;
        tail = (uint8_t)(tail + 1) % RING;
    }
    lost = false;
    return true;
}
