#include "telemetry.h"

#include "analog.h"
#include "capture.h"
#include "clock.h"
#include "encoders.h"
#include "link.h"
#include "reset.h"
#include "speed.h"
#include "store.h"

#define COMMAND_UNIT_TICKS 32 /* 128 us */
#define DEFAULT_RATE 40
#define ANY_BACKLOG UINT8_MAX
/* Status goes out only right behind a state frame, so that answers are never held up by it. */
#define STATE_BACKLOG (sizeof(state_t) + CHECK_BYTES + 2)

static ticks_t period = TICKS_PER_SECOND / DEFAULT_RATE;
static uint8_t state_size = sizeof(state_t);
static bool capturing;
static ticks_t next_state;
static uint8_t sequence, dropped, item;

void telemetry_configure(const settings_t *settings)
{
    period = TICKS_PER_SECOND / settings->telemetry;
    state_size = settings->edge_times ? sizeof(state_t) : sizeof(counts_t);
}

void telemetry_capture(bool on)
{
    capturing = on;
    encoders_capture(on);
}

/* Leaves a link out that has more than `backlog` bytes to send already. */
static void send(const void *payload, uint8_t size, uint8_t backlog)
{
    for (uint8_t link = 0; link < LINKS; link++)
        if (link_spoken(link) && link_backlog(link) <= backlog)
            link_send(link, payload, size);
}

/* The same structure serves both kinds of frame: a counts frame is its beginning. */
static void send_state(const deadman_t *deadman)
{
    encoder_t both[2];
    state_t frame = {.type = state_size == sizeof(state_t) ? TYPE_STATE : TYPE_COUNTS};
    ticks_t now = encoders_read(both);
    ticks_t age = (now - deadman->since) / COMMAND_UNIT_TICKS;
    frame.boot = reset_boot();
    frame.sequence = sequence++;
    frame.dropped = dropped != link_dropped();
    dropped = link_dropped();
    frame.mode = deadman->mode;
    frame.command_age = age < COMMAND_AGE_NONE ? (uint16_t)age : COMMAND_AGE_NONE;
    frame.time = (uint16_t)(now >> 4);
    frame.left = both[0].count;
    frame.right = both[1].count;
    frame.range = analog_mean(0);
    frame.command = deadman->sequence;
    frame.left_age = both[0].age;
    frame.right_age = both[1].age;
    send(&frame, state_size, ANY_BACKLOG);
}

static uint16_t value(const deadman_t *deadman, uint8_t faults, uint16_t longest_us)
{
    encoder_t both[2];
    encoders_read(both);
    switch (item) {
    case ITEM_UPTIME:
        return clock_uptime();
    case ITEM_FLAGS:
        return (uint16_t)(reset_cause | store_done() << 4 | deadman->pressed << 5 | faults << 6);
    case ITEM_BATTERY:
        return analog_mean(1);
    case ITEM_FREE_STACK:
        return reset_free_stack();
    case ITEM_LOOP:
        return longest_us;
    case ITEM_LEFT_REJECTED:
        return both[0].rejected;
    case ITEM_RIGHT_REJECTED:
        return both[1].rejected;
    case ITEM_DAMAGED:
        return link_damaged();
    case ITEM_FOREIGN:
        return deadman->foreign;
    default:
        return link_dropped();
    }
}

bool telemetry_tick(const deadman_t *deadman, uint8_t faults, uint16_t longest_us)
{
    ticks_t now = clock_now();
    capture_t edges;
    if (capturing && capture_take(&edges, now))
        send(&edges, sizeof edges, ANY_BACKLOG);
    if (!ticks_due(now, next_state))
        return false;
    ticks_t step = capturing ? 2 * period : period;
    next_state += step;
    if (ticks_due(now, next_state))
        next_state = now + step; /* the loop was held up for more than a frame */
    send_state(deadman);
    if (sequence & 3)
        return false;
    status_t status = {.type = TYPE_STATUS};
    status.item = item;
    status.value = value(deadman, faults, longest_us);
    bool told = item == ITEM_LOOP;
    item = item == ITEM_DROPPED ? 0 : item + 1;
    send(&status, sizeof status, STATE_BACKLOG);
    return told;
}
