#include "telemetry.h"

#include "analog.h"
#include "capture.h"
#include "clock.h"
#include "encoders.h"
#include "link.h"
#include "reset.h"
#include "speed.h"
#include "store.h"

#define UNIT_TICKS 16          /* 64 us */
#define COMMAND_UNIT_TICKS 128 /* 512 us */
#define DEFAULT_RATE 40

static uint32_t period = TICKS_PER_SECOND / DEFAULT_RATE;
static bool edge_times = true, capturing, told;
static uint32_t next_state, next_status;
static uint8_t sequence, dropped;
static bool since_known;
static uint32_t since;

void telemetry_configure(const settings_t *settings)
{
    period = TICKS_PER_SECOND / settings->telemetry;
    edge_times = settings->edge_times;
}

void telemetry_capture(bool on)
{
    capturing = on;
    encoders_capture(on);
}

bool telemetry_second(void)
{
    bool was = told;
    told = false;
    return was;
}

static void send(const uint8_t *payload, uint8_t size)
{
    for (uint8_t link = 0; link < LINKS; link++)
        if (link_spoken(link))
            link_send(link, payload, size);
}

static uint16_t age_of(const encoder_t *encoder)
{
    return encoder->any ? (uint16_t)(encoder->age / UNIT_TICKS) : AGE_NONE;
}

/* An age is told up to its limit, and once it was beyond it stays so, though the clock comes
   round. */
static uint16_t command_age(const deadman_t *deadman, uint32_t now)
{
    if (deadman->since != since) {
        since = deadman->since;
        since_known = true;
    }
    uint32_t age = (now - since) / COMMAND_UNIT_TICKS;
    if (age >= COMMAND_AGE_NONE)
        since_known = false;
    return since_known ? (uint16_t)age : COMMAND_AGE_NONE;
}

static void send_state(const deadman_t *deadman)
{
    encoder_t both[2];
    uint32_t now;
    uint8_t payload[SIZE_STATE];
    encoders_read(both, &now);
    uint16_t time = (uint16_t)(now / UNIT_TICKS);
    bool lost = dropped != link_dropped();
    dropped = link_dropped();
    uint16_t age = command_age(deadman, now);
    if (edge_times) {
        state_t frame = {
            .sequence = sequence, .boot = reset_boot(), .mode = deadman->mode, .dropped = lost,
            .time = time, .left = both[0].count, .right = both[1].count, .range = analog_range(),
            .command = deadman->sequence, .command_age = age,
            .left_age = age_of(&both[0]), .right_age = age_of(&both[1]),
        };
        state_pack(&frame, payload);
        send(payload, SIZE_STATE);
    } else {
        counts_t frame = {
            .sequence = sequence, .boot = reset_boot(), .mode = deadman->mode, .dropped = lost,
            .time = time, .left = both[0].count, .right = both[1].count, .range = analog_range(),
            .command = deadman->sequence, .command_age = age,
        };
        counts_pack(&frame, payload);
        send(payload, SIZE_COUNTS);
    }
    sequence = (uint8_t)(sequence + 1) & 0x3F;
}

static void send_status(const deadman_t *deadman, uint8_t faults, uint16_t longest_us)
{
    encoder_t both[2];
    uint32_t now;
    uint8_t payload[SIZE_STATUS];
    encoders_read(both, &now);
    status_t frame = {
        .uptime = clock_uptime(), .reset = reset_cause, .stored = store_done(),
        .button = deadman->pressed, .left_fault = faults & 1, .right_fault = faults >> 1,
        .battery = analog_battery(), .free_stack = reset_free_stack(), .loop = longest_us,
        .left_rejected = both[0].rejected, .right_rejected = both[1].rejected,
        .damaged = link_damaged(), .foreign = deadman->foreign, .dropped = link_dropped(),
    };
    status_pack(&frame, payload);
    send(payload, SIZE_STATUS);
}

static void send_capture(uint32_t now)
{
    capture_t frame;
    uint8_t payload[SIZE_CAPTURE];
    if (!capture_take(&frame, now))
        return;
    capture_pack(&frame, payload);
    send(payload, SIZE_CAPTURE);
}

void telemetry_tick(const deadman_t *deadman, uint8_t faults, uint16_t longest_us)
{
    uint32_t now = clock_now();
    if ((int32_t)(now - next_state) >= 0) {
        next_state += capturing ? 2 * period : period;
        if ((int32_t)(now - next_state) >= 0)
            next_state = now + period; /* settings changed the rate, or the loop was held up */
        send_state(deadman);
    } else if ((int32_t)(now - next_status) >= 0) {
        next_status += TICKS_PER_SECOND;
        send_status(deadman, faults, longest_us);
        told = true;
    }
    if (capturing)
        send_capture(now);
}
