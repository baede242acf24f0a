#include "telemetry.h"

#include "analog.h"
#include "atomic.h"
#include "board.h"
#include "capture.h"
#include "gyro.h"
#include "link.h"
#include "ranges.h"
#include "reset.h"
#include "status.h"
#include "store.h"
#include "wheel.h"

#define COMMAND_UNIT_TICKS 32 /* 128 us */
#define DEFAULT_RATE 38
#define ANY_BACKLOG UINT8_MAX
/* Status is sent only directly after a state frame, so that it never delays an answer. */
#define STATE_BACKLOG (sizeof(inertial_t) + CHECK_BYTES + 2)

static uint32_t period = TICKS_PER_SECOND / DEFAULT_RATE; /* ticks */
static uint8_t state_type = TYPE_STATE;
static bool capturing;
static ticks_t next_state;
static uint8_t sequence, dropped, item;
static uint16_t sent_faults;

void telemetry_configure(const settings_t *settings)
{
    period = TICKS_PER_SECOND / settings->telemetry;
    state_type = settings->edge_times ? TYPE_STATE : TYPE_COUNTS;
    if (settings->gyro_address != 0)
        state_type = TYPE_INERTIAL;
}

void telemetry_capture(bool on)
{
    capturing = on;
    encoders_capture(&LEFT->encoder, &RIGHT->encoder, on);
}

/* Sends on every active link with at most `backlog` waiting bytes. */
static void send(const void *payload, uint8_t size, uint8_t backlog)
{
    for (uint8_t link = 0; link < LINKS; link++)
        if (link_active(link) && link_backlog(link) <= backlog)
            link_send(link, payload, size);
}

/* Full duty, 32767, becomes REPORTED_DUTY_ONE. */
static int8_t reported_duty(int16_t duty)
{
    return (int8_t)((duty - (duty >> 7) + 128) >> 8);
}

/* One structure for three types of frame: a counts frame is the beginning of a state frame, and that of
   an inertial one, which has its turn_fault in the place of their level. */
static void send_state(const deadman_t *deadman)
{
    inertial_t frame = {.type = state_type, .turn_fault = gyro_faults() != 0, .turn = gyro_turn()};
    const wheel_t *shown = sequence & 1 ? RIGHT : LEFT;
    uint8_t drops = (uint8_t)status[ITEM_DROPPED];
    ticks_t now;
    ATOMIC
    {
        now = board_now();
        frame.left = LEFT->encoder.count;
        frame.right = RIGHT->encoder.count;
        frame.left_age = encoders_age(&LEFT->encoder, now);
        frame.right_age = encoders_age(&RIGHT->encoder, now);
        if (state_type != TYPE_INERTIAL && board_read(&shown->encoder.in))
            frame.turn_fault = true;
    }
    ticks_t age = (now - deadman->since) / COMMAND_UNIT_TICKS;
    frame.boot = reset_boot();
    frame.sequence = sequence++;
    frame.dropped = dropped != drops;
    dropped = drops;
    frame.mode = deadman->mode;
    frame.command_age = age < COMMAND_AGE_NONE ? (uint16_t)age : COMMAND_AGE_NONE;
    frame.time = (uint16_t)(now >> 4);
    frame.range = analog_mean(0);
    frame.command = deadman->sequence;
    frame.duty = reported_duty(shown->speed.duty);
    send(&frame, payload_size(state_type), ANY_BACKLOG);
}

static uint16_t flags(const deadman_t *deadman, uint16_t faults)
{
    uint16_t flags = reset_cause | faults;
    if (store_done())
        flags |= FLAG_STORED;
    if (deadman->pressed)
        flags |= FLAG_BUTTON;
    return flags;
}

static void send_item(uint8_t item, uint8_t backlog)
{
    status_t frame = {.type = TYPE_STATUS, .item = item};
    ATOMIC frame.value = status[item];
    send(&frame, sizeof frame, backlog);
}

/* Sends the next item. */
static void send_status(const deadman_t *deadman, uint16_t faults)
{
    status[ITEM_FLAGS] = flags(deadman, faults);
    status[ITEM_BATTERY] = analog_mean(1);
    status[ITEM_FREE_STACK] = board_free_stack();
    status[ITEM_FOREIGN] = deadman->foreign;
    send_item(item, STATE_BACKLOG);
    if (item == ITEM_LOOP)
        status[ITEM_LOOP] = 0;
    item = item == ITEM_DROPPED ? 0 : item + 1;
}

/* A change of the faults is sent at once, so that the host knows the cause of the next state frame. */
static void send_faults(const deadman_t *deadman, uint16_t faults)
{
    if (faults == sent_faults)
        return;
    sent_faults = faults;
    status[ITEM_FLAGS] = flags(deadman, faults);
    send_item(ITEM_FLAGS, ANY_BACKLOG);
}

void telemetry_tick(const deadman_t *deadman, uint16_t faults)
{
    ticks_t now = board_now();
    capture_t edges;
    send_faults(deadman, faults);
    if (capturing && capture_take(&edges, now))
        send(&edges, sizeof edges, ANY_BACKLOG);
    range_t range;
    if (ranges_tick(&range) && !capturing)
        send(&range, sizeof range, ANY_BACKLOG);
    if (!ticks_due(now, next_state))
        return;
    ticks_t step = capturing ? 2 * period : period;
    next_state += step;
    if (ticks_due(now, next_state))
        next_state = now + step; /* the loop was delayed by more than a frame */
    send_state(deadman);
    if ((sequence & 3) == 0)
        send_status(deadman, faults);
}
